// SPDX-License-Identifier: BSD-2-Clause
#include <fstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "cli/command.h"
#include "pmsp/io/densify.h"

using namespace pmsp_test;
using Catch::Contains;

namespace fs = std::filesystem;

namespace {

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

/// Mask of the mission's image size, 8 bits, 0 = ignore.
cv::Mat mission_mask() { return cv::imread((mission() / "mask.png").string(), cv::IMREAD_GRAYSCALE); }

/// A copy of the mission, to whose image directory a test may add files.
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

TEST_CASE("each run reports the masked share", "[masks]") {
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

TEST_CASE("masks that hide nothing or nearly everything give a warning", "[masks]") {
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

TEST_CASE("masks beside the images are used and reported", "[masks]") {
  const TempDir dir;
  copy_mission(dir / "mission");
  fs::create_directory(dir / "mission/masks");
  const auto numbered = [](int i, const char* end) { return "00000" + std::to_string(i) + end; };
  for (int i = 0; i < 3; ++i) fs::copy(mission() / "mask.png", dir / "mission/masks" / numbered(i, ".png.png"));
  for (int i = 3; i < 5; ++i) fs::copy(mission() / "mask.png", dir / "mission/images" / numbered(i, "_mask.png"));
  const Masked found = copied_run(dir);
  CHECK_THAT(found.result.err, Contains("5 of 5 keyframes") &&
                                   Contains("3 of 5 images have one in the directory masks") &&
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

namespace {

/// A room with a rider fixed to the camera.
const fs::path& with_rider() {
  static const TempDir dir;
  static const fs::path folder =
      made_mission(dir, {"--keyframes", "10", "--width", "512", "--samples", "1", "--rider"});
  return folder;
}

Words rider_run(const fs::path& cloud, const Words& more = {}) {
  Words words{"run",
              (with_rider() / "map.msg").string(),
              "--images",
              (with_rider() / "images").string(),
              "--width",
              "64",
              "--patchmatch-geometric-passes",
              "0",
              "--backend",
              "cpu",
              "-o",
              cloud.string()};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

std::string points_in(const fs::path& ply) {
  const std::string text = read_text(ply);
  return text.substr(text.find("end_header"));
}

}  // namespace

TEST_CASE("the library hides the rig for one call and keeps the caller's masks") {
  const pmsp::SlamMap map = pmsp::read_map(with_rider() / "map.msg");
  pmsp::MaskSource masks({});
  const auto pixels = [&](bool find_rig) {
    const auto images = pmsp::open_image_folder(map, with_rider() / "images");
    pmsp::DensifierOptions options = pmsp::preset(pmsp::Quality::kOnline);
    options.width = 64;
    options.height = 32;
    options.advanced.patchmatch.geometric_passes = 0;
    pmsp::DensifyExtras extras;
    extras.masks = &masks;
    extras.calibrate.rig = find_rig;
    return pmsp::densify(map, *images, options, pmsp::DensifierCallbacks(), extras).pixels;
  };
  const auto all = pixels(false), without_rider = pixels(true);
  CHECK(without_rider < all);
  CHECK(pixels(true) == without_rider);
  pmsp::Image<std::uint8_t> own(512, 256, 255);
  std::fill_n(own.row(0), own.size() / 4, std::uint8_t{0});
  masks.set_rig(own);
  const auto without_own = pixels(false);
  CHECK(without_own < all);
  CHECK(pixels(true) < without_own);
  CHECK(masks.set_rig({}).pixels() == own.pixels());
}

TEST_CASE("the rig is detected and masked and written as a mask") {
  const TempDir dir;
  const Result found = densify(rider_run(dir / "a.ply", {"--stats", (dir / "s.json").string()}));
  INFO(found.err);
  REQUIRE(found.code == 0);
  CHECK_THAT(found.err, Contains("rig: ") && Contains("--mask none"));
  const auto stats = nlohmann::json::parse(read_text(dir / "s.json"));
  CHECK(stats["rig"]["hidden"].get<double>() > 0.05);
  const fs::path png = dir / "a.ply.rig-mask.png";
  const cv::Mat mask = cv::imread(png.string(), cv::IMREAD_UNCHANGED);
  REQUIRE(mask.cols == 512);

  SECTION("passed as a mask it gives the same points") {
    REQUIRE(densify(rider_run(dir / "b.ply", {"--mask", png.string()})).code == 0);
    CHECK(points_in(dir / "b.ply") == points_in(dir / "a.ply"));
    CHECK_FALSE(fs::exists(dir / "b.ply.rig-mask.png"));
  }
  SECTION("without masks all pixels are used") {
    const Result none = densify(rider_run(dir / "b.ply", {"--mask", "none"}));
    CHECK(none.code == 0);
    CHECK_THAT(none.err, !Contains("rig: "));
    CHECK_FALSE(fs::exists(dir / "b.ply.rig-mask.png"));
    CHECK(points_in(dir / "b.ply") != points_in(dir / "a.ply"));
  }
  SECTION("an edited mask is not overwritten") {
    write_text(png, "edited");
    fs::remove(dir / "a.ply");
    const Result again = densify(rider_run(dir / "a.ply"));
    CHECK(again.code == 0);
    CHECK_THAT(again.err, Contains("rig-mask.png") && Contains("--force"));
    CHECK(read_text(png) == "edited");
  }
  SECTION("a workspace stores it for shards and their merge") {
    const std::string kept = (dir / "kept").string();
    REQUIRE(densify(rider_run(dir / "b.ply", {"--workspace", kept})).code == 0);
    CHECK(points_in(dir / "b.ply") == points_in(dir / "a.ply"));
    const Result again = densify(rider_run(dir / "b.ply", {"--workspace", kept, "--force"}));
    INFO(again.err);
    CHECK(again.code == 0);
    CHECK_THAT(again.err, Contains("rig: "));
    CHECK(points_in(dir / "b.ply") == points_in(dir / "a.ply"));

    const std::string shared = (dir / "shared").string();
    for (const char* shard : {"0/2", "1/2"}) {
      Words words = rider_run("");
      words.resize(words.size() - 2);  // a shard writes no cloud
      words.insert(words.end(), {"--workspace", shared, "--shard", shard});
      const Result made = densify(words);
      INFO(made.err);
      REQUIRE(made.code == 0);
    }
    const Result merged = densify({"merge", shared, "-o", (dir / "c.ply").string()});
    INFO(merged.err);
    REQUIRE(merged.code == 0);
    CHECK(points_in(dir / "c.ply") == points_in(dir / "a.ply"));
  }
}
