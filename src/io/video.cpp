// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <opencv2/videoio.hpp>
#include <string>
#include <vector>

#include "image_decode.h"
#include "image_naming.h"
#include "pmsp/error.h"
#include "pmsp/io/image_source.h"

namespace pmsp {
namespace {

constexpr double kWhole = 0.05;        ///< how far from a whole number a frame index may be [frames]
constexpr double kExactTime = 1e-3;    ///< a frame this near is the right one [s]
constexpr double kFallbackFps = 30.0;  ///< where neither video nor map names a rate; only bounds how near is near

/// How keyframes are found among the frames.
enum class Pairing { kPresentationTime, kIndexFromTime, kSourceFrame };

bool is_rate(double fps) { return std::isfinite(fps) && fps > 0.0 && fps < 1e5; }

/// True when all timestamps are whole numbers of frames at this rate.
bool are_whole_frames(const SlamMap& map, double fps) {
  return is_rate(fps) && std::all_of(map.keyframes.begin(), map.keyframes.end(), [fps](const MapKeyframe& k) {
           const double index = k.timestamp * fps;
           return std::abs(index - std::round(index)) < kWhole;
         });
}

bool all_have_source_frame(const SlamMap& map) {
  return std::all_of(map.keyframes.begin(), map.keyframes.end(),
                     [](const MapKeyframe& k) { return k.source_frame.has_value(); });
}

/// True when timestamps say nothing: RoblabWh/PatchMatch gives each keyframe 0.
bool are_timestamps_constant(const SlamMap& map) {
  return map.keyframes.size() > 1 && std::all_of(map.keyframes.begin(), map.keyframes.end(), [&](const MapKeyframe& k) {
           return k.timestamp == map.keyframes.front().timestamp;
         });
}

class Video final : public ImageSource {
 public:
  Video(const SlamMap& map, const std::filesystem::path& path, const VideoOptions& options) : path_(path) {
    open();
    choose_pairing(map, options);
    plan(map, options);
    describe(map, options);
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

  /// Frames come one after the other, and FFmpeg decodes them in threads of its own.
  void read_ahead(int /*images*/) override {}

  Origin origin(std::int64_t keyframe_id) const override {
    const auto found = std::find_if(plan_.begin(), plan_.end(),
                                    [&](const Target& target) { return target.keyframe_id == keyframe_id; });
    if (found == plan_.end()) throw InvalidInput("keyframe " + std::to_string(keyframe_id) + " has no image");
    const bool by_time = pairing_ == Pairing::kPresentationTime;
    return {path_, by_time ? io::format_number(found->timestamp) + " s" : std::to_string(found->index)};
  }

  void restrict_to(const std::set<std::int64_t>& keyframe_ids) override {
    ids_.clear();
    for (Target& target : plan_) {
      target.wanted = target.wanted && keyframe_ids.count(target.keyframe_id) != 0;
      if (target.wanted) ids_.push_back(target.keyframe_id);
    }
  }

  std::unique_ptr<ImageSource> again() const override { return std::unique_ptr<ImageSource>(new Video(*this)); }

 private:
  struct Target {
    std::int64_t keyframe_id = 0;
    MapCamera camera;
    double timestamp = 0.0;
    std::int64_t index = 0;
    bool wanted = true;
  };

  /// The same plan, at the beginning of the video.
  Video(const Video& other) : path_(other.path_) {
    open();
    pairing_ = other.pairing_;
    fps_ = other.fps_;
    map_fps_ = other.map_fps_;
    t0_ = other.t0_;
    plan_ = other.plan_;
    ids_ = other.ids_;
    skipped_ = other.skipped_;
    description_ = other.description_;
  }

  void open() {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path_, error))
      throw IoError(path_.string() + ": cannot be opened: " + (error ? error.message() : "it is no file") +
                    "; expected a video");
    try {
      // The backend is named, for others take digits in a file name for a pattern of an image sequence.
      capture_.open(path_.string(), cv::CAP_FFMPEG);
    } catch (const std::exception& e) {
      throw IoError(path_.string() + ": cannot be opened as a video: " + e.what());
    }
    if (!capture_.isOpened())
      throw IoError(path_.string() + ": cannot be opened as a video: broken, or no format that OpenCV's FFmpeg reads");
    fps_ = capture_.get(cv::CAP_PROP_FPS);
    if (!advance()) throw IoError(path_.string() + ": not one frame of the video can be decoded");
  }

  void choose_pairing(const SlamMap& map, const VideoOptions& options) {
    const MapCamera& camera = map.cameras[static_cast<std::size_t>(map.keyframes.front().camera)];
    map_fps_ = options.fps > 0.0 ? options.fps : camera.fps;
    const bool unix_time = io::has_unix_time(map);
    const double frames = capture_.get(cv::CAP_PROP_FRAME_COUNT);
    if (all_have_source_frame(map) && (unix_time || are_timestamps_constant(map))) {
      pairing_ = Pairing::kSourceFrame;
      return;
    }
    double latest = 0.0;
    for (const MapKeyframe& k : map.keyframes) latest = std::max(latest, k.timestamp);
    const bool fits_duration = !is_rate(fps_) || !(frames > 0.0) || latest <= (frames + 1.0) / fps_;
    // A rate that differs from the video's and divides all timestamps evenly is what they were counted with.
    const bool counted = are_whole_frames(map, map_fps_) && !are_whole_frames(map, fps_);
    const bool asked_for_index = options.fps > 0.0 || options.frame_offset != 0;
    pairing_ = unix_time || asked_for_index || !fits_duration || counted ? Pairing::kIndexFromTime
                                                                         : Pairing::kPresentationTime;
    if (pairing_ == Pairing::kIndexFromTime && !is_rate(map_fps_))
      throw InvalidInput(path_.string() + ": the timestamps of " + map.path.string() +
                         " are no presentation times of this video, and its camera has no frame rate; set --fps");
    if (!is_rate(fps_)) fps_ = is_rate(map_fps_) ? map_fps_ : kFallbackFps;
    if (unix_time) t0_ = io::first_timestamp(map);
  }

  void plan(const SlamMap& map, const VideoOptions& options) {
    const std::vector<int> repeated = io::earlier_with_same_timestamp(map);
    for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
      const MapKeyframe& keyframe = map.keyframes[k];
      if (pairing_ != Pairing::kSourceFrame && repeated[k] >= 0) {
        skipped_.push_back(
            {keyframe.id, io::same_timestamp_reason(map.keyframes[static_cast<std::size_t>(repeated[k])])});
        continue;
      }
      Target target{keyframe.id, map.cameras[static_cast<std::size_t>(keyframe.camera)], keyframe.timestamp, 0};
      if (pairing_ != Pairing::kPresentationTime) {
        const std::optional<std::int64_t> index = pairing_ == Pairing::kSourceFrame
                                                      ? keyframe.source_frame
                                                      : io::frame_index(keyframe.timestamp, t0_, map_fps_);
        target.index = index.value_or(-1) + (index ? options.frame_offset : 0);
        if (target.index < 0) {
          skipped_.push_back(
              {keyframe.id, "its frame index " + std::to_string(target.index) + " lies before the start of the video"});
          continue;
        }
      }
      plan_.push_back(std::move(target));
    }
    std::stable_sort(plan_.begin(), plan_.end(), [this](const Target& a, const Target& b) {
      return pairing_ == Pairing::kPresentationTime ? a.timestamp < b.timestamp : a.index < b.index;
    });
    for (const Target& target : plan_) ids_.push_back(target.keyframe_id);
  }

  void describe(const SlamMap& map, const VideoOptions& options) {
    description_ = std::to_string(ids_.size()) + " of " + std::to_string(map.keyframes.size()) +
                   " keyframes looked for in " + path_.string() + ": ";
    std::string offset;
    if (options.frame_offset != 0)
      offset = (options.frame_offset > 0 ? " + " : " - ") + std::to_string(std::abs(options.frame_offset));
    if (pairing_ == Pairing::kPresentationTime) {
      description_ += "timestamps are presentation times";
    } else if (pairing_ == Pairing::kSourceFrame) {
      description_ += "frame indices are the SLAM's count of frames" + offset;
    } else if (io::has_unix_time(map)) {
      description_ += "timestamps are Unix times, frame indices are (timestamp - " + io::format_number(t0_) + ") x " +
                      io::format_number(map_fps_) + " fps" + offset + ", so the first keyframe is taken as frame " +
                      std::to_string(options.frame_offset) + " (--frame-offset changes that)";
    } else {
      description_ += "frame indices are timestamp x " + io::format_number(map_fps_) + " fps" + offset;
    }
  }

  /// Grabs the next frame; false at the end of the video.
  bool advance() {
    bool grabbed = false;
    try {
      grabbed = !ended_ && capture_.grab();
    } catch (const std::exception& e) {
      throw IoError(path_.string() + ": frame " + std::to_string(index_ + 1) + " cannot be decoded: " + e.what());
    }
    if (!grabbed) {
      ended_ = true;
      return false;
    }
    ++index_;
    const double time = capture_.get(cv::CAP_PROP_POS_MSEC) / 1000.0;
    // OpenCV gives 0 for the last frames of a stream with B-frames, and for all of them in some formats.
    const double rate = is_rate(fps_) ? fps_ : kFallbackFps;
    if (index_ == 0) {
      time_ = std::isfinite(time) ? time : 0.0;
    } else {
      time_ = std::isfinite(time) && time > 0.0 ? time : time_ + 1.0 / rate;
    }
    return true;
  }

  bool retrieve(cv::Mat& bgr) {
    taken_ = index_;
    try {
      return capture_.retrieve(bgr) && !bgr.empty();
    } catch (const std::exception& e) {
      throw IoError(path_.string() + ": frame " + std::to_string(index_) + " cannot be decoded: " + e.what());
    }
  }

  std::string end_reason() const {
    return "the video ends before it, after " + std::to_string(index_ + 1) + " frames (" +
           io::format_number(std::round(time_ * 1000.0) / 1000.0) + " s)";
  }

  std::string undecodable_reason() const { return "frame " + std::to_string(taken_) + " cannot be decoded"; }

  std::string taken_reason() const {
    return "frame " + std::to_string(taken_) + " is already another keyframe's image";
  }

  /// Finds the frame of a target; returns why there is none. Frames are shared out in the same way whoever is wanted.
  std::string take(const Target& target, cv::Mat& bgr) {
    try {
      return pairing_ == Pairing::kPresentationTime ? take_nearest(target, bgr) : take_index(target, bgr);
    } catch (const IoError&) {
      if (target.wanted) throw;
      return undecodable_reason();
    }
  }

  /// Finds the frame of a target by its index; returns why there is none.
  std::string take_index(const Target& target, cv::Mat& bgr) {
    while (index_ < target.index && advance()) continue;
    if (index_ < target.index) return end_reason();
    if (target.index == taken_) return taken_reason();
    return retrieve(bgr) ? std::string() : undecodable_reason();
  }

  /// The same by presentation time.
  std::string take_nearest(const Target& target, cv::Mat& bgr) {
    const double tolerance = 0.5 / fps_;
    while (time_ < target.timestamp - tolerance && advance()) continue;
    if (time_ < target.timestamp - tolerance) return end_reason();
    const auto distance = [&] { return std::abs(time_ - target.timestamp); };
    if (distance() > tolerance)
      return "no frame within half a frame of its timestamp " + io::format_number(target.timestamp) + " s";
    if (index_ == taken_ && !advance()) return taken_reason();
    if (distance() > tolerance) return taken_reason();
    bool decoded = retrieve(bgr);
    // Frames of a variable rate may lie closer than half of the mean distance: go on while they come nearer.
    for (double best = distance(); best > kExactTime && advance() && distance() < best; best = distance())
      decoded = retrieve(bgr);
    return decoded ? std::string() : undecodable_reason();
  }

  std::filesystem::path path_;
  cv::VideoCapture capture_;
  Pairing pairing_ = Pairing::kPresentationTime;
  double fps_ = 0.0;      ///< of the video
  double map_fps_ = 0.0;  ///< that turns timestamps into indices
  double t0_ = 0.0;       ///< timestamp of frame 0
  std::vector<Target> plan_;
  std::size_t next_ = 0;
  std::int64_t index_ = -1;  ///< of the frame grabbed last
  std::int64_t taken_ = -1;  ///< of the frame retrieved last
  double time_ = 0.0;        ///< presentation time of the frame grabbed last [s]
  bool ended_ = false;
  std::vector<std::int64_t> ids_;
  std::vector<SkippedKeyframe> skipped_;
  std::string description_;
};

}  // namespace

std::unique_ptr<ImageSource> open_video(const SlamMap& map, const std::filesystem::path& video,
                                        const VideoOptions& options) {
  if (!(options.fps >= 0.0) || !std::isfinite(options.fps))
    throw InvalidOption("fps = " + io::format_number(options.fps) + ": expected a number > 0, or 0 for the map's own");
  if (map.keyframes.empty()) throw InvalidInput(map.path.string() + ": the map has no keyframe");
  return std::make_unique<Video>(map, video, options);
}

}  // namespace pmsp
