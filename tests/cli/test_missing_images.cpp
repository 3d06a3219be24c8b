// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "cli/command.h"
#include "pmsp/io/cloud.h"

using namespace pmsp_test;
using Catch::Contains;

namespace {

namespace fs = std::filesystem;

std::string name_of(int keyframe) { return "00000" + std::to_string(keyframe) + ".png"; }

/// quick_run() with a copy of the images or a video instead of the mission's directory.
std::vector<std::string> run_with(const TempDir& dir, const char* option, const fs::path& images,
                                  const std::vector<std::string>& more = {}) {
  std::vector<std::string> words = quick_run(dir / "c.ply", {"--stats", (dir / "s.json").string()});
  words[2] = option;
  words[3] = images.string();
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

nlohmann::json stats_of(const TempDir& dir) { return nlohmann::json::parse(read_text(dir / "s.json")); }

/// A video of the mission's first keyframes, which are 0.1 s apart.
void write_video(const fs::path& path, int keyframes) {
  cv::VideoWriter writer(path.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 10.0,
                         cv::Size(256, 128));
  REQUIRE(writer.isOpened());
  for (int i = 0; i < keyframes; ++i) writer.write(cv::imread((mission() / "images" / name_of(i)).string()));
}

}  // namespace

TEST_CASE("an undecodable image skips only its keyframe") {
  const TempDir dir;
  fs::copy(mission() / "images", dir / "images");
  write_text(dir / "images/000002.png", "no image");
  const Result result = densify(run_with(dir, "--images", dir / "images"));
  INFO(result.err);
  CHECK(result.code == 0);
  CHECK_THAT(result.err, Contains("warning: keyframe 2 skipped: ") && Contains("000002.png"));
  CHECK_THAT(result.err, Contains("4/4") && Contains("4 with an image"));
  CHECK(pmsp::read_ply(dir / "c.ply").positions.size() > 1000);
  const auto stats = stats_of(dir);
  CHECK(stats["keyframes"]["with_image"] == 4);
  CHECK(stats["keyframes"]["added"] == 4);
  REQUIRE(stats["skipped"].size() == 1);
  CHECK(stats["skipped"][0]["keyframe_id"] == 2);
}

TEST_CASE("a run without decodable images exits with 3") {
  const TempDir dir;
  fs::create_directory(dir / "images");
  for (int i = 0; i < 5; ++i) write_text(dir / "images" / name_of(i), "no image");
  const Result result = densify(run_with(dir, "--images", dir / "images"));
  INFO(result.err);
  CHECK(result.code == 3);
  CHECK_THAT(result.err, Contains("no image can be read") && Contains("000000.png") && Contains("000004.png"));
  CHECK(dir.entries() == 1);
}

TEST_CASE("a failed run leaves no directory of depth maps") {
  const TempDir dir;
  fs::copy(mission() / "images", dir / "images");
  cv::imwrite((dir / "images/000004.png").string(), cv::Mat(100, 256, CV_8UC3, cv::Scalar::all(90)));
  const Result result =
      densify(run_with(dir, "--images", dir / "images",
                       {"--raw-depth-maps", (dir / "raw").string(), "--patchmatch-geometric-passes", "0"}));
  INFO(result.err);
  CHECK(result.code == 3);
  CHECK_THAT(result.err, Contains("000004.png") && Contains("256x100"));
  CHECK_FALSE(fs::exists(dir / "raw"));
  CHECK_FALSE(fs::exists(dir / "raw.part"));
}

TEST_CASE("keyframes beyond the end of a video give a warning and are counted") {
  const TempDir dir;
  write_video(dir / "short.avi", 3);
  const Result result = densify(run_with(dir, "--video", dir / "short.avi"));
  INFO(result.err);
  CHECK(result.code == 0);
  CHECK_THAT(result.err, Contains("warning: keyframe 3 skipped: the video ends before it") &&
                             Contains("warning: keyframe 4 skipped"));
  CHECK_THAT(result.err, Contains("3 with an image"));
  const auto stats = stats_of(dir);
  CHECK(stats["keyframes"]["with_image"] == 3);
  REQUIRE(stats["skipped"].size() == 2);
  CHECK(stats["skipped"][0]["keyframe_id"] == 3);
  CHECK(stats["skipped"][1]["keyframe_id"] == 4);
}

TEST_CASE("a video without matching keyframes exits with 5 and suggests the offset") {
  const TempDir dir;
  write_video(dir / "short.avi", 3);
  const Result refused = densify(run_with(dir, "--video", dir / "short.avi", {"--frame-offset", "100"}));
  CHECK(refused.code == 3);
  CHECK_THAT(refused.err, Contains("0 of 5 keyframes") && Contains("--frame-offset") && Contains("--allow-missing"));
  const Result result =
      densify(run_with(dir, "--video", dir / "short.avi", {"--frame-offset", "100", "--allow-missing"}));
  INFO(result.err);
  CHECK(result.code == 5);
  CHECK_THAT(result.err, Contains("no keyframe has an image") && Contains("--frame-offset"));
  CHECK_THAT(result.err, !Contains("view-filter"));
  CHECK(stats_of(dir)["keyframes"]["with_image"] == 0);
  CHECK(stats_of(dir)["skipped"].size() == 5);
}

TEST_CASE("images for fewer than half of the keyframes are refused unless more are expected") {
  const TempDir dir;
  fs::create_directory(dir / "images");
  for (int i = 0; i < 2; ++i) fs::copy(mission() / "images" / name_of(i), dir / "images" / name_of(i));
  const Result refused = densify(run_with(dir, "--images", dir / "images"));
  CHECK(refused.code == 3);
  CHECK_THAT(refused.err, Contains("2 of 5 keyframes") && Contains("--fps") && Contains("--allow-missing"));
  const Result told = densify({"info", (mission() / "map.msg").string(), "--images", (dir / "images").string()});
  CHECK(told.code == 3);
  const Result allowed = densify(run_with(dir, "--images", dir / "images", {"--allow-missing"}));
  INFO(allowed.err);
  CHECK_THAT(allowed.err, Contains("2 with an image"));
  const Result growing = densify(
      run_with(dir, "--images", dir / "images", {"--workspace", (dir / "work").string(), "--growing", "--force"}));
  CHECK_THAT(growing.err, Contains("2 with an image"));
}

TEST_CASE("a list names the images of a map of a SLAM") {
  const TempDir dir;
  fs::create_directory(dir / "images");
  std::string list = "timestamp name\n";
  for (int i = 0; i < 5; ++i) {
    const std::string name = "R 0001 (" + std::to_string(9 - i) + ").png";
    fs::copy(mission() / "images" / name_of(i), dir / "images" / name);
    list += "0." + std::to_string(i) + " " + name + "\n";
  }
  write_text(dir / "list.txt", list);
  const Result result =
      densify(run_with(dir, "--images", dir / "images", {"--image-list", (dir / "list.txt").string()}));
  INFO(result.err);
  CHECK(result.code == 0);
  CHECK_THAT(result.err, Contains("5 of 5 keyframes found") && Contains("5 with an image"));
}
