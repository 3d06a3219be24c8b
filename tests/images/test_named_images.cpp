// SPDX-License-Identifier: BSD-2-Clause
// Images named by the map, at deviating paths, and with deviating sizes and data.
#include <catch2/catch.hpp>
#include <opencv2/imgcodecs.hpp>

#include "drawn_scene.h"
#include "pmsp/error.h"

using namespace pmsp;
using namespace pmsp::test;
using Catch::Matchers::Contains;

namespace {

namespace fs = std::filesystem;

SlamMap named_map(const std::vector<std::string>& names) {
  std::vector<Shot> shots;
  for (std::size_t i = 0; i < names.size(); ++i) {
    shots.push_back({static_cast<std::int64_t>(i), 0.1 * static_cast<double>(i), static_cast<int>(i)});
  }
  SlamMap map = bare_map(shots);
  for (std::size_t i = 0; i < names.size(); ++i) map.keyframes[i].image = names[i];
  return map;
}

void write_frames(const fs::path& folder, const std::vector<std::string>& names) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    fs::create_directories((folder / names[i]).parent_path());
    write_gray_frame(folder / names[i], static_cast<int>(i));
  }
}

}  // namespace

TEST_CASE("The longest existing suffix of a path is used") {
  const TempDir folder;
  write_frames(folder.path(), {"left/1.png", "2.png", "right/1.png", "c/3.png"});
  const auto source = open_image_folder(
      named_map({"data/left/1.png", "data/left/2.png", "data/right/1.png", "a/b/c/3.png"}), folder.path());
  CHECK(drain(*source).frames == std::vector<int>{0, 1, 2, 3});
  CHECK(open_image_folder(named_map({"left/1.png"}), folder / "left")->keyframe_ids().size() == 1);
}

TEST_CASE("An ambiguous file matches no name unless one matches exactly") {
  const TempDir folder;
  write_frames(folder.path(), {"1.png", "2.png"});
  ImageFolderOptions few;
  few.allow_missing = true;
  const auto source = open_image_folder(named_map({"left/1.png", "right/1.png", "x/2.png"}), folder.path(), few);
  CHECK(source->keyframe_ids() == std::vector<std::int64_t>{2});
  CHECK_THAT(skip_reason(*source, 0), Contains("could be the image of 2 keyframes") && Contains("left/1.png"));
  const auto whole = open_image_folder(named_map({"1.png", "right/1.png"}), folder.path());
  CHECK(whole->keyframe_ids() == std::vector<std::int64_t>{0});
}

TEST_CASE("Images of another extension are used if none of the names exists") {
  const TempDir folder;
  write_frames(folder.path(), {"a/1.jpg", "2.JPG"});
  CHECK(open_image_folder(named_map({"x/a/1.tif", "2.tif"}), folder.path())->keyframe_ids().size() == 2);
  CHECK(open_image_folder(named_map({"a/1", "x/2"}), folder.path())->keyframe_ids().size() == 2);
  write_frames(folder / "masks", {"5.jpg.png"});
  CHECK_THROWS_AS(open_image_folder(named_map({"5.jpg"}), folder / "masks"), InvalidInput);
  // A mask that is named as a missing image is no image.
  const auto source = open_image_folder(named_map({"a/1.jpg", "2.png"}), folder.path());
  CHECK(source->keyframe_ids() == std::vector<std::int64_t>{0});
  CHECK_THROWS_WITH(open_image_folder(named_map({"x/7.tif"}), folder.path()), Contains("none of the 1 images"));
}

TEST_CASE("Images of one row more or less are resized to full panoramas") {
  const TempDir folder;
  const std::vector<std::pair<int, int>> sizes{{64, 33}, {65, 32}, {64, 31}, {62, 31}, {63, 32}, {64, 32}, {130, 65}};
  std::vector<std::string> names;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    names.push_back(std::to_string(i) + ".png");
    cv::imwrite((folder / names.back()).string(),
                cv::Mat(sizes[i].second, sizes[i].first, CV_8UC3, cv::Scalar(3, 2, 1)));
  }
  const auto source = open_image_folder(named_map(names), folder.path());
  for (const auto& [width, height] : sizes) {
    CAPTURE(width, height);
    const auto item = source->next();
    REQUIRE(item);
    CHECK(item->image.width() == 2 * item->image.height());
    CHECK(item->image.height() % 2 == 0);
    CHECK(std::abs(item->image.height() - height) <= 1);
    CHECK(item->image(5, 5) == Rgb{1, 2, 3});
  }
}

TEST_CASE("A stale crop is ignored") {
  const TempDir folder;
  write_frames(folder.path(), {"1.jpg", "2.jpg"});
  const auto tag = [&](const fs::path& path, const std::string& size) {
    add_xmp(path, "<a GPano:FullPanoWidthPixels=\"5760\" GPano:FullPanoHeightPixels=\"2880\" " + size + "/>");
  };
  tag(folder / "1.jpg", "GPano:CroppedAreaImageWidthPixels=\"5760\" GPano:CroppedAreaImageHeightPixels=\"2300\"");
  tag(folder / "2.jpg", "GPano:CroppedAreaImageWidthPixels=\"64\" GPano:CroppedAreaImageHeightPixels=\"32\"");
  const auto source = open_image_folder(named_map({"1.jpg", "2.jpg"}), folder.path());
  CHECK(source->next());
  CHECK_THROWS_WITH(source->next(), Contains("is a part of a panorama"));
}
