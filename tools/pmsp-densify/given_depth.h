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

/// What `fuse` has in place of a preset's values: all depth images are used, in their own size; what their index says
/// has been filtered is not filtered again. Throws as DepthFolder.
void set_fuse_defaults(DensifierOptions& options, const Arguments& arguments);

/// The depth images of `fuse`, in place of depth maps that PatchMatch would make. In the order of the members.
class GivenDepths {
 public:
  /// Throws as DepthFolder.
  explicit GivenDepths(const Arguments& arguments);

  /// Looks at the depth images of the keyframes that have an image, and plans. `options`: of the run; a size of 0
  /// becomes that of the first depth image. Returns those that cannot be used. Throws InvalidInput where none can, and
  /// where they are clearly of another unit than the landmarks; and as MaskSource.
  std::vector<SkippedKeyframe> look(const SlamMap& map, const ImageSource& source, DensifierOptions& options);
  std::size_t count() const { return found_.size(); }
  const Plan& plan() const { return plan_; }

  /// A sentence for people, and for --stats.
  std::string summary() const;
  nlohmann::ordered_json report() const;

  /// `this` must outlive it.
  std::unique_ptr<PlannedDensifier> densifier(PlannedCallbacks callbacks);

  /// To be told before the keyframe is added.
  void set_image_size(std::int64_t keyframe_id, int width, int height);
  /// What to add for a keyframe whose image cannot be read after all: it has no depth then.
  Keyframe without_image(std::int64_t keyframe_id);

  /// What the densifier does not count: pixels before the consistency filter.
  void count_pixels(DensifierStats& stats) const;

 private:
  struct Found {
    std::filesystem::path file, image;
    DepthAlignment alignment;   ///< scale, shift and model to go by
    int width = 0, height = 0;  ///< of the image; 0 = none can be read
  };

  bool is_aligned() const { return !arguments_.depth_scale; }
  Found look_at(const Keyframe& keyframe, const std::filesystem::path& file, DensifierOptions& options,
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
