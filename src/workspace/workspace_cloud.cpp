// SPDX-License-Identifier: BSD-2-Clause
#include "workspace/workspace_cloud.h"

#include <system_error>
#include <vector>

#include "pmsp/error.h"

namespace pmsp::workspace {

bool is_workspace(const std::filesystem::path& folder) {
  std::error_code ignored;
  return std::filesystem::exists(folder / "workspace.json", ignored);
}

WorkspaceCloud::WorkspaceCloud(const std::filesystem::path& folder) : workspace_(folder) {
  info_.format = "workspace";
  info_.has_normals = info_.has_colors = info_.has_confidence = info_.has_views = true;
  info_.file_from_map = Similarity{};
  info_.unit.kind = CloudUnit::Kind::kMap;
}

void WorkspaceCloud::read(const Take& take) {
  std::vector<OutputPoint> placed;
  each([&](const KeyframeCloud& cloud) {
    placed.resize(cloud.points.size());
    place_points(cloud, cloud.pose(), {}, 0, cloud.points.size(), placed.data());
    if (!placed.empty()) take(placed.data(), placed.size());
  });
}

void WorkspaceCloud::each(const std::function<void(const KeyframeCloud& cloud)>& take) const {
  for (const PlanEntry& entry : record().plan.entries) {
    const auto found = record().keyframes.find(entry.id);
    if (found == record().keyframes.end() || !found->second.points) continue;
    KeyframeCloud cloud = workspace_.load_points(found->second.points->file);
    if (cloud.keyframe_id != entry.id) {
      throw IoError("the record of the workspace names a file of keyframe " + std::to_string(cloud.keyframe_id) +
                    " as that of keyframe " + std::to_string(entry.id) + "; run again in another workspace");
    }
    cloud.cam_from_world = found->second.pose.cam_from_world;
    cloud.scale = found->second.pose.scale;
    take(cloud);
  }
}

}  // namespace pmsp::workspace
