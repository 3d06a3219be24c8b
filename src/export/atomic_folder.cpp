// SPDX-License-Identifier: BSD-2-Clause
#include "export/atomic_folder.h"

#include <algorithm>
#include <system_error>
#include <vector>

#include "export/files.h"
#include "export/sync_folder.h"
#include "pmsp/error.h"

namespace pmsp {

namespace fs = std::filesystem;

namespace {

constexpr const char* kPart = ".part";             // name prefix of files in progress inside an existing folder
constexpr const char* kCompleteSuffix = ".whole";  // complete output while its entries are moved into the target

std::string name_of(const fs::path& path) { return path.filename().string(); }

[[noreturn]] void throw_error(const fs::path& path, const std::string& what, const std::error_code& error) {
  throw OutputError(path.string() + ": cannot be " + what + ": " + error.message());
}

std::vector<fs::path> entries_of(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> entries;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    entries.push_back(it->path());
  }
  if (error) throw_error(folder, "listed", error);
  // Index files (JSON) last, after the files they refer to.
  std::stable_partition(entries.begin(), entries.end(), [](const fs::path& it) { return it.extension() != ".json"; });
  return entries;
}

void put(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::rename(from, to, error);
  if (error) throw_error(to, "moved into place", error);
}

/// Moves a file or folder; merges a folder into an existing one.
void move_into_place(const fs::path& from, const fs::path& to) {
  std::error_code ignored;
  if (!fs::is_directory(fs::symlink_status(from, ignored)) || !fs::is_directory(to, ignored)) return put(from, to);
  for (const fs::path& entry : entries_of(from)) move_into_place(entry, to / entry.filename());
}

fs::path without_slash(const fs::path& path) { return path.has_filename() ? path : path.parent_path(); }

}  // namespace

AtomicFolder::AtomicFolder(const fs::path& target, IsOwn is_own, const std::string& part)
    : target_(end_of_links(without_slash(target))), is_own_(is_own) {
  std::error_code ignored;
  in_target_ = fs::exists(target_, ignored);
  part_ = in_target_ ? target_ / part : fs::path(target_.string() + part);
  if (in_target_) make_folder(target_);  // throws if it is not a folder
  if (fs::exists(fs::symlink_status(part_, ignored))) require_leftover(part_);
  make_folder(part_);
  lock_.emplace(part_, "output", std::chrono::milliseconds(0), FolderLock::For::kOne, FolderLock::Need::kWhereItWorks);
  for (const fs::path& entry : entries_of(part_)) {
    std::error_code error;
    if (name_of(entry) != FolderLock::kName) fs::remove_all(entry, error);
    if (error) throw_error(entry, "deleted", error);
  }
  const fs::path whole = target_ / kCompleteSuffix;
  if (!in_target_ || !fs::exists(whole, ignored)) return;
  require_leftover(whole);
  fs::remove_all(whole, ignored);
}

AtomicFolder::~AtomicFolder() {
  lock_.reset();
  std::error_code ignored;
  if (!part_.empty() && !is_placing_) fs::remove_all(part_, ignored);
}

/// Throws OutputError unless the folder is the temporary of an AtomicFolder.
void AtomicFolder::require_leftover(const fs::path& folder) const {
  std::error_code ignored;
  const bool is_folder = fs::is_directory(fs::symlink_status(folder, ignored));
  const std::vector<fs::path> entries = is_folder ? entries_of(folder) : std::vector<fs::path>{};
  const bool is_own = std::all_of(entries.begin(), entries.end(), [this](const fs::path& entry) {
    const std::string name = name_of(entry);
    return name == FolderLock::kName || is_own_(name) || is_own_(target_of_temporary(name));
  });
  if (is_folder && is_own && (entries.empty() || fs::exists(folder / FolderLock::kName, ignored))) return;
  throw OutputError(
      folder.string() +
      ": exists and is no unfinished output; expected no such file or directory; move it, or give another name");
}

void AtomicFolder::commit() {
  std::error_code error;
  if (in_target_ || fs::is_directory(target_, error)) {  // possibly created by another process in the meantime
    const fs::path whole = target_ / kCompleteSuffix;
    put(part_, whole);
    part_ = whole;
    is_placing_ = true;
    replace();
    lock_.reset();
    std::error_code ignored;
    fs::remove_all(whole, ignored);
    sync_folder(target_);
  } else {
    sync_folder(part_);
    put(part_, target_);
    lock_.reset();
    std::error_code ignored;
    fs::remove(target_ / FolderLock::kName, ignored);
    sync_folder(target_.parent_path());
  }
  part_.clear();
}

void AtomicFolder::replace() const {
  std::vector<fs::path> old = entries_of(target_);
  std::reverse(old.begin(), old.end());
  for (const fs::path& entry : old) {
    std::error_code error;
    if (!is_own_(name_of(entry)) || !fs::is_regular_file(entry, error)) continue;
    fs::remove(entry, error);
    if (error) throw_error(entry, "deleted", error);
  }
  for (const fs::path& entry : entries_of(part_)) {
    if (name_of(entry) != FolderLock::kName) move_into_place(entry, target_ / entry.filename());
  }
}

bool AtomicFolder::is_free(const fs::path& target) {
  std::error_code ignored;
  if (!fs::exists(target, ignored)) return true;
  const std::vector<fs::path> entries = entries_of(target);
  const auto has = [&](const char* name) {
    return std::any_of(entries.begin(), entries.end(), [&](const fs::path& it) { return name_of(it) == name; });
  };
  const auto is_part = [](const fs::path& it) { return name_of(it).rfind(kPart, 0) == 0; };
  return has(kCompleteSuffix) || std::all_of(entries.begin(), entries.end(), is_part);
}

}  // namespace pmsp
