// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "cloud_view.h"
#include "export/atomic_folder.h"
#include "pmsp/types.h"

namespace pmsp::tool {

/// Pictures of a run that a person judges at a glance: a few keyframes with depth and confidence, and the cloud. Memory
/// stays bounded: colours of the keyframes in the densifier's windows, and a share of the points, thinned where they
/// are dense. Pictures and points are worked on beside the caller, one call's at a time; what goes wrong there is
/// thrown by a later call.
class Preview {
 public:
  /// `keyframes`: how many will come. Throws OutputError.
  Preview(const std::filesystem::path& folder, std::size_t keyframes);
  ~Preview();

  /// Each keyframe, before the densifier gets it; `index` counts from 0. Sizes are those of the depth map.
  void add_keyframe(std::size_t index, std::int64_t id, const RigidTransform& cam_from_world,
                    ImageView<const Rgb> image, int depth_width, int depth_height);
  /// The keyframe added last gets no depth map.
  void drop_keyframe(std::int64_t id);
  void add_depth(const DepthMap& map);
  void add_points(const KeyframeCloud& cloud);

  /// Draws the cloud. `points` in all, for the caption. Returns what the pictures leave out, as left_out_of.
  std::string finish(std::int64_t points);
  /// Puts the folder in its place. Throws OutputError.
  void commit() { folder_.commit(); }

 private:
  struct Pending {
    std::size_t index = 0;
    std::int64_t id = 0;
    cv::Mat color;  // BGR
  };

  class Cells;

  void beside(std::function<void()> work);
  void keep(const std::vector<ViewPoint>& points);
  void thin();

  AtomicFolder folder_;
  std::size_t keyframes_;
  std::size_t strips_ = 0;
  std::deque<Pending> pending_;
  ViewScene scene_;
  std::unique_ptr<Cells> cells_;  ///< those that have a point, once points are thinned
  Eigen::Vector3d down_ = Eigen::Vector3d::Zero();
  std::future<void> working_;  ///< goes first: it works on the others
};

/// Whether Preview writes files of that name.
bool is_preview_file(const std::string& name);

}  // namespace pmsp::tool
