// SPDX-License-Identifier: BSD-2-Clause
#include "live/live_preview.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <utility>

#include "make_engine.h"
#include "patchmatch/neighbours.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

constexpr int kLargestPreview = 640;
constexpr int kNeighbours = 2;
/// Number of newest keyframes that are prepared.
constexpr std::size_t kKept = 4;
/// Maximum age of an arrival; older ones get no preview.
constexpr std::chrono::milliseconds kLate{3000};

DensifierOptions preview_options(const DensifierOptions& final) {
  DensifierOptions options = final;
  const double shape = final.width > 0 && final.height > 0 ? static_cast<double>(final.height) / final.width : 0.5;
  options.width = final.width > 0 ? std::min(final.width / 2, kLargestPreview) : kLargestPreview;
  options.width = std::max(32, options.width / 2 * 2);
  options.height = std::max(16, static_cast<int>(options.width * shape) / 2 * 2);
  options.unordered = false;
  options.advanced.pipelined = false;
  options.scratch_folder.clear();
  options.advanced.expected_keyframes = 0;
  options.advanced.patchmatch.neighbours = kNeighbours;
  options.advanced.patchmatch.iterations = 1;
  options.advanced.patchmatch.geometric_passes = 0;
  options.advanced.patchmatch.plane_priors = false;
  options.advanced.consistency.max_relative_depth = std::max(0.03, final.advanced.consistency.max_relative_depth);
  options.advanced.fusion.window = 1;
  options.advanced.fusion.spacing_px = 0.0;
  options.advanced.free_space.enabled = false;
  return options;
}

}  // namespace

LivePreview::LivePreview(const LiveOptions& options, const std::atomic<bool>& cancel,
                         std::function<void(const KeyframeCloud&)> publish)
    : options_(preview_options(options.densifier)), mask_(options.mask), publish_(std::move(publish)), cancel_(cancel) {
  results_.cloud = publish_;
  engine_ = make_engine({options_, results_, stats_, cancel_, reload_image_}, options_, backend_);
}

void LivePreview::add(std::int64_t id) { arrived_.push_back({id, Clock::now()}); }

void LivePreview::erase(std::int64_t id) {
  arrived_.erase(std::remove_if(arrived_.begin(), arrived_.end(), [&](const Arrival& one) { return one.id == id; }),
                 arrived_.end());
}

bool LivePreview::work(Nodes& nodes, const std::function<void(const std::string&)>& on_error) {
  while (!arrived_.empty()) {
    const Arrival newest = arrived_.back();
    arrived_.pop_back();
    const auto tolerable = Clock::now() - kLate;
    const auto late = std::partition(arrived_.begin(), arrived_.end(),
                                     [&](const Arrival& arrival) { return arrival.at >= tolerable; });
    late_ += std::distance(late, arrived_.end());
    arrived_.erase(late, arrived_.end());
    std::sort(arrived_.begin(), arrived_.end(), [](const Arrival& a, const Arrival& b) { return a.at < b.at; });
    try {
      if (make(nodes, newest.id)) return true;
    } catch (const InvalidInput& error) {
      on_error(error.what());
    }
  }
  return false;
}

bool LivePreview::prepare(LiveNode& node) {
  if (!node.preview && node.image.data != nullptr) {
    Image<Rgb> converted;
    node.preview = engine_->prepare(node.keyframe(mask_.get(), converted));
  }
  if (!node.preview) return false;
  node.preview->pose = node.pose;
  return true;
}

/// Computes the preview of the keyframe before `newest`, which lies between its source views. Returns false if `newest`
/// is erased or its image released.
bool LivePreview::make(Nodes& nodes, std::int64_t newest) {
  const auto last = nodes.find(newest);
  if (last == nodes.end() || !prepare(last->second)) return false;
  std::vector<LiveNode*> around{&last->second};  // newest first
  for (auto at = last; at != nodes.begin() && around.size() < kKept;) {
    --at;
    if (at->second.map_id != last->second.map_id) continue;
    const bool known = at->second.preview || around.size() == 1;
    if (known && prepare(at->second)) around.push_back(&at->second);
  }
  for (auto& [id, node] : nodes) {
    if (std::find(around.begin(), around.end(), &node) == around.end()) node.preview.reset();
  }
  if (around.size() < 2) return true;
  std::reverse(around.begin(), around.end());
  const std::size_t own = around.size() - 2;
  const LiveNode& node = *around[own];
  if (node.published_passes > 0 || node.preview->matched) return true;

  std::vector<Keyframe> keyframes;
  std::vector<const Keyframe*> sequence;
  for (const LiveNode* each : around) keyframes.push_back(each->keyframe());
  for (const Keyframe& keyframe : keyframes) sequence.push_back(&keyframe);
  Engine::MatchTask task;
  task.reference = node.preview.get();
  task.keyframe = sequence[own];
  for (const std::size_t k : choose_neighbours(sequence, own, kNeighbours)) {
    task.neighbours.push_back(around[k]->preview.get());
  }
  task.num_with_planes = task.neighbours.size();
  task.range = depth_range(keyframes[own], options_.advanced.init);
  if (task.neighbours.empty() || !(task.range.max > task.range.min)) return true;
  std::vector<const Engine::Frame*> others;
  for (std::size_t i = 0; i < own; ++i) {
    const Engine::Frame* const frame = around[i]->preview.get();
    if (frame->matched) others.push_back(frame);
  }
  if (!others.empty()) task.previous = others.back();
  engine_->match(task);
  if (!task.reference->matched || others.empty()) return true;  // cancelled, or no map to compare with
  engine_->filter(*task.reference, others);
  engine_->fuse(*task.reference, {task.reference}, 0);
  if (cancel_.load(std::memory_order_relaxed)) return true;
  engine_->emit(*task.reference);
  engine_->deliver(true);
  return true;
}

}  // namespace pmsp
