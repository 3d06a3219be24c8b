// SPDX-License-Identifier: BSD-2-Clause
#include "plane_keeper.h"

#include "workspace_step.h"

namespace pmsp::tool {

PlaneKeeper::PlaneKeeper(workspace::Workspace& workspace, const Arguments& arguments, const DensifierOptions& options,
                         const SlamMap& map, const RigMask& rig, const ImageSource& source, TimeAccount& time)
    : workspace_(workspace),
      arguments_(arguments),
      options_(options),
      map_(map),
      rig_(rig),
      source_(source),
      time_(time) {}

bool PlaneKeeper::wants_planes(const Densifier& densifier) { return pace_.is_worth_keeping(densifier.options()); }

void PlaneKeeper::keep(const PlaneMap& planes, const Densifier& densifier) {
  const TimeAccount::Scope spent(time_, Busy::kWorkspace);
  if (step_.empty()) {
    WorkspaceStep step(workspace_, arguments_, options_, map_, rig_, false, nullptr);
    step_ = step.begin_run(source_, densifier);
  }
  workspace_.save_planes(workspace::planes_name(planes.keyframe_id, step_), planes);
}

}  // namespace pmsp::tool
