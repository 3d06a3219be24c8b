// SPDX-License-Identifier: BSD-2-Clause
#include "export/placed_points.h"

#include <algorithm>

namespace pmsp {
namespace {

constexpr std::size_t kShare = std::size_t{1} << 14;  ///< points per task of a thread
constexpr std::size_t kPiece = 8 * kShare;

}  // namespace

PointTransform::PointTransform(const KeyframeCloud& cloud, const KeyframePose& pose, const Similarity& file_from_map)
    : cloud_(cloud),
      scale_(pose.scale),
      map_from_cam_(pose.cam_from_world.inverse()),
      file_from_map_(file_from_map),
      moves_(!file_from_map.is_identity()),
      rotation_((moves_ ? Eigen::Matrix3d(file_from_map.rotation * map_from_cam_.rotation) : map_from_cam_.rotation)
                    .cast<float>()) {}

Eigen::Vector3d PointTransform::position(std::size_t i) const {
  const Eigen::Vector3d in_map = map_from_cam_ * (scale_ * cloud_.points[i].position.cast<double>());
  return moves_ ? file_from_map_ * in_map : in_map;
}

void PointTransform::place(std::size_t i, OutputPoint& to) const {
  const CloudPoint& from = cloud_.points[i];
  to.position = position(i);
  to.normal = rotation_ * from.normal;
  to.confidence = from.confidence;
  to.keyframe_id = cloud_.keyframe_id;
  to.pixel = cloud_.pixels.empty() ? static_cast<std::uint32_t>(i) : cloud_.pixels[i];
  to.agree = cloud_.agree.empty() ? 0 : cloud_.agree[i];
  to.color = from.color;
  to.views = from.views;
}

void place_points(const KeyframeCloud& cloud, const KeyframePose& pose, const Similarity& file_from_map,
                  std::size_t first, std::size_t last, OutputPoint* to) {
  const PointTransform placer(cloud, pose, file_from_map);
  for (std::size_t i = first; i < last; ++i) placer.place(i, *to++);
}

std::vector<std::uint32_t> points_in_box(const PointTransform& points, const Box& box, ThreadPool& pool) {
  std::vector<std::vector<std::uint32_t>> of_share((points.size() + kShare - 1) / kShare);
  pool.for_each(static_cast<int>(of_share.size()), [&](int number) {
    const std::size_t share = static_cast<std::size_t>(number);
    for (std::size_t i = share * kShare; i < std::min((share + 1) * kShare, points.size()); ++i) {
      if (box.contains(points.position(i))) of_share[share].push_back(static_cast<std::uint32_t>(i));
    }
  });
  std::vector<std::uint32_t> all;
  for (const std::vector<std::uint32_t>& some : of_share) all.insert(all.end(), some.begin(), some.end());
  return all;
}

PointChunks::PointChunks(ThreadPool& pool) : pool_(pool), piece_(kPiece) {}

void PointChunks::for_each_piece(std::size_t count, const PointProducer& place,
                                 const std::function<void(const OutputPoint* points, std::size_t count)>& take) {
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
