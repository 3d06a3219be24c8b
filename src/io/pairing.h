// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "pmsp/api.h"
#include "pmsp/io/map.h"
#include "pmsp/types.h"

namespace pmsp {

/// Checks, while images stream by, that they belong to their keyframes. A landmark is found where an image looks more
/// like the landmark's last sighting right where the map has it than a few pixels beside. Patches lie fixed in the
/// world, so turning and approaching do no harm. How many are found is compared with what chance finds in the same
/// images (each landmark sought with the looks of another), and with other pairings of them: of the keyframe before and
/// after, in reverse order, mirrored, flipped, upside down, turned by half a turn.
///
/// Images are refused where they find hardly more than chance, or clearly less than another pairing: only where the
/// difference is more than four standard deviations, taken between images, so that right images are refused in fewer
/// than one of a thousand missions, although the verdict is asked after each image. Where noise hides what the images
/// show, less is demanded.
///
/// Costs about 3 ms per keyframe at first, 2 ms once the other pairings are known well enough (after some forty
/// keyframes), and 4 MB for the last sixteen keyframes.
class PMSP_API PairingVerifier {
 public:
  /// `map` must outlive the verifier.
  explicit PairingVerifier(const SlamMap& map);
  ~PairingVerifier();

  /// Takes the next image, of any size. Throws InvalidInput when the map has no such keyframe or the image is empty.
  void add(std::int64_t keyframe_id, ImageView<const Rgb> image);

  /// What is known so far.
  struct Verdict {
    int comparisons = 0;      ///< landmarks sought so far
    double agreement = 0.0;   ///< share of them that are found, 0 to 1
    double by_chance = 0.0;   ///< share that chance finds in the same images
    double fit = 0.0;         ///< agreement beyond chance: 0 = as by chance, 1 = all
    double likeness = 0.0;    ///< mean correlation of landmarks with their last sightings; compares pairings of a map
    bool conclusive = false;  ///< enough comparisons to judge
    bool belongs = true;      ///< false: the images evidently belong to other keyframes
    bool doubtful = false;    ///< they may belong, but fit worse than the right images do
    std::string message;      ///< one sentence for people
  };
  Verdict verdict() const;  ///< of the images so far

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
