// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/convention.h"
#include "io/image_reader.h"
#include "io/pairing.h"
#include "io/prior_depths.h"
#include "pmsp/api.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "pmsp/types.h"

namespace pmsp::io {

/// Which inputs are checked, and on how many threads.
struct MissionOptions {
  bool verify_map = true;     ///< conventions and poses
  bool verify_images = true;  ///< whether they belong to their keyframes
  int threads = 0;            ///< 0 = one for each CPU
};

/// Receives sentences for people.
struct MissionLog {
  std::function<void(const std::string&)> stage = [](const std::string&) {};
  std::function<void(const std::string&)> warning = [](const std::string&) {};
};

/// A map with its images, masks and prior depth, and their checks: what every run does before the first depth map, in
/// the order of the functions.
class PMSP_API Mission {
 public:
  explicit Mission(const MissionOptions& options, MissionLog log = {}) : options_(options), log_(std::move(log)) {}

  /// Takes a map and checks its conventions. Throws as require_convention.
  void set_map(SlamMap read);

  /// `source`: before the first image is read. Both must outlive the mission.
  void set_images(ImageSource& source, MaskSource& of_images) {
    images = &source;
    masks = &of_images;
  }

  /// Compares the poses with the images where the map proves nothing of them, and makes landmarks from all images for a
  /// map without any (LandmarkSweep); it may find none. Throws InvalidInput where poses or points do not fit the
  /// images.
  void check_poses();

  /// Result of check_images().
  struct ImageCheck {
    int width = 0, height = 0;                        ///< of the first image; 0 = none can be read
    std::optional<PairingVerifier::Verdict> pairing;  ///< none without `verify_images`
    std::vector<SkippedKeyframe> skipped;             ///< without an image, or with one that cannot be decoded
  };
  /// Decodes images in order until the pairing check is clear, or all: what a run finds out on its way. Throws
  /// InvalidInput where the images belong to other keyframes, IoError where none can be decoded.
  ImageCheck check_images() const;

  /// nullptr without `verify_images`.
  std::unique_ptr<PairingVerifier> verifier() const {
    return options_.verify_images ? std::make_unique<PairingVerifier>(map) : nullptr;
  }

  /// Adds mask and prior depth to a keyframe with its image; they stay until the next call. `source`: of the image.
  void complete(Keyframe& keyframe, const ImageSource& source);

  /// Threads that decode images.
  int threads() const;

  SlamMap map;
  ConventionCheck convention;     ///< empty without `verify_map`
  ImageSource* images = nullptr;  ///< nullptr before set_images()
  MaskSource* masks = nullptr;    ///< likewise
  PriorDepths prior_depths;
  std::vector<std::string> remarks;  ///< on the map

 private:
  void sweep_landmarks();
  void check_points();
  [[noreturn]] void refuse(const std::string& why) const;

  MissionOptions options_;
  MissionLog log_;
};

/// Warning of a verdict; "" = none. `saw_all`: no more images will come, so that an open verdict stays open.
PMSP_API std::string warning_of(const PairingVerifier::Verdict& pairing, bool saw_all);

}  // namespace pmsp::io
