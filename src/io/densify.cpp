// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/io/densify.h"

#include <memory>
#include <optional>
#include <string>

#include "pmsp/error.h"
#include "pmsp/io/convention.h"
#include "pmsp/io/landmark_sweep.h"
#include "pmsp/io/pairing.h"

namespace pmsp {
namespace {

/// The next image that can be read; nullopt after the last one. `unreadable`: why the first one of the others is not.
std::optional<ImageSource::Item> next_readable(ImageSource& images, std::string& unreadable) {
  for (;;) {
    try {
      return images.next();
    } catch (const Error& error) {
      if (unreadable.empty()) unreadable = error.what();
    }
  }
}

/// A copy of the map with landmarks that the images give.
SlamMap with_landmarks(const SlamMap& map, const ImageSource& images, MaskSource& masks, bool verify) {
  const std::unique_ptr<ImageSource> source = images.again();
  LandmarkSweep sweep(map);
  std::string unreadable;
  while (const auto item = next_readable(*source, unreadable)) {
    sweep.add(item->keyframe_id, item->image.view(),
              masks.mask_for(source->origin(item->keyframe_id).file, item->image.width(), item->image.height()));
  }
  SlamMap result = map;
  const LandmarkSweep::Result made = sweep.make_landmarks(result, 0, verify);
  if (!made.fits) throw InvalidInput(map.path.string() + ": " + made.message);
  if (!result.landmarks.empty()) return result;
  throw InvalidInput(map.path.string() +
                     ": neither the map nor its images give landmarks, expected at least some: depth "
                     "ranges follow from them; a PLY file with points may stand in (ReadMapOptions::points)");
}

}  // namespace

DensifierStats densify(const SlamMap& original, ImageSource& images, const DensifierOptions& given,
                       const DensifierCallbacks& callbacks, const DensifyExtras& extras) {
  if (extras.verify) require_convention(original);
  std::optional<SlamMap> swept;
  MaskSource alpha_alone{MaskOptions{}};
  MaskSource& masks = extras.masks != nullptr ? *extras.masks : alpha_alone;
  if (original.landmarks.empty()) swept = with_landmarks(original, images, masks, extras.verify);
  const SlamMap& map = swept ? *swept : original;
  DensifierOptions options = given;
  {
    CalibrationOptions calibrate = extras.calibrate;
    calibrate.lenses = calibrate.lenses && options.lens_distance == 0.0;
    const Executor executor(options.threads, options.simd);
    const std::optional<CameraCalibration> found = calibrate_camera(map, images, &masks, calibrate, executor);
    if (found && found->lenses && found->lenses->significant) options.lens_distance = found->lenses->distance;
    if (found) masks.set_rig(found->rig.mask);
  }
  if (options.expected_keyframes == 0)
    options.expected_keyframes = static_cast<std::int64_t>(images.keyframe_ids().size());
  Densifier densifier(options, callbacks);
  PairingVerifier verifier(map);
  std::string unreadable;
  std::size_t done = 0;
  while (const auto item = next_readable(images, unreadable)) {
    const MapKeyframe* in_map = map.find_keyframe(item->keyframe_id);
    if (in_map == nullptr) {
      throw InvalidInput("an image names keyframe " + std::to_string(item->keyframe_id) + ", which the map lacks");
    }
    if (extras.verify) {
      verifier.add(item->keyframe_id, item->image.view());
      const PairingVerifier::Verdict verdict = verifier.verdict();
      if (verdict.conclusive && !verdict.belongs) throw InvalidInput(verdict.message);
    }
    Keyframe keyframe = keyframe_of(map, *in_map);
    keyframe.image = item->image.view();
    keyframe.mask = masks.mask_for(images.origin(keyframe.id).file, item->image.width(), item->image.height());
    densifier.add(keyframe);
    ++done;
    if (extras.progress && !extras.progress(done, images.keyframe_ids().size())) return densifier.stats();
  }
  if (done == 0)
    throw InvalidInput("no image can be read" + (unreadable.empty() ? "" : "; the first one: " + unreadable));
  densifier.flush();
  return densifier.stats();
}

DensifierStats densify(const SlamMap& map, ImageSource& images, const DensifierOptions& options, CloudOutput& output,
                       const DensifyExtras& extras) {
  DensifierCallbacks callbacks;
  callbacks.cloud = [&output](const KeyframeCloud& cloud) { output.add(cloud); };
  return densify(map, images, options, callbacks, extras);
}

}  // namespace pmsp
