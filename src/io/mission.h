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
  bool verify_images = true;  ///< whether images belong to their keyframes
  int threads = 0;            ///< 0 = one per CPU
};

/// Receives progress and warnings.
struct MissionLog {
  std::function<void(const std::string&)> stage = [](const std::string&) {};
  std::function<void(const std::string&)> warning = [](const std::string&) {};
};

/// Loads and checks a map with images, masks and prior depth. Members are called in the order of declaration.
class PMSP_API Mission {
 public:
  explicit Mission(const MissionOptions& options, MissionLog log = {}) : options_(options), log_(std::move(log)) {}

  /// Sets the map and checks its conventions. Throws as require_convention.
  void set_map(SlamMap read);

  /// To be called before the first image is read. Both must outlive the mission.
  void set_images(ImageSource& source, MaskSource& of_images) {
    images = &source;
    masks = &of_images;
  }

  /// Compares the poses with the images unless the map's observations prove them, and makes landmarks from all images
  /// for a map without any (LandmarkSweep), possibly none. Throws InvalidInput if poses or points do not fit the
  /// images.
  void check_poses();

  /// Result of check_images().
  struct ImageCheck {
    int width = 0, height = 0;                        ///< of the first image; 0 = none is readable
    std::optional<PairingVerifier::Verdict> pairing;  ///< none without `verify_images`
    std::vector<SkippedKeyframe> skipped;             ///< without image, or undecodable
  };
  /// Decodes images until the pairing check is conclusive, at least 8, or all. Throws
  /// InvalidInput if the images belong to other keyframes, IoError if none can be decoded.
  ImageCheck check_images() const;

  /// nullptr without `verify_images`.
  std::unique_ptr<PairingVerifier> verifier() const {
    return options_.verify_images ? std::make_unique<PairingVerifier>(map) : nullptr;
  }

  /// Adds mask and prior depth to a keyframe with image; valid until the next call. `source`: of the image.
  void complete(Keyframe& keyframe, const ImageSource& source);

  /// Number of threads for decoding.
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

/// Adds the masks that the map names to the options of its images' masks.
PMSP_API void name_masks(const SlamMap& map, const ImageSource& source, MaskOptions& options);

/// Returns the warning of a verdict; "" = none. `saw_all`: no more images follow, so an open verdict is final.
PMSP_API std::string warning_of(const PairingVerifier::Verdict& pairing, bool saw_all);

}  // namespace pmsp::io
