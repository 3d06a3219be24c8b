// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/recording.h"
#include "pmsp/error.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

const Image<Rgb> kOdd(127, 64);
const Image<std::uint8_t> kSmallMask(64, 32, 255);

struct Mistake {
  const char* name;
  std::function<void(Keyframe&)> make;
  const char* complaint;
};

const std::vector<Mistake>& mistakes() {
  static const std::vector<Mistake> kMistakes = {
      {"no image", [](Keyframe& k) { k.image = {}; }, "image"},
      {"odd width", [](Keyframe& k) { k.image = kOdd.view(); }, "127 x 64"},
      {"mask of another size", [](Keyframe& k) { k.mask = kSmallMask.view(); }, "64 x 32"},
      {"scaled rotation", [](Keyframe& k) { k.cam_from_world.rotation *= 1.1; }, "rotation"},
      {"negative pose error", [](Keyframe& k) { k.pose_error = -0.001; }, "pose error"},
      {"pose error that is no number", [](Keyframe& k) { k.pose_error = std::nan(""); }, "pose error"},
      {"mirrored rotation", [](Keyframe& k) { k.cam_from_world.rotation.col(0) *= -1.0; }, "rotation"},
      {"zero rotation", [](Keyframe& k) { k.cam_from_world.rotation.setZero(); }, "rotation"},
      {"NaN in the rotation",
       [](Keyframe& k) { k.cam_from_world.rotation(1, 1) = std::numeric_limits<double>::quiet_NaN(); },
       "cam_from_world"},
      {"infinite translation",
       [](Keyframe& k) { k.cam_from_world.translation.x() = std::numeric_limits<double>::infinity(); },
       "cam_from_world"},
      {"NaN in a landmark",
       [](Keyframe& k) { k.landmarks[3].position_world.z() = std::numeric_limits<double>::quiet_NaN(); }, "landmark"},
  };
  return kMistakes;
}

}  // namespace

TEST_CASE("an invalid keyframe is refused by name and has no effect", "[densifier]") {
  Recording recording;
  Densifier densifier(fast_options(), recording.callbacks());
  for (std::size_t i = 0; i < test_flight().frames.size(); ++i) {
    const Keyframe good = synth::keyframe_of(test_flight(), i);
    for (const Mistake& mistake : mistakes()) {
      Keyframe bad = good;
      mistake.make(bad);
      INFO(mistake.name);
      CHECK_THROWS_AS(densifier.add(bad), InvalidInput);
      CHECK_THROWS_WITH(densifier.add(bad),
                        Catch::Contains("keyframe " + std::to_string(good.id)) && Catch::Contains(mistake.complaint));
    }
    CHECK(densifier.stats().keyframes_added == static_cast<std::int64_t>(i));
    CHECK(densifier.add(good));
    CHECK_THROWS_AS(densifier.add(good), InvalidInput);  // its id was used before
    CHECK_THROWS_WITH(densifier.add(good), Catch::Contains("keyframe " + std::to_string(good.id)));
  }
  densifier.flush();
  CHECK(same(recording, test_result()));
}

TEST_CASE("images of an unusable shape are refused and have no effect", "[densifier]") {
  DensifierOptions options = fast_options(kTinyWidth);
  options.height = 0;
  Densifier densifier(options, {});
  const Image<Rgb> flat(1024, 8);
  const Keyframe good = synth::keyframe_of(test_flight(), 0);
  Keyframe bad = good;
  bad.image = flat.view();
  CHECK_THROWS_AS(densifier.add(bad), InvalidInput);
  CHECK_THROWS_WITH(densifier.add(bad), Catch::Contains("1024 x 8") && Catch::Contains("height"));
  CHECK(densifier.add(good));
  CHECK(densifier.options().height == kTinyWidth / 2);
}

TEST_CASE("landmarks at the camera or at huge distances do not abort a mission", "[densifier]") {
  Densifier densifier(fast_options(kTinyWidth), {});
  for (std::size_t i = 0; i < test_flight().frames.size(); ++i) {
    Keyframe keyframe = synth::keyframe_of(test_flight(), i);
    keyframe.landmarks.resize(20);
    keyframe.landmarks[3].position_world = keyframe.cam_from_world.center();
    keyframe.landmarks[4].position_world = {1e12, 0.0, 0.0};
    CHECK_NOTHROW(densifier.add(keyframe));
  }
  CHECK_NOTHROW(densifier.flush());
  CHECK(densifier.stats().depth_maps > 0);
}

TEST_CASE("an id stays taken over a flush and over a rejection", "[densifier]") {
  Densifier densifier(fast_options(), {});
  const Keyframe first = synth::keyframe_of(test_flight(), 0);
  Keyframe lost = first;
  lost.id = 50;
  lost.landmarks.clear();
  CHECK(densifier.add(first));
  CHECK_FALSE(densifier.add(lost));
  CHECK_THROWS_AS(densifier.add(lost), InvalidInput);
  densifier.flush();
  CHECK_THROWS_AS(densifier.add(first), InvalidInput);
}

TEST_CASE("invalid options are refused by the constructor", "[densifier]") {
  DensifierOptions options;
  options.width = 33;
  CHECK_THROWS_AS(Densifier(options, {}), InvalidOption);
  options = {};
  options.advanced.patchmatch.iterations = 0;
  CHECK_THROWS_WITH(Densifier(options, {}), Catch::Contains("patchmatch.iterations"));
  options = {};
  options.threads = 5000;
  CHECK_THROWS_AS(Densifier(options, {}), InvalidOption);
}

TEST_CASE("an unsupported instruction set is refused", "[densifier]") {
  const std::vector<Simd> sets = available_simd();
  for (const Simd simd : {Simd::kScalar, Simd::kAvx2, Simd::kAvx512}) {
    DensifierOptions options = fast_options();
    options.simd = simd;
    INFO(name_of(simd));
    if (std::find(sets.begin(), sets.end(), simd) == sets.end()) {
      CHECK_THROWS_AS(Densifier(options, {}), BackendUnavailable);
    } else {
      CHECK(Densifier(options, {}).options().simd == simd);
    }
  }
}

TEST_CASE("an exception of a callback leaves add or flush", "[densifier]") {
  DensifierCallbacks callbacks;
  callbacks.raw_depth = [](const DepthMap&) { throw std::runtime_error("disk full"); };
  Densifier densifier(fast_options(), callbacks);
  CHECK_THROWS_WITH(fly_through(densifier, test_flight()), "disk full");
}

TEST_CASE("after an exception of a callback no input is accepted and no result delivered", "[densifier]") {
  int clouds = 0;
  bool thrown = false;
  DensifierCallbacks callbacks;
  callbacks.filtered_depth = [&](const DepthMap&) {
    thrown = true;
    throw std::runtime_error("disk full");
  };
  callbacks.cloud = [&](const KeyframeCloud&) { clouds += thrown ? 1 : 0; };
  Densifier densifier(fast_options(kTinyWidth), callbacks);
  CHECK_THROWS_WITH(fly_through(densifier, test_flight()), "disk full");
  CHECK(densifier.cancelled());
  Keyframe more = synth::keyframe_of(test_flight(), 0);
  more.id = 1000;
  CHECK_FALSE(densifier.add(more));
  densifier.flush();
  CHECK(clouds == 0);
}

TEST_CASE("a missing CUDA device is an error and with auto a reason for the CPU", "[densifier][errors]") {
  DensifierOptions options = fast_options(kTinyWidth);
  options.devices = {255};
  options.backend = Backend::kCuda;
  CHECK_THROWS_AS(Densifier(options, {}), BackendUnavailable);
  CHECK_THROWS_WITH(Densifier(options, {}), Catch::Contains("cuda") && Catch::Contains("backend cpu"));
  options.backend = Backend::kAuto;
  const Densifier densifier(options, {});
  CHECK(densifier.options().backend == Backend::kCpu);
  CHECK_THAT(densifier.backend(), Catch::Contains("CPU") && Catch::Contains("CUDA: "));
}
