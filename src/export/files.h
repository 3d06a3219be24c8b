// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/error.h"

// Reading of whole files, and atomic writing.
namespace pmsp {

/// File that appears under its name at `commit`, complete, or not at all. Before, it is unnamed if the file system
/// supports that, so that even a killed process leaves nothing; otherwise it is ".NAME.PID-N.tmp" beside the target,
/// removed by the destructor (a leftover is harmless). Symbolic links are kept: their target is written. All members
/// throw OutputError with path and system error, after which the object is unusable.
class PMSP_API AtomicFile {
 public:
  explicit AtomicFile(const std::filesystem::path& target);  ///< opens it for writing
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void write(const void* data, std::size_t bytes);  ///< appends
  void write(const std::string& text) { write(text.data(), text.size()); }

  /// Overwrites bytes written before.
  void patch(std::int64_t offset, const std::string& text);

  /// Writes at an offset and starts writeback, so that `commit` has less to wait for. Thread-safe; not to be mixed with
  /// `write`.
  void write_at(std::int64_t offset, const char* data, std::size_t bytes);

  /// Moves the file to its final name, after its content has reached the disk.
  void commit();

  /// As `commit`, unless a file of that name exists; then it stays as it is and false is returned. Atomic.
  bool commit_unless_there();

 private:
  std::string failure(const std::string& what) const;
  [[noreturn]] void fail(const std::string& what);
  void make_ready();
  void finish();
  void discard() noexcept;
  std::filesystem::path temporary_name() const;
  std::string descriptor_path() const;
  template <class Make>
  void make_temporary(const Make& make);
  void open_temporary();
  void link_unnamed();
  void flush();
  void append(const char* data, std::size_t bytes);
  void put(std::int64_t offset, const char* data, std::size_t bytes) const;

  std::filesystem::path target_;
  std::filesystem::path folder_;
  std::filesystem::path temporary_;
  int fd_ = -1;
  std::int64_t end_ = 0;  ///< size written by `write` [bytes]
  std::vector<char> buffer_;
};

/// Returns the final target of a symbolic link, which need not exist; other paths unchanged. Throws OutputError for
/// circular links.
PMSP_API std::filesystem::path end_of_links(std::filesystem::path path);

/// Returns the target name of a temporary file of AtomicFile: "a.ply" for ".a.ply.123-0.tmp"; "" for other names.
PMSP_API std::string target_of_temporary(const std::string& name);

/// Writes a file atomically; `bytes` is a string or a vector of bytes. Throws OutputError.
template <class Bytes>
void write_file(const std::filesystem::path& path, const Bytes& bytes) {
  AtomicFile file(path);
  file.write(bytes.data(), bytes.size());
  file.commit();
}

/// As write_file, unless the file exists; returns whether it was written.
template <class Bytes>
bool write_new_file(const std::filesystem::path& path, const Bytes& bytes) {
  AtomicFile file(path);
  file.write(bytes.data(), bytes.size());
  return file.commit_unless_there();
}

/// Creates a folder with its parents, if missing. Throws OutputError.
PMSP_API void make_folder(const std::filesystem::path& folder);

/// False also if the path cannot be queried.
PMSP_API bool is_file(const std::filesystem::path& path);

/// Throws IoError unless `path` is a regular file. To be called before opening: opening a pipe may block for ever.
PMSP_API void require_regular_file(const std::filesystem::path& path);

/// Returns the content of a regular file. Throws IoError.
PMSP_API std::string read_whole_file(const std::filesystem::path& path);

}  // namespace pmsp
