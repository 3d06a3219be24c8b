// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <functional>
#include <limits>

#include "drawn_scene.h"
#include "io/pairing.h"
#include "pmsp/error.h"

using namespace pmsp;
using namespace pmsp::test;
using Catch::Matchers::Contains;

namespace {

std::vector<Shot> flight() {
  std::vector<Shot> shots;
  for (int i = 0; i < 8; ++i) shots.push_back({2 * i, 0.3 * i, 3 * i});
  return shots;
}

PairingVerifier::Verdict verify(const std::vector<Shot>& shots, const std::function<int(int)>& frame_of,
                                int width = kRoomWidth) {
  const SlamMap map = room_map(shots);
  PairingVerifier verifier(map);
  for (const Shot& shot : shots) verifier.add(shot.id, render_room(frame_of(shot.frame), width).view());
  return verifier.verdict();
}

}  // namespace

TEST_CASE("The right images are accepted at any size") {
  const int width = GENERATE(320, 160, 640);
  CAPTURE(width);
  const auto verdict = verify(
      flight(), [](int frame) { return frame; }, width);
  CHECK(verdict.conclusive);
  CHECK(verdict.belongs);
  CHECK(verdict.agreement > 0.75);
  CHECK_THAT(verdict.message, Contains("belong to their keyframes"));
}

TEST_CASE("Images of other keyframes are refused with advice") {
  const auto shuffled = [](int frame) { return (frame * 5 + 6) % 24; };
  const auto by_one_keyframe = [](int frame) { return frame + 3; };
  const auto constant = [](int) { return 9; };
  const std::function<int(int)> wrong =
      GENERATE_COPY(values<std::function<int(int)>>({shuffled, by_one_keyframe, constant}));
  const auto verdict = verify(flight(), wrong);
  CHECK(verdict.conclusive);
  CHECK_FALSE(verdict.belongs);
  CHECK(verdict.agreement < 0.5);
  CHECK_THAT(verdict.message, Contains("do not belong") && Contains("--frame-offset") && Contains("--no-verify"));
}

TEST_CASE("Images without any texture are refused") {
  const auto shots = flight();
  const SlamMap map = room_map(shots);
  PairingVerifier verifier(map);
  const Image<Rgb> black(kRoomWidth, kRoomWidth / 2);
  for (const Shot& shot : shots) verifier.add(shot.id, black.view());
  CHECK(verifier.verdict().conclusive);
  CHECK_FALSE(verifier.verdict().belongs);
}

TEST_CASE("Skipped keyframes do not affect the verdict") {
  const auto shots = flight();
  const SlamMap map = room_map(shots);
  PairingVerifier verifier(map);
  for (const std::size_t i : {0U, 1U, 4U, 5U, 7U}) verifier.add(shots[i].id, render_room(shots[i].frame).view());
  CHECK(verifier.verdict().conclusive);
  CHECK(verifier.verdict().belongs);
}

TEST_CASE("Too little evidence gives no verdict") {
  const SlamMap map = room_map(flight());
  PairingVerifier verifier(map);
  CHECK_FALSE(verifier.verdict().conclusive);
  verifier.add(0, render_room(0).view());
  verifier.add(0 + 2, render_room(3).view());
  CHECK(verifier.verdict().comparisons > 0);

  const SlamMap bare = bare_map(flight());
  PairingVerifier nothing(bare);
  for (const Shot& shot : flight()) nothing.add(shot.id, render_room(17).view());
  CHECK_FALSE(nothing.verdict().conclusive);
  CHECK(nothing.verdict().belongs);
  CHECK_THAT(nothing.verdict().message, Contains("unknown whether"));
}

TEST_CASE("Invalid values in the map do not crash the verifier") {
  auto shots = flight();
  SlamMap map = room_map(shots);
  map.landmarks[3].position_world.setConstant(std::numeric_limits<double>::quiet_NaN());
  map.landmarks[4].position_world = map.keyframes[0].cam_from_world.center();
  map.keyframes[1].observations[5].pixel = {std::numeric_limits<float>::infinity(), 3.0F};
  map.keyframes[1].observations[6].pixel = {-1e30F, 1e30F};
  map.keyframes[1].observations[7].landmark_id = 999999;
  PairingVerifier verifier(map);
  for (const Shot& shot : shots) verifier.add(shot.id, render_room(shot.frame).view());
  CHECK(verifier.verdict().belongs);
  CHECK_THROWS_AS(verifier.add(12345, render_room(0).view()), InvalidInput);
  CHECK_THROWS_AS(verifier.add(0, ImageView<const Rgb>()), InvalidInput);
}
