// SPDX-License-Identifier: BSD-2-Clause
#include "export/placed_points.h"

#include <algorithm>

namespace pmsp {

void place_points(const KeyframeCloud& cloud, const KeyframePose& pose, const Similarity& file_from_map,
                  std::size_t first, std::size_t last, OutputPoint* to) {
  const RigidTransform map_from_cam = pose.cam_from_world.inverse();
  const bool moves = !file_from_map.is_identity();
  Eigen::Matrix3f rotation = map_from_cam.rotation.cast<float>();
  if (moves) rotation = (file_from_map.rotation * map_from_cam.rotation).cast<float>();
  for (std::size_t i = first; i < last; ++i, ++to) {
    const CloudPoint& from = cloud.points[i];
    to->position = map_from_cam * (pose.scale * from.position.cast<double>());
    if (moves) to->position = file_from_map * to->position;
    to->normal = rotation * from.normal;
    to->confidence = from.confidence;
    to->keyframe_id = cloud.keyframe_id;
    to->pixel = cloud.pixels.empty() ? static_cast<std::uint32_t>(i) : cloud.pixels[i];
    to->agree = cloud.agree.empty() ? 0 : cloud.agree[i];
    to->color = from.color;
    to->views = from.views;
  }
}

PlacedPoints::PlacedPoints(int threads) : pool_(threads), piece_(kPiece) {}

void PlacedPoints::for_each_piece(std::size_t count, const PlacePoints& place,
                                  const std::function<void(OutputPoint* points, std::size_t count)>& take) {
  for (std::size_t begin = 0; begin < count; begin += kPiece) {
    const std::size_t some = std::min(kPiece, count - begin);
    pool_.for_each(static_cast<int>((some + kShare - 1) / kShare), [&](int share) {
      const std::size_t first = static_cast<std::size_t>(share) * kShare;
      place(begin + first, begin + std::min(first + kShare, some), piece_.data() + first);
    });
    take(piece_.data(), some);
  }
}

}  // namespace pmsp
