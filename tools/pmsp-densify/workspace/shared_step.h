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

/// Inputs of a shard, except those known later: step, engine and build.
workspace::ShardJob shared_job(const Arguments& arguments, const DensifierOptions& options,
                               workspace::Workspace& workspace);

/// Step computed by shards, with their markers.
class SharedStep {
 public:
  /// `step`: decided; must outlive it.
  SharedStep(const WorkspaceStep& step, std::vector<workspace::ShardMarker> markers, int count);

  /// Returns keyframes without result, according to finished shards.
  std::set<std::int64_t> without(workspace::Wave wave) const;

  /// Returns "shards 3 and 5 of 7 have not finished (planes of 12 keyframes are missing)", with their errors.
  std::string who_lacks(const std::vector<std::int64_t>& planes, const std::vector<std::int64_t>& points) const;

  /// Throws InvalidInput if a finished shard belongs to another job, IoError if results are missing.
  void require_all(const workspace::ShardJob& job) const;

 private:
  int shard_of(std::int64_t keyframe_id) const;
  std::string failures(const std::set<int>& shards) const;

  const WorkspaceStep& step_;
  std::vector<workspace::ShardMarker> markers_;
  int count_;
  std::vector<std::int64_t> depth_maps_;
};

/// Input of `merge`: a run with the arguments of the shards, except for its outputs.
struct Merge {
  /// Throws InvalidInput if there are no shards, or an input has changed.
  Merge(const Arguments& given, workspace::Workspace& workspace);

  /// Adopts the results of the shards into a decided step. Throws as SharedStep::require_all.
  void join(WorkspaceStep& step) const;

  workspace::Workspace& workspace;
  workspace::ShardJob job;
  bool is_repeated = false;  ///< the shards were merged before
  RigMask rig;               ///< of the shards
  Arguments arguments;
  DensifierOptions options;
};

}  // namespace pmsp::tool
