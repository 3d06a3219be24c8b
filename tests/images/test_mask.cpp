// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "drawn_scene.h"
#include "elementary.h"
#include "pmsp/error.h"
#include "pmsp/io/images.h"

using namespace pmsp;
using namespace pmsp::test;
using Catch::Matchers::Contains;

namespace {

/// All 255 but for one ignored pixel.
cv::Mat mask_with_hole(int width, int height, int x, int y) {
  cv::Mat mask(height, width, CV_8UC1, cv::Scalar(255));
  mask.at<std::uint8_t>(y, x) = 0;
  return mask;
}

int count_ignored(const Image<std::uint8_t>& mask) {
  return static_cast<int>(std::count(mask.pixels().begin(), mask.pixels().end(), 0));
}

}  // namespace

TEST_CASE("A mask of the images' size is used unchanged") {
  TempDir folder;
  cv::imwrite((folder / "mask.png").string(), mask_with_hole(64, 32, 63, 0));
  const auto mask = read_mask(folder / "mask.png", 64, 32);
  REQUIRE(mask.width() == 64);
  REQUIRE(mask.height() == 32);
  CHECK(mask(63, 0) == 0);
  CHECK(count_ignored(mask) == 1);
}

TEST_CASE("Shrinking a mask never makes an ignored pixel usable") {
  TempDir folder;
  cv::imwrite((folder / "mask.png").string(), mask_with_hole(64, 32, 17, 9));
  const auto half = read_mask(folder / "mask.png", 32, 16);
  CHECK(half(8, 4) == 0);
  CHECK(count_ignored(half) == 1);
  // 64 to 20 columns: pixel 17 spans [17, 18) / 3.2 = [5.3, 5.6); 32 to 10 rows: 9 spans [2.8, 3.1), which touches two.
  const auto uneven = read_mask(folder / "mask.png", 20, 10);
  CHECK(uneven(5, 2) == 0);
  CHECK(uneven(5, 3) == 0);
  CHECK(count_ignored(uneven) == 2);
}

TEST_CASE("Enlarging a mask ignores all pixels that an ignored pixel touches") {
  TempDir folder;
  cv::imwrite((folder / "mask.png").string(), mask_with_hole(8, 4, 2, 1));
  const auto larger = read_mask(folder / "mask.png", 20, 10);  // pixel 2 spans [5, 7.5), row 1 [2.5, 5)
  CHECK(count_ignored(larger) == 3 * 3);
  CHECK(larger(5, 2) == 0);
  CHECK(larger(7, 4) == 0);
  CHECK(larger(8, 4) == 255);
  CHECK(larger(4, 2) == 255);
}

TEST_CASE("Any value but 0 means use, in colour and 16 bits too") {
  TempDir folder;
  cv::Mat deep(4, 8, CV_16UC1, cv::Scalar(1));
  deep.at<std::uint16_t>(0, 0) = 0;
  cv::imwrite((folder / "deep.png").string(), deep);
  CHECK(count_ignored(read_mask(folder / "deep.png", 8, 4)) == 1);
  cv::Mat colour(4, 8, CV_8UC3, cv::Scalar(1, 0, 0));
  colour.at<cv::Vec3b>(3, 7) = {0, 0, 0};
  cv::imwrite((folder / "colour.png").string(), colour);
  CHECK(count_ignored(read_mask(folder / "colour.png", 8, 4)) == 1);
}

TEST_CASE("Implausible masks are refused") {
  TempDir folder;
  CHECK_THROWS_AS(read_mask(folder / "missing.png", 64, 32), IoError);
  std::ofstream(folder / "text.png") << "no image";
  CHECK_THROWS_AS(read_mask(folder / "text.png", 64, 32), IoError);
  cv::imwrite((folder / "square.png").string(), cv::Mat(32, 32, CV_8UC1, cv::Scalar(255)));
  CHECK_THROWS_WITH(read_mask(folder / "square.png", 64, 32), Contains("square.png") && Contains("32x32"));
  cv::imwrite((folder / "black.png").string(), cv::Mat(32, 64, CV_8UC1, cv::Scalar(0)));
  CHECK_THROWS_AS(read_mask(folder / "black.png", 64, 32), InvalidInput);
  cv::imwrite((folder / "good.png").string(), mask_with_hole(64, 32, 0, 0));
  CHECK_THROWS_AS(read_mask(folder / "good.png", 0, 0), InvalidOption);
}

TEST_CASE("A photo or a depth map is no mask but soft edges and JPEG are accepted") {
  TempDir folder;
  write_image(folder / "photo.png", render_room(3));
  CHECK_THROWS_WITH(read_mask(folder / "photo.png", 64, 32), Contains("photo.png") && Contains("is no mask"));
  cv::Mat depth(160, 320, CV_16UC1);
  for (int i = 0; i < 160 * 320; ++i) depth.at<std::uint16_t>(i / 320, i % 320) = static_cast<std::uint16_t>(i);
  cv::imwrite((folder / "depth.png").string(), depth);
  CHECK_THROWS_WITH(read_mask(folder / "depth.png", 64, 32), Contains("is no mask"));

  cv::Mat soft = cv::Mat(160, 320, CV_8UC1, cv::Scalar(255));
  cv::circle(soft, {160, 80}, 40, cv::Scalar(0), -1, cv::LINE_AA);
  cv::GaussianBlur(soft, soft, {7, 7}, 2.0);
  for (const char* name : {"soft.png", "soft.jpg"}) {
    cv::imwrite((folder / name).string(), soft);
    CHECK(read_mask(folder / name, 320, 160)(160, 80) == 0);
  }
}

TEST_CASE("A directory holds a mask per image under COLMAP's names or another extension") {
  TempDir images;
  TempDir masks;
  std::filesystem::create_directories(images / "left");
  std::filesystem::create_directories(masks / "left");
  for (const char* name : {"1.jpg", "2.jpg", "left/3.jpg"}) std::ofstream(images / name) << "an image";
  cv::imwrite((masks / "1.jpg.png").string(), mask_with_hole(64, 32, 1, 0));
  cv::imwrite((masks / "left/3.png").string(), mask_with_hole(64, 32, 3, 0));
  MaskSource source({masks.path(), images.path(), 0.0});
  CHECK(source.is_folder());
  CHECK(source.mask_for(images / "1.jpg", 64, 32)(1, 0) == 0);
  CHECK(source.mask_for(images / "left/3.jpg", 64, 32)(3, 0) == 0);
  CHECK(source.mask_for(images / "left/3.jpg", 32, 16)(1, 0) == 0);  // in the image's size
  CHECK(source.mask_for(images / "2.jpg", 64, 32).empty());
  const MaskSummary summary = source.summarise({images / "1.jpg", images / "2.jpg", images / "left/3.jpg"}, 64, 32);
  CHECK(summary.in_folder == 2);
  CHECK(summary.images == 3);
  CHECK(summary.unmatched.empty());
  CHECK(source.summarise({images / "1.jpg"}, 64, 32).unmatched == std::vector{masks / "left/3.png"});
  CHECK_THROWS_WITH(source.summarise({images / "2.jpg"}, 64, 32), Contains("2.jpg.png") && Contains("2_mask.png"));
  CHECK(MaskSource({images.path(), images.path(), 0.0}).file_for(images / "1.png").empty());
}

TEST_CASE("A cap at the nadir is ignored alone and with a mask") {
  TempDir folder;
  cv::imwrite((folder / "mask.png").string(), mask_with_hole(64, 32, 5, 2));
  for (const auto& path : {std::filesystem::path(), folder / "mask.png"}) {
    MaskSource source({path, {}, 45.0});  // a quarter of the rows
    const auto mask = source.mask_for("any.jpg", 64, 32);
    CHECK(mask(0, 23) == 255);
    CHECK(mask(0, 24) == 0);
    CHECK(mask(63, 31) == 0);
    CHECK(mask(5, 2) == (path.empty() ? 255 : 0));
  }
  CHECK(MaskSource({}).mask_for("any.jpg", 64, 32).empty());
  CHECK_THROWS_AS(MaskSource({{}, {}, 91.0}), InvalidOption);
  CHECK_THROWS_AS(MaskSource({{}, {}, 0.0, -1.0}), InvalidOption);
  CHECK_THROWS_AS(MaskSource({folder / "missing.png", {}, 0.0}), IoError);
}

TEST_CASE("A cap at the zenith is ignored") {
  MaskSource source({{}, {}, 22.5, 45.0});
  const auto mask = source.mask_for("any.jpg", 64, 32);
  CHECK(mask(0, 7) == 0);
  CHECK(mask(63, 8) == 255);
  CHECK(mask(0, 27) == 255);
  CHECK(mask(0, 28) == 0);
  CHECK(
      MaskSource({{}, {}, 22.5, 45.0}).summarise({"any.jpg"}, 640, 320).hidden ==
      Approx(1.0 - 0.5 * (std::cos(45.0 / 180.0 * kernels::kPi) + std::cos(22.5 / 180.0 * kernels::kPi))).margin(1e-3));
}

TEST_CASE("The alpha channel of a mask decides where colours do not") {
  TempDir folder;
  const auto ignored_of = [&](const cv::Mat& image, const char* name) {
    cv::imwrite((folder / name).string(), image);
    return count_ignored(read_mask(folder / name, 64, 32));
  };
  const cv::Rect hole(4, 4, 3, 2);
  for (const char* name : {"white.png", "white.webp", "white.tif"}) {
    cv::Mat white(32, 64, CV_8UC4, cv::Scalar(255, 255, 255, 255));
    white(hole) = cv::Scalar(255, 255, 255, 0);
    CHECK(ignored_of(white, name) == 6);
  }
  cv::Mat black(32, 64, CV_8UC4, cv::Scalar(0, 0, 0, 255));
  black(hole) = cv::Scalar(0, 0, 0, 0);
  CHECK(ignored_of(black, "black.png") == 6);
  cv::Mat both(32, 64, CV_8UC4, cv::Scalar(255, 255, 255, 0));  // painted on a transparent layer
  both(hole) = cv::Scalar(0, 0, 0, 255);
  CHECK(ignored_of(both, "both.png") == 6);
  cv::Mat photo(32, 64, CV_8UC4);
  for (int i = 0; i < 64 * 32; ++i)
    photo.at<cv::Vec4b>(i / 64, i % 64) =
        cv::Vec4b(static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(i / 8), 0, 255);
  photo(hole).setTo(cv::Scalar(1, 2, 3, 0));
  CHECK(ignored_of(photo, "photo.png") == 6);
}

TEST_CASE("Black of a JPEG is ignored though it is not exactly 0") {
  TempDir folder;
  cv::Mat mask(32, 64, CV_8UC1, cv::Scalar(240));
  mask(cv::Rect(0, 16, 64, 16)) = cv::Scalar(9);
  cv::imwrite((folder / "mask.jpg").string(), mask);
  CHECK(count_ignored(read_mask(folder / "mask.jpg", 64, 32)) == 64 * 16);
}

TEST_CASE("Masks are found by the names that programs use") {
  TempDir images, masks;
  std::ofstream(images / "a1.JPG") << "an image";
  for (const char* name :
       {"a1_mask.png", "a1.mask.png", "a1.JPG.mask.png", "a1.jpg", "A1_MASK.PNG", "a1.tif", "a1.JPG.png"}) {
    TempDir one;
    cv::imwrite((one / "m.png").string(), mask_with_hole(64, 32, 1, 0));
    std::filesystem::copy(one / "m.png", one / name);
    std::filesystem::remove(one / "m.png");
    CHECK(MaskSource({one.path(), images.path()}).file_for(images / "a1.JPG") == one / name);
  }
  cv::imwrite((masks / "a1.png").string(), mask_with_hole(64, 32, 1, 0));
  CHECK(MaskSource({masks.path(), images.path().parent_path()}).file_for(images / "a1.JPG") == masks / "a1.png");
}

TEST_CASE("Masks beside the images are found unless disabled") {
  TempDir mission;
  const auto images = mission / "images";
  for (const char* name : {"images/left", "masks/left", "named"}) std::filesystem::create_directories(mission / name);
  std::map<std::filesystem::path, std::filesystem::path> named;
  for (const char* name : {"1.jpg", "2.jpg", "left/3.jpg", "4.jpg"}) std::ofstream(images / name) << "an image";
  for (const char* name : {"named/x.png", "masks/1.jpg.png", "masks/left/3.jpg.png", "images/2_mask.png"})
    cv::imwrite((mission / name).string(), mask_with_hole(64, 32, 1, 0));
  named[images / "1.jpg"] = mission / "named/x.png";
  named[images / "4.jpg"] = mission / "named/4.png";
  MaskOptions options{{}, images, 0.0, 0.0, true, named};
  MaskSource source(options);
  CHECK(source.file_for(images / "1.jpg") == mission / "named/x.png");
  CHECK(source.file_for(images / "2.jpg") == images / "2_mask.png");
  CHECK(source.file_for(images / "left/3.jpg") == std::filesystem::absolute(mission / "masks/left/3.jpg.png"));
  CHECK(source.file_for(images / "4.jpg").empty());
  const MaskSummary summary =
      source.summarise({images / "1.jpg", images / "2.jpg", images / "left/3.jpg", images / "4.jpg"}, 64, 32);
  CHECK(summary.named == 1);
  CHECK(summary.named_missing == 1);
  CHECK(summary.first_missing == mission / "named/4.png");
  CHECK(summary.in_masks == 1);
  CHECK(summary.beside == 1);
  CHECK(summary.looked_at == 3);
  CHECK(summary.hidden > 0.0);
  options.found = false;
  CHECK_FALSE(MaskSource(options).has_mask(images / "1.jpg"));
  options.found = true;
  cv::imwrite((mission / "all.png").string(), mask_with_hole(64, 32, 9, 9));
  options.path = mission / "all.png";
  CHECK(MaskSource(options).file_for(images / "1.jpg") == options.path);
}

TEST_CASE("Transparent pixels of an image are ignored in addition to a mask") {
  TempDir folder;
  cv::imwrite((folder / "mask.png").string(), mask_with_hole(64, 32, 5, 2));
  for (const char* name : {"1.png", "1.webp", "1.tif"}) {
    cv::Mat image(32, 64, CV_8UC4, cv::Scalar(10, 120, 200, 255));
    image(cv::Rect(0, 30, 64, 2)) = cv::Scalar(10, 120, 200, 0);
    cv::imwrite((folder / name).string(), image);
    MaskSource source({folder / "mask.png", folder.path()});
    const auto mask = source.mask_for(folder / name, 64, 32);
    CHECK(mask(0, 30) == 0);
    CHECK(mask(0, 29) == 255);
    CHECK(mask(5, 2) == 0);
    CHECK(source.summarise({folder / name}, 64, 32).with_alpha == 1);
    CHECK(MaskSource({{}, folder.path(), 0.0, 0.0, false}).mask_for(folder / name, 64, 32).empty());
    cv::imwrite((folder / name).string(), cv::Mat(32, 64, CV_8UC4, cv::Scalar(10, 120, 200, 255)));
    MaskSource opaque({{}, folder.path()});
    CHECK(opaque.mask_for(folder / name, 64, 32).empty());
    CHECK(opaque.summarise({folder / name}, 64, 32).with_alpha == 0);
  }
}

TEST_CASE("The masked share is measured by solid angle") {
  TempDir folder;
  cv::Mat mask(320, 640, CV_8UC1, cv::Scalar(0));
  mask(cv::Rect(0, 0, 640, 80)) = cv::Scalar(255);
  cv::imwrite((folder / "mask.png").string(), mask);
  const MaskSummary summary = MaskSource({folder / "mask.png", {}}).summarise({"1.jpg", "2.jpg"}, 640, 320);
  CHECK(summary.hidden == Approx(0.5 + 0.5 * std::sqrt(0.5)).margin(1e-3));
  CHECK(summary.hidden_by_files == Approx(summary.hidden));
  CHECK(summary.first == folder / "mask.png");
  cv::imwrite((folder / "red.png").string(), cv::Mat(320, 640, CV_8UC3, cv::Scalar(0, 0, 255)));
  MaskSource red({folder / "red.png", {}, 20.0});
  CHECK(red.summarise({"1.jpg"}, 640, 320).hidden_by_files == 0.0);
  CHECK(red.summarise({"1.jpg"}, 640, 320).colours == "100 % #ff0000");
}

TEST_CASE("Rectangles of the SLAM's configuration are ignored in any notation") {
  TempDir folder;
  for (const char* text :
       {"Camera:\n  name: x\nPreprocessing:\n  min_size: 800\n  mask_rectangles:\n"
        "    - [0.0, 1.0, 0.0, 0.1]  # the pole\n    - [0.5, 0.75, 0.5, 1.0]\nFeature:\n  a: 1\n",
        "Feature.mask_rectangles: [[0.0, 1.0, 0.0, 0.1], [0.5, 0.75, 0.5, 1.0]]\n",
        "Preprocessing: \n  mask_rectangles:\n  - [0, 1, 0, 0.1]\n  - [ .5 , 7.5e-1,\n    0.5, 1]"}) {
    std::ofstream(folder / "camera.yaml") << text;
    MaskSource source({folder / "camera.yaml", {}, 0.0});
    const auto mask = source.mask_for("any.jpg", 64, 32);
    CHECK(mask(0, 3) == 0);
    CHECK(mask(0, 4) == 255);
    CHECK(mask(32, 16) == 0);
    CHECK(mask(47, 31) == 0);
    CHECK(mask(48, 31) == 255);
    CHECK(mask(31, 31) == 255);
  }
  for (const char* text :
       {"", "Camera:\n  name: x\n", "mask_rectangles:\n", "mask_rectangles: [[0, 1, 0]]\n",
        "mask_rectangles: [[0, 1, 0, 1.5]]\n", "mask_rectangles: [[0.5, 0.2, 0, 1]]\n",
        "mask_rectangles: [[nan, 1, 0, 1]]\n", "mask_rectangles: none\n", "mask_rectangles: [[0, 1, 0, 1\n",
        "mask_rectangles: [0, 1, 0, 1, 2, 3, 4]\n", "mask_rectangles:\n  - 0.1\n"}) {
    INFO(text);
    std::ofstream(folder / "camera.yml") << text;
    CHECK_THROWS_WITH(MaskSource({folder / "camera.yml", {}, 0.0}), Contains("mask_rectangles: with lines such as"));
  }
}
