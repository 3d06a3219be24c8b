// SPDX-License-Identifier: BSD-2-Clause
#include "lenses.h"

#include <memory>
#include <set>
#include <sstream>

#include <nlohmann/json.hpp>

#include "decoder.h"
#include "image_input.h"
#include "pmsp/error.h"
#include "pmsp/executor.h"
#include "pmsp/io/map.h"

namespace pmsp::tool {
namespace {

LensDistance estimate(const Arguments& arguments, const DensifierOptions& options, const SlamMap& map,
                      const ImageSource& all_images) {
  const std::unique_ptr<ImageSource> source = all_images.again();
  std::vector<std::int64_t> ids = keyframes_for_lens_distance(source->keyframe_ids());
  if (!arguments.video.empty()) {  // the beginning, since all before the last one is decoded
    const std::vector<std::int64_t>& all = source->keyframe_ids();
    ids.assign(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(ids.size()));
  }
  source->restrict_to({ids.begin(), ids.end()});
  const Executor executor(options.threads, options.simd);
  ImageReader images(*source, map, executor.threads(), nullptr);
  MaskSource masks(mask_options(arguments, map, *source));
  LensDistanceEstimator estimator;
  images.each([&](Keyframe& keyframe) {
    keyframe.mask = masks.mask_for(source->origin(keyframe.id).file, keyframe.image.width, keyframe.image.height);
    estimator.add(keyframe, &executor);
  });
  return estimator.estimate(executor);
}

}  // namespace

Lenses find_lenses(const Arguments& arguments, const DensifierOptions& options, const SlamMap& map,
                   const ImageSource& images, bool growing, const workspace::Record& recorded) {
  Lenses lenses;
  lenses.distance = options.lens_distance;
  if (lenses.distance != 0.0 || !arguments.calibrate_lenses || quality_of(arguments) == Quality::kPaper) return lenses;
  lenses.distance = nlohmann::json::parse(recorded.options).value("lens_distance", 0.0);
  const std::size_t now = images.keyframe_ids().size();
  const std::size_t then = recorded.lenses_looked_at;
  const bool again = growing ? now >= 2 * then : now != then;
  if (lenses.distance != 0.0 || !again) return lenses;
  try {
    lenses.estimated = estimate(arguments, options, map, images);
  } catch (const Error&) {
    return lenses;  // the run will meet that image or mask, and say what is wrong
  }
  lenses.images = now;
  if (lenses.estimated->significant) lenses.distance = lenses.estimated->distance;
  return lenses;
}

std::string describe(const Lenses& lenses) {
  if (!lenses.estimated) return "";
  const LensDistance& it = *lenses.estimated;
  if (it.standard_error == 0.0) {
    return "lenses: taken for one; too few landmarks that both would have seen (" + std::to_string(it.landmarks) + ")";
  }
  std::ostringstream text;
  text.precision(3);
  text << "lenses: " << it.distance << " map units apart (standard error " << it.standard_error << ", " << it.landmarks
       << " landmarks), " << (it.significant ? "corrected" : "taken for one");
  return text.str();
}

}  // namespace pmsp::tool
