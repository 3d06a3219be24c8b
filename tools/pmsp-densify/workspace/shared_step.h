// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "arguments.h"
#include "workspace/workspace.h"
#include "workspace_step.h"

namespace pmsp::tool {

/// What a shard is made from, but for what is known of it later: step, engine and build.
workspace::ShardJob shared_job(const Arguments& arguments, const DensifierOptions& options,
                               workspace::Workspace& workspace);

/// A step that shards do, and what they tell of themselves.
class SharedStep {
 public:
  /// `step`: decided; must outlive it.
  SharedStep(const WorkspaceStep& step, std::vector<workspace::ShardMarker> markers, int count);

  /// Keyframes for which nothing comes out, as finished shards say.
  std::set<std::int64_t> without(workspace::Wave wave) const;

  /// "shards 3 and 5 of 7 have not finished (planes of 12 keyframes are missing)", and what these have told.
  std::string who_lacks(const std::vector<std::int64_t>& planes, const std::vector<std::int64_t>& points) const;

  /// Throws InvalidInput where a shard that has finished is none of this job, IoError where something is missing.
  void require_all(const workspace::ShardJob& job) const;

 private:
  int shard_of(std::int64_t keyframe_id) const;
  std::string failures(const std::set<int>& shards) const;

  const WorkspaceStep& step_;
  std::vector<workspace::ShardMarker> markers_;
  int count_;
  std::vector<std::int64_t> depth_maps_;
};

/// What `merge` ends: a run as the shards were told, but for its outputs.
struct Merge {
  /// Throws InvalidInput where nothing was shared out, or an input is not what it was.
  Merge(const Arguments& given, workspace::Workspace& workspace);

  /// Once it is decided: takes what the shards have made. Throws as SharedStep::require_all.
  void join(WorkspaceStep& step) const;

  workspace::Workspace& workspace;
  workspace::ShardJob job;
  bool is_repeated = false;  ///< the shards were merged before
  RigMask rig;               ///< of the shards
  Arguments arguments;
  DensifierOptions options;
};

}  // namespace pmsp::tool
