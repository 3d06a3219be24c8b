// SPDX-License-Identifier: BSD-2-Clause
// Pairing check with realistic images and with wrong ones of all kinds.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <iterator>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "drawn_scene.h"
#include "io/pairing.h"
#include "pmsp/camera.h"
#include "synth/mission.h"
#include "synth/rng.h"

using namespace pmsp;
using namespace pmsp::test;
using Catch::Matchers::Contains;
using Images = std::vector<Image<Rgb>>;
using Change = std::function<Image<Rgb>(const Image<Rgb>&)>;

namespace {

/// Eight keyframes of a drawn_flight through a room that turns as it goes.
std::vector<Shot> drawn_flight() {
  std::vector<Shot> shots;
  for (int i = 0; i < 8; ++i) shots.push_back({2 * i, 0.3 * i, 4 * i});
  return shots;
}

const Images& right_images() {
  static const Images images = [] {
    Images rendered;
    for (const Shot& shot : drawn_flight()) rendered.push_back(render_room(shot.frame));
    return rendered;
  }();
  return images;
}

PairingVerifier::Verdict verify(const SlamMap& map, const Images& images) {
  PairingVerifier verifier(map);
  for (std::size_t i = 0; i < images.size(); ++i) {
    verifier.add(map.keyframes[i].id, images[i].view());
    if (!verifier.verdict().belongs) break;  // as a run does
  }
  return verifier.verdict();
}

Images changed(const Images& images, const Change& change) {
  Images result;
  std::transform(images.begin(), images.end(), std::back_inserter(result), change);
  return result;
}

Image<Rgb> rearranged(const Image<Rgb>& image, const std::function<std::pair<int, int>(int, int)>& source) {
  Image<Rgb> result(image.width(), image.height());
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x) {
      const auto [from_x, from_y] = source(x, y);
      result(x, y) = image(from_x, from_y);
    }
  return result;
}

Image<Rgb> with_levels(const Image<Rgb>& image, const std::function<double(double level, std::uint64_t index)>& level) {
  Image<Rgb> result(image.width(), image.height());
  std::uint64_t index = 0;
  const auto change = [&](std::uint8_t value) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(level(value, index++), 0.0, 255.0)));
  };
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x) {
      const Rgb c = image(x, y);
      result(x, y).r = change(c.r);
      result(x, y).g = change(c.g);
      result(x, y).b = change(c.b);
    }
  return result;
}

/// Noise of a sensor, another one in each image.
Images noisy(const Images& images, double sigma, double contrast = 1.0, std::uint64_t seed = 1) {
  return changed(images, [&](const Image<Rgb>& image) {
    ++seed;
    return with_levels(image, [&](double level, std::uint64_t index) {
      return 128.0 + contrast * (level - 128.0) + sigma * synth::gaussian(seed, index);
    });
  });
}

Image<Rgb> blurred(const Image<Rgb>& image, double sigma) {
  Image<Rgb> result = image;
  cv::Mat mat(image.height(), image.width(), CV_8UC3, result.row(0));
  cv::GaussianBlur(mat, mat, cv::Size(), sigma);
  return result;
}

Images one_later(const Images& images) { return {images.begin() + 1, images.end()}; }

SlamMap map_of(const synth::Mission& mission) {
  SlamMap map;
  map.cameras.push_back({"camera", mission.width, mission.height, 10.0});
  for (const synth::SurfacePoint& point : mission.points) map.landmarks.push_back({point.id, point.position_world});
  for (const synth::Frame& frame : mission.frames) {
    MapKeyframe keyframe;
    keyframe.id = frame.id;
    keyframe.timestamp = frame.timestamp;
    keyframe.cam_from_world = frame.cam_from_world;
    for (const Landmark& landmark : frame.landmarks) {
      const Eigen::Vector3d in_camera =
          frame.cam_from_world * mission.points[static_cast<std::size_t>(landmark.id)].position_world;
      keyframe.observations.push_back(
          {landmark.id, pixel_from_bearing(in_camera, mission.width, mission.height).cast<float>()});
    }
    map.keyframes.push_back(keyframe);
  }
  return map;
}

Images images_of(const synth::Mission& mission) {
  Images images;
  for (const synth::Frame& frame : mission.frames) images.push_back(frame.image);
  return images;
}

/// A furnished hall, the way people take panoramas by hand: 1.6 m apart, at 4 to 5 m from what is around.
synth::Mission far_apart(const synth::TextureOptions& texture) {
  synth::Scene hall;
  hall.add(synth::Box{{0.0, 0.0, 4.0}, {4.5, 2.2, 8.0}, Eigen::Matrix3d::Identity()}, texture);
  for (int i = 0; i < 8; ++i) {
    const double side = i % 2 == 0 ? 1.0 : -1.0;
    const double height = 0.5 + 0.2 * i;
    hall.add(synth::Box{{side * (2.0 + 0.2 * i), 2.2 - height, -2.0 + 1.6 * i},
                        {0.4, height, 0.5},
                        Eigen::AngleAxisd(0.3 * i, Eigen::Vector3d::UnitY()).toRotationMatrix()},
             texture);
  }
  synth::Flight walk;
  walk.start = {0.2, 0.3, -2.5};
  walk.step = 1.6;
  walk.keyframes = 8;
  walk.sway = 0.4;
  walk.wobble_deg = 8.0;
  synth::MissionOptions options;
  options.render.samples = 1;
  options.render.noise_sigma = 2.0;
  options.landmarks.min_views = 2;
  options.landmarks.count = 600;
  return synth::make_mission(hall, synth::fly(walk), 640, 320, options);
}

}  // namespace

TEST_CASE("Images taken far apart are accepted with any texture") {
  const synth::TextureOptions texture = GENERATE(synth::textured(1), synth::weak(2));
  const synth::Mission mission = far_apart(texture);
  const SlamMap map = map_of(mission);
  const auto right = verify(map, images_of(mission));
  INFO(right.message);
  CHECK(right.conclusive);
  CHECK(right.belongs);
  CHECK_FALSE(right.doubtful);
  CHECK(right.likeness < 0.6);  // which alone would not say so

  const auto wrong = verify(map, one_later(images_of(mission)));
  INFO(wrong.message);
  CHECK_FALSE(wrong.belongs);
  CHECK_THAT(wrong.message, Contains("paired with the next keyframe"));
}

TEST_CASE("Wrong images are refused and a better pairing is named") {
  const auto mirrored = [](const Image<Rgb>& image) {
    return rearranged(image, [&](int x, int y) { return std::pair(image.width() - 1 - x, y); });
  };
  const auto flipped = [](const Image<Rgb>& image) {
    return rearranged(image, [&](int x, int y) { return std::pair(x, image.height() - 1 - y); });
  };
  const auto turned = [](const Image<Rgb>& image) {
    return rearranged(image, [&](int x, int y) { return std::pair((x + image.width() / 2) % image.width(), y); });
  };
  Images reversed = right_images();
  std::reverse(reversed.begin(), reversed.end());
  Images earlier = right_images();
  earlier.insert(earlier.begin(), render_room(-4));
  earlier.pop_back();
  struct Wrong {
    const char* name;
    Images images;
  };
  const Wrong wrong[] = {{"mirrored", changed(right_images(), mirrored)},
                         {"flipped top to bottom", changed(right_images(), flipped)},
                         {"turned upside down", changed(changed(right_images(), mirrored), flipped)},
                         {"turned by half a turn", changed(right_images(), turned)},
                         {"in reverse order", reversed},
                         {"paired with the next keyframe", one_later(right_images())},
                         {"paired with the previous keyframe", earlier}};
  for (const double sigma : {0.0, 20.0})
    for (const Wrong& it : wrong) {
      const auto verdict = verify(room_map(drawn_flight()), sigma > 0.0 ? noisy(it.images, sigma) : it.images);
      INFO(it.name << ", noise " << sigma << ": " << verdict.message);
      CHECK(verdict.conclusive);
      CHECK_FALSE(verdict.belongs);
      CHECK_THAT(verdict.message, Contains(it.name) && Contains("by chance") && Contains("--no-verify"));
    }
}

TEST_CASE("Images of another place are refused") {
  const auto verdict = verify(room_map(drawn_flight()), images_of(far_apart(synth::textured(3))));
  INFO(verdict.message);
  CHECK_FALSE(verdict.belongs);
}

TEST_CASE("Degraded images are accepted") {
  const SlamMap map = room_map(drawn_flight());
  const Images& right = right_images();
  struct Poor {
    const char* name;
    Images images;
  };
  const Poor poor[] = {
      {"noise", noisy(right, 30.0)},
      {"noise on little contrast", noisy(right, 4.0, 0.1)},
      {"blur", changed(right, [](const Image<Rgb>& image) { return blurred(image, 3.0); })},
      {"dark",
       changed(right, [](const Image<Rgb>& i) { return with_levels(i, [](double v, auto) { return v / 12; }); })},
      {"overexposed",
       changed(right, [](const Image<Rgb>& i) { return with_levels(i, [](double v, auto) { return 3 * v; }); })},
      {"one brighter than the other", changed(right, [k = 0](const Image<Rgb>& i) mutable {
         return with_levels(i, [k = ++k](double v, auto) { return v * (k % 2 ? 1.0 : 0.5); });
       })}};
  for (const Poor& it : poor) {
    const auto verdict = verify(map, it.images);
    INFO(it.name << ": " << verdict.message);
    CHECK(verdict.conclusive);
    CHECK(verdict.belongs);
    CHECK_FALSE(verdict.doubtful);
  }
}

TEST_CASE("With a repetitive texture right images are accepted and wrong ones refused") {
  Images right;
  for (const Shot& shot : drawn_flight()) right.push_back(render_room(shot.frame, kRoomWidth, 0.6));
  const auto verdict = verify(room_map(drawn_flight()), right);
  INFO(verdict.message);
  CHECK(verdict.conclusive);
  CHECK(verdict.belongs);
  CHECK_FALSE(verdict.doubtful);
  const auto wrong = verify(room_map(drawn_flight()), one_later(right));
  INFO(wrong.message);
  CHECK_FALSE(wrong.belongs);
}

TEST_CASE("Under heavy noise right images give a warning and uniform ones are refused") {
  const SlamMap map = room_map(drawn_flight());
  const auto much = verify(map, noisy(right_images(), 120.0));
  INFO(much.message);
  CHECK(much.belongs);
  CHECK(much.doubtful);
  CHECK_THAT(much.message, Contains("noise"));
  const auto nothing = verify(map, noisy(right_images(), 60.0, 0.0));
  INFO(nothing.message);
  CHECK_FALSE(nothing.belongs);
}

TEST_CASE("Right images are not refused under any noise") {
  const SlamMap map = room_map(drawn_flight());
  for (std::uint64_t seed = 0; seed < 16; ++seed) {
    const double sigma = 8.0 * static_cast<double>(seed);
    const auto verdict = verify(map, noisy(right_images(), sigma, 1.0, 1000 * seed));
    INFO("noise " << sigma << ": " << verdict.message);
    CHECK(verdict.belongs);
  }
}
