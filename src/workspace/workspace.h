// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "export/folder_lock.h"
#include "pmsp/api.h"
#include "pmsp/stages.h"
#include "pmsp/types.h"
#include "workspace/artefact_file.h"
#include "workspace/record.h"
#include "workspace/shards.h"
#include "workspace/step.h"

namespace pmsp::workspace {

/// A folder that keeps what keyframes left, so that a run on a newer state of the same mission, or after a kill, makes
/// only what is missing:
///
///     workspace.json          the record of the last finished step
///     begun.json              what a step that has begun since is to make
///     lock                    locked while a process works here
///     planes/ID-STEP          planes of a keyframe, and the step that made them
///     points/ID-STEP          points, likewise
///     looks/ID-INPUTS         what shards have seen of images; until the step is through
///     shards/                 see ShardFolder
///
/// Each file appears whole or not at all, and a file never changes. A step writes its files beside those of earlier
/// steps, then the record, then deletes what the record does not name. So after a kill at any moment the folder holds
/// the earlier state, and what the interrupted step had finished: a run with the same inputs plans the same step, under
/// the same name, and finds these. Several processes may do parts of one step: what they write under one name is the
/// same.
class PMSP_API Workspace {
 public:
  /// Who may work in the folder meanwhile. Where the file system has no locks, kAlone fails; the others go without:
  /// names and whole files keep shards from harming each other, and nobody else must come between.
  enum class Access {
    kAlone,   ///< nobody
    kShared,  ///< others that share: parts of a step; `commit` is not for them
    kMerge,   ///< nobody, to end what was shared
  };

  /// Makes the folder where there is none. Throws OutputError where that fails or another process works in it,
  /// InvalidInput where it holds other things, or a record that cannot be read.
  explicit Workspace(const std::filesystem::path& folder, Access access = Access::kAlone);
  ~Workspace();  ///< after all that was saved has come to the disk
  Workspace(const Workspace&) = delete;
  Workspace& operator=(const Workspace&) = delete;

  /// Without what had been deleted when it was last looked for. Looking throws OutputError, as `wait_until_saved`.
  const Record& record() const { return record_; }
  void look_again();
  /// What the step that was begun last, and was not finished, has made. nullopt = there is none.
  const std::optional<Record>& begun() const { return begun_; }
  /// See record_of_begun. Throws OutputError.
  void begin(Record record);
  /// Whether the record is of a step that was finished through this object.
  bool has_committed() const { return has_committed_; }

  /// Of a file's bytes; remembered while its size and time stay. Throws IoError.
  std::string fingerprint(const std::filesystem::path& file);

  /// Whether no step was finished here, and none has left anything.
  bool is_blank() const;

  /// What an interrupted run of this step has left.
  bool has_planes(const StepKeyframePlan& keyframe) const;
  bool has_points(const StepKeyframePlan& keyframe) const;

  /// Throw IoError and OutputError. What is saved is written by a few threads and appears when it has reached the disk;
  /// an error in that is thrown by the next call that saves or waits.
  PlaneMap load_planes(const std::string& file) const;
  void save_planes(const std::string& file, const PlaneMap& planes);
  KeyframeCloud load_points(const std::string& file) const;
  void save_points(const std::string& file, const KeyframeCloud& cloud);
  /// Throws OutputError.
  void wait_until_saved();

  /// What shards have seen of an image; nullopt = nothing under this name. Throw IoError and OutputError.
  std::optional<Look> find_look(const std::string& file) const;
  void save_look(const std::string& file, const Look& look) const;

  const ShardFolder& shards() const { return shards_; }

  /// The step is through: its record takes the place of the earlier one, and files that it does not name are deleted.
  /// Waits until all is saved.
  void commit(Record record);

  /// Nobody will need the folder any more: deletes what a workspace consists of, and the folder if that is all.
  /// For kAlone. Nothing else may be called then.
  void remove();

 private:
  std::filesystem::path planes() const { return folder_ / "planes"; }
  std::filesystem::path points() const { return folder_ / "points"; }
  std::filesystem::path great_circles() const { return folder_ / "looks"; }
  bool holds_record() const;
  void drop_missing(Record& record) const;
  void delete_unnamed() const;

  std::filesystem::path folder_;
  ShardFolder shards_;
  struct Saving;
  struct Known {
    std::int64_t time = 0;
    std::uintmax_t size = 0;
    std::string text;
  };

  std::optional<FolderLock> lock_;
  std::unique_ptr<Saving> saving_;  ///< while the folder is locked
  std::map<std::string, Known> known_;
  Record record_;
  std::optional<Record> begun_;
  bool has_committed_ = false;
};

}  // namespace pmsp::workspace
