// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include "arguments.h"
#include "planes_pace.h"
#include "pmsp/calibration.h"
#include "pmsp/densifier.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "time_account.h"
#include "workspace/workspace.h"

namespace pmsp::tool {

/// For runs with --delete-workspace in an empty workspace: otherwise as without workspace, but planes are stored under
/// the names that a WorkspaceStep expects, for resumption after a kill.
class PlaneKeeper {
 public:
  /// All must outlive it. `options`: of the arguments.
  PlaneKeeper(workspace::Workspace& workspace, const Arguments& arguments, const DensifierOptions& options,
              const SlamMap& map, const RigMask& rig, const ImageSource& source, TimeAccount& time);

  /// For PlannedCallbacks. `densifier`: the caller.
  bool wants_planes(const Densifier& densifier);
  void keep(const PlaneMap& planes, const Densifier& densifier);

 private:
  workspace::Workspace& workspace_;
  const Arguments& arguments_;
  const DensifierOptions options_;
  const SlamMap& map_;
  const RigMask& rig_;
  const ImageSource& source_;
  TimeAccount& time_;
  PlanesPace pace_;
  std::string step_;  ///< name, set at the first planes
};

}  // namespace pmsp::tool
