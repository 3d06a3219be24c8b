// SPDX-License-Identifier: BSD-2-Clause
#include <fstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "cli/command.h"

using namespace pmsp_test;
using Catch::Contains;

namespace fs = std::filesystem;

namespace {

using Words = std::vector<std::string>;

struct Masked {
  Result result;
  nlohmann::json mask;  ///< of --stats
};

/// A run with little work; `words`: besides.
Masked masked_run(const TempDir& dir, const Words& words) {
  Words all{"--force", "--stats", (dir / "s.json").string()};
  all.insert(all.end(), words.begin(), words.end());
  Masked run{densify(quick_run(dir / "c.ply", all)), {}};
  INFO(run.result.err);
  REQUIRE(run.result.code == 0);
  const auto stats = nlohmann::json::parse(read_text(dir / "s.json"));
  if (stats.contains("mask")) run.mask = stats["mask"];
  return run;
}

/// The mission's, of 8 bits, 0 = ignore.
cv::Mat mission_mask() { return cv::imread((mission() / "mask.png").string(), cv::IMREAD_GRAYSCALE); }

/// A copy of the mission in a folder, whose images a test may put something beside.
void copy_mission(const fs::path& folder) {
  fs::create_directories(folder / "images");
  fs::copy(mission() / "map.msg", folder / "map.msg");
  fs::copy(mission() / "images", folder / "images", fs::copy_options::recursive);
}

Masked copied_run(const TempDir& dir, const Words& words = {}) {
  Words all{"run",
            (dir / "mission/map.msg").string(),
            "--images",
            (dir / "mission/images").string(),
            "--width",
            "128",
            "--patchmatch-iterations",
            "1",
            "--force",
            "--stats",
            (dir / "s.json").string(),
            "-o",
            (dir / "c.ply").string()};
  all.insert(all.end(), words.begin(), words.end());
  Masked run{densify(all), {}};
  INFO(run.result.err);
  REQUIRE(run.result.code == 0);
  const auto stats = nlohmann::json::parse(read_text(dir / "s.json"));
  if (stats.contains("mask")) run.mask = stats["mask"];
  return run;
}

constexpr double kCap20 = 0.0302;  ///< share of the sphere that a cap of 20 degrees covers

}  // namespace

TEST_CASE("each run says what its masks hide", "[masks]") {
  const TempDir dir;
  const Masked one = masked_run(dir, {"--mask", (mission() / "mask.png").string()});
  CHECK(one.mask["hidden"].get<double>() == Approx(kCap20).margin(0.005));
  CHECK(one.mask["weighted_by"] == "solid angle");
  CHECK_THAT(one.result.err, Contains("masks: ") && Contains("masks:       ") && Contains("of the sphere is hidden") &&
                                 !Contains("hides nothing") && !Contains("masks hide"));
  const Masked caps = masked_run(dir, {"--mask-nadir", "20", "--mask-zenith", "20"});
  CHECK(caps.mask["hidden"].get<double>() == Approx(2 * kCap20).margin(0.01));
  CHECK_THAT(caps.result.err, Contains("a cap of 20 degrees at the zenith"));
  CHECK(densify(quick_run(dir / "d.ply", {"--mask-zenith", "100"})).code == 2);
  const Masked none = masked_run(dir, {});
  CHECK(none.mask.is_null());
  CHECK_THAT(none.result.err, !Contains("masks:"));
}

TEST_CASE("masks that hide nothing, or nearly everything, are warned of", "[masks]") {
  const TempDir dir;
  const cv::Mat good = mission_mask();
  const std::string mask = (dir / "mask.png").string();
  const auto said_of = [&](const cv::Mat& image) {
    cv::imwrite(mask, image);
    const Result info = densify(
        {"info", (mission() / "map.msg").string(), "--images", (mission() / "images").string(), "--mask", mask});
    INFO(info.err);
    CHECK(info.code == 0);
    return info.out + info.err;
  };

  CHECK_THAT(said_of(cv::Mat(good.size(), CV_8UC1, cv::Scalar(255))),
             Contains("hides nothing") && Contains("black (0) is ignored") && Contains("100 % gray 255"));

  cv::Mat red(good.size(), CV_8UC3, cv::Scalar(255, 255, 255));
  red.setTo(cv::Scalar(0, 0, 255), good == 0);
  CHECK_THAT(said_of(red), Contains("hides nothing") && Contains("% #ff0000"));

  cv::Mat most(good.size(), CV_8UC1, cv::Scalar(0));
  most.rowRange(good.rows / 2, good.rows * 3 / 4) = cv::Scalar(255);
  CHECK_THAT(said_of(most), Contains("black (0) is ignored, white (any other colour) is used") && Contains("invert") &&
                                Contains("64.6 % of the sphere is hidden"));

  cv::Mat alpha(good.size(), CV_8UC4, cv::Scalar(255, 255, 255, 255));
  alpha.setTo(cv::Scalar(255, 255, 255, 0), good == 0);
  CHECK_THAT(said_of(alpha), Contains("(its alpha channel); 2.9 % of the sphere is hidden") &&
                                 !Contains("hides nothing") && !Contains("masks hide"));
}

TEST_CASE("masks that come with the images are used, and said", "[masks]") {
  const TempDir dir;
  copy_mission(dir / "mission");
  fs::create_directory(dir / "mission/masks");
  const auto numbered = [](int i, const char* end) { return "00000" + std::to_string(i) + end; };
  for (int i = 0; i < 3; ++i) fs::copy(mission() / "mask.png", dir / "mission/masks" / numbered(i, ".png.png"));
  for (int i = 3; i < 5; ++i) fs::copy(mission() / "mask.png", dir / "mission/images" / numbered(i, "_mask.png"));
  const Masked found = copied_run(dir);
  CHECK_THAT(found.result.err, Contains("5 of 5 keyframes") && Contains("3 of 5 images have one in the folder masks") &&
                                   Contains("2 of 5 images have one beside them") && Contains("--no-masks"));
  CHECK(found.mask["with_file"] == 5);
  const std::string cloud = read_text(dir / "c.ply");
  copied_run(dir, {"--mask", (mission() / "mask.png").string()});
  const auto points = [](const std::string& ply) { return ply.substr(ply.find("end_header")); };
  CHECK((points(read_text(dir / "c.ply")) == points(cloud)));
  CHECK(copied_run(dir, {"--no-masks"}).mask.is_null());
  CHECK((points(read_text(dir / "c.ply")) != points(cloud)));

  for (int i = 0; i < 3; ++i)
    fs::rename(dir / "mission/masks" / numbered(i, ".png.png"), dir / "mission/masks" / numbered(i, "b.png"));
  CHECK_THAT(copied_run(dir).result.err, Contains("mission/masks are not used"));
}

TEST_CASE("transparent pixels of images are ignored", "[masks]") {
  const TempDir dir;
  copy_mission(dir / "mission");
  for (const auto& entry : fs::directory_iterator(dir / "mission/images")) {
    cv::Mat image = cv::imread(entry.path().string());
    std::vector<cv::Mat> channels;
    cv::split(image, channels);
    channels.push_back(mission_mask());
    cv::merge(channels, image);
    cv::imwrite(entry.path().string(), image);
  }
  const Masked found = copied_run(dir);
  CHECK_THAT(found.result.err, Contains("alpha channels of images"));
  CHECK(found.mask["hidden"].get<double>() == Approx(kCap20).margin(0.005));
  CHECK(found.mask["with_alpha"] == 5);
  CHECK(copied_run(dir, {"--no-masks"}).mask.is_null());
}

TEST_CASE("the masks of a dataset are used when it is read back", "[masks][outputs]") {
  const TempDir dir;
  const Result written = densify(quick_run(dir / "d.nerfstudio", {"--mask", (mission() / "mask.png").string()}));
  INFO(written.err);
  REQUIRE(written.code == 0);
  const Result back =
      densify({"run", (dir / "d.nerfstudio/transforms.json").string(), "--images", (dir / "d.nerfstudio").string(),
               "--width", "128", "--quality", "online", "--patchmatch-iterations", "1", "--stats",
               (dir / "s.json").string(), "-o", (dir / "back.ply").string()});
  INFO(back.err);
  REQUIRE(back.code == 0);
  CHECK_THAT(back.err, Contains("5 of 5 images have one that transforms.json names"));
  CHECK(nlohmann::json::parse(read_text(dir / "s.json"))["mask"]["hidden"].get<double>() ==
        Approx(kCap20).margin(0.005));

  fs::remove_all(dir / "d.nerfstudio/masks");
  const Result lost = densify({"run", (dir / "d.nerfstudio/transforms.json").string(), "--images",
                               (dir / "d.nerfstudio").string(), "--width", "128", "--quality", "online",
                               "--patchmatch-iterations", "1", "--force", "-o", (dir / "back.ply").string()});
  CHECK_THAT(lost.err, Contains("missing masks that transforms.json names: 5"));
}

TEST_CASE("shards and merge use the same masks as a run", "[masks][shards]") {
  const TempDir dir;
  copy_mission(dir / "mission");
  for (int i = 0; i < 5; ++i) {
    fs::copy(mission() / "mask.png", dir / "mission/images" / ("00000" + std::to_string(i) + "_mask.png"));
  }
  const Words words{"run",
                    (dir / "mission/map.msg").string(),
                    "--images",
                    (dir / "mission/images").string(),
                    "--width",
                    "128",
                    "--patchmatch-iterations",
                    "1",
                    "--mask-zenith",
                    "10",
                    "--workspace",
                    (dir / "w").string()};
  Words shard = words;
  shard.insert(shard.end(), {"--shard", "0/1"});
  const Result one = densify(shard);
  INFO(one.err);
  REQUIRE(one.code == 0);
  CHECK_THAT(one.err, Contains("5 of 5 images have one beside them") && Contains("at the zenith"));
  const Result merged = densify({"merge", (dir / "w").string(), "-o", (dir / "merged.ply").string()});
  INFO(merged.err);
  CHECK(merged.code == 0);
}
