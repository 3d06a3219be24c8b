// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "engine.h"
#include "live/live_node.h"
#include "planned_densifier.h"

namespace pmsp {

/// Preliminary points: one pass of PatchMatch per keyframe at half the size, at current poses, as soon as the next
/// keyframe arrives. Final points do not depend on them. Not thread-safe.
class LivePreview {
 public:
  using Nodes = std::map<std::int64_t, LiveNode>;

  LivePreview(const LiveOptions& options, const std::atomic<bool>& cancel,
              std::function<void(const KeyframeCloud&)> publish);

  void add(std::int64_t id);
  void erase(std::int64_t id);
  void set_lens_distance(double distance) { options_.lens_distance = distance; }

  bool has_work() const { return !arrived_.empty(); }

  /// Computes the next preview, newest arrivals first. Returns whether there was one.
  bool work(Nodes& nodes, const std::function<void(const std::string&)>& on_error);

  std::int64_t late() const { return late_; }

 private:
  using Clock = std::chrono::steady_clock;
  struct Arrival {
    std::int64_t id;
    Clock::time_point at;
  };

  bool make(Nodes& nodes, std::int64_t newest);
  bool prepare(LiveNode& node);

  DensifierOptions options_;
  std::shared_ptr<const Image<std::uint8_t>> mask_;
  std::function<void(const KeyframeCloud&)> publish_;
  EngineResults results_;
  DensifierStats stats_;
  KeyframeSource reload_image_;  ///< empty: the engine retains prepared images
  std::string backend_;
  std::unique_ptr<Engine> engine_;  ///< must outlive LiveNode::preview
  std::vector<Arrival> arrived_;
  const std::atomic<bool>& cancel_;
  std::int64_t late_ = 0;
};

}  // namespace pmsp
