// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cmath>

#include "core/helpers.h"
#include "cuda/on_device.h"
#include "cuda/prepared.h"
#include "patchmatch/match_setup.h"
#include "pmsp/stages.h"
#include "sphere/panorama_data.h"
#include "util/eigen_kernels.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

constexpr int kCount = 100000;

/// Number of values that differ by more than `tolerance` (absolute, or relative above 1).
std::size_t differing(const Both& both, int value, double tolerance) {
  std::size_t count = 0;
  for (std::size_t i = static_cast<std::size_t>(value); i < both.host.size();
       i += static_cast<std::size_t>(both.values)) {
    const double host = both.host[i];
    const double device = both.device[i];
    if (!(std::abs(host - device) <= tolerance * std::max(1.0, std::abs(host)))) ++count;
  }
  return count;
}

/// The middle frame of a small mission with its neighbours, as the kernels take it.
struct Match {
  synth::Mission mission;
  std::vector<Panorama> panoramas;

  explicit Match(int width) : mission(synth::sphere_inside(small_recipe(width))) {
    const Executor executor;
    for (std::size_t i = 0; i < mission.frames.size(); ++i) {
      const Keyframe keyframe = synth::keyframe_of(mission, i);
      panoramas.emplace_back(keyframe.image, keyframe.mask, mission.width, mission.height, executor, 1.0);
    }
  }

  template <class Cube, class Image>
  Scoring<Cube> scoring(const Image& image_of) const {
    const Cube reference = image_of(1);
    Scoring<Cube> scoring;
    scoring.match_args = make_match_args<Cube>(reference, 0.0F, PatchMatchOptions{}, mission.width, {0.5, 8.0}, 1, 1);
    const RigidTransform world_from_ref = mission.frames[1].cam_from_world.inverse();
    for (const std::size_t i : {std::size_t{0}, std::size_t{2}}) {
      auto& view = scoring.match_args.views[scoring.match_args.num_views++];
      view.image = image_of(i);
      view.view_from_ref = to_rigid(mission.frames[i].cam_from_world * world_from_ref);
    }
    scoring.width = mission.width;
    scoring.height = mission.height;
    scoring.depth = 2.8F;
    return scoring;
  }

  Scoring<kernels::CubeView> scoring_of_quads() const {
    auto result = scoring<kernels::CubeView>([&](std::size_t i) { return impl_of(panoramas[i]).gray.view(); });
    result.elements = impl_of(panoramas[0]).gray.quads.size();
    return result;
  }
};

}  // namespace

TEST_CASE("host and device draw the same random numbers", "[cuda][kernels][small]") {
  const Both found = random_draws(kCount);
  CHECK(found.host == found.device);
  CHECK(found.host[0] != found.host[2]);
}

TEST_CASE("host and device make the same planes from the same draws", "[cuda][kernels][small]") {
  const Both found = planes(kCount);
  for (int value = 0; value < 6; ++value) {
    INFO("value " << value);
    CHECK(differing(found, value, 1e-4) < kCount / 10000);  // a normal that just faces the camera
  }
  for (int value = 6; value < 9; ++value) {  // where 1 - v . t is nearly 0, a rounding error becomes large
    INFO("value " << value);
    CHECK(differing(found, value, 1e-3) < kCount / 100);
  }
  CHECK(differing(found, 9, 0.0) < kCount / 1000);
}

TEST_CASE("medians are equal on host and device", "[cuda][kernels][small]") {
  const Both found = medians(kCount);
  CHECK(differing(found, 0, 1e-6) == 0);             // the values themselves are made with and without fused operations
  CHECK(differing(found, 1, 1e-6) < kCount / 1000);  // the limit is a product
}

TEST_CASE("maps agree alike on host and device", "[cuda][kernels][small]") {
  const Both found = agreements(kCount);
  CHECK(differing(found, 2, 0.0) < kCount / 1000);  // points on the border between two pixels
  CHECK(differing(found, 0, 1e-4) < kCount / 500);
  CHECK(differing(found, 1, 1e-3) < kCount / 100);
}

TEST_CASE("a packed cube gives the same samples on host and device", "[cuda][kernels][small]") {
  const Match match(128);
  const CubeMap& cube = impl_of(match.panoramas[0]).gray;
  const Both found = cube_samples(cube.view(), cube.quads.size(), kCount);
  CHECK(differing(found, 0, 0.01) < kCount / 1000);  // directions between two faces
  CHECK(differing(found, 0, 0.2) == 0);
}

TEST_CASE("patches score alike on host and device", "[cuda][kernels][small]") {
  const Match match(64);
  const Both found = patch_scores(match.scoring_of_quads());
  const std::size_t pixels = found.host.size() / 2;
  CHECK(differing(found, 0, 1e-2) < pixels / 200);  // fine or coarse patch: a choice at a limit
  CHECK(differing(found, 1, 2e-3) < pixels / 200);
}

TEST_CASE("the texture units score patches as the packed cube does", "[cuda][kernels]") {
  const Match match(320);
  const Both quads = patch_scores(match.scoring_of_quads());
  std::vector<PreparedOnDevice> prepared;
  for (const synth::Frame& frame : match.mission.frames) {
    prepared.push_back(prepare_on_device(frame.image.view(), {}, match.mission.width, match.mission.height));
  }
  const std::vector<float> texture = patch_scores(
      match.scoring<cuda::TextureCube>([&](std::size_t i) { return cuda::TextureCube{prepared[i].cube->texture()}; }));
  double difference = 0.0;
  double quads_score = 0.0;
  double texture_score = 0.0;
  const std::size_t pixels = texture.size() / 2;
  for (std::size_t i = 0; i < pixels; ++i) {
    quads_score += static_cast<double>(quads.host[2 * i + 1]);
    texture_score += static_cast<double>(texture[2 * i + 1]);
    difference += std::abs(static_cast<double>(quads.host[2 * i + 1] - texture[2 * i + 1]));
  }
  CAPTURE(quads_score / static_cast<double>(pixels), texture_score / static_cast<double>(pixels));
  CHECK(difference < 0.03 * static_cast<double>(pixels));
  CHECK(texture_score > 0.7 * static_cast<double>(pixels));  // the planes are nearly the true ones
}
