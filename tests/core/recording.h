// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/helpers.h"
#include "pmsp/densifier.h"

namespace pmsp::test {

/// All results that a Densifier delivered.
struct Recording {
  std::vector<DepthMap> raw;
  std::vector<DepthMap> filtered;
  std::vector<KeyframeCloud> clouds;
  std::vector<std::pair<char, std::int64_t>> order;  ///< 'r', 'f' or 'c' and the keyframe's id

  DensifierCallbacks callbacks();  ///< they point to this object
  std::size_t points() const;
};

bool same(const KeyframeCloud& a, const KeyframeCloud& b);
bool same(const Recording& a, const Recording& b);

/// Results grouped by kind: the order between kinds differs with several devices.
Recording by_kind(Recording recording);

/// First difference; empty if equal.
std::string difference(const Recording& a, const Recording& b);

constexpr int kFlightWidth = width_of_any(128);
constexpr int kFlightHeight = kFlightWidth / 2;
constexpr int kTinyWidth = kSanitized ? 32 : 64;

/// The online preset at a small size, fewer iterations.
DensifierOptions fast_options(int width = kFlightWidth, int threads = 2);

/// Adds all frames and flushes.
void fly_through(Densifier& densifier, const synth::Mission& mission);
Recording densify(const synth::Mission& mission, const DensifierOptions& options);

/// An empty room with seven keyframes, and its results with `fast_options()`.
const synth::Mission& test_flight();
const Recording& test_result();

/// Number of callbacks of `test_flight` on another thread than the one that calls add and flush.
int callbacks_elsewhere(const DensifierOptions& options);

/// Cancels `test_flight` from another thread in the callback of raw depth map `at`; checks that no result follows, and
/// that those before are as in `whole`.
void check_cancel(const DensifierOptions& options, std::size_t at, const Recording& whole);

/// Share of the points within `relative` of the scene's surfaces, seen from their keyframes.
double points_on_surface(const synth::Scene& scene, const std::vector<KeyframeCloud>& clouds, double relative);

/// Median distance of the points, more than 1000, from the surfaces, relative to that from their keyframes.
double median_surface_error(const synth::Scene& scene, const std::vector<KeyframeCloud>& clouds);

}  // namespace pmsp::test
