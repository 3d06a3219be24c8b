// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/io/densify.h"

#include <optional>
#include <string>

#include "pmsp/error.h"
#include "pmsp/io/convention.h"
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

}  // namespace

DensifierStats densify(const SlamMap& map, ImageSource& images, const DensifierOptions& options,
                       const DensifierCallbacks& callbacks, const DensifyExtras& extras) {
  if (map.landmarks.empty()) {
    throw InvalidInput(map.path.string() +
                       ": has no landmarks, which depth ranges follow from; LandmarkSweep makes some from the images");
  }
  if (extras.verify) require_convention(map);
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
    if (extras.masks != nullptr) {
      keyframe.mask =
          extras.masks->mask_for(images.origin(keyframe.id).file, item->image.width(), item->image.height());
    }
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
