// SPDX-License-Identifier: BSD-2-Clause
#include "plane_keeper.h"

#include <vector>

#include "workspace_step.h"

namespace pmsp::tool {

bool PlanesPace::is_worth_keeping(const PlaneMap& planes) {
  constexpr double kMostBytesPerSecond = 100e6;
  constexpr std::size_t kPlaneBytes = 4 * sizeof(float);
  if (!first_) {
    first_ = Clock::now();
    return false;
  }
  bytes_ += static_cast<double>(kPlaneBytes * planes.x.size());
  return bytes_ < kMostBytesPerSecond * std::chrono::duration<double>(Clock::now() - *first_).count();
}

PlaneKeeper::PlaneKeeper(workspace::Workspace& workspace, const Arguments& arguments, const DensifierOptions& options,
                         const SlamMap& map, const ImageSource& source, TimeAccount& time)
    : workspace_(workspace), arguments_(arguments), options_(options), map_(map), source_(source), time_(time) {}

void PlaneKeeper::keep(const PlaneMap& planes, const Densifier& densifier) {
  if (!pace_.is_worth_keeping(planes)) return;
  const TimeAccount::Scope spent(time_, Busy::kWorkspace);
  if (step_.empty()) {
    WorkspaceStep step(workspace_, arguments_, options_, map_, false, nullptr);
    step_ = step.name_of_run(source_, densifier);
  }
  workspace_.save_planes(workspace::planes_name(planes.keyframe_id, step_), planes);
}

void PlaneKeeper::remove() {
  const TimeAccount::Scope spent(time_, Busy::kWorkspace);
  workspace_.remove();
}

}  // namespace pmsp::tool
