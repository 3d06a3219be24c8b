// SPDX-License-Identifier: BSD-2-Clause
#include "fusion/surfel_shelf.h"

#include <utility>

namespace pmsp {
namespace {

// Where a part begins in a keyframe's piece of the file, in bytes a pixel.
constexpr int kSurfels = 0;
constexpr int kDetails = 4;
constexpr int kStandings = 8;  ///< after even rounds, then after odd ones
constexpr int kSight = 10;     ///< nearest and farthest, a quarter of the pixels
constexpr int kAsked = 12;
constexpr int kAgree = 16;
constexpr int kEnd = 20;

}  // namespace

void SurfelShelf::take_room(int width, int height) {
  if (has_room_) return;
  width_ = width;
  height_ = height;
  begin_ = scratch_->take(static_cast<std::size_t>(kEnd) * static_cast<std::size_t>(width * height));
  has_room_ = true;
}

void SurfelShelf::give_back_room() {
  if (has_room_) scratch_->give_back(begin_);
  has_room_ = false;
}

void SurfelShelf::release_sight() {
  sight_ = {};
  sight_wanted_ = false;
  if (!points_wanted_) give_back_room();
}

void SurfelShelf::release_points() {
  map_ = {};
  for (Image<std::uint8_t>& standings : standings_) standings = {};
  asked_ = {};
  points_wanted_ = false;
  if (!sight_wanted_) give_back_room();
}

void SurfelShelf::put(SightMap sight) {
  sight_ = std::move(sight);
  sight_wanted_ = true;
  if (scratch_ == nullptr) return;
  take_room(2 * sight_.nearest.width(), 2 * sight_.nearest.height());
  scratch_->write(place(kSight), sight_.nearest.pixels());
  scratch_->write(place(kSight + 1), sight_.farthest.pixels());
  sight_.nearest = {};
  sight_.farthest = {};
}

const SightMap& SurfelShelf::sight(SightMap& copy) const {
  if (scratch_ == nullptr) return sight_;
  copy = sight_;
  copy.nearest = copy.farthest = Image<float>(width_ / 2, height_ / 2);
  scratch_->read(place(kSight), copy.nearest.pixels());
  scratch_->read(place(kSight + 1), copy.farthest.pixels());
  return copy;
}

void SurfelShelf::put(SurfelMap map) {
  map_ = std::move(map);
  points_wanted_ = true;
  put(std::move(map_.standings), 0);
  map_.standings = {};
  if (scratch_ == nullptr) return;
  scratch_->write(place(kSurfels), map_.surfels.pixels());
  scratch_->write(place(kDetails), map_.details.pixels());
  scratch_->write(place(kAgree), map_.agree);
  map_.surfels = {};
  map_.details = {};
  map_.agree = {};
}

const SurfelMap& SurfelShelf::points(bool details, SurfelMap& copy) const {
  if (scratch_ == nullptr) return map_;
  copy = map_;
  copy.surfels = Image<std::uint32_t>(width_, height_);
  scratch_->read(place(kSurfels), copy.surfels.pixels());
  if (details) {
    copy.details = Image<std::uint32_t>(width_, height_);
    scratch_->read(place(kDetails), copy.details.pixels());
    copy.agree.resize(copy.surfels.size() * static_cast<std::size_t>(copy.agree_bytes()));
    scratch_->read(place(kAgree), copy.agree);
  }
  return copy;
}

void SurfelShelf::put(Image<std::uint8_t> standings, int round) {
  if (scratch_ == nullptr) {
    standings_[round % 2] = std::move(standings);
    return;
  }
  take_room(standings.width(), standings.height());
  scratch_->write(place(kStandings + round % 2), standings.pixels());
}

const Image<std::uint8_t>& SurfelShelf::standings(int round, Image<std::uint8_t>& copy) const {
  if (scratch_ == nullptr) return standings_[round % 2];
  copy = Image<std::uint8_t>(width_, height_);
  scratch_->read(place(kStandings + round % 2), copy.pixels());
  return copy;
}

void SurfelShelf::put_asked(std::vector<std::uint32_t> asked) {
  asked_ = std::move(asked);
  if (scratch_ == nullptr) return;
  asked_count_ = asked_.size();
  scratch_->write(place(kAsked), asked_);
  asked_ = {};
}

std::vector<std::uint32_t> SurfelShelf::take_asked() {
  if (scratch_ == nullptr) return std::move(asked_);
  std::vector<std::uint32_t> asked(asked_count_);
  scratch_->read(place(kAsked), asked);
  return asked;
}

}  // namespace pmsp
