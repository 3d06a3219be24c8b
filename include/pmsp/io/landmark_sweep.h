// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "pmsp/api.h"
#include "pmsp/image.h"
#include "pmsp/io/map.h"

namespace pmsp {

/// Makes landmarks for a map that has none, from the images: patches of each keyframe are looked for in the keyframes
/// nearest to it, at depths from 0.4 to 60 times the distance to the farthest of these, and give a landmark where one
/// depth fits clearly better than all others. A coarse sweep at 512 pixels across, for the plan and the initialiser; it
/// is a function of poses, images and masks alone, whatever the order in which they come. Takes 128 KiB a keyframe
/// (twice that with masks) and about 0.2 s of a CPU.
class PMSP_API LandmarkSweep {
 public:
  /// `map` must outlive the sweep.
  explicit LandmarkSweep(const SlamMap& map);
  ~LandmarkSweep();

  /// Takes the image of a keyframe, of any size, and its mask: 0 = ignore, same size, empty = use all. Throws
  /// InvalidInput when the map has no such keyframe or the image is empty.
  void add(std::int64_t keyframe_id, ImageView<const Rgb> image, ImageView<const std::uint8_t> mask = {});

  /// How many landmarks were found, and whether the poses are what they should be.
  struct Result {
    std::size_t patches = 0;    ///< that were looked for
    std::size_t landmarks = 0;  ///< of those that were found
    double share = 0.0;         ///< landmarks / patches
    std::string fits_better;    ///< another convention of the poses that finds clearly more, in words; "" = none does
    double better_share = 0.0;  ///< what that finds, of the patches of some keyframes
  };

  /// Puts landmarks and observations into `map`, the one of the constructor or a copy. `threads`: 0 = one for each CPU.
  /// With `try_conventions`, poses are tried as other conventions have them as well (see ConventionCheck); where one
  /// finds clearly more, the map is left as it is.
  Result make_landmarks(SlamMap& map, int threads = 0, bool try_conventions = true) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
