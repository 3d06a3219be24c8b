// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <vector>

#include "core/helpers.h"
#include "elementary.h"
#include "pmsp/error.h"
#include "pmsp/stages.h"
#include "view_filter/sharpness.h"
#include "view_filter/view_chain.h"

using namespace pmsp;
using namespace pmsp::test;
using Eigen::Vector3d;

namespace {

constexpr double kRadians = kernels::kPi / 180.0;

/// Seen from (-1, 0, 0) and (1, 0, 0) under `parallax_deg`.
Landmark landmark(std::int64_t id, double parallax_deg) {
  return {id, Vector3d(0.0, 0.0, 1.0 / std::tan(0.5 * parallax_deg * kRadians))};
}

const Vector3d kLeft(-1.0, 0.0, 0.0);
const Vector3d kRight(1.0, 0.0, 0.0);

Keyframe keyframe(std::int64_t id, const Vector3d& center, const std::vector<Landmark>& landmarks) {
  Keyframe result;
  result.id = id;
  result.cam_from_world.rotation << 0, 0, -1, 0, 1, 0, 1, 0, 0;  // the camera's rotation must have no effect
  result.cam_from_world.translation = -(result.cam_from_world.rotation * center);
  result.landmarks = landmarks;
  return result;
}

/// Whether the second of two keyframes is accepted that see `good` landmarks under 20 degrees and `bad` ones under 2.
bool accepts(int good, int bad, const ViewFilterOptions& options = {}) {
  std::vector<Landmark> landmarks;
  for (int i = 0; i < good; ++i) landmarks.push_back(landmark(i, 20.0));
  for (int i = 0; i < bad; ++i) landmarks.push_back(landmark(100 + i, 2.0));
  ViewFilter filter(options);
  REQUIRE(filter.accept(keyframe(0, kLeft, landmarks)));
  return filter.accept(keyframe(1, kRight, landmarks));
}

bool accepts_parallax(double degrees) {
  ViewFilter filter{ViewFilterOptions{}};
  REQUIRE(filter.accept(keyframe(0, kLeft, {landmark(1, degrees)})));
  return filter.accept(keyframe(1, kRight, {landmark(1, degrees)}));
}

/// Along rows, as a turning camera does.
Image<Rgb> blurred(const Image<Rgb>& image, int length) {
  Image<Rgb> result(image.width(), image.height());
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      int sum[3] = {};
      for (int k = 0; k < length; ++k) {
        const Rgb& pixel = image((x + k) % image.width(), y);
        sum[0] += pixel.r;
        sum[1] += pixel.g;
        sum[2] += pixel.b;
      }
      const auto mean = [&](int i) { return static_cast<std::uint8_t>(sum[i] / length); };
      result(x, y) = {mean(0), mean(1), mean(2)};
    }
  }
  return result;
}

/// The same scene darker and with less contrast.
Image<Rgb> faded(Image<Rgb> image) {
  for (Rgb& pixel : image.pixels()) {
    const auto fade = [](std::uint8_t value) { return static_cast<std::uint8_t>(20 + value * 2 / 5); };
    pixel = {fade(pixel.r), fade(pixel.g), fade(pixel.b)};
  }
  return image;
}

constexpr int kFlightWidth = 512;
const synth::Mission& flight() {
  static const synth::Mission kFlight = synth::textured_room(small_recipe(kFlightWidth, 7));
  return kFlight;
}

ViewFilterOptions strict() {
  ViewFilterOptions options;
  options.min_sharpness = 0.7;
  return options;
}

using Change = std::function<Image<Rgb>(const Image<Rgb>&)>;
Change motion(int length) {
  return [length](const Image<Rgb>& image) { return blurred(image, length); };
}

/// Whether keyframe i is left out as blurred when it is changed.
std::vector<bool> found_blurred(const Change& change, const std::vector<std::size_t>& changed,
                                const ViewFilterOptions& options = strict(), int width = 0) {
  ViewFilter filter(options, width);
  std::vector<bool> result;
  for (std::size_t i = 0; i < flight().frames.size(); ++i) {
    Keyframe frame = synth::keyframe_of(flight(), i);
    Image<Rgb> image = flight().frames[i].image;
    if (std::count(changed.begin(), changed.end(), i) > 0) image = change(image);
    frame.image = image.view();
    const bool accepted = filter.accept(frame);
    result.push_back(filter.blurred());
    CHECK(accepted != filter.blurred());
  }
  return result;
}

std::vector<bool> only(const std::vector<std::size_t>& indices) {
  std::vector<bool> result(flight().frames.size(), false);
  for (const std::size_t i : indices) result[i] = true;
  return result;
}

}  // namespace

TEST_CASE("a blurred keyframe is skipped and sharp ones before and after are not",
          "[view_filter][blur]" PMSP_ACCURACY) {
  CHECK(found_blurred(motion(4), {3}) == only({3}));
  CHECK(found_blurred(motion(12), {2, 5}) == only({2, 5}));
  CHECK(found_blurred(motion(12), {}) == only({}));
}

TEST_CASE("by default little blur is tolerated", "[view_filter][blur]" PMSP_ACCURACY) {
  CHECK(found_blurred(motion(2), {3}, {}) == only({}));
  CHECK(found_blurred(motion(8), {3}, {}) == only({3}));
}

TEST_CASE("brightness and contrast are no blur", "[view_filter][blur]" PMSP_ACCURACY) {
  CHECK(found_blurred(faded, {1, 4}) == only({}));
  CHECK(found_blurred([](const Image<Rgb>& image) { return faded(blurred(image, 6)); }, {4}) == only({4}));
}

TEST_CASE("blur is measured in pixels of the depth map", "[view_filter][blur]" PMSP_ACCURACY) {
  CHECK(found_blurred(motion(3), {3}) == only({3}));
  CHECK(found_blurred(motion(3), {3}, strict(), kFlightWidth / 4) == only({}));
  CHECK(found_blurred(motion(16), {3}, strict(), kFlightWidth / 4) == only({3}));
}

TEST_CASE("a blurred keyframe is kept instead of a gap", "[view_filter][blur]" PMSP_ACCURACY) {
  // All are blurred from the third on: the rest must continue from the newest accepted one.
  const std::vector<bool> found = found_blurred(motion(8), {2, 3, 4, 5, 6});
  CHECK(found[2]);
  CHECK(std::count(found.begin(), found.end(), true) < 4);
  ViewFilterOptions narrow = strict();
  narrow.max_parallax_deg = 16.0;  // a quarter of it has passed with each keyframe
  narrow.min_share = 0.0;
  CHECK(found_blurred(motion(12), {3}, narrow) == only({}));
}

TEST_CASE("blur detection can be disabled", "[view_filter][blur]") {
  ViewFilterOptions off;
  off.min_sharpness = 0.0;
  CHECK(found_blurred(motion(20), {3}, off) == only({}));
}

TEST_CASE("after a reset keyframes are compared with later ones only", "[view_filter][blur]" PMSP_ACCURACY) {
  ViewFilter filter(strict());
  const auto accepts = [&](std::size_t i, const Change& change) {
    Keyframe frame = synth::keyframe_of(flight(), i);
    const Image<Rgb> image = change(flight().frames[i].image);
    frame.image = image.view();
    return filter.accept(frame);
  };
  for (std::size_t i = 0; i < 3; ++i) CHECK(accepts(i, motion(1)));
  filter.reset();
  for (std::size_t i = 0; i < 5; ++i) CHECK(accepts(i, motion(8)));  // sharp keyframes before the reset do not count
}

TEST_CASE("blur is not estimated from fewer than twenty common landmarks", "[view_filter][blur]") {
  std::vector<LandmarkSharpness> sharp;
  std::vector<LandmarkSharpness> blurred;
  for (std::int64_t id = 0; id < 19; ++id) {
    sharp.push_back({id, 1.0F, 1.0F});
    blurred.push_back({id, 0.25F, 0.5F});
  }
  sharp.push_back({19, 1.0F, 1.0F});
  blurred.push_back({20, 0.25F, 0.5F});
  CHECK(relative_sharpness(blurred, sharp) == 1.0);
  blurred.back().id = 19;
  CHECK(relative_sharpness(blurred, sharp) == Approx(0.25).epsilon(1e-4));
}

TEST_CASE("sharpness is compared with that of the three keyframes before", "[view_filter][blur]") {
  const auto of_all = [](float factor) {
    std::vector<LandmarkSharpness> sharpness;
    for (std::int64_t id = 0; id < 30; ++id) sharpness.push_back({id, factor, factor});
    return sharpness;
  };
  ViewChain chain(strict());
  for (int i = 0; i < 5; ++i) chain.add_sharpness(of_all(1.0F));
  CHECK(chain.is_blurred(of_all(0.4F)));
  chain.add_sharpness(of_all(0.4F));  // one of three is as it is
  CHECK(chain.is_blurred(of_all(0.4F)));
  chain.add_sharpness(of_all(0.4F));  // two of three
  CHECK_FALSE(chain.is_blurred(of_all(0.4F)));
}

TEST_CASE("common_parallax counts common landmarks and gives their angles", "[view_filter]") {
  const std::vector<Landmark> a = {landmark(5, 10.0), landmark(1, 70.0), landmark(3, 30.0), landmark(8, 20.0)};
  const std::vector<Landmark> b = {landmark(1, 70.0), landmark(9, 20.0), landmark(5, 10.0), landmark(3, 30.0)};
  const CommonParallax common = common_parallax(a, kLeft, b, kRight, 6.0, 60.0);
  CHECK(common.landmarks == 3);
  CHECK(common.in_range == 2);
  CHECK(common.median_deg == Approx(30.0).margin(0.01));
  const CommonParallax swapped = common_parallax(b, kRight, a, kLeft, 6.0, 60.0);
  CHECK(swapped.landmarks == 3);
  CHECK(swapped.in_range == 2);
  CHECK(swapped.median_deg == Approx(common.median_deg));
}

TEST_CASE("common_parallax measures any angle", "[view_filter]") {
  for (const double degrees : {0.05, 1.0, 6.0, 45.0, 90.0, 135.0, 179.0}) {
    INFO(degrees);
    const std::vector<Landmark> one = {landmark(1, degrees)};
    CHECK(common_parallax(one, kLeft, one, kRight, 0.0, 180.0).median_deg == Approx(degrees).margin(0.005));
  }
  const std::vector<Landmark> one = {landmark(1, 10.0)};
  CHECK(common_parallax(one, kLeft, one, kLeft, 0.0, 180.0).median_deg == Approx(0.0).margin(0.005));
}

TEST_CASE("common_parallax is zero without common landmarks", "[view_filter]") {
  const CommonParallax common = common_parallax({landmark(1, 10.0)}, kLeft, {landmark(2, 10.0)}, kRight, 0.0, 180.0);
  CHECK(common.landmarks == 0);
  CHECK(common.in_range == 0);
  CHECK(common.median_deg == 0.0);
  CHECK(common_parallax({}, kLeft, {}, kRight, 0.0, 180.0).landmarks == 0);
}

TEST_CASE("the first keyframe and keyframes without common landmarks are accepted", "[view_filter]") {
  ViewFilter filter{ViewFilterOptions{}};
  CHECK(filter.accept(keyframe(0, kLeft, {})));
  CHECK(filter.accept(keyframe(1, kRight, {landmark(1, 20.0)})));
  CHECK_FALSE(filter.accept(keyframe(2, kRight, {})));
  CHECK(filter.accept(keyframe(3, kLeft, {landmark(2, 20.0)})));  // tracking was lost and found
  CHECK_FALSE(filter.accept(keyframe(4, kLeft, {landmark(2, 20.0)})));
  filter.reset();
  CHECK(filter.accept(keyframe(5, kLeft, {landmark(2, 20.0)})));
}

TEST_CASE("the landmarks used for blur do not depend on their order", "[view_filter][blur]") {
  synth::Recipe recipe = small_recipe(256, 1);
  recipe.mission.landmarks.count = 1500;
  const synth::Mission mission = synth::textured_room(recipe);
  Keyframe frame = synth::keyframe_of(mission, 0);
  for (std::size_t i = 0; i < frame.landmarks.size(); ++i) {
    frame.landmarks[i].id = static_cast<std::int64_t>(i) << 32;  // as where the upper half numbers the maps
  }
  REQUIRE(frame.landmarks.size() > 500);
  const auto ids = [&] {
    std::vector<std::int64_t> result;
    for (const LandmarkSharpness& sharpness : landmark_sharpness(frame, 256)) result.push_back(sharpness.id);
    return result;
  };
  const std::vector<std::int64_t> before = ids();
  CHECK(before.size() > 150);
  std::reverse(frame.landmarks.begin(), frame.landmarks.end());
  CHECK(ids() == before);
}

TEST_CASE("the share of landmarks with useful parallax decides including its limit", "[view_filter]") {
  CHECK(accepts(3, 17));
  CHECK_FALSE(accepts(14, 86));
  CHECK(accepts(15, 85));
  CHECK_FALSE(accepts(0, 10));
  ViewFilterOptions all;
  all.min_share = 1.0;
  CHECK(accepts(10, 0, all));
  CHECK_FALSE(accepts(99, 1, all));
}

TEST_CASE("parallax counts between 6 and 60 degrees", "[view_filter]") {
  CHECK_FALSE(accepts_parallax(5.98));
  CHECK(accepts_parallax(6.02));
  CHECK(accepts_parallax(59.98));
  CHECK_FALSE(accepts_parallax(60.02));
}

TEST_CASE("keyframes are compared with the newest accepted one and not with a rejected one", "[view_filter]") {
  ViewFilter filter{ViewFilterOptions{}};
  const std::vector<Landmark> far = {{1, Vector3d(0.0, 0.0, 10.0)}};
  REQUIRE(filter.accept(keyframe(0, Vector3d(0.0, 0.0, 0.0), far)));
  CHECK_FALSE(filter.accept(keyframe(1, Vector3d(0.7, 0.0, 0.0), far)));  // 4 degrees
  CHECK(filter.accept(keyframe(2, Vector3d(1.4, 0.0, 0.0), far)));        // 8 degrees from the first
  CHECK_FALSE(filter.accept(keyframe(3, Vector3d(2.1, 0.0, 0.0), far)));  // 12 from the first, 4 from the newest
}

TEST_CASE("a disabled view filter accepts all", "[view_filter]") {
  ViewFilterOptions options;
  options.enabled = false;
  CHECK(accepts(0, 10, options));
  ViewFilter filter(options);
  CHECK(filter.accept(keyframe(0, kLeft, {})));
  CHECK(filter.accept(keyframe(1, kLeft, {})));
}

TEST_CASE("a view filter refuses invalid options", "[view_filter]") {
  ViewFilterOptions options;
  options.min_share = 1.5;
  CHECK_THROWS_AS(ViewFilter(options), InvalidOption);
}
