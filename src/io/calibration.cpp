// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/io/densify.h"

#include <memory>
#include <vector>

#include "io/image_reader.h"
#include "pmsp/error.h"

namespace pmsp {

std::optional<CameraCalibration> calibrate_camera(const SlamMap& map, const ImageSource& images, MaskSource* masks,
                                                  const CalibrationOptions& options, const Executor& executor) {
  CameraCalibration result;
  if (images.keyframe_ids().empty() || (!options.lenses && !options.rig)) return result;
  const std::unique_ptr<ImageSource> source = images.reopen();
  io::restrict_to_sample(*source);
  source->read_ahead(executor.threads());
  LensDistanceEstimator lenses;
  RigMaskEstimator rig;
  try {
    while (const std::optional<ImageSource::Item> item = source->next()) {
      const MapKeyframe* const in_map = map.find_keyframe(item->keyframe_id);
      if (in_map == nullptr) return std::nullopt;
      Keyframe keyframe = keyframe_of(map, *in_map);
      keyframe.image = item->image.view();
      if (masks != nullptr) {
        keyframe.mask =
            masks->mask_for(source->origin(keyframe.id).name(), keyframe.image.width, keyframe.image.height);
      }
      if (options.lenses) lenses.add(keyframe, &executor);
      if (options.rig) rig.add(keyframe, executor);
    }
  } catch (const Error&) {
    return std::nullopt;
  }
  if (options.lenses) result.lenses = lenses.estimate(executor);
  if (options.rig) result.rig = rig.estimate(executor);
  return result;
}

}  // namespace pmsp
