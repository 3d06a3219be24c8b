// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "pmsp/api.h"
#include "pmsp/io/map.h"
#include "pmsp/types.h"

namespace pmsp {

/// Tests while images are read whether they belong to their keyframes. A landmark is found if its last patch correlates
/// better at its position than a few pixels beside. Patches are fixed in the world, independent of rotation and
/// distance. The share found is compared with chance in the same images (each landmark compared with the patch of
/// another one) and with alternative pairings: previous and next keyframe, reverse order, mirrored, flipped, upside
/// down, turned by half a turn.
///
/// Images are rejected if they match hardly better than chance, or clearly less than an alternative. Differences must
/// exceed four standard deviations, estimated between images: correct images are rejected in less than one mission in a
/// thousand, although the verdict is computed after each image. Requirements are lower for noisy images.
///
/// Memory: 4 MB for the patches of the last sixteen keyframes.
class PMSP_API PairingVerifier {
 public:
  /// `map` must outlive the verifier.
  explicit PairingVerifier(const SlamMap& map);
  ~PairingVerifier();

  /// Adds the next image, of any size. Throws InvalidInput if the map lacks the keyframe or the image is empty.
  void add(std::int64_t keyframe_id, ImageView<const Rgb> image);

  /// Result so far.
  struct Verdict {
    int comparisons = 0;      ///< number of landmarks compared
    double agreement = 0.0;   ///< share found, 0 to 1
    double by_chance = 0.0;   ///< share found by chance in the same images
    double fit = 0.0;         ///< agreement beyond chance: 0 = chance, 1 = all
    double likeness = 0.0;    ///< mean correlation with the last patches; comparable between pairings of one map
    bool conclusive = false;  ///< enough comparisons for a verdict
    bool belongs = true;      ///< false: the images belong to other keyframes
    bool doubtful = false;    ///< images may belong, but fit worse than correct ones usually do
    std::string message;      ///< message
  };
  Verdict verdict() const;  ///< of the images so far

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
