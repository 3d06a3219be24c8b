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

/// Folder with cached results of a mission, so that a run on a newer state of it, or after a kill, makes only missing
/// ones:
///
///     workspace.json          the record of the last finished step
///     begun.json              planned results of a step that was begun but not completed
///     lock                    locked while a process works here
///     planes/ID-STEP          planes of a keyframe, made by step STEP
///     points/ID-STEP          points, likewise
///     image_records/ID-INPUTS image properties recorded by shards; until the step is complete
///     shards/                 see ShardFolder
///
/// Files are written atomically and never change. A step writes its files beside those of earlier steps, then the
/// record, then deletes files that the record does not contain. After a kill at any moment, the folder therefore has
/// the previous state and the finished files of the interrupted step: a run with the same inputs plans a step of the
/// same name and reuses them. Several processes may make parts of one step: files of one name are identical.
class PMSP_API Workspace {
 public:
  /// Concurrent access to the folder. On a file system without locks kAlone fails; the others go without: names and
  /// atomic files keep shards from conflicts, but other processes must be kept away.
  enum class Access {
    kAlone,   ///< exclusive
    kShared,  ///< together with other shards of a step; no `commit`
    kMerge,   ///< exclusive, to complete a step of shards
  };

  /// Creates the folder if needed. Throws OutputError if that fails or another process uses it; InvalidInput if it has
  /// other content or an invalid record.
  explicit Workspace(const std::filesystem::path& folder, Access access = Access::kAlone);
  ~Workspace();  ///< completes all writes
  Workspace(const Workspace&) = delete;
  Workspace& operator=(const Workspace&) = delete;

  /// Entries whose files are missing are dropped, as of the last lower_last_bin(), which throws OutputError as
  /// `wait_until_saved`.
  const Record& record() const { return record_; }
  void lower_last_bin();
  /// Results of the last step that was begun but not completed; nullopt = none.
  const std::optional<Record>& begun() const { return begun_; }
  /// See record_of_begun. Throws OutputError.
  void begin(Record record);
  /// Whether the record was committed by this object.
  bool has_committed() const { return has_committed_; }

  /// Returns the fingerprint of a file's content; cached while size and time are equal. Throws IoError.
  std::string fingerprint(const std::filesystem::path& file);

  /// Whether the folder has no completed step and no results.
  bool is_blank() const;

  /// Whether an interrupted run of this step has saved them.
  bool has_planes(const StepKeyframePlan& keyframe) const;
  bool has_points(const StepKeyframePlan& keyframe) const;

  /// Throw IoError and OutputError. A few threads write saved data, which appear when they are on the disk; errors are
  /// thrown by the next call that saves or waits.
  PlaneMap load_planes(const std::string& file) const;
  void save_planes(const std::string& file, const PlaneMap& planes);
  KeyframeCloud load_points(const std::string& file) const;
  void save_points(const std::string& file, const KeyframeCloud& cloud);
  /// Blocks until all is saved. Throws OutputError.
  void wait_until_saved();

  /// Image properties recorded by shards; nullopt = none of this name. Throw IoError and OutputError.
  std::optional<ImageRecord> find_image_record(const std::string& file) const;
  void save_image_record(const std::string& file, const ImageRecord& record) const;

  const ShardFolder& shards() const { return shards_; }

  /// Completes the step: blocks until all is saved, replaces the record, and deletes files that it does not contain.
  void commit(Record record);

  /// Deletes all files of a workspace, and the folder if it is then empty. For kAlone; no other call may follow.
  void remove();

 private:
  std::filesystem::path planes() const { return folder_ / "planes"; }
  std::filesystem::path points() const { return folder_ / "points"; }
  std::filesystem::path image_records() const { return folder_ / "image_records"; }
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
