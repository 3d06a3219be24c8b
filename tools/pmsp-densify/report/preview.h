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

#include "export/atomic_folder.h"
#include "pictures.h"
#include "pmsp/types.h"

namespace pmsp::tool {

/// Pictures of a run for visual inspection: some keyframes with depth and confidence, and the cloud. Bounded memory:
/// colours of the keyframes in the densifier's windows, and a thinned subset of the points. Works on a background
/// thread, one call at a time; its errors are thrown by a later call.
class Preview {
 public:
  /// `keyframes`: expected number. Throws OutputError.
  Preview(const std::filesystem::path& folder, std::size_t keyframes);
  ~Preview();

  /// To be called for each keyframe before the densifier; `index` counts from 0. Sizes are those of the depth map.
  void add_keyframe(std::size_t index, std::int64_t id, const RigidTransform& cam_from_world,
                    ImageView<const Rgb> image, int depth_width, int depth_height);
  /// The last added keyframe gets no depth map.
  void drop_keyframe(std::int64_t id);
  void add_depth(const DepthMap& map);
  void add_points(const KeyframeCloud& cloud);

  /// Draws the cloud. `points`: total number, for the caption. Returns left_out_of() of the scene.
  std::string finish(std::int64_t points);
  /// Moves the folder to its final name. Throws OutputError.
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
  std::unique_ptr<Cells> cells_;  ///< occupied ones, once points are thinned
  Eigen::Vector3d down_ = Eigen::Vector3d::Zero();
  std::future<void> working_;  ///< last member, since it uses the others
};

/// True for file names of Preview.
bool is_preview_file(const std::string& name);

}  // namespace pmsp::tool
