// SPDX-License-Identifier: BSD-2-Clause
#include "export/thinning.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <vector>

#include "export/spool.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

/// Finaliser of splitmix64 (Steele, Lea, Flood 2014): every input bit affects every output bit.
std::uint64_t mixed(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15U;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31);
}

/// Position in a pseudo-random order of all points, determined by their keys.
using PointRank = std::tuple<std::uint64_t, std::int64_t, std::uint32_t>;

std::uint64_t hash_of(const OutputPoint& point) {
  return mixed(mixed(static_cast<std::uint64_t>(point.keyframe_id)) + point.pixel);
}

PointRank rank_of(const OutputPoint& point) { return {hash_of(point), point.keyframe_id, point.pixel}; }

}  // namespace

/// Most confident point of each cube. Cubes are distributed to lists by hash, few of them in memory at a time.
class Thinning::Voxels {
 public:
  Voxels(double side, const std::string& folder) : side_(side), spool_(folder, kLists) {}

  void add(const OutputPoint& point) { spool_.add(hash_of(cell_of(point)) >> 56, point); }

  void finish(const Take& take) {
    for (std::size_t list = 0; list < kLists; ++list) {
      const auto rounds = static_cast<std::uint64_t>(spool_.size(list) / kAtOnce + 1);
      for (std::uint64_t round = 0; round < rounds; ++round) {
        best_of(list, rounds, round);
        if (!best_.empty()) take(best_.data(), best_.size());
      }
      spool_.drop(list);
    }
  }

 private:
  using Cell = std::array<std::int64_t, 3>;

  Cell cell_of(const OutputPoint& point) const {
    Cell cell;
    for (int i = 0; i < 3; ++i) {
      const double steps = std::floor(point.position[i] / side_);
      if (!(std::abs(steps) < 9e15)) {
        throw InvalidInput("--voxel is too small for a cloud this large: cubes of " + std::to_string(side_) +
                           " cannot be counted; give a larger one");
      }
      cell[static_cast<std::size_t>(i)] = static_cast<std::int64_t>(steps);
    }
    return cell;
  }

  static std::uint64_t hash_of(const Cell& cell) {
    std::uint64_t hash = 0;
    for (const std::int64_t at : cell) hash = mixed(hash ^ static_cast<std::uint64_t>(at));
    return hash;
  }

  static bool is_better(const OutputPoint& a, const OutputPoint& b) {
    if (a.confidence != b.confidence) return a.confidence > b.confidence;
    return rank_of(a) < rank_of(b);
  }

  /// Fills `best_` for the cubes of a list whose hash belongs to this round.
  void best_of(std::size_t list, std::uint64_t rounds, std::uint64_t round) {
    best_.clear();
    std::size_t slots = 1024;
    while (static_cast<std::int64_t>(slots) < 2 * std::min(spool_.size(list), kAtOnce)) slots *= 2;
    slots_.assign(slots, 0);
    spool_.read(list, [&](const OutputPoint* points, std::size_t count) {
      for (const OutputPoint* point = points; point != points + count; ++point) {
        const Cell cell = cell_of(*point);
        const std::uint64_t hash = hash_of(cell);
        if ((hash >> 32 & 0xffffffU) % rounds != round) continue;
        if (2 * best_.size() >= slots_.size()) grow();
        std::uint32_t& slot = find(cell, hash);
        if (slot == 0) {
          best_.push_back(*point);
          slot = static_cast<std::uint32_t>(best_.size());
        } else if (is_better(*point, best_[slot - 1])) {
          best_[slot - 1] = *point;
        }
      }
    });
  }

  /// Slot of a cube: 1 + index into `best_`; 0 = new.
  std::uint32_t& find(const Cell& cell, std::uint64_t hash) {
    std::size_t at = hash & (slots_.size() - 1);
    while (slots_[at] != 0 && cell_of(best_[slots_[at] - 1]) != cell) at = (at + 1) & (slots_.size() - 1);
    return slots_[at];
  }

  void grow() {
    slots_.assign(2 * slots_.size(), 0);
    for (std::size_t i = 0; i < best_.size(); ++i) {
      const Cell cell = cell_of(best_[i]);
      find(cell, hash_of(cell)) = static_cast<std::uint32_t>(i + 1);
    }
  }

  static constexpr std::size_t kLists = 256;
  static constexpr std::int64_t kAtOnce = 1 << 19;

  double side_;
  Spool<OutputPoint> spool_;
  std::vector<OutputPoint> best_;
  std::vector<std::uint32_t> slots_;
};

/// Points of the lowest ranks; others are dropped as soon as possible.
class Thinning::Sample {
 public:
  Sample(std::int64_t most, const std::string& folder) : most_(most), counts_(kBins, 0), spool_(folder, 1) {}

  void add(const OutputPoint& point) {
    const std::size_t bin = hash_of(point) >> kShift;
    if (bin > last_bin_) return;
    ++counts_[bin];
    spool_.add(0, point);
    if (++added_ == check_at_) lower_last_bin();
  }

  void finish(const Take& take) {
    lower_last_bin();
    std::int64_t left = most_;  // points remaining for the last bin
    for (std::size_t bin = 0; bin < last_bin_; ++bin) left -= counts_[bin];
    std::vector<PointRank> ranks;
    spool_.read(0, [&](const OutputPoint* points, std::size_t count) {
      for (std::size_t i = 0; i < count; ++i) {
        if (hash_of(points[i]) >> kShift == last_bin_) ranks.push_back(rank_of(points[i]));
      }
    });
    std::sort(ranks.begin(), ranks.end());
    if (static_cast<std::int64_t>(ranks.size()) > left) ranks.resize(static_cast<std::size_t>(left));
    std::vector<OutputPoint> kept;
    spool_.read(0, [&](const OutputPoint* points, std::size_t count) {
      kept.clear();
      for (std::size_t i = 0; i < count; ++i) {
        const std::size_t bin = hash_of(points[i]) >> kShift;
        if (bin < last_bin_ || (bin == last_bin_ && !ranks.empty() && rank_of(points[i]) <= ranks.back())) {
          kept.push_back(points[i]);
        }
      }
      if (!kept.empty()) take(kept.data(), kept.size());
    });
    spool_.drop(0);
  }

 private:
  /// Lowers the last bin to the limit.
  void lower_last_bin() {
    std::int64_t sum = 0;
    for (std::size_t bin = 0; bin <= last_bin_; ++bin) {
      sum += counts_[bin];
      if (sum >= most_) last_bin_ = bin;
    }
    check_at_ = added_ + std::max<std::int64_t>(most_ / 4, 1 << 16);
  }

  static constexpr std::size_t kBins = 1 << 16;
  static constexpr int kShift = 48;

  std::int64_t most_;
  std::vector<std::int64_t> counts_;
  std::size_t last_bin_ = kBins - 1;
  std::int64_t added_ = 0;
  std::int64_t check_at_ = 1 << 16;
  Spool<OutputPoint> spool_;
};

Thinning::Thinning(const ThinningOptions& options, const std::string& scratch_folder) {
  if (options.voxel > 0.0) voxels_ = std::make_unique<Voxels>(options.voxel, scratch_folder);
  if (options.max_points > 0) sample_ = std::make_unique<Sample>(options.max_points, scratch_folder);
}

Thinning::~Thinning() = default;

void Thinning::add(const OutputPoint* points, std::size_t count) {
  for (const OutputPoint* point = points; point != points + count; ++point) {
    if (voxels_) {
      voxels_->add(*point);
    } else {
      sample_->add(*point);
    }
  }
}

void Thinning::finish(const Take& take) {
  if (voxels_) {
    voxels_->finish(!sample_ ? take : [this](const OutputPoint* points, std::size_t count) {
      for (const OutputPoint* point = points; point != points + count; ++point) sample_->add(*point);
    });
  }
  voxels_.reset();
  if (sample_) sample_->finish(take);
  sample_.reset();
}

}  // namespace pmsp
