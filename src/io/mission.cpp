// SPDX-License-Identifier: BSD-2-Clause
#include "io/mission.h"

#include <utility>

#include "io/landmark_sweep.h"
#include "machine.h"
#include "pmsp/error.h"
#include "util/percent.h"

namespace pmsp::io {
namespace {

constexpr std::size_t kFewestDecoded = 8;  ///< decoded at least, until a clear verdict ends the check

constexpr double kSameDepth = 1.25;          ///< maximum ratio of equal depths
constexpr float kSameDirection = 0.01F;      ///< maximum distance in the image [width]
constexpr std::size_t kFewestCompared = 50;  ///< minimum number of points
constexpr double kLeastAgreement = 0.4;

/// Comparison of a map's points with landmarks made from the images.
struct PointsAtDepth {
  std::size_t compared = 0;
  double agree = 0.0;  ///< share of points at the depth of the landmark
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

/// Passes all images of `source` to the sweep, and to `also`.
void show_images(Mission& mission, ImageSource& source, LandmarkSweep& sweep,
                 const std::function<void(const Keyframe&)>& also = {}) {
  ImageReader reader(source, mission.map, mission.threads(), nullptr);
  ImageLoop{reader, [&](std::size_t, const Keyframe& keyframe) {
              sweep.add(keyframe.id, keyframe.image,
                        mission.masks->mask_for(source.origin(keyframe.id).name(), keyframe.image.width,
                                                keyframe.image.height));
              if (also) also(keyframe);
            }}();
}

}  // namespace

void Mission::refuse(const std::string& why) const { throw InvalidInput(map.path.string() + ": " + why); }

int Mission::threads() const { return options_.threads > 0 ? options_.threads : usable_cpus(); }

void Mission::set_map(SlamMap read) {
  map = std::move(read);
  if (!options_.verify_map) return;
  convention = require_convention(map);
  if (!convention.remark.empty()) map.notes.push_back(convention.remark);
}

void Mission::check_poses() {
  if (options_.verify_map && map.observations_are_measured && !map.landmarks.empty() && convention.observations == 0) {
    log_.warning(
        "unknown whether the map was read by the right conventions: too few observations of landmarks, expected at "
        "least 100");
  }
  if (map.landmarks.empty()) {
    log_.stage("comparing the poses with the images");
    sweep_landmarks();
  } else if (options_.verify_map && !map.observations_are_measured) {
    log_.stage("comparing the poses with the images");
    check_points();
  }
}

void Mission::sweep_landmarks() {
  LandmarkSweep sweep(map);
  const std::unique_ptr<ImageSource> source = images->reopen();
  show_images(*this, *source, sweep);
  const LandmarkSweep::Result result = sweep.make_landmarks(map, options_.threads, options_.verify_map);
  if (!result.fits) refuse(result.message);
  remarks.push_back("landmarks: " + std::to_string(result.landmarks) + " made from the images, the map has none (" +
                    percent(result.share) + " of " + std::to_string(result.patches) +
                    " patches are found at one depth)");
  if (!result.message.empty()) log_.warning(result.message);
}

/// Checks the points against some images, since their projections are no evidence for the poses.
void Mission::check_points() {
  const std::unique_ptr<ImageSource> source = images->reopen();
  restrict_to_sample(*source);
  LandmarkSweep sweep(map);
  PairingVerifier pairing(map);
  show_images(*this, *source, sweep, [&](const Keyframe& keyframe) { pairing.add(keyframe.id, keyframe.image); });
  const LandmarkSweep::Result poses = sweep.check_poses(options_.threads);
  if (!poses.fits) refuse(poses.message);
  const PairingVerifier::Verdict verdict = pairing.verdict();
  if (poses.conclusive && !poses.doubtful && !(verdict.conclusive && verdict.belongs && !verdict.doubtful)) {
    const PointsAtDepth points = compare_depths(map, sweep, options_.threads);
    if (points.compared >= kFewestCompared && points.agree < kLeastAgreement) {
      refuse("its points do not fit its poses and images: " + percent(points.agree) + " of " +
             std::to_string(points.compared) + " lie where the images show a surface, while poses and images fit " +
             "each other (" + percent(poses.share) +
             " of the patches are found at one depth); the points may be of another frame or scale; give points in the "
             "frame of the poses, or none: landmarks are then made from the images");
    }
  }
  if (!poses.message.empty()) log_.warning(poses.message);
}

Mission::ImageCheck Mission::check_images() const {
  ImageCheck check;
  const std::unique_ptr<PairingVerifier> pairing = verifier();
  const std::unique_ptr<ImageSource> source = images->reopen();
  ImageReader reader(*source, map, threads(), pairing.get());
  check.skipped = images->skipped();
  for (std::size_t count = 1;; ++count) {
    ImageReader::Read read = reader.next();
    check.skipped.insert(check.skipped.end(), read.skipped.begin(), read.skipped.end());
    if (read.pairing) check.pairing = read.pairing;
    if (!read.item) break;
    if (check.width == 0) {
      check.width = read.keyframe.image.width;
      check.height = read.keyframe.image.height;
    }
    const bool is_clear = !check.pairing || (check.pairing->conclusive && !check.pairing->doubtful);
    reader.release_async(*std::move(read.item));
    if (is_clear && count >= kFewestDecoded) return check;
  }
  if (check.width == 0 && !reader.first_error().empty()) {
    throw IoError("no image can be read; the first one: " + reader.first_error());
  }
  return check;
}

void Mission::complete(Keyframe& keyframe, const ImageSource& source) {
  const std::filesystem::path name = source.origin(keyframe.id).name();
  keyframe.mask = masks->mask_for(name, keyframe.image.width, keyframe.image.height);
  prior_depths.attach(keyframe, name);
}

void name_masks(const SlamMap& map, const ImageSource& source, MaskOptions& options) {
  options.named_are_instances = map.masks_are_instances;
  for (const std::int64_t id : source.keyframe_ids()) {
    const MapKeyframe* keyframe = map.find_keyframe(id);
    if (keyframe != nullptr && !keyframe->mask.empty()) options.named[source.origin(id).name()] = keyframe->mask;
  }
}

std::string warning_of(const PairingVerifier::Verdict& pairing, bool saw_all) {
  return pairing.doubtful || (saw_all && !pairing.conclusive) ? pairing.message : "";
}

}  // namespace pmsp::io
