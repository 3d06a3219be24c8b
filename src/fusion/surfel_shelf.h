// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "pmsp/fusion.h"
#include "pmsp/sight_map.h"
#include "util/scratch_file.h"

namespace pmsp {

/// What is kept of a keyframe from the consistency filter on until its points are handed out: in memory or, with a
/// scratch file, put aside, so that keyframes take no memory while they wait. Whoever asks for something gives room for
/// a copy, which is used only where it has been put aside.
class SurfelShelf {
 public:
  /// `scratch`: nullptr = in memory; must outlive the shelf.
  explicit SurfelShelf(ScratchFile* scratch) : scratch_(scratch) {}
  ~SurfelShelf() { give_back_room(); }
  SurfelShelf(const SurfelShelf&) = delete;
  SurfelShelf& operator=(const SurfelShelf&) = delete;

  void put(SightMap sight);
  void put(SurfelMap map);
  /// After a round of ownership; 0 = before the first. While some keyframes are through a round, others still ask for
  /// the standings of the round before: those are kept, too.
  void put(Image<std::uint8_t> standings, int round);
  void put_asked(std::vector<std::uint32_t> asked);

  const SightMap& sight(SightMap& copy) const;
  /// `details`: with colours and with who agrees; else surfels are all that is sure to be there.
  const SurfelMap& points(bool details, SurfelMap& copy) const;
  const Image<std::uint8_t>& standings(int round, Image<std::uint8_t>& copy) const;
  /// Takes them from the shelf.
  std::vector<std::uint32_t> take_asked();

  void release_sight();
  void release_points();

 private:
  std::uint64_t place(int bytes_per_pixel) const {
    return begin_ + static_cast<std::uint64_t>(bytes_per_pixel) * static_cast<std::uint64_t>(width_ * height_);
  }
  void take_room(int width, int height);
  void give_back_room();

  ScratchFile* scratch_;
  bool has_room_ = false;
  bool sight_wanted_ = false;  ///< it is there, as the points are
  bool points_wanted_ = false;
  std::uint64_t begin_ = 0;
  int width_ = 0;
  int height_ = 0;
  std::size_t asked_count_ = 0;
  SightMap sight_;  ///< this and the others without arrays where these have been put aside
  SurfelMap map_;
  Image<std::uint8_t> standings_[2];  ///< after the last even and the last odd round
  std::vector<std::uint32_t> asked_;
};

}  // namespace pmsp
