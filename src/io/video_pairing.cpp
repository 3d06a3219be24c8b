// SPDX-License-Identifier: BSD-2-Clause
#include "video_pairing.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "image_naming.h"
#include "pairing_trial.h"
#include "pmsp/error.h"
#include "video_frames.h"

namespace pmsp::io {
namespace {

using Reading = VideoPairing::Reading;

constexpr double kWholeFrame = 0.05;         ///< maximum deviation of a frame index from a whole number [frames]
constexpr double kSameFrame = 0.5;           ///< readings that differ by less give the same frames [frames]
constexpr double kNeighbouringFrames = 2.0;  ///< readings that differ by less need no decision [frames]
constexpr double kAlikeReadings = 0.06;      ///< difference in fit of equally good readings
constexpr double kBetter = 0.03;             ///< required lead in fit of a shifted reading
constexpr std::int64_t kNear = 5;            ///< maximum shift of a reading that fits [frames]
constexpr double kEarly = 300.0;             ///< maximum frame of a first keyframe with Unix time
constexpr std::size_t kLatePairs = 3;        ///< pairs for the comparison of readings
constexpr std::int64_t kBefore = 30;         ///< frames decoded before that of the first keyframe

std::string with_sign(std::int64_t offset) {
  if (offset == 0) return "";
  return (offset > 0 ? " + " : " - ") + std::to_string(std::abs(offset));
}

class Chooser {
 public:
  Chooser(const SlamMap& map, const std::filesystem::path& path, const VideoOptions& options, const VideoReader& video)
      : map_(map),
        path_(path),
        options_(options),
        video_(video),
        unit_(time_unit(map)),
        is_unix_(has_unix_time(map, unit_)),
        first_(first_timestamp(map) * unit_),
        latest_(last_timestamp(map) * unit_) {
    const double map_fps = map.cameras[static_cast<std::size_t>(map.keyframes.front().camera)].fps;
    rate_ = options.fps > 0.0 ? options.fps : map_fps;
    if (!is_frame_rate(rate_) && options.frame_offset) rate_ = video.fps();
  }

  VideoPairing choose() {
    VideoPairing chosen = find();
    chosen.description = describe(chosen) + (is_shown_ ? ", by landmarks in the frames" : "");
    return chosen;
  }

 private:
  VideoPairing find() {
    const std::vector<VideoPairing> readings = possible_readings();
    const bool has_offset = options_.frame_offset.has_value();
    const bool decides = options_.presentation_times || options_.fps > 0.0;
    if (has_offset || (decides && !is_unix_)) return readings.front();
    return can_try() ? tried(readings) : by_rule(readings);
  }

  VideoPairing reading(Reading which) const {
    VideoPairing pairing;
    pairing.reading = which;
    pairing.unit = unit_;
    pairing.rate = rate_;
    pairing.t0 = is_unix_ ? first_ : 0.0;
    const std::int64_t offset = options_.frame_offset.value_or(0);
    if (which == Reading::kPresentationTime) {
      pairing.t0 -= static_cast<double>(offset) / (is_frame_rate(video_.fps()) ? video_.fps() : 1.0);
    } else {
      pairing.offset = offset;
    }
    return pairing;
  }

  /// Readings allowed by options and map, by decreasing plausibility; without duplicates.
  std::vector<VideoPairing> possible_readings() const {
    const bool counts = std::all_of(map_.keyframes.begin(), map_.keyframes.end(),
                                    [](const MapKeyframe& k) { return k.source_frame.has_value(); });
    const bool has_times = latest_ > first_ || map_.keyframes.size() == 1;
    if (options_.presentation_times) return {reading(Reading::kPresentationTime)};
    if (counts && (is_unix_ || !has_times)) return {reading(Reading::kSourceFrame)};
    if (!has_times) {
      throw InvalidInput(path_.string() + ": the keyframes of " + map_.path.string() + " all have the timestamp " +
                         format_number(first_) + " s, which determines no frames; give the images with --images");
    }
    const bool asks_for_indices = options_.fps > 0.0 || options_.frame_offset.has_value();
    const bool has_rate = is_frame_rate(rate_);
    const bool in_time = !is_unix_ && (!has_length() || latest_ <= length());
    if (is_unix_ && !asks_for_indices && !can_try()) refuse_unix_times();
    if (!has_rate && (asks_for_indices || (!in_time && !can_try()))) {
      throw InvalidInput(path_.string() + ": the timestamps of " + map_.path.string() +
                         " are no presentation times of this video, and its camera has no frame rate; set --fps");
    }
    std::vector<VideoPairing> readings;
    const bool are_same = has_rate && is_frame_rate(video_.fps()) &&
                          std::abs((latest_ - (is_unix_ ? first_ : 0.0)) * (rate_ - video_.fps())) < kSameFrame;
    const bool prefers_indices = asks_for_indices || is_unix_ || !in_time || are_counted();
    if (!asks_for_indices && !(are_same && prefers_indices)) readings.push_back(reading(Reading::kPresentationTime));
    if (has_rate && (prefers_indices || !are_same)) {
      const auto at = prefers_indices ? readings.begin() : readings.end();
      readings.insert(at, reading(Reading::kIndexFromTime));
    }
    return readings;
  }

  bool has_length() const { return is_frame_rate(video_.fps()) && video_.frames() > 0.0; }
  double length() const { return (video_.frames() + 1.0) / video_.fps(); }

  /// True if timestamps are whole frames at the map's rate, but not at the video's.
  bool are_counted() const { return are_whole_frames(rate_) && !are_whole_frames(video_.fps()); }

  bool are_whole_frames(double fps) const {
    return is_frame_rate(fps) && std::all_of(map_.keyframes.begin(), map_.keyframes.end(), [&](const MapKeyframe& k) {
             const double index = k.timestamp * unit_ * fps;
             return std::abs(index - std::round(index)) < kWholeFrame;
           });
  }

  bool is_inside(const VideoPairing& pairing) const {
    if (is_unix_ || !has_length()) return true;
    return pairing.reading == Reading::kPresentationTime ? latest_ <= length()
                                                         : latest_ * rate_ <= video_.frames() + 1.0;
  }

  bool can_try() const { return !map_.landmarks.empty() && map_.keyframes.size() > 1; }

  /// Choice if the frames are not conclusive.
  VideoPairing by_rule(const std::vector<VideoPairing>& readings) const {
    if (is_unix_) refuse_unix_times();
    std::vector<VideoPairing> inside;
    for (const VideoPairing& pairing : readings)
      if (is_inside(pairing)) inside.push_back(pairing);
    if (inside.size() > 1 && are_whole_frames(rate_)) refuse_alike();
    return inside.empty() ? readings.front() : inside.front();
  }

  [[noreturn]] void refuse_unix_times() const {
    throw InvalidInput(path_.string() + ": the timestamps of " + map_.path.string() +
                       " are Unix times, and the frame of the first keyframe is unknown; set --frame-offset (0 = the "
                       "first frame), and --fps if the SLAM counted at another rate");
  }

  [[noreturn]] void refuse_alike() const {
    throw InvalidInput(path_.string() + ": the timestamps of " + map_.path.string() +
                       " may be presentation times or counts of frames (timestamp x " + format_number(rate_) +
                       " fps), which the frames do not decide; set --presentation-times or --fps " +
                       format_number(rate_));
  }

  double expected_frame(const VideoPairing& pairing, const MapKeyframe& keyframe) const {
    if (pairing.reading == Reading::kPresentationTime)
      return pairing.time(keyframe) * (is_frame_rate(video_.fps()) ? video_.fps() : 1.0);
    return static_cast<double>(pairing.index(keyframe).value_or(0));
  }

  VideoPairing tried(const std::vector<VideoPairing>& readings) {
    const Keyframes by_time = [&] {
      Keyframes all = readings.front().reading == Reading::kSourceFrame ? Keyframes() : keyframes_by_time(map_);
      if (all.empty())
        for (const MapKeyframe& keyframe : map_.keyframes) all.push_back(&keyframe);
      return all;
    }();
    VideoFrames frames(path_, where_to_begin(readings, *by_time.front()));
    const Image<Rgb>* image = frames.image(frames.begin());
    const MapCamera& camera = map_.cameras[static_cast<std::size_t>(by_time.front()->camera)];
    if (image == nullptr || std::abs(image->width() * camera.height - image->height() * camera.width) > camera.width)
      return readings.front();  // reported with the first image
    const Keyframes run = first_run(map_, by_time);
    const double room = readings.size() > 1 ? VideoFrames::kMost - kBefore : is_unix_ ? kEarly : 0.0;
    const Keyframes more = late_pairs(readings, by_time, frames.begin(), room);
    return tried_on(readings, by_time, run, more, frames);
  }

  /// First decoded frame: 0, unless the first keyframe is expected far behind it.
  std::int64_t where_to_begin(const std::vector<VideoPairing>& readings, const MapKeyframe& first) const {
    double expected = expected_frame(readings.front(), first);
    for (const VideoPairing& pairing : readings) expected = std::min(expected, expected_frame(pairing, first));
    const bool is_far = expected >= VideoFrames::kMost - kBefore && expected < video_.frames();
    return is_far ? static_cast<std::int64_t>(expected) - kBefore : 0;
  }

  /// Keyframes within `room` frames on which readings differ most.
  Keyframes late_pairs(const std::vector<VideoPairing>& readings, const Keyframes& by_time, std::int64_t begin,
                       double room) const {
    Keyframes reachable;
    for (const MapKeyframe* keyframe : by_time) {
      const bool is_near = std::all_of(readings.begin(), readings.end(), [&](const VideoPairing& pairing) {
        const double first =
            is_inside(pairing) ? static_cast<double>(begin) : expected_frame(pairing, *by_time.front());
        return expected_frame(pairing, *keyframe) - first < room;
      });
      if (is_near) reachable.push_back(keyframe);
    }
    const Keyframes half(reachable.begin() + static_cast<std::ptrdiff_t>(reachable.size() / 2), reachable.end());
    return spread_pairs(half, kLatePairs);
  }

  std::optional<std::int64_t> frame_of(const VideoPairing& pairing, const MapKeyframe& keyframe,
                                       VideoFrames& frames) const {
    return pairing.reading == Reading::kPresentationTime ? frames.nearest(pairing.time(keyframe))
                                                         : pairing.index(keyframe);
  }

  ImageOf image_of(const VideoPairing& pairing, VideoFrames& frames) const {
    return [this, &pairing, &frames](const MapKeyframe& keyframe) -> const Image<Rgb>* {
      const std::optional<std::int64_t> frame = frame_of(pairing, keyframe, frames);
      return frame ? frames.image(*frame) : nullptr;
    };
  }

  /// Chooses by the fit on `run` and `more`: unshifted, or else with a constant offset.
  VideoPairing tried_on(const std::vector<VideoPairing>& readings, const Keyframes& by_time, const Keyframes& run,
                        const Keyframes& more, VideoFrames& frames) {
    Keyframes all = run;
    for (const MapKeyframe* keyframe : more)
      if (std::find(all.begin(), all.end(), keyframe) == all.end()) all.push_back(keyframe);
    bool says_nothing = true;
    std::vector<Tried> fitting;
    std::optional<Tried> poor;
    for (const VideoPairing& pairing : readings) {
      if (!is_inside(pairing)) continue;
      const Evidence evidence = try_images(map_, all, image_of(pairing, frames));
      says_nothing = says_nothing && !evidence.conclusive();
      if (evidence.fits()) fitting.push_back(refined({pairing, evidence.fit}, all, frames));
      if (evidence.may_fit() && (!poor || evidence.fit > poor->fit)) poor = Tried{pairing, evidence.fit};
    }
    is_shown_ = readings.size() > 1 || is_unix_;
    if (!fitting.empty()) return best_of(fitting);
    is_shown_ = false;
    const bool any_inside = std::any_of(readings.begin(), readings.end(),
                                        [this](const VideoPairing& pairing) { return is_inside(pairing); });
    if (says_nothing && any_inside) return by_rule(readings);
    const Keyframes late = late_pairs(readings, by_time, frames.begin(), VideoFrames::kMost - kBefore);
    for (const VideoPairing& pairing : readings)
      if (is_inside(pairing) && fit_presented(map_, all, image_of(pairing, frames))) return pairing;
    for (const VideoPairing& pairing : readings) {
      const std::optional<Tried> shifted = find_shift(pairing, run, late, frames);
      if (shifted) fitting.push_back(*shifted);
    }
    is_shown_ = !fitting.empty();
    if (!fitting.empty()) return best_of(fitting);
    if (poor) return poor->pairing;  // left to the pairing check
    throw InvalidInput(path_.string() + ": its frames do not show the landmarks of " + map_.path.string() +
                       ", with the timestamps read as " + names_of(readings) + ", at any offset within the first " +
                       std::to_string(VideoFrames::kMost) +
                       " frames; set --frame-offset, --fps or --presentation-times, or give the video of the map");
  }

  struct Tried {
    VideoPairing pairing;
    double fit = 0.0;
  };

  /// Tries small shifts, for Unix times or a poor fit.
  Tried refined(const Tried& tried, const Keyframes& keyframes, VideoFrames& frames) const {
    if (!is_unix_ && tried.fit >= kExpectedFit) return tried;
    Tried best = tried;
    for (std::int64_t shift = -kNear; shift <= kNear; ++shift) {
      VideoPairing shifted = tried.pairing;
      if (shifted.reading == Reading::kPresentationTime) {
        shifted.t0 -= static_cast<double>(shift) / (is_frame_rate(video_.fps()) ? video_.fps() : 1.0);
      } else {
        shifted.offset += shift;
      }
      const Evidence evidence = try_images(map_, keyframes, image_of(shifted, frames));
      if (evidence.fits() && evidence.fit > std::max(best.fit, tried.fit + kBetter)) best = {shifted, evidence.fit};
    }
    return best;
  }

  VideoPairing best_of(std::vector<Tried> fitting) const {
    std::stable_sort(fitting.begin(), fitting.end(), [](const Tried& a, const Tried& b) { return a.fit > b.fit; });
    const double apart = std::abs((latest_ - first_) * (rate_ - video_.fps()));
    if (fitting.size() > 1 && apart > kNeighbouringFrames && fitting[1].fit > fitting[0].fit - kAlikeReadings)
      refuse_alike();
    return fitting.front().pairing;
  }

  /// Returns the pairing with the best constant offset; nullopt if none fits.
  std::optional<Tried> find_shift(const VideoPairing& pairing, const Keyframes& run, const Keyframes& more,
                                  VideoFrames& frames) const {
    const MapKeyframe& first = *run.front();
    VideoPairing from_first = pairing;
    if (pairing.reading == Reading::kIndexFromTime) from_first.t0 = first_;  // whole frames from the first keyframe on
    const auto shifted_to = [&](std::int64_t anchor) {
      VideoPairing shifted = from_first;
      if (pairing.reading == Reading::kPresentationTime) {
        shifted.t0 += pairing.time(first) - frames.time(anchor);
      } else {
        shifted.offset += anchor - from_first.index(first).value_or(0);
      }
      return shifted;
    };
    FrameReading reading;
    reading.image = [&frames](std::int64_t frame) { return frames.image(frame); };
    reading.frame_of = [&](const MapKeyframe& keyframe, std::int64_t anchor) -> std::optional<std::int64_t> {
      if (frames.image(anchor) == nullptr) return std::nullopt;
      return frame_of(shifted_to(anchor), keyframe, frames);
    };
    const std::int64_t begin = frames.begin();
    const auto found = find_anchor(map_, run, more, reading, begin, begin + VideoFrames::kMost - 1);
    if (!found) return std::nullopt;
    return Tried{shifted_to(found->anchor), found->evidence.fit};
  }

  std::string names_of(const std::vector<VideoPairing>& readings) const {
    std::string names;
    for (const VideoPairing& pairing : readings) {
      names += names.empty() ? "" : " or ";
      names += pairing.reading == Reading::kPresentationTime ? "presentation times"
               : pairing.reading == Reading::kSourceFrame    ? "the SLAM's count of frames"
                                                             : "counts of frames at " + format_number(rate_) + " fps";
    }
    return names;
  }

  std::string describe(const VideoPairing& pairing) const {
    const std::string timestamp = unit_ == 1.0 ? "timestamp" : "timestamp x " + format_number(unit_);
    const std::string from_t0 =
        pairing.t0 == 0.0 ? timestamp : "(" + timestamp + " - " + format_number(pairing.t0) + ")";
    if (pairing.reading == Reading::kPresentationTime) {
      if (pairing.t0 == 0.0 && unit_ == 1.0) return "timestamps are presentation times";
      return (is_unix_ ? "timestamps are Unix times, " : "") + from_t0 + " are presentation times";
    }
    if (pairing.reading == Reading::kSourceFrame)
      return "frame indices are the SLAM's count of frames" + with_sign(pairing.offset);
    const std::string formula =
        "frame indices are " + from_t0 + " x " + format_number(rate_) + " fps" + with_sign(pairing.offset);
    if (!is_unix_) return formula;
    return "timestamps are Unix times, " + formula + ", so the first keyframe is taken as frame " +
           std::to_string(pairing.offset) + " (--frame-offset changes that)";
  }

  const SlamMap& map_;
  const std::filesystem::path& path_;
  const VideoOptions& options_;
  const VideoReader& video_;
  double unit_;
  bool is_unix_;
  double first_;
  double latest_;
  double rate_ = 0.0;
  bool is_shown_ = false;  ///< whether the frames were decisive
};

}  // namespace

std::optional<std::int64_t> VideoPairing::index(const MapKeyframe& keyframe) const {
  const std::optional<std::int64_t> frame =
      reading == Reading::kSourceFrame ? source_index(keyframe) : frame_index(keyframe.timestamp * unit, t0, rate);
  return frame ? std::optional(*frame + offset) : std::nullopt;
}

VideoPairing choose_video_pairing(const SlamMap& map, const std::filesystem::path& path, const VideoOptions& options,
                                  const VideoReader& video) {
  return Chooser(map, path, options, video).choose();
}

}  // namespace pmsp::io
