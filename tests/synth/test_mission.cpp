// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "elementary.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "synth/mission.h"

using Eigen::Vector2d;
using Eigen::Vector3d;
using namespace pmsp;
using namespace pmsp::synth;

namespace {

Recipe small(int keyframes = 4) {
  Recipe recipe;
  recipe.width = 192;
  recipe.height = 96;
  recipe.keyframes = keyframes;
  recipe.mission.landmarks.count = 300;
  recipe.mission.render.samples = 1;
  return recipe;
}

const std::vector<std::pair<std::string, std::function<Mission(const Recipe&)>>>& all_missions() {
  static const std::vector<std::pair<std::string, std::function<Mission(const Recipe&)>>> kAll = {
      {"textured_room", textured_room},   {"empty_room", empty_room},
      {"sphere_inside", sphere_inside},   {"slanted_plane", slanted_plane},
      {"corridor", corridor_across_seam}, {"floor_at_nadir", floor_at_nadir},
      {"glossy_room", glossy_room},       {"thin_room", thin_room}};
  return kAll;
}

double parallax_deg(const Vector3d& point, const Vector3d& a, const Vector3d& b) {
  return std::acos((a - point).normalized().dot((b - point).normalized())) * 180.0 / kernels::kPi;
}

}  // namespace

TEST_CASE("every ready-made mission has truth in all pixels and landmarks where it claims them") {
  for (const auto& [name, make] : all_missions()) {
    INFO(name);
    const Mission mission = make(small());
    REQUIRE(mission.frames.size() == 4);
    CHECK(mission.points.size() == 300);
    for (std::size_t i = 0; i < mission.frames.size(); ++i) {
      const Frame& frame = mission.frames[i];
      CHECK(std::all_of(frame.depth.pixels().begin(), frame.depth.pixels().end(), [](float d) { return d > 0.2F; }));
      CHECK(frame.landmarks.size() > 100);
      for (const Landmark& landmark : frame.landmarks) {
        REQUIRE(landmark.position_world == mission.points[static_cast<std::size_t>(landmark.id)].position_world);
        const Vector3d in_camera = frame.cam_from_world * landmark.position_world;
        const auto hit = mission.scene.intersect(frame.cam_from_world.center(),
                                                 landmark.position_world - frame.cam_from_world.center());
        REQUIRE(hit);
        REQUIRE(hit->distance == Approx(in_camera.norm()).epsilon(1e-6));
      }
    }
  }
}

TEST_CASE("successive keyframes share enough landmarks with 6 to 60 degrees of parallax for the default view filter") {
  for (const auto& [name, make] : all_missions()) {
    INFO(name);
    const Mission mission = make(small());
    for (std::size_t i = 1; i < mission.frames.size(); ++i) {
      int shared = 0;
      int useful = 0;
      for (const Landmark& landmark : mission.frames[i].landmarks) {
        const auto& before = mission.frames[i - 1].landmarks;
        if (std::any_of(before.begin(), before.end(), [&](const Landmark& l) { return l.id == landmark.id; })) {
          const double angle = parallax_deg(landmark.position_world, mission.frames[i].cam_from_world.center(),
                                            mission.frames[i - 1].cam_from_world.center());
          ++shared;
          useful += angle >= 6.0 && angle <= 60.0 ? 1 : 0;
        }
      }
      CHECK(shared > 100);
      CHECK(useful > 0.25 * shared);
    }
  }
}

TEST_CASE("a surface point has the same colour in two views") {
  Recipe recipe = small(2);
  recipe.width = 512;
  recipe.height = 256;
  recipe.mission.render.samples = 2;
  const Mission mission = textured_room(recipe);
  const auto color_at = [&](const Frame& frame, const Vector3d& position) {
    const Vector2d pixel = pixel_from_bearing(frame.cam_from_world * position, mission.width, mission.height);
    const Rgb rgb = frame.image(std::min(static_cast<int>(pixel.x()), mission.width - 1),
                                std::min(static_cast<int>(pixel.y()), mission.height - 1));
    return Vector3d(rgb.r, rgb.g, rgb.b);
  };
  double same = 0.0;
  double other = 0.0;
  const std::size_t count = mission.points.size();
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3d color = color_at(mission.frames[0], mission.points[i].position_world);
    same += (color - color_at(mission.frames[1], mission.points[i].position_world)).norm();
    other += (color - color_at(mission.frames[1], mission.points[(i + 7) % count].position_world)).norm();
  }
  CHECK(same < 0.35 * other);
}

TEST_CASE("keyframe_of returns pointers into the mission") {
  Mission mission = empty_room(small());
  const Keyframe keyframe = keyframe_of(mission, 2);
  CHECK(keyframe.id == 2);
  CHECK(keyframe.timestamp == Approx(0.2));
  CHECK(keyframe.image.data == mission.frames[2].image.view().data);
  CHECK(keyframe.landmarks.size() == mission.frames[2].landmarks.size());
  CHECK(keyframe.mask.empty());
  mission.mask = Image<std::uint8_t>(mission.width, mission.height, 255);
  CHECK(keyframe_of(mission, 0).mask(3, 4) == 255);
}

TEST_CASE("a scaled mission is the same one in another unit") {
  const Mission mission = textured_room(small());
  const Mission large = scaled(mission, 100.0);
  for (std::size_t i = 0; i < mission.frames.size(); ++i) {
    const Frame& a = mission.frames[i];
    const Frame& b = large.frames[i];
    CHECK(a.image.pixels() == b.image.pixels());
    CHECK((100.0 * a.cam_from_world.center() - b.cam_from_world.center()).norm() < 1e-9);
    CHECK(b.depth(17, 40) == Approx(100.0 * a.depth(17, 40)).epsilon(1e-6));
    REQUIRE(a.landmarks.size() == b.landmarks.size());
    CHECK((100.0 * a.landmarks[5].position_world - b.landmarks[5].position_world).norm() < 1e-9);
    const RenderedView again = render(large.scene, b.cam_from_world, large.width, large.height, small().mission.render);
    CHECK(share_within(again.depth, b.depth, 1e-5) == 1.0);
  }
}

TEST_CASE("a turned mission shows the view of a turned camera") {
  const Mission mission = textured_room(small(3));
  for (const int columns : {mission.width / 4, mission.width / 2, -5}) {
    const Mission rolled = turned(mission, columns);
    const Frame& frame = rolled.frames[1];
    const RenderedView seen =
        render(rolled.scene, frame.cam_from_world, rolled.width, rolled.height, small().mission.render);
    CHECK(share_within(frame.depth, seen.depth, 1e-5) > 0.999);
    CHECK((frame.cam_from_world.center() - mission.frames[1].cam_from_world.center()).norm() < 1e-12);
    std::size_t same_color = 0;
    float worst_normal = 0.0F;
    for (std::size_t i = 0; i < seen.image.size(); ++i) {
      same_color += seen.image.pixels()[i] == frame.image.pixels()[i] ? 1U : 0U;
      if (seen.surface.pixels()[i] == frame.surface.pixels()[i]) {
        worst_normal = std::max(worst_normal, (seen.normal.pixels()[i] - frame.normal.pixels()[i]).norm());
      }
    }
    CHECK(static_cast<double>(same_color) > 0.999 * static_cast<double>(seen.image.size()));
    CHECK(worst_normal < 1e-5F);
  }
}

TEST_CASE("landmark noise has the requested size and is shared by all observers") {
  Recipe recipe = small();
  recipe.mission.landmarks.noise = 0.02;
  const Mission mission = sphere_inside(recipe);
  double sum = 0.0;
  int count = 0;
  std::vector<Vector3d> seen(mission.points.size(), Vector3d::Zero());
  for (const Frame& frame : mission.frames) {
    for (const Landmark& landmark : frame.landmarks) {
      const auto index = static_cast<std::size_t>(landmark.id);
      if (seen[index].isZero()) {
        seen[index] = landmark.position_world;
        const double distance = (mission.points[index].position_world - frame.cam_from_world.center()).norm();
        sum += (landmark.position_world - mission.points[index].position_world).squaredNorm() /
               (3.0 * distance * distance);
        ++count;
      }
      CHECK(seen[index] == landmark.position_world);
    }
  }
  CHECK(std::sqrt(sum / count) == Approx(0.02).epsilon(0.15));
}

TEST_CASE("missions are the same on every run") {
  const Mission a = corridor_across_seam(small(3));
  const Mission b = corridor_across_seam(small(3));
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(a.frames[i].image.pixels() == b.frames[i].image.pixels());
    REQUIRE(a.frames[i].landmarks.size() == b.frames[i].landmarks.size());
    CHECK(a.frames[i].landmarks.back().position_world == b.frames[i].landmarks.back().position_world);
  }
}

TEST_CASE("special surfaces lie where the missions' names state") {
  const Mission corridor = corridor_across_seam(small(2));
  const Image<int>& around = corridor.frames[1].surface;
  const int middle = corridor.height / 2;
  CHECK(around(0, middle) == around(corridor.width - 1, middle));
  CHECK(corridor.frames[1].depth(0, middle) < 1.6F);

  const Mission floor = floor_at_nadir(small(2));
  for (int x = 0; x < floor.width; ++x) {
    CHECK(floor.frames[0].surface(x, floor.height - 1) == 0);
    CHECK(floor.frames[0].surface(x, 0) == 8);
  }
  const Mission plane = slanted_plane(small(2));
  const auto on_plane = std::count(plane.frames[0].surface.pixels().begin(), plane.frames[0].surface.pixels().end(), 0);
  CHECK(on_plane > plane.width * plane.height / 8);
}

TEST_CASE("a flight that would leave the scene is refused, with the number of keyframes that fit") {
  Recipe recipe = small(100);
  CHECK_THROWS_AS(textured_room(recipe), InvalidOption);
  CHECK_THROWS_WITH(textured_room(recipe), Catch::Contains("keyframes is 100") && Catch::Contains("at most"));
}

TEST_CASE("share_within counts pixels with truth only") {
  Image<float> truth(4, 1, 2.0F);
  truth(3, 0) = 0.0F;
  Image<float> depth(4, 1, 2.0F);
  depth(1, 0) = 2.1F;
  depth(2, 0) = 0.0F;
  CHECK(share_within(depth, truth, 0.02) == Approx(1.0 / 3.0));
  CHECK(share_within(depth, truth, 0.06) == Approx(2.0 / 3.0));
  CHECK(share_within(depth, truth, 0.02, [](int x, int) { return x == 0; }) == 1.0);
}

TEST_CASE("yard: sky and riders and movers have labels and movers have the range behind them") {
  Recipe recipe = small(2);
  const Mission plain = yard(recipe);
  recipe.rider = true;
  recipe.movers = 3;
  const Mission full = yard(recipe);
  std::map<std::uint8_t, int> labels;
  for (std::size_t i = 0; i < full.frames.size(); ++i) {
    const Frame& frame = full.frames[i];
    for (std::size_t k = 0; k < frame.label.size(); ++k) {
      const std::uint8_t label = frame.label.pixels()[k];
      ++labels[label];
      const bool has_no_range =
          label == static_cast<std::uint8_t>(Label::kSky) || label == static_cast<std::uint8_t>(Label::kRider);
      if (has_no_range) REQUIRE(frame.depth.pixels()[k] == 0.0F);
      if (!has_no_range) REQUIRE(frame.depth.pixels()[k] == plain.frames[i].depth.pixels()[k]);
    }
    CHECK(frame.landmarks.size() > 100);
  }
  for (const Label label : {Label::kSky, Label::kRider, Label::kMover, Label::kThin}) {
    INFO(static_cast<int>(label));
    CHECK(labels[static_cast<std::uint8_t>(label)] > 20);
  }
}
