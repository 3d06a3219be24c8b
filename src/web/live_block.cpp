// SPDX-License-Identifier: BSD-2-Clause
#include "web/live_block.h"

#include <algorithm>
#include <cmath>

#include "export/little_endian.h"
#include "export/page_cloud.h"

namespace pmsp::web {

KeyframeCloud thinned(const KeyframeCloud& cloud, std::size_t most) {
  KeyframeCloud result;
  result.keyframe_id = cloud.keyframe_id;
  result.cam_from_world = cloud.cam_from_world;
  result.scale = cloud.scale;
  const std::size_t all = cloud.points.size(), count = std::min(all, most);
  result.points.reserve(count);
  for (std::size_t i = 0; i < count; ++i) result.points.push_back(cloud.points[i * all / count]);
  return result;
}

std::string live_block(const KeyframeCloud& cloud) {
  Eigen::Vector3f low = Eigen::Vector3f::Zero(), high = low;
  if (!cloud.points.empty()) low = high = cloud.points.front().position;
  for (const CloudPoint& point : cloud.points) {
    low = low.cwiseMin(point.position);
    high = high.cwiseMax(point.position);
  }
  const double side = std::max(static_cast<double>((high - low).maxCoeff()), 1e-9);
  std::string bytes;
  bytes.reserve(32 + PageCloud::kPointBytes * cloud.points.size());
  for (int i = 0; i < 3; ++i) append_little(bytes, static_cast<double>(low[i]));
  append_little(bytes, side);
  for (const CloudPoint& point : cloud.points) {
    for (int i = 0; i < 3; ++i) {
      const double share = static_cast<double>(point.position[i] - low[i]) / side;
      append_little(bytes, static_cast<std::uint16_t>(std::lround(65535.0 * std::clamp(share, 0.0, 1.0))));
    }
  }
  for (const CloudPoint& point : cloud.points) {
    for (const std::uint8_t value : {point.color.r, point.color.g, point.color.b}) append_little(bytes, value);
  }
  for (const CloudPoint& point : cloud.points) {
    const float share = std::clamp(point.confidence, 0.0F, 1.0F);
    append_little(bytes, static_cast<std::uint8_t>(std::lround(255.0F * share)));
  }
  for (const CloudPoint& point : cloud.points) append_little(bytes, point.views);
  for (const CloudPoint& point : cloud.points) {
    for (const std::int8_t value : octahedral({point.normal.x(), point.normal.y(), point.normal.z()})) {
      append_little(bytes, value);
    }
  }
  return bytes;
}

}  // namespace pmsp::web
