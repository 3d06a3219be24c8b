// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <initializer_list>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "drawn_scene.h"
#include "pmsp/error.h"
#include "pmsp/io/mask.h"

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

TEST_CASE("A mask of the images' size is taken as it is") {
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

TEST_CASE("Enlarging a mask ignores all that an ignored pixel touches") {
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

TEST_CASE("Masks that cannot be meant are refused") {
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

TEST_CASE("A photo or a depth map is no mask, soft edges and JPEG are none the less") {
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

TEST_CASE("A folder holds a mask for each image, under COLMAP's names or with another ending") {
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
  CHECK(source.count({images / "1.jpg", images / "2.jpg", images / "left/3.jpg"}) == 2);
  CHECK_THROWS_WITH(source.count({images / "2.jpg"}), Contains("2.jpg.png") && Contains("2.png"));
  CHECK(MaskSource({images.path(), images.path(), 0.0}).file_for(images / "1.png").empty());
}

TEST_CASE("A cap at the nadir is ignored, alone and with a mask") {
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
  CHECK_THROWS_AS(MaskSource({folder / "missing.png", {}, 0.0}), IoError);
}

TEST_CASE("Rectangles of the SLAM's configuration are ignored, however they are written") {
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
