// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "image_decode.h"
#include "image_naming.h"
#include "pmsp/error.h"
#include "pmsp/io/images.h"
#include "video_pairing.h"
#include "video_reader.h"

namespace pmsp {
namespace {

constexpr double kExactTime = 1e-3;    ///< maximum deviation of an exact match [s]
constexpr double kFallbackFps = 30.0;  ///< if neither video nor map has a rate; bounds the time tolerance only

using Reading = io::VideoPairing::Reading;

class Video final : public ImageSource {
 public:
  Video(const SlamMap& map, const std::filesystem::path& path, const VideoOptions& options)
      : path_(path), reader_(path), pairing_(io::choose_video_pairing(map, path, options, reader_)) {
    reader_.set_fallback_fps(io::is_frame_rate(pairing_.rate) ? pairing_.rate : kFallbackFps);
    plan(map);
    description_ = std::to_string(ids_.size()) + " of " + std::to_string(map.keyframes.size()) +
                   " keyframes searched in " + path_.string() + ": " + pairing_.description;
    if (!options.allow_missing) require_half(map.keyframes.size());
  }

  const std::vector<std::int64_t>& keyframe_ids() const override { return ids_; }
  const std::vector<SkippedKeyframe>& skipped() const override { return skipped_; }
  const std::string& description() const override { return description_; }

  std::optional<Item> next() override {
    while (next_ < plan_.size()) {
      const Target& target = plan_[next_++];
      cv::Mat bgr;
      const std::string problem = take(target, bgr);
      if (!target.wanted) continue;
      if (!problem.empty()) {
        skipped_.push_back({target.keyframe_id, problem});
        continue;
      }
      io::check_image_size(path_.string() + ": frame " + std::to_string(taken_), bgr.cols, bgr.rows, target.camera);
      return Item{target.keyframe_id, io::rgb_from_bgr(bgr)};
    }
    return std::nullopt;
  }

  /// No effect: frames are sequential, and FFmpeg has decoding threads of its own.
  void read_ahead(int /*images*/) override {}

  Origin origin(std::int64_t keyframe_id) const override {
    const auto found = std::find_if(plan_.begin(), plan_.end(),
                                    [&](const Target& target) { return target.keyframe_id == keyframe_id; });
    if (found == plan_.end()) throw InvalidInput("keyframe " + std::to_string(keyframe_id) + " has no image");
    return {path_, by_time() ? io::format_number(found->timestamp) + " s" : std::to_string(found->index)};
  }

  void restrict_to(const std::set<std::int64_t>& keyframe_ids) override {
    ids_.clear();
    for (Target& target : plan_) {
      target.wanted = target.wanted && keyframe_ids.count(target.keyframe_id) != 0;
      if (target.wanted) ids_.push_back(target.keyframe_id);
    }
  }

  std::unique_ptr<ImageSource> reopen() const override { return std::unique_ptr<ImageSource>(new Video(*this)); }

 private:
  struct Target {
    std::int64_t keyframe_id = 0;
    MapCamera camera;
    double timestamp = 0.0;
    std::int64_t index = 0;
    bool wanted = true;
  };

  /// Copies the plan and starts at the beginning of the video.
  Video(const Video& other)
      : path_(other.path_),
        reader_(other.path_),
        pairing_(other.pairing_),
        plan_(other.plan_),
        ids_(other.ids_),
        skipped_(other.skipped_),
        description_(other.description_) {
    reader_.set_fallback_fps(other.reader_.fps());
  }

  bool by_time() const { return pairing_.reading == Reading::kPresentationTime; }

  void plan(const SlamMap& map) {
    const std::vector<int> repeated = io::earlier_with_same_timestamp(map);
    for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
      const MapKeyframe& keyframe = map.keyframes[k];
      if (pairing_.reading != Reading::kSourceFrame && repeated[k] >= 0) {
        skipped_.push_back(
            {keyframe.id, io::same_timestamp_reason(map.keyframes[static_cast<std::size_t>(repeated[k])])});
        continue;
      }
      Target target{keyframe.id, map.cameras[static_cast<std::size_t>(keyframe.camera)], pairing_.time(keyframe), 0};
      if (!by_time()) {
        target.index = pairing_.index(keyframe).value_or(-1);
        if (target.index < 0) {
          skipped_.push_back(
              {keyframe.id, "its frame index " + std::to_string(target.index) + " lies before the start of the video"});
          continue;
        }
      }
      plan_.push_back(std::move(target));
    }
    std::stable_sort(plan_.begin(), plan_.end(), [this](const Target& a, const Target& b) {
      return by_time() ? a.timestamp < b.timestamp : a.index < b.index;
    });
    for (const Target& target : plan_) ids_.push_back(target.keyframe_id);
  }

  /// Throws InvalidInput unless the video covers half of the keyframes.
  void require_half(std::size_t keyframes) const {
    const double frames = reader_.frames() > 0.0 ? reader_.frames() + 1.0 : std::numeric_limits<double>::infinity();
    const auto reached = static_cast<std::size_t>(std::count_if(plan_.begin(), plan_.end(), [&](const Target& target) {
      const double frame = by_time() ? target.timestamp * reader_.fps() : static_cast<double>(target.index);
      return frame > -1.0 && frame < frames;
    }));
    io::require_half(path_, reached, keyframes, pairing_.description,
                     "set --fps, --frame-offset or --presentation-times");
  }

  bool retrieve(cv::Mat& bgr) {
    taken_ = reader_.index();
    return reader_.retrieve(bgr);
  }

  std::string end_reason() const {
    return "the video ends before it, after " + std::to_string(reader_.index() + 1) + " frames (" +
           io::format_number(std::round(reader_.time() * 1000.0) / 1000.0) + " s)";
  }

  std::string undecodable_reason() const { return "frame " + std::to_string(taken_) + " cannot be decoded"; }

  std::string taken_reason() const {
    return "frame " + std::to_string(taken_) + " is already another keyframe's image";
  }

  /// Decodes the frame of a target; returns the reason if there is none. Independent of the restriction to keyframes.
  std::string take(const Target& target, cv::Mat& bgr) {
    try {
      return by_time() ? take_nearest(target, bgr) : take_index(target, bgr);
    } catch (const IoError&) {
      if (target.wanted) throw;
      return undecodable_reason();
    }
  }

  /// By index; returns the reason if there is no frame.
  std::string take_index(const Target& target, cv::Mat& bgr) {
    while (reader_.index() < target.index && reader_.advance()) continue;
    if (reader_.index() < target.index) return end_reason();
    if (target.index == taken_) return taken_reason();
    return retrieve(bgr) ? std::string() : undecodable_reason();
  }

  /// By presentation time.
  std::string take_nearest(const Target& target, cv::Mat& bgr) {
    const double tolerance = 0.5 / reader_.fps();
    while (reader_.time() < target.timestamp - tolerance && reader_.advance()) continue;
    if (reader_.time() < target.timestamp - tolerance) return end_reason();
    const auto distance = [&] { return std::abs(reader_.time() - target.timestamp); };
    if (distance() > tolerance)
      return "no frame within half a frame of its timestamp " + io::format_number(target.timestamp) + " s";
    if (reader_.index() == taken_ && !reader_.advance()) return taken_reason();
    if (distance() > tolerance) return taken_reason();
    bool decoded = retrieve(bgr);
    // With variable rate, frames may be closer than half the mean interval: advance while the distance decreases.
    for (double best = distance(); best > kExactTime && reader_.advance() && distance() < best; best = distance())
      decoded = retrieve(bgr);
    return decoded ? std::string() : undecodable_reason();
  }

  std::filesystem::path path_;
  io::VideoReader reader_;
  io::VideoPairing pairing_;
  std::vector<Target> plan_;
  std::size_t next_ = 0;
  std::int64_t taken_ = -1;  ///< index of the last retrieved frame
  std::vector<std::int64_t> ids_;
  std::vector<SkippedKeyframe> skipped_;
  std::string description_;
};

}  // namespace

std::unique_ptr<ImageSource> open_video(const SlamMap& map, const std::filesystem::path& video,
                                        const VideoOptions& options) {
  if (!(options.fps >= 0.0) || !std::isfinite(options.fps))
    throw InvalidOption("fps = " + io::format_number(options.fps) + ": expected a number > 0, or 0 for the map's own");
  if (options.presentation_times && options.fps > 0.0)
    throw InvalidOption("fps and presentation_times exclude each other: timestamps are counts of frames, or times");
  if (map.keyframes.empty()) throw InvalidInput(map.path.string() + ": the map has no keyframe");
  return std::make_unique<Video>(map, video, options);
}

}  // namespace pmsp
