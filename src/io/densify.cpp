// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/io/densify.h"

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "io/mission.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

/// Thrown to end a pass over images early.
struct Stopped {};

/// Adds a rig to masks for the duration of a run.
class RigScope {
 public:
  RigScope(MaskSource& masks, Image<std::uint8_t> rig) : masks_(masks), previous_(masks.set_rig({})) {
    hide_rig(previous_, rig);
    masks_.set_rig(std::move(rig));
  }
  ~RigScope() { masks_.set_rig(std::move(previous_)); }
  RigScope(const RigScope&) = delete;
  RigScope& operator=(const RigScope&) = delete;

 private:
  MaskSource& masks_;
  Image<std::uint8_t> previous_;
};

}  // namespace

DensifierStats densify(const SlamMap& map, ImageSource& images, const DensifierOptions& given,
                       const DensifierCallbacks& callbacks, const DensifyExtras& extras) {
  io::MissionLog log;
  if (extras.warning) log.warning = extras.warning;
  io::Mission mission({extras.verify, extras.verify, given.threads}, log);
  MaskOptions of_map;
  of_map.images = extras.image_folder;
  if (extras.masks == nullptr) io::name_masks(map, images, of_map);
  MaskSource own_masks(of_map);
  mission.prior_depths = io::PriorDepths(extras.prior_depth, extras.image_folder, map);
  mission.set_map(map);
  mission.set_images(images, extras.masks != nullptr ? *extras.masks : own_masks);
  mission.check_poses();
  if (mission.map.landmarks.empty()) {
    throw InvalidInput(map.path.string() +
                       ": neither the map nor the images give landmarks, expected some for the depth ranges; "
                       "give a PLY file with points (ReadMapOptions::points)");
  }
  DensifierOptions options = given;
  std::optional<RigScope> rig;
  {
    CalibrationOptions calibrate = extras.calibrate;
    calibrate.lenses = calibrate.lenses && options.lens_distance == 0.0;
    const Executor executor(options.threads, options.simd);
    std::optional<CameraCalibration> found = calibrate_camera(mission.map, images, mission.masks, calibrate, executor);
    if (found && found->lenses && found->lenses->significant) options.lens_distance = found->lenses->distance;
    if (found && !found->rig.mask.empty()) rig.emplace(*mission.masks, std::move(found->rig.mask));
  }
  if (options.advanced.expected_keyframes == 0)
    options.advanced.expected_keyframes = static_cast<std::int64_t>(images.keyframe_ids().size());
  Densifier densifier(options, callbacks);
  const std::unique_ptr<PairingVerifier> verifier = mission.verifier();
  io::ImageReader reader(images, mission.map, mission.threads(), verifier.get());
  const auto add = [&](std::size_t index, Keyframe& keyframe) {
    mission.complete(keyframe, images);
    densifier.add(keyframe);
    if (extras.progress && !extras.progress(index + 1, images.keyframe_ids().size())) throw Stopped{};
  };
  const auto skipped = [&](const SkippedKeyframe& keyframe) {
    log.warning("keyframe " + std::to_string(keyframe.keyframe_id) + ": " + keyframe.reason);
  };
  try {
    const io::ImageLoop::End end = io::ImageLoop{reader, add, skipped}();
    if (end.images == 0)
      throw InvalidInput("no image can be read" +
                         (end.first_error.empty() ? "" : "; the first one: " + end.first_error));
    if (end.pairing) {
      const std::string doubt = io::warning_of(*end.pairing, true);
      if (!doubt.empty()) log.warning(doubt);
    }
  } catch (const Stopped&) {
    return densifier.stats();
  }
  densifier.flush();
  return densifier.stats();
}

DensifierStats densify(const SlamMap& map, ImageSource& images, const DensifierOptions& options, CloudOutput& output,
                       const DensifyExtras& extras) {
  DensifierCallbacks callbacks;
  callbacks.cloud = [&output](const KeyframeCloud& cloud) { output.add(cloud); };
  if (output.wants_depth()) callbacks.filtered_depth = [&output](const DepthMap& depth) { output.add_depth(depth); };
  return densify(map, images, options, callbacks, extras);
}

}  // namespace pmsp
