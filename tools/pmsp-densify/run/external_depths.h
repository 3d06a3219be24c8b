// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "plan/plan.h"
#include "planned_densifier.h"
#include "pmsp/calibration.h"
#include "pmsp/io/depth.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "pmsp/stages.h"

namespace pmsp::tool {

/// Sets the defaults of `fuse`: all depth images are used, in their own size; those marked as filtered in their index
/// are not filtered again. Throws as DepthFolder.
void set_fuse_defaults(DensifierOptions& options, const Arguments& arguments);

/// Depth images of `fuse`, which replace the depth maps of PatchMatch. Members are to be called in order.
class ExternalDepths {
 public:
  /// Throws as DepthFolder.
  explicit ExternalDepths(const Arguments& arguments);

  /// Checks the depth images of keyframes with an image and makes the plan. `options`: of the run; sizes of 0 are set
  /// to that of the first depth image. Returns keyframes with unusable depth. Throws InvalidInput if none is usable or
  /// their unit clearly differs from the landmarks'; as MaskSource.
  std::vector<SkippedKeyframe> look(const SlamMap& map, const ImageSource& source, DensifierOptions& options);
  std::size_t count() const { return found_.size(); }
  const Plan& plan() const { return plan_; }

  /// A sentence for people, and the same for --stats.
  std::string summary() const;
  nlohmann::ordered_json report() const;

  /// `this` must outlive the densifier.
  std::unique_ptr<PlannedDensifier> densifier(PlannedCallbacks callbacks);

  /// To be called before the keyframe is added.
  void set_image_size(std::int64_t keyframe_id, int width, int height);
  /// Returns a substitute for a keyframe with an unreadable image, without depth.
  Keyframe without_image(std::int64_t keyframe_id);

  /// Adds pixel counts before the consistency filter, which the densifier does not know.
  void count_pixels(DensifierStats& stats) const;

 private:
  struct Found {
    std::filesystem::path file, image;
    DepthAlignment alignment;   ///< scale, shift and model
    int width = 0, height = 0;  ///< of the image; 0 = unreadable
  };

  bool is_aligned() const { return !arguments_.depth_scale; }
  Found add_image(const Keyframe& keyframe, const std::filesystem::path& file, DensifierOptions& options,
                  std::vector<double>& ratios);
  void check_unit(std::vector<double> ratios) const;
  PlaneMap planes_of(std::int64_t keyframe_id);
  DepthMap read(std::int64_t keyframe_id, const Found& found) const;
  void find_normals(DepthMap& map) const;
  void leave_out_masked(DepthMap& map, const Found& found);

  const Arguments& arguments_;
  DepthFolder folder_;
  std::optional<MaskSource> masks_;
  const SlamMap* map_ = nullptr;
  std::size_t with_image_ = 0;
  std::map<std::int64_t, Found> found_;
  DensifierOptions options_;
  std::unique_ptr<Executor> executor_;
  Plan plan_;
  Image<Rgb> blank_;
  DensifierStats stats_;
};

}  // namespace pmsp::tool
