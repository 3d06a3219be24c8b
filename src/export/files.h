// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/error.h"

// Files that are read whole, and files that are written whole or not at all.
namespace pmsp {

/// A file that appears under its name when `commit` is called, complete, or not at all. Where the file system can do
/// it, the file has no name before, so that even a killed process leaves nothing behind; elsewhere it lies beside the
/// target as ".NAME.PID-N.tmp" and is removed by the destructor; one that a killed process leaves does no harm. A
/// symbolic link stays: the file that it leads to is written. All members throw OutputError, with the path and what the
/// system says; after that it is of no use any more.
class PMSP_API AtomicFile {
 public:
  explicit AtomicFile(const std::filesystem::path& target);  ///< opens it
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void write(const void* data, std::size_t bytes);  ///< at the end
  void write(const std::string& text) { write(text.data(), text.size()); }

  /// Overwrites bytes that were written before.
  void patch(std::int64_t offset, const std::string& text);

  /// Writes bytes at a place of the file, and lets the system bring them to the disk at once, so that `commit` has less
  /// to wait for. Several threads may do so at a time; not to be mixed with `write`.
  void write_at(std::int64_t offset, const char* data, std::size_t bytes);

  /// Puts the file in its place. The content has reached the disk before the name changes.
  void commit();

  /// The same where there is no file of that name, and no other process is faster; else leaves that one as it is and
  /// returns false.
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
  std::int64_t end_ = 0;  ///< of what `write` has brought to the file
  std::vector<char> buffer_;
};

/// Where a symbolic link leads in the end, also where nothing lies there; any other path as it is. Throws OutputError
/// for links that lead in a circle.
PMSP_API std::filesystem::path end_of_links(std::filesystem::path path);

/// The file that one of this name was to become which AtomicFile has written beside it: "a.ply" for ".a.ply.123-0.tmp";
/// "" for names that AtomicFile gives to none.
PMSP_API std::string target_of_temporary(const std::string& name);

/// Writes a whole file or nothing; `bytes` is a string or a vector of bytes. Throws OutputError.
template <class Bytes>
void write_file(const std::filesystem::path& path, const Bytes& bytes) {
  AtomicFile file(path);
  file.write(bytes.data(), bytes.size());
  file.commit();
}

/// The same unless there is such a file; returns whether it was written.
template <class Bytes>
bool write_new_file(const std::filesystem::path& path, const Bytes& bytes) {
  AtomicFile file(path);
  file.write(bytes.data(), bytes.size());
  return file.commit_unless_there();
}

/// Makes a folder and its parents, which may exist. Throws OutputError.
PMSP_API void make_folder(const std::filesystem::path& folder);

/// Throws IoError unless `path` is an ordinary file. To be asked before it is opened: opening a pipe may wait for ever.
PMSP_API void require_regular_file(const std::filesystem::path& path);

/// All bytes of an ordinary file. Throws IoError.
PMSP_API std::string read_whole_file(const std::filesystem::path& path);

}  // namespace pmsp
