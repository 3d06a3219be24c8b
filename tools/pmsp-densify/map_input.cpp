// SPDX-License-Identifier: BSD-2-Clause
#include "map_input.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <system_error>

#include "decoder.h"
#include "exit_code.h"
#include "image_input.h"
#include "pmsp/error.h"
#include "pmsp/executor.h"
#include "pmsp/io/landmark_sweep.h"
#include "pmsp/io/mask.h"
#include "pmsp/io/pairing.h"
#include "pmsp/lens_distance.h"

namespace pmsp::tool {

namespace {

SlamMap read_unproven(const Arguments& arguments) {
  return pmsp::read_map(arguments.map,
                        {arguments.component, arguments.points, arguments.image_list, arguments.camera_from_body});
}

std::string percent(double share) { return std::to_string(std::lround(100.0 * share)) + " %"; }

void refuse(const SlamMap& map, const std::string& why) { throw InvalidInput(map.path.string() + ": " + why); }

/// All images go to the sweep; `also`: sees them, too.
void show_images(const SlamMap& map, const Arguments& arguments, int threads, ImageSource& source, LandmarkSweep& sweep,
                 const std::function<void(const Keyframe&)>& also = {}) {
  ImageReader images(source, map, threads > 0 ? threads : usable_cpus(), nullptr);
  MaskSource masks(mask_options(arguments, map, source));
  images.each([&](const Keyframe& keyframe) {
    sweep.add(keyframe.id, keyframe.image,
              masks.mask_for(source.origin(keyframe.id).file, keyframe.image.width, keyframe.image.height));
    if (also) also(keyframe);
  });
}

PosesByImages sweep_landmarks(SlamMap& map, const Arguments& arguments, int threads) {
  const std::unique_ptr<ImageSource> source = open_images(arguments, map);
  LandmarkSweep sweep(map);
  show_images(map, arguments, threads, *source, sweep);
  const LandmarkSweep::Result result = sweep.make_landmarks(map, threads, !arguments.no_verify);
  if (!result.fits) refuse(map, result.message);
  return {"landmarks: " + std::to_string(result.landmarks) + " made from the images, the map has none (" +
              percent(result.share) + " of " + std::to_string(result.patches) + " patches are found at one depth)",
          result.message};
}

constexpr double kSameDepth = 1.25;          ///< ratio of two depths
constexpr float kSameDirection = 0.01F;      ///< of the width of the image
constexpr std::size_t kFewestCompared = 50;  ///< points
constexpr double kLeastAgreement = 0.4;

/// Points of a map beside landmarks that were made from the images.
struct PointsAtDepth {
  std::size_t compared = 0;
  double agree = 0.0;  ///< share of them at the landmark's depth
};

PointsAtDepth compare_depths(const SlamMap& map, const LandmarkSweep& sweep, int threads) {
  SlamMap swept = map;
  sweep.make_landmarks(swept, threads, false);
  PointsAtDepth points;
  std::size_t agree = 0;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
    const Eigen::Vector3d center = map.keyframes[k].cam_from_world.center();
    const float near_px =
        kSameDirection * static_cast<float>(map.cameras[static_cast<std::size_t>(map.keyframes[k].camera)].width);
    const auto distance = [&](const SlamMap& of, const MapObservation& observation) {
      return (of.find_landmark(observation.landmark_id)->position_world - center).norm();
    };
    for (const MapObservation& landmark : swept.keyframes[k].observations) {
      for (const MapObservation& point : map.keyframes[k].observations) {
        if ((point.pixel - landmark.pixel).cwiseAbs().maxCoeff() > near_px) continue;
        const double ratio = distance(map, point) / distance(swept, landmark);
        ++points.compared;
        agree += static_cast<std::size_t>(ratio < kSameDepth && ratio * kSameDepth > 1.0);
      }
    }
  }
  if (points.compared > 0) points.agree = static_cast<double>(agree) / static_cast<double>(points.compared);
  return points;
}

/// By some images, since what a map's points project to says nothing of its poses.
PosesByImages check_points(const SlamMap& map, const Arguments& arguments, int threads) {
  const std::unique_ptr<ImageSource> source = open_images(arguments, map);
  const std::vector<std::int64_t> all = source->keyframe_ids();
  std::vector<std::int64_t> some = keyframes_for_lens_distance(all);
  if (!arguments.video.empty()) some.assign(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(some.size()));
  source->restrict_to({some.begin(), some.end()});
  LandmarkSweep sweep(map);
  PairingVerifier verifier(map);
  show_images(map, arguments, threads, *source, sweep,
              [&](const Keyframe& keyframe) { verifier.add(keyframe.id, keyframe.image); });
  const LandmarkSweep::Result poses = sweep.check_poses(threads);
  if (!poses.fits) refuse(map, poses.message);
  const PairingVerifier::Verdict pairing = verifier.verdict();
  if (poses.conclusive && !poses.doubtful && !(pairing.conclusive && pairing.belongs && !pairing.doubtful)) {
    const PointsAtDepth points = compare_depths(map, sweep, threads);
    if (points.compared >= kFewestCompared && points.agree < kLeastAgreement) {
      refuse(map, "its points do not fit its poses and images: " + percent(points.agree) + " of " +
                      std::to_string(points.compared) +
                      " lie where the images show a surface, while poses and images fit each other (" +
                      percent(poses.share) +
                      " of the patches are found at one depth); the points may be of another frame or scale: give "
                      "those of the frame of the poses, or none, so that landmarks are made from the images");
    }
  }
  return {"", poses.message};
}

/// What shards have made was proven by them.
bool wants_proof(const Arguments& arguments) { return !arguments.no_verify && arguments.verb != Verb::kMerge; }

bool has_images(const Arguments& arguments) { return !arguments.images.empty() || !arguments.video.empty(); }

}  // namespace

SlamMap read_map(const Arguments& arguments, ConventionCheck* proof) {
  SlamMap map = read_unproven(arguments);
  if (!wants_proof(arguments)) return map;
  const ConventionCheck check = require_convention(map);
  if (!check.remark.empty()) map.notes.push_back(check.remark);
  if (proof != nullptr) *proof = check;
  return map;
}

Arguments with_images(const Arguments& arguments, const SlamMap& map) {
  Arguments result = arguments;
  std::error_code ignored;
  if (!has_images(arguments) && std::filesystem::is_directory(map.images, ignored)) result.images = map.images;
  return result;
}

Arguments with_needed_images(const Arguments& arguments) {
  if (has_images(arguments)) return arguments;
  Arguments result = arguments;
  result.images = read_unproven(arguments).images;
  if (result.images.empty()) throw UsageError("the images are missing; give --images DIR or --video FILE");
  return result;
}

bool needs_check_by_images(const SlamMap& map, const Arguments& arguments) {
  return map.landmarks.empty() || (!map.observations_are_tested && wants_proof(arguments));
}

PosesByImages check_by_images(SlamMap& map, const Arguments& arguments, int threads) {
  if (!needs_check_by_images(map, arguments)) return {};
  return map.landmarks.empty() ? sweep_landmarks(map, arguments, threads) : check_points(map, arguments, threads);
}

std::string undecided(const ConventionCheck& proof, const SlamMap& map, const Arguments& arguments) {
  if (!wants_proof(arguments) || !map.observations_are_tested || map.landmarks.empty() || proof.observations > 0)
    return "";
  return "cannot tell whether the map was read by the right conventions: too few landmarks are observed (100 times at "
         "least needed)";
}

std::vector<std::string> remarks(const SlamMap& map) {
  std::vector<std::string> all = map.notes;
  if (map.component_keyframes.size() > 1) {
    std::string text = "component " + std::to_string(map.component) + " of " +
                       std::to_string(map.component_keyframes.size()) + "; keyframes of each:";
    for (const std::size_t count : map.component_keyframes) text += " " + std::to_string(count);
    all.insert(all.begin(), text + "; --component chooses");
  }
  if (!map.observations_are_tested && !map.landmarks.empty()) {
    all.push_back("nothing says which keyframe sees which point; each is given those that nothing nearer hides");
  }
  const bool has_times =
      std::any_of(map.keyframes.begin(), map.keyframes.end(), [](const MapKeyframe& k) { return k.timestamp != 0.0; });
  if (!has_times && map.keyframes.size() > 1) {
    all.push_back("keyframes have no times; they are taken in the order of their ids, or --unordered as a set");
  }
  return all;
}

}  // namespace pmsp::tool
