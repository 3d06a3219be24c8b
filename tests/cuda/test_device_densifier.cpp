// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cstdint>
#include <map>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/recording.h"
#include "cuda/cuda_engine.h"
#include "devices.h"
#include "plan/plan.h"
#include "planned_densifier.h"
#include "pmsp/error.h"

// Contract of the Densifier on the CUDA backend.
using namespace pmsp;
using namespace pmsp::test;

namespace {

DensifierOptions cuda_options(int width = kFlightWidth, bool pipelined = false) {
  DensifierOptions options = fast_options(width);
  options.backend = Backend::kCuda;
  options.advanced.pipelined = pipelined;
  return options;
}

const Recording& cuda_result() {
  static const Recording kResult = densify(test_flight(), cuda_options());
  return kResult;
}

synth::Mission tiny_mission(std::int64_t first_id = 0) {
  synth::Recipe recipe = small_recipe(kTinyWidth, 4);
  recipe.mission.first_id = first_id;
  synth::Mission mission = synth::empty_room(recipe);
  mission.mask = Image<std::uint8_t>(mission.width, mission.height, 255);
  for (int x = 0; x < mission.width; ++x) mission.mask(x, mission.height - 1) = 0;
  return mission;
}

void add_all(Densifier& densifier, const synth::Mission& mission) {
  for (std::size_t i = 0; i < mission.frames.size(); ++i) densifier.add(synth::keyframe_of(mission, i));
}

}  // namespace

TEST_CASE("a tiny mission comes through all stages", "[cuda][densifier][small]") {
  const synth::Mission mission = tiny_mission();
  const Recording cpu = densify(mission, fast_options(kTinyWidth));
  for (const bool pipelined : {false, true}) {
    INFO(pipelined);
    const Recording recording = densify(mission, cuda_options(kTinyWidth, pipelined));
    CHECK(recording.order == cpu.order);
    CHECK(recording.points() > 0);
  }
}

TEST_CASE("a second run on the device gives the same bytes", "[cuda][densifier][small]") {
  const synth::Mission mission = tiny_mission();
  CHECK(same(densify(mission, cuda_options(kTinyWidth)), densify(mission, cuda_options(kTinyWidth))));
}

TEST_CASE("the device accepts planes that it has delivered", "[cuda][densifier][small]") {
  const synth::Mission mission = tiny_mission();
  std::vector<PlanKeyframe> keyframes;
  std::vector<std::int64_t> ids;
  for (std::size_t i = 0; i < mission.frames.size(); ++i) {
    keyframes.push_back(plan_keyframe(synth::keyframe_of(mission, i), cuda_options(kTinyWidth)));
    ids.push_back(keyframes.back().id);
  }
  const Plan plan = make_plan(keyframes, cuda_options(kTinyWidth));
  for (const bool pipelined : {false, true}) {
    const DensifierOptions options = cuda_options(kTinyWidth, pipelined);
    std::map<std::int64_t, PlaneMap> planes;
    Recording whole;
    PlannedCallbacks callbacks = whole.callbacks();
    callbacks.raw_depth = nullptr;
    callbacks.planes = [&](const PlaneMap& map) { planes[map.keyframe_id] = map; };
    PlannedDensifier first(options, plan, ids, callbacks);
    add_all(first, mission);
    first.flush();
    CHECK(planes.size() == whole.clouds.size());
    CHECK(planes.size() > 2);
    for (const PlaneReuse::Planes kind : {PlaneReuse::Planes::kStart, PlaneReuse::Planes::kResult}) {
      PlaneReuses reuses;
      for (const auto& [id, map] : planes) {
        reuses.keyframes[id] = {
            kind, kind == PlaneReuse::Planes::kStart ? 0 : options.advanced.patchmatch.geometric_passes + 1, false};
      }
      reuses.load = [&](std::int64_t id) { return planes.at(id); };
      Recording again;
      callbacks = again.callbacks();
      callbacks.raw_depth = nullptr;
      PlannedDensifier second(options, plan, ids, callbacks, reuses);
      add_all(second, mission);
      second.flush();
      CHECK(second.stats().depth_maps == 0);
      CHECK(difference(again, whole) == "");
    }
  }
}

TEST_CASE("runs at full size give the same bytes", "[cuda][densifier]") {
  const synth::Mission mission = synth::textured_room(small_recipe(640, 5));
  DensifierOptions options = preset(Quality::kOnline);
  options.backend = Backend::kCuda;
  const Recording first = densify(mission, options);
  CHECK(first.points() > 100000);
  for (int i = 0; i < 3; ++i) CHECK(difference(densify(mission, options), first) == "");
  options.advanced.pipelined = true;
  for (int i = 0; i < 3; ++i) CHECK(difference(densify(mission, options), first) == "");
}

TEST_CASE("a pipelined Densifier delivers the same results in the same order", "[cuda][densifier]") {
  CHECK(same(densify(test_flight(), cuda_options(kFlightWidth, true)), cuda_result()));
  CHECK(cuda_result().order == test_result().order);
}

TEST_CASE("pipelined results are delivered before the work is done", "[cuda][densifier]") {
  Recording recording;
  Densifier densifier(cuda_options(kFlightWidth, true), recording.callbacks());
  add_all(densifier, test_flight());
  const std::size_t before = recording.order.size();
  CHECK(before < cuda_result().order.size());
  densifier.flush();
  CHECK(same(recording, cuda_result()));
}

TEST_CASE("seeds change the result on the device", "[cuda][densifier]") {
  DensifierOptions options = cuda_options();
  options.seed = 2;
  CHECK_FALSE(same(densify(test_flight(), options).raw[1], cuda_result().raw[1]));
}

TEST_CASE("two Densifiers at once on one device give the results of each alone", "[cuda][densifier][threads]") {
  synth::Recipe recipe = small_recipe(kFlightWidth, 4);
  recipe.mission.first_id = 100;
  const synth::Mission other = synth::sphere_inside(recipe);
  const Recording other_alone = densify(other, cuda_options());
  cuda_result();
  for (int round = 0; round < 5; ++round) {
    Recording first;
    Recording second;
    std::thread one([&] { first = densify(test_flight(), cuda_options(kFlightWidth, round % 2 == 0)); });
    std::thread two([&] { second = densify(other, cuda_options()); });
    one.join();
    two.join();
    CHECK(same(first, cuda_result()));
    CHECK(same(second, other_alone));
  }
}

TEST_CASE("two Densifiers in turns on one thread do not disturb each other", "[cuda][densifier]") {
  Recording first;
  Recording second;
  Densifier one(cuda_options(kFlightWidth, true), first.callbacks());
  Densifier two(cuda_options(), second.callbacks());
  for (std::size_t i = 0; i < test_flight().frames.size(); ++i) {
    one.add(synth::keyframe_of(test_flight(), i));
    two.add(synth::keyframe_of(test_flight(), i));
  }
  one.flush();
  two.flush();
  CHECK(same(first, cuda_result()));
  CHECK(same(second, cuda_result()));
}

TEST_CASE("several processors give the result of one", "[cuda][densifier]") {
  for (const int count : {2, 3}) {
    for (const bool pipelined : {false, true}) {
      INFO(count << " processors, pipelined " << pipelined);
      DensifierOptions options = cuda_options(kFlightWidth, pipelined);
      options.devices = std::vector<int>(static_cast<std::size_t>(count), 0);
      CHECK(difference(by_kind(densify(test_flight(), options)), by_kind(cuda_result())) == "");
    }
  }
  DensifierOptions options = cuda_options(kFlightWidth, true);
  options.devices = {};  // all devices
  CHECK(difference(by_kind(densify(test_flight(), options)), by_kind(cuda_result())) == "");
}

TEST_CASE("several processors also share the results that wait for the whole mission", "[cuda][densifier]") {
  DensifierOptions options = cuda_options(kFlightWidth, true);
  options.advanced.free_space.whole_mission = true;
  const Recording one = by_kind(densify(test_flight(), options));
  options.devices = {0, 0};
  CHECK(difference(by_kind(densify(test_flight(), options)), one) == "");
  options.scratch_folder = ".";
  CHECK(difference(by_kind(densify(test_flight(), options)), one) == "");
}

TEST_CASE("closed devices can be opened again", "[cuda][densifier]") {
  const Recording before = densify(test_flight(), cuda_options());
  close_devices({0});
  CHECK(same(densify(test_flight(), cuda_options()), before));
  close_devices({});
  close_devices({0, 0, 1000});
  CHECK(same(densify(test_flight(), cuda_options(kFlightWidth, true)), before));
}

TEST_CASE("a second device gives the results of the first", "[cuda][densifier]") {
  if (!cuda::find_device(1).why_not.empty()) {
    WARN("not tested, there is one device only: " + cuda::find_device(1).why_not);
    return;
  }
  cuda_result();
  DensifierOptions options = cuda_options();
  options.devices = {1};
  Recording first;
  Recording second;
  std::thread one([&] { first = densify(test_flight(), cuda_options()); });
  std::thread two([&] { second = densify(test_flight(), options); });
  one.join();
  two.join();
  CHECK(same(first, cuda_result()));
  if (cuda::find_device(0).name == cuda::find_device(1).name) CHECK(same(second, cuda_result()));
}

TEST_CASE("a CUDA Densifier may be used from another thread and moved and destroyed while working",
          "[cuda][densifier][threads]") {
  Recording recording;
  Densifier made(cuda_options(), recording.callbacks());
  Densifier densifier = std::move(made);
  std::thread([&] { fly_through(densifier, test_flight()); }).join();
  CHECK(same(recording, cuda_result()));
  for (const bool pipelined : {false, true}) {
    Recording unfinished;
    Densifier left(cuda_options(kFlightWidth, pipelined), unfinished.callbacks());
    add_all(left, test_flight());  // destroyed without flush
  }
}

TEST_CASE("callbacks run on the calling thread", "[cuda][densifier][threads]") {
  CHECK(callbacks_elsewhere(cuda_options(kTinyWidth, true)) == 0);
}

TEST_CASE("callbacks are optional on the device", "[cuda][densifier][small]") {
  const synth::Mission mission = tiny_mission();
  const Recording all = densify(mission, cuda_options(kTinyWidth));
  for (int given = 0; given < 8; ++given) {
    CAPTURE(given);
    Recording some;
    DensifierCallbacks callbacks = some.callbacks();
    if ((given & 1) == 0) callbacks.raw_depth = nullptr;
    if ((given & 2) == 0) callbacks.filtered_depth = nullptr;
    if ((given & 4) == 0) callbacks.cloud = nullptr;
    Densifier densifier(cuda_options(kTinyWidth, given % 3 == 0), callbacks);
    fly_through(densifier, mission);
    CHECK(densifier.stats().depth_maps == 4);
    CHECK(densifier.stats().pixels_after_consistency > 0);
    REQUIRE(some.raw.size() == ((given & 1) != 0 ? 4 : 0));
    REQUIRE(some.filtered.size() == ((given & 2) != 0 ? 4 : 0));
    REQUIRE(some.clouds.size() == ((given & 4) != 0 ? 4 : 0));
    for (std::size_t i = 0; i < some.raw.size(); ++i) CHECK(same(some.raw[i], all.raw[i]));
    for (std::size_t i = 0; i < some.filtered.size(); ++i) CHECK(same(some.filtered[i], all.filtered[i]));
    for (std::size_t i = 0; i < some.clouds.size(); ++i) CHECK(same(some.clouds[i], all.clouds[i]));
  }
}

TEST_CASE("after flush a new sequence starts on the device", "[cuda][densifier][small]") {
  const synth::Mission first = tiny_mission();
  const synth::Mission second = tiny_mission(50);
  const Recording first_alone = densify(first, cuda_options(kTinyWidth));
  const Recording second_alone = densify(second, cuda_options(kTinyWidth));
  for (const bool pipelined : {false, true}) {
    Recording both;
    Densifier densifier(cuda_options(kTinyWidth, pipelined), both.callbacks());
    fly_through(densifier, first);
    CHECK(same(both, first_alone));
    fly_through(densifier, second);
    densifier.flush();  // nothing waits
    REQUIRE(both.clouds.size() == 8);
    for (std::size_t i = 0; i < 4; ++i) {
      CHECK(same(both.raw[i + 4], second_alone.raw[i]));
      CHECK(same(both.filtered[i + 4], second_alone.filtered[i]));
      CHECK(same(both.clouds[i + 4], second_alone.clouds[i]));
    }
  }
}

TEST_CASE("after cancel the device delivers no result", "[cuda][densifier][threads]") {
  for (const bool pipelined : {false, true}) {
    for (const std::size_t at : {std::size_t{1}, std::size_t{3}, std::size_t{7}}) {
      CAPTURE(pipelined, at);
      check_cancel(cuda_options(kFlightWidth, pipelined), at, cuda_result());
    }
  }
}

TEST_CASE("images of different sizes and padded rows with and without mask follow each other",
          "[cuda][densifier][small]") {
  const synth::Mission mission = tiny_mission();
  const synth::Mission finer = synth::empty_room(small_recipe(2 * kTinyWidth, 4));
  Image<Rgb> padded(kTinyWidth + 7, kTinyWidth / 2, Rgb{255, 0, 255});
  for (int y = 0; y < mission.height; ++y) {
    for (int x = 0; x < mission.width; ++x) padded(x, y) = mission.frames[2].image(x, y);
  }
  const auto run = [&](Backend backend, bool with_padding) {
    Recording recording;
    DensifierOptions options = fast_options(kTinyWidth);
    options.backend = backend;
    Densifier densifier(options, recording.callbacks());
    for (std::size_t i = 0; i < 4; ++i) {
      Keyframe keyframe = synth::keyframe_of(i % 2 == 1 ? finer : mission, i);
      if (i == 2 && with_padding) keyframe.image = {padded.row(0), mission.width, mission.height, padded.width()};
      if (i == 2) keyframe.mask = {};
      densifier.add(keyframe);
    }
    densifier.flush();
    return recording;
  };
  const Recording plain = run(Backend::kCuda, false);
  CHECK(plain.order == run(Backend::kCpu, false).order);
  CHECK(same(plain, run(Backend::kCuda, true)));
}

TEST_CASE("automatic depth map sizes follow the first image", "[cuda][densifier][small]") {
  const synth::Mission mission = tiny_mission();
  DensifierOptions options = cuda_options(kTinyWidth);
  options.width = 0;
  options.height = 0;
  Recording recording;
  Densifier densifier(options, recording.callbacks());
  fly_through(densifier, mission);
  constexpr int kEnlarged = kTinyWidth * 3 / 2;
  CHECK(densifier.options().width == kEnlarged);
  CHECK(densifier.options().backend == Backend::kCuda);
  CHECK(same(recording, densify(mission, cuda_options(kEnlarged))));
}

TEST_CASE("keyframes without landmarks or alone give no depth map", "[cuda][densifier][small]") {
  Recording recording;
  DensifierOptions options = cuda_options(kTinyWidth);
  options.advanced.view_filter.enabled = false;
  Densifier densifier(options, recording.callbacks());
  const synth::Mission mission = tiny_mission();
  densifier.add(synth::keyframe_of(mission, 0));
  densifier.flush();
  CHECK(recording.order.empty());
  for (std::size_t i = 1; i < 4; ++i) {
    Keyframe keyframe = synth::keyframe_of(mission, i);
    if (i == 2) keyframe.landmarks.clear();  // no depth range
    densifier.add(keyframe);
  }
  densifier.flush();
  CHECK(densifier.stats().depth_maps == 2);
  CHECK(recording.filtered.size() == 2);
}

TEST_CASE("statistics count pixels and seconds of the device", "[cuda][densifier]") {
  Recording recording;
  Densifier densifier(cuda_options(), recording.callbacks());
  fly_through(densifier, test_flight());
  const DensifierStats& stats = densifier.stats();
  std::int64_t raw = 0;
  std::int64_t filtered = 0;
  for (const DepthMap& map : recording.raw) {
    for (const float depth : map.depth.pixels()) raw += depth > 0.0F ? 1 : 0;
  }
  for (const DepthMap& map : recording.filtered) {
    for (const float depth : map.depth.pixels()) filtered += depth > 0.0F ? 1 : 0;
  }
  CHECK(stats.depth_maps == 7);
  CHECK(stats.pixels == 7 * kFlightWidth * kFlightHeight);
  CHECK(stats.pixels_matched >= raw);  // far pixels have no depth
  CHECK(stats.pixels_after_median <= stats.pixels_matched);
  CHECK(stats.pixels_after_consistency == filtered);
  CHECK(stats.points == static_cast<std::int64_t>(recording.points()));
  for (const double seconds : {stats.seconds_prepare, stats.seconds_init, stats.seconds_patchmatch,
                               stats.seconds_median, stats.seconds_consistency, stats.seconds_fusion}) {
    CHECK(seconds > 0.0);
    CHECK(seconds < 10.0);
  }
}

TEST_CASE("a missing device is named", "[cuda][densifier][small]") {
  DensifierOptions options = cuda_options();
  options.devices = {217};
  CHECK_THROWS_AS(Densifier(options, {}), BackendUnavailable);
  CHECK_THROWS_WITH(Densifier(options, {}), Catch::Contains("217") && Catch::Contains("auto"));
}

TEST_CASE("auto selects the device or else the CPU with the reason", "[cuda][densifier][small]") {
  DensifierOptions options = fast_options(kTinyWidth);
  options.backend = Backend::kAuto;
  const synth::Mission mission = tiny_mission();
  Recording recording;
  Densifier densifier(options, recording.callbacks());
  CHECK(densifier.options().backend == Backend::kCuda);
  CHECK_THAT(densifier.backend(), Catch::Contains("CUDA device 0") && Catch::Contains(cuda::find_device(0).name));
  fly_through(densifier, mission);
  CHECK(same(recording, densify(mission, cuda_options(kTinyWidth))));
  options.devices = {217};
  Densifier fallen_back(options, {});
  CHECK(fallen_back.options().backend == Backend::kCpu);
  CHECK_THAT(fallen_back.backend(), Catch::Contains("CPU") && Catch::Contains("217"));
}
