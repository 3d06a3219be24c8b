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

/// Creates landmarks for a map without any, by a coarse plane sweep at 512 pixels width: patches of each keyframe are
/// matched in the nearest keyframes at depths of 0.4 to 60 times the distance to the farthest of these; a patch becomes
/// a landmark if one depth clearly fits best. For plan and initial planes. Depends on poses, images and masks, not on
/// their order. Needs 200 KiB per keyframe.
class PMSP_API LandmarkSweep {
 public:
  /// `map` must outlive the sweep.
  explicit LandmarkSweep(const SlamMap& map);
  ~LandmarkSweep();

  /// Adds the image of a keyframe, of any size, and its mask: same size, 0 = ignored, empty = none. Throws InvalidInput
  /// if the map lacks the keyframe or the image is empty.
  void add(std::int64_t keyframe_id, ImageView<const Rgb> image, ImageView<const std::uint8_t> mask = {});

  /// Share of matched patches, and verdict on the poses.
  struct Result {
    std::size_t patches = 0;    ///< patches searched; 0 = no landmarks were made
    std::size_t landmarks = 0;  ///< landmarks made from matched patches
    double share = 0.0;         ///< matched patches, 0 to 1; of some keyframes if no landmarks were made
    double by_chance = 0.0;     ///< share with the poses of other keyframes; 0 if `share` is clear
    std::string fits_better;    ///< description of poses with clearly more matches; "" = none
    double better_share = 0.0;  ///< their share
    bool conclusive = true;     ///< enough images and patches for a verdict
    bool fits = true;           ///< false: other poses match clearly more, or the map's hardly more than chance
    bool doubtful = false;      ///< poses may fit, but match less than correct ones usually do
    std::string message;        ///< message; "" = poses fit
  };

  /// Compares the poses, on some patches of at most eight keyframes, with those of other keyframes (chance), with other
  /// conventions (see ConventionCheck) and with poses one keyframe late or early. `threads`: 0 = one per CPU.
  Result check_poses(int threads = 0) const;

  /// Adds landmarks and observations to `map`, the one of the constructor or a copy. `threads`: 0 = one per CPU.
  /// `with_check`: runs check_poses first, and leaves the map unchanged if the poses do not fit.
  Result make_landmarks(SlamMap& map, int threads = 0, bool with_check = true) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
