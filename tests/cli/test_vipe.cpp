// SPDX-License-Identifier: BSD-2-Clause
// Results of ViPE as MAP: its video, prior depth and masks.
#include <catch2/catch.hpp>

#include <map>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "cli/command.h"
#include "map/scene_files.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/depth.h"
#include "pmsp/io/map.h"
#include "support/zip_file.h"

using namespace pmsp_test;
using Catch::Contains;
using Json = nlohmann::ordered_json;

namespace {

namespace fs = std::filesystem;

std::string frame_name(std::int64_t id, const char* ending) { return "0000" + std::to_string(id) + ending; }

/// The mission as ViPE writes it: frames of its video in time order, with the true depth in another unit and the number
/// of an object on the left quarter of the images.
void write_results(const fs::path& folder) {
  const pmsp::SlamMap map = pmsp::read_map(mission() / "map.msg");
  pmsp::test::write_vipe(folder, map);
  fs::create_directories(folder / "rgb");
  cv::VideoWriter video((folder / "rgb/flight.mp4").string(), cv::CAP_FFMPEG,
                        cv::VideoWriter::fourcc('m', 'p', '4', 'v'), 10.0, cv::Size(256, 128));
  REQUIRE(video.isOpened());
  std::map<std::string, std::string> depths, masks;
  for (const pmsp::MapKeyframe& keyframe : map.keyframes) {
    const std::string name = "0" + frame_name(keyframe.id, ".png");
    video.write(cv::imread((mission() / "images" / name).string()));
    pmsp::write_exr(folder / "one.exr", {{"Z", pmsp::read_png16(mission() / "gt/range_mm" / name, 0.0004)}});
    depths[frame_name(keyframe.id, ".exr")] = read_text(folder / "one.exr");
    cv::Mat mask(128, 256, CV_8UC1, cv::Scalar(0));
    mask.colRange(0, 64) = cv::Scalar(1 + static_cast<double>(keyframe.id));
    std::vector<unsigned char> png;
    cv::imencode(".png", mask, png);
    masks[frame_name(keyframe.id, ".png")] = {png.begin(), png.end()};
  }
  fs::remove(folder / "one.exr");
  write_zip(folder / "depth/flight.zip", depths);
  write_zip(folder / "mask/flight.zip", masks);
}

Words run_on(const fs::path& map, const fs::path& output, const Words& more = {}) {
  Words words = quick_run(output, more);
  words[1] = map.string();
  words.erase(words.begin() + 2, words.begin() + 4);  // --images
  return words;
}

}  // namespace

TEST_CASE("results of ViPE need no further argument", "[vipe]") {
  const TempDir dir;
  write_results(dir / "results");
  const auto run = [&](const Words& more) {
    require_ok(densify(
        run_on(dir / "results", dir / "c.ply", joined({"--force", "--stats", (dir / "s.json").string()}, more))));
    return Json::parse(read_text(dir / "s.json"));
  };
  const Json stats = run({"--workspace", (dir / "work").string()});
  CHECK(stats["keyframes"]["with_image"] == 5);
  REQUIRE(stats["prior_depth"].size() == 5);
  for (const Json& entry : stats["prior_depth"]) CHECK(entry["scale"].get<double>() == Approx(2.5).epsilon(0.03));
  CHECK(stats["mask"]["with_file"] == 5);
  CHECK(stats["mask"]["hidden"].get<double>() == Approx(0.25).margin(0.01));
  const std::string cloud = read_text(dir / "c.ply");
  CHECK(pmsp::read_ply(dir / "c.ply").positions.size() > 1000);

  const Json again = run({"--workspace", (dir / "work").string()})["workspace"];
  CHECK(again["kept"] == again["depth_maps"]);
  CHECK(read_text(dir / "c.ply") == cloud);
  CHECK(run({"--no-masks"})["mask"].is_null());
  CHECK(run({"--prior-depth", (dir / "work").string()})["prior_depth"][0]["left_out"] == "there is no file for it");

  fs::remove(dir / "results/rgb/flight.mp4");
  CHECK_THAT(densify(run_on(dir / "results", dir / "no.ply")).err, Contains("--video"));
}

TEST_CASE("fuse makes a cloud of the depth in ViPE's results", "[vipe]") {
  const TempDir dir;
  write_results(dir / "results");
  const auto fuse = [&](const Words& more) {
    return densify(joined({"fuse", (dir / "results/depth").string(), (dir / "results").string(), "-o",
                           (dir / "c.ply").string(), "--stats", (dir / "s.json").string()},
                          more));
  };
  require_ok(fuse({"--depth-scale", "2.5"}));
  CHECK(Json::parse(read_text(dir / "s.json"))["external_depths"]["maps"].size() == 5);
  CHECK(pmsp::read_ply(dir / "c.ply").positions.size() > 1000);
  require_ok(fuse({"--depth-scale", "auto", "--force"}));
  const Json stats = Json::parse(read_text(dir / "s.json"));
  for (const Json& map : stats["external_depths"]["maps"]) {
    CHECK(map["scale"].get<double>() == Approx(2.5).epsilon(0.03));
  }
  CHECK_THAT(fuse({"--force"}).err, Contains("--depth-scale 2.5"));
}

TEST_CASE("info reads the results of ViPE", "[vipe]") {
  const TempDir dir;
  write_results(dir / "results");
  const Json info = Json::parse(require_ok(densify({"info", (dir / "results").string(), "--json"})).out);
  CHECK(info["format"] == "ViPE");
  CHECK(info["keyframes"] == 5);
  CHECK(info["images"]["found"].get<int>() == 5);
}
