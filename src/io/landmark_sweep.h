// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "pmsp/api.h"
#include "pmsp/io/map.h"
#include "pmsp/types.h"

namespace pmsp {

/// Makes landmarks for a map that has none, from the images: patches of each keyframe are looked for in the keyframes
/// nearest to it, at depths from 0.4 to 60 times the distance to the farthest of these, and give a landmark where one
/// depth fits clearly better than all others. A coarse sweep at 512 pixels across, for the plan and the initialiser; it
/// is a function of poses, images and masks alone, whatever the order in which they come. Takes 200 KiB a keyframe and
/// about 0.1 s of a CPU.
class PMSP_API LandmarkSweep {
 public:
  /// `map` must outlive the sweep.
  explicit LandmarkSweep(const SlamMap& map);
  ~LandmarkSweep();

  /// Takes the image of a keyframe, of any size, and its mask: 0 = ignore, same size, empty = use all. Throws
  /// InvalidInput when the map has no such keyframe or the image is empty.
  void add(std::int64_t keyframe_id, ImageView<const Rgb> image, ImageView<const std::uint8_t> mask = {});

  /// The share of patches found, and whether the poses fit the images.
  struct Result {
    std::size_t patches = 0;    ///< that were looked for; 0 = no landmarks were made
    std::size_t landmarks = 0;  ///< of those that were found
    double share = 0.0;         ///< found patches, 0 to 1; of some keyframes where no landmarks were made
    double by_chance = 0.0;     ///< the same with the poses of other keyframes; 0 where `share` leaves no doubt
    std::string fits_better;    ///< other poses that find clearly more, in words; "" = none do
    double better_share = 0.0;  ///< the share that these find
    bool conclusive = true;     ///< enough images and patches to judge the poses
    bool fits = true;           ///< false: other poses find clearly more, or the given ones hardly more than chance
    bool doubtful = false;      ///< the poses may fit, but find less than those that fit usually do
    std::string message;        ///< one sentence for people, unless the poses fit; "" = they do
  };

  /// Compares, for some patches of at most eight keyframes, the poses with those of other keyframes (chance), with
  /// other conventions (see ConventionCheck) and with those one keyframe late or early. `threads`: 0 = one for each
  /// CPU.
  Result check_poses(int threads = 0) const;

  /// Puts landmarks and observations into `map`, the one of the constructor or a copy. `threads`: 0 = one for each CPU.
  /// `with_check`: check_poses first; where the poses do not fit, the map stays as it is.
  Result make_landmarks(SlamMap& map, int threads = 0, bool with_check = true) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
