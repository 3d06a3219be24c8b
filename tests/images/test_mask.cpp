// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "pmsp/error.h"
#include "scene.h"

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
