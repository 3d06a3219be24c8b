// SPDX-License-Identifier: BSD-2-Clause
#include "zip_member.h"

#include <cstdint>
#include <memory>

#include <zip.h>

#include "export/files.h"
#include "pmsp/error.h"

namespace pmsp::io {
namespace {

constexpr zip_uint64_t kMaxMemberBytes = zip_uint64_t{1} << 30U;

using Archive = std::unique_ptr<zip_t, decltype(&zip_discard)>;

Archive open_archive(const std::filesystem::path& path) {
  require_regular_file(path);
  int code = 0;
  Archive archive(zip_open(path.c_str(), ZIP_RDONLY, &code), &zip_discard);
  if (archive) return archive;
  zip_error_t error;
  zip_error_init_with_code(&error, code);
  const std::string reason = zip_error_strerror(&error);
  zip_error_fini(&error);
  throw IoError(path.string() + ": cannot be read as a ZIP archive: " + reason + "; copy it again");
}

}  // namespace

std::filesystem::path archive_of(const std::filesystem::path& path) {
  const std::filesystem::path archive = path.parent_path();
  const bool is_archive = archive.extension() == ".zip" || archive.extension() == ".npz";
  return is_archive && is_file(archive) ? archive : std::filesystem::path();
}

std::set<std::string> zip_members(const std::filesystem::path& archive) {
  const Archive opened = open_archive(archive);
  std::set<std::string> names;
  const zip_int64_t count = zip_get_num_entries(opened.get(), 0);
  for (zip_int64_t i = 0; i < count; ++i) {
    const char* const name = zip_get_name(opened.get(), static_cast<zip_uint64_t>(i), 0);
    if (name != nullptr) names.insert(name);
  }
  return names;
}

std::string read_zip_member(const std::filesystem::path& path) {
  const Archive archive = open_archive(path.parent_path());
  const std::string name = path.filename().string();
  zip_stat_t stat;
  if (zip_stat(archive.get(), name.c_str(), 0, &stat) != 0) {
    throw IoError(path.string() + ": the archive has no such member; correct the name, or pack it again");
  }
  if (stat.comp_method != ZIP_CM_STORE && stat.comp_method != ZIP_CM_DEFLATE) {
    throw InvalidInput(path.string() + ": compression method " + std::to_string(stat.comp_method) +
                       " is not supported, expected 0 (stored) or 8 (deflate); pack the archive again");
  }
  if (stat.size / kMaxInflation > stat.comp_size) {
    throw InvalidInput(path.string() + ": " + std::to_string(stat.size) + " bytes from " +
                       std::to_string(stat.comp_size) +
                       " compressed ones, expected at most 1032 times as many; the archive is damaged, copy it again");
  }
  if (stat.size > kMaxMemberBytes) {
    throw InvalidInput(path.string() + ": " + std::to_string(stat.size) +
                       " bytes, expected at most 1 GiB; write smaller images");
  }
  std::string bytes(stat.size, '\0');
  const std::unique_ptr<zip_file_t, decltype(&zip_fclose)> file(zip_fopen_index(archive.get(), stat.index, 0),
                                                                &zip_fclose);
  const zip_int64_t got = file ? zip_fread(file.get(), bytes.data(), stat.size) : -1;
  char more = 0;  // the checksum is compared at the end
  if (got != static_cast<zip_int64_t>(stat.size) || zip_fread(file.get(), &more, 1) != 0) {
    throw IoError(path.string() + ": cannot be unpacked: " +
                  zip_error_strerror(file ? zip_file_get_error(file.get()) : zip_get_error(archive.get())) +
                  "; copy the archive again");
  }
  return bytes;
}

}  // namespace pmsp::io
