// SPDX-License-Identifier: BSD-2-Clause
#include "workspace/workspace.h"

#include <set>
#include <system_error>
#include <utility>

#include "export/files.h"
#include "io/zip_member.h"
#include "pmsp/error.h"
#include "workspace/artefact_file.h"
#include "workspace/fingerprint.h"
#include "workspace/saver.h"

namespace pmsp::workspace {

namespace fs = std::filesystem;

namespace {

constexpr const char* kRecord = "workspace.json";
constexpr const char* kBegun = "begun.json";

bool consists_of(const std::string& text, const char* characters) {
  return !text.empty() && text.find_first_not_of(characters) == std::string::npos;
}

/// Whether a name is that of a workspace's file: ID-STEP, or its temporary name by AtomicFile.
bool is_own_name(std::string name) {
  if (name[0] == '.') name = target_of_temporary(name);
  constexpr std::size_t kStepDigits = 16;
  const std::size_t dash = name.rfind('-');
  if (dash == std::string::npos || dash == 0 || name.size() - dash - 1 != kStepDigits) return false;
  const std::string id = name.substr(name[0] == '-' ? 1 : 0, dash - (name[0] == '-' ? 1 : 0));
  return consists_of(id, "0123456789") && consists_of(name.substr(dash + 1), "0123456789abcdef");
}

/// Deletes files of the workspace in `folder`, except `names`.
void delete_all_but(const std::set<std::string>& names, const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> old;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (names.count(name) == 0 && is_own_name(name) && it->is_regular_file(error)) old.push_back(it->path());
  }
  for (const fs::path& file : old) fs::remove(file, error);  // remaining files are harmless
}

}  // namespace

struct Workspace::Saving {
  Copies<PlaneMap> planes;
  Copies<KeyframeCloud> points;
  Saver saver;  ///< destroyed first
};

Workspace::Workspace(const fs::path& folder, Access access)
    : folder_(folder), shards_(folder / "shards"), saving_(std::make_unique<Saving>()) {
  std::error_code error;
  const fs::path record = folder / kRecord;
  if (!holds_record() && fs::exists(fs::symlink_status(folder, error))) {
    if (!fs::is_directory(folder, error)) {
      throw InvalidInput(folder.string() + ": is no directory; expected a workspace of an earlier run, or a new name");
    }
    for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
      const std::string name = it->path().filename().string();
      if (name == FolderLock::kName || name.rfind("." + std::string(kRecord), 0) == 0)
        continue;                 // remains of a killed run
      if (holds_record()) break;  // another shard has just created it
      throw InvalidInput(folder.string() +
                         ": is no workspace, and not empty; expected a workspace of an earlier run, or a new name");
    }
  }
  make_folder(folder);
  lock_.emplace(folder, "workspace", std::chrono::milliseconds(0),
                access == Access::kShared ? FolderLock::For::kMany : FolderLock::For::kOne,
                access == Access::kAlone ? FolderLock::Need::kAlways : FolderLock::Need::kWhereItWorks);
  if (!holds_record()) write_new_file(record, record_json({}));
  record_ = record_from_json(read_whole_file(record), record.string());
  if (is_file(folder / kBegun)) {
    begun_ = record_from_json(read_whole_file(folder / kBegun), (folder / kBegun).string());
  }
  fs::rename(folder_ / "looks", image_records(), error);  // former name
  make_folder(planes());
  make_folder(points());
  if (access == Access::kShared) {
    make_folder(image_records());
    shards_.make();
  }
  lower_last_bin();
}

Workspace::~Workspace() = default;

bool Workspace::holds_record() const {
  std::error_code ignored;
  return fs::exists(fs::symlink_status(folder_ / kRecord, ignored));
}

void Workspace::lower_last_bin() {
  wait_until_saved();
  drop_missing(record_);
  if (begun_) drop_missing(*begun_);
}

void Workspace::begin(Record record) {
  write_file(folder_ / kBegun, record_json(record));
  begun_ = std::move(record);
}

std::string Workspace::fingerprint(const fs::path& file) {
  std::error_code error;
  const fs::path archive = io::archive_of(file);
  const fs::path& holder = archive.empty() ? file : archive;
  const std::int64_t time = fs::last_write_time(holder, error).time_since_epoch().count();
  const std::uintmax_t size = error ? 0 : fs::file_size(holder, error);
  Known& known = known_[file.string()];
  if (error || known.text.empty() || known.time != time || known.size != size) {
    known = {time, size, fingerprint_of_file(file)};
  }
  return known.text;
}

void Workspace::drop_missing(Record& record) const {
  for (auto& [id, keyframe] : record.keyframes) {
    if (keyframe.planes && !is_file(planes() / keyframe.planes->file)) keyframe.planes.reset();
    if (keyframe.points && !is_file(points() / keyframe.points->file)) keyframe.points.reset();
  }
}

bool Workspace::is_blank() const {
  std::error_code ignored;
  const auto is_empty = [&](const fs::path& folder) { return fs::is_empty(folder, ignored); };
  return record_.keyframes.empty() && is_empty(planes()) && is_empty(points());
}

bool Workspace::has_planes(const StepKeyframePlan& keyframe) const { return is_file(planes() / keyframe.planes_file); }
bool Workspace::has_points(const StepKeyframePlan& keyframe) const { return is_file(points() / keyframe.points_file); }

PlaneMap Workspace::load_planes(const std::string& file) const { return read_planes(planes() / file); }
void Workspace::save_planes(const std::string& file, const PlaneMap& map) {
  const std::size_t bytes = 4 * sizeof(float) * map.x.size();
  saving_->saver.make_room(bytes);
  const auto copy = saving_->planes.copy(map);
  saving_->saver.take(bytes, [path = planes() / file, copy] { return planes_file(path, *copy); });
}
KeyframeCloud Workspace::load_points(const std::string& file) const { return read_points(points() / file); }
void Workspace::save_points(const std::string& file, const KeyframeCloud& cloud) {
  const std::size_t bytes = (sizeof(CloudPoint) + 2 * sizeof(std::uint32_t)) * cloud.points.size();
  saving_->saver.make_room(bytes);
  const auto copy = saving_->points.copy(cloud);
  saving_->saver.take(bytes, [path = points() / file, copy] { return points_file(path, *copy); });
}
void Workspace::wait_until_saved() { saving_->saver.finish(); }

std::optional<ImageRecord> Workspace::find_image_record(const std::string& file) const {
  if (!is_file(image_records() / file)) return std::nullopt;
  return read_image_record(image_records() / file);
}
void Workspace::save_image_record(const std::string& file, const ImageRecord& record) const {
  write_image_record(image_records() / file, record);
}

void Workspace::commit(Record record) {
  wait_until_saved();
  drop_missing(record);
  write_file(folder_ / kRecord, record_json(record));
  record_ = std::move(record);
  has_committed_ = true;
  begun_.reset();
  std::error_code ignored;
  fs::remove(folder_ / kBegun, ignored);
  delete_unnamed();
}

/// Record and lock are deleted last: until then the folder is a workspace.
void Workspace::remove() {
  saving_->saver.drop();
  shards_.remove();
  std::error_code ignored;
  bool has_others = fs::exists(shards_.path(), ignored);
  for (const fs::path& folder : {planes(), points(), image_records()}) {
    delete_all_but({}, folder);
    fs::remove(folder, ignored);  // if it is empty
    has_others = has_others || fs::exists(folder, ignored);
  }
  if (has_others) return;
  fs::remove(folder_ / kBegun, ignored);
  fs::remove(folder_ / kRecord, ignored);
  fs::remove(folder_ / FolderLock::kName, ignored);
  fs::remove(folder_, ignored);
}

void Workspace::delete_unnamed() const {
  std::set<std::string> named_planes, named_points;
  for (const auto& [id, keyframe] : record_.keyframes) {
    if (keyframe.planes) named_planes.insert(keyframe.planes->file);
    if (keyframe.points) named_points.insert(keyframe.points->file);
  }
  delete_all_but(named_planes, planes());
  delete_all_but(named_points, points());
  delete_all_but({}, image_records());  // now part of the record
  shards_.end(record_.step);
}

}  // namespace pmsp::workspace
