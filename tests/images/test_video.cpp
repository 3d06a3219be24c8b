// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <numeric>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "drawn_scene.h"
#include "pmsp/error.h"

using namespace pmsp;
using namespace pmsp::test;
using Catch::Matchers::Contains;

namespace {

constexpr int kFrames = 40;

/// A video whose frame i is of gray level 5 i. False where this OpenCV cannot write it.
bool write_video(const std::filesystem::path& path, const char* codec, double fps) {
  cv::VideoWriter writer(path.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc(codec[0], codec[1], codec[2], codec[3]),
                         fps, cv::Size(64, 32));
  if (!writer.isOpened()) return false;
  for (int i = 0; i < kFrames; ++i) writer.write(cv::Mat(32, 64, CV_8UC3, cv::Scalar::all(5 * i)));
  return true;
}

struct Clip {
  TempDir folder;
  std::filesystem::path path = folder / "flight 1.avi";
  explicit Clip(double fps = 10.0) { REQUIRE(write_video(path, "MJPG", fps)); }
};

using Ids = std::vector<std::int64_t>;
using Frames = std::vector<int>;

/// A video of these frames of the flight through the room.
void write_room_video(const std::filesystem::path& path, const Frames& frames, double fps, bool upside_down = false) {
  cv::VideoWriter writer(path.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), fps,
                         cv::Size(kRoomWidth, kRoomWidth / 2));
  REQUIRE(writer.isOpened());
  for (const int frame : frames) {
    cv::Mat bgr = bgr_of(render_room(frame));
    if (upside_down) cv::flip(bgr, bgr, -1);
    writer.write(bgr);
  }
}

/// The frames of all keyframes, where there are 10 a second.
Frames frames_of(const ImageSource& source) {
  Frames frames;
  for (const std::int64_t id : source.keyframe_ids()) {
    const std::string frame = source.origin(id).frame;
    const bool is_time = frame.back() == 's';
    frames.push_back(static_cast<int>(std::lround(std::stod(frame) * (is_time ? 10.0 : 1.0))));
  }
  return frames;
}

}  // namespace

TEST_CASE("Keyframes take the frame with the nearest presentation time") {
  const Clip clip;
  const auto source = open_video(bare_map({{0, 0.0}, {1, 0.13}, {4, 0.5}, {5, 2.96}, {9, 3.9}}), clip.path);
  CHECK(source->keyframe_ids() == Ids{0, 1, 4, 5, 9});
  CHECK_THAT(source->description(), Contains("presentation times") && Contains("5 of 5"));
  const Drained drained = drain(*source);
  CHECK(drained.ids == Ids{0, 1, 4, 5, 9});
  CHECK(drained.frames == Frames{0, 1, 5, 30, 39});
  CHECK(source->skipped().empty());
  CHECK_FALSE(source->next().has_value());
}

TEST_CASE("The order is by time and not by id") {
  const Clip clip;
  const auto source = open_video(bare_map({{0, 2.0}, {1, 1.0}, {2, 3.0}}), clip.path);
  CHECK(source->keyframe_ids() == Ids{1, 0, 2});
  CHECK(drain(*source).frames == Frames{10, 20, 30});
}

TEST_CASE("A repeated timestamp keeps its first keyframe only") {
  const Clip clip;
  const auto source = open_video(bare_map({{0, 0.0}, {7, 3.7}, {8, 3.7}, {9, 3.7}}), clip.path);
  CHECK(source->keyframe_ids() == Ids{0, 7});
  CHECK_THAT(skip_reason(*source, 8), Contains("keyframe 7") && Contains("3.7 s"));
  CHECK_THAT(skip_reason(*source, 9), Contains("keyframe 7"));
  CHECK(drain(*source).frames == Frames{0, 37});
}

TEST_CASE("Two keyframes never share a frame") {
  const Clip clip;
  const auto source = open_video(bare_map({{0, 1.0}, {1, 1.03}, {2, 1.1}}), clip.path);
  const Drained drained = drain(*source);
  CHECK(drained.ids == Ids{0, 2});
  CHECK(drained.frames == Frames{10, 11});
  CHECK_THAT(skip_reason(*source, 1), Contains("another keyframe"));
}

TEST_CASE("Timestamps counted with another rate than the video's are indices") {
  const Clip clip(29.97);
  std::vector<Shot> shots;
  for (int i = 0; i < 10; ++i) shots.push_back({i, 4 * i / 20.0});
  SlamMap map = bare_map(shots);
  map.cameras[0].fps = 20.0;
  const auto source = open_video(map, clip.path);
  CHECK_THAT(source->description(), Contains("timestamp x 20 fps"));
  CHECK(drain(*source).frames == Frames{0, 4, 8, 12, 16, 20, 24, 28, 32, 36});
}

TEST_CASE("Unix times count from the first keyframe shifted by --frame-offset") {
  const Clip clip;
  const double t0 = 1763660000.25;
  const SlamMap map = bare_map({{0, t0}, {1, t0 + 0.1}, {2, t0 + 0.6}, {5, t0 + 2.0}});
  CHECK_THROWS_WITH(open_video(map, clip.path), Contains("Unix") && Contains("--frame-offset (0 = the first frame)"));
  VideoOptions options;
  options.frame_offset = 0;
  const auto source = open_video(map, clip.path, options);
  CHECK_THAT(source->description(), Contains("Unix") && Contains("1763660000.25") && Contains("--frame-offset"));
  CHECK(drain(*source).frames == Frames{0, 1, 6, 20});

  options.frame_offset = 12;
  CHECK(drain(*open_video(map, clip.path, options)).frames == Frames{12, 13, 18, 32});
  options.frame_offset = -1;
  const auto early = open_video(map, clip.path, options);
  CHECK(early->keyframe_ids() == Ids{1, 2, 5});
  CHECK_THAT(skip_reason(*early, 0), Contains("-1"));
}

TEST_CASE("An explicit rate or offset selects indices") {
  const Clip clip;
  const SlamMap map = bare_map({{0, 0.0}, {1, 0.5}, {2, 1.0}});
  VideoOptions options;
  options.fps = 30.0;
  CHECK(drain(*open_video(map, clip.path, options)).frames == Frames{0, 15, 30});
  options.frame_offset = 2;
  CHECK(drain(*open_video(map, clip.path, options)).frames == Frames{2, 17, 32});
}

TEST_CASE("Maps without timestamps count by their source frames") {
  const Clip clip;
  SlamMap map = bare_map({{0, 0.0}, {1, 0.0}, {2, 0.0}});
  for (std::size_t i = 0; i < 3; ++i) map.keyframes[i].source_frame = static_cast<std::int64_t>(3 + 7 * i);
  const auto source = open_video(map, clip.path);
  CHECK_THAT(source->description(), Contains("count of frames"));
  CHECK(drain(*source).frames == Frames{3, 10, 17});
}

TEST_CASE("Keyframes beyond the end of the video are skipped and listed") {
  const Clip clip;
  const auto source = open_video(bare_map({{0, 0.0}, {1, 3.0}, {2, 8.0}, {3, 9.0}}), clip.path);
  const Drained drained = drain(*source);
  CHECK(drained.ids == Ids{0, 1});
  CHECK_THAT(skip_reason(*source, 2), Contains("ends") && Contains("40 frames"));
  CHECK_THAT(skip_reason(*source, 3), Contains("ends"));
}

TEST_CASE("The last frames of a stream with B-frames are found without a timestamp") {
  TempDir folder;
  if (!write_video(folder / "b.mp4", "avc1", 10.0)) {
    WARN("this OpenCV cannot write H.264: not tested");
    return;
  }
  const auto source = open_video(bare_map({{0, 0.0}, {1, 2.0}, {2, 3.7}, {3, 3.8}, {4, 3.9}}), folder / "b.mp4");
  CHECK(drain(*source).frames == Frames{0, 20, 37, 38, 39});
}

TEST_CASE("Ambiguous timestamps without landmarks are refused until an option decides") {
  const Clip clip;  // of 4 s
  SlamMap map = bare_map({{0, 0.0}, {1, 0.5}, {2, 1.0}, {3, 1.5}});
  map.cameras[0].fps = 20.0;
  CHECK_THROWS_WITH(open_video(map, clip.path), Contains("--presentation-times") && Contains("--fps 20"));
  VideoOptions options;
  options.presentation_times = true;
  CHECK(drain(*open_video(map, clip.path, options)).frames == Frames{0, 5, 10, 15});
  options.fps = 20.0;
  CHECK_THROWS_AS(open_video(map, clip.path, options), InvalidOption);
  options.presentation_times = false;
  CHECK(drain(*open_video(map, clip.path, options)).frames == Frames{0, 10, 20, 30});
}

TEST_CASE("A video that covers fewer than half of the keyframes is refused unless allowed") {
  const Clip clip;
  const SlamMap map = bare_map({{0, 0.0}, {1, 30.0}, {2, 31.0}});
  CHECK_THROWS_WITH(open_video(map, clip.path), Contains("1 of 3 keyframes") && Contains("--allow-missing"));
  VideoOptions options;
  options.allow_missing = true;
  CHECK(drain(*open_video(map, clip.path, options)).ids == Ids{0});
}

TEST_CASE("The frame of the first keyframe is found by image content") {
  TempDir folder;
  const auto path = folder / "room.avi";
  Frames frames(34);
  std::iota(frames.begin(), frames.end(), 0);
  write_room_video(path, frames, 10.0);
  const double t0 = GENERATE(1763660000.25, 1000.5, -0.7);
  std::vector<Shot> shots;
  for (int i = 0; i < 8; ++i) shots.push_back({i, t0 + 0.3 * i, 7 + 3 * i});
  const auto source = open_video(room_map(shots), path);
  INFO(source->description());
  CHECK(frames_of(*source) == Frames{7, 10, 13, 16, 19, 22, 25, 28});
  CHECK_THAT(source->description(), Contains("by landmarks in the frames"));
}

TEST_CASE("Timestamps are presentation times or frame counts as determined by image content") {
  TempDir folder;
  const auto path = folder / "room.avi";
  constexpr double kRate = 7.0;  // of a video at 10 fps with dropped frames
  Frames frames;
  for (int i = 0; i < 36; ++i) frames.push_back(std::min(33, static_cast<int>(std::lround(10.0 * i / kRate))));
  write_room_video(path, frames, kRate);
  std::vector<Shot> shots;
  Frames taken;
  for (int i = 0; i < 23; i += 2) {
    shots.push_back({i, frames[static_cast<std::size_t>(i)] / 10.0, frames[static_cast<std::size_t>(i)]});
    taken.push_back(i);
  }
  const auto times = open_video(room_map(shots), path);
  INFO(times->description());
  CHECK_THAT(times->description(), Contains("presentation times"));
  CHECK(times->keyframe_ids().size() == shots.size());

  for (Shot& shot : shots) shot.timestamp = static_cast<double>(shot.id) / 10.0;
  const auto counts = open_video(room_map(shots), path);
  INFO(counts->description());
  CHECK_THAT(counts->description(), Contains("timestamp x 10 fps"));
  CHECK(frames_of(*counts) == taken);
}

TEST_CASE("A video of another place is refused and an upside-down one left to the pairing check") {
  TempDir folder;
  std::vector<Shot> shots;
  for (int i = 0; i < 8; ++i) shots.push_back({i, 0.2 * i, 2 * i});
  Frames right(16);
  std::iota(right.begin(), right.end(), 0);
  Frames elsewhere;  // a different one in each frame
  for (const int frame : right) elsewhere.push_back((7 * frame + 5) % 31);
  write_room_video(folder / "other.avi", elsewhere, 10.0);
  CHECK_THROWS_WITH(open_video(room_map(shots), folder / "other.avi"),
                    Contains("--frame-offset") && Contains("--fps") && Contains("--presentation-times"));
  write_room_video(folder / "turned.avi", right, 10.0, true);
  CHECK_THAT(open_video(room_map(shots), folder / "turned.avi")->description(), Contains("presentation times"));
}

TEST_CASE("Unusable videos are refused") {
  TempDir folder;
  const SlamMap map = bare_map({{0, 0.0}, {1, 0.1}});
  CHECK_THROWS_WITH(open_video(map, folder / "missing.mp4"), Contains("missing.mp4"));
  CHECK_THROWS_AS(open_video(map, folder.path()), IoError);
  std::ofstream(folder / "text.mp4") << "no video";
  CHECK_THROWS_AS(open_video(map, folder / "text.mp4"), IoError);

  const Clip clip;
  VideoOptions options;
  options.fps = -1.0;
  CHECK_THROWS_AS(open_video(map, clip.path, options), InvalidOption);
  SlamMap wide = map;
  wide.cameras[0].height = 48;
  CHECK_THROWS_WITH(open_video(wide, clip.path)->next(), Contains("64x32") && Contains("64x48"));
  SlamMap no_rate = bare_map({{0, 1763660000.0}, {1, 1763660001.0}});
  no_rate.cameras[0].fps = 0.0;
  CHECK_THROWS_WITH(open_video(no_rate, clip.path), Contains("--fps"));
}
