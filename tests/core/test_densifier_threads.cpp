// SPDX-License-Identifier: BSD-2-Clause
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdint>
#include <thread>
#include <utility>

#include "core/recording.h"
#include "pmsp/error.h"
#include "support/temp_dir.h"

using namespace pmsp;
using namespace pmsp::test;

TEST_CASE("the number of threads changes no byte of the result", "[densifier][threads]") {
  for (const int threads : {1, 5}) {
    INFO(threads);
    CHECK(same(densify(test_flight(), fast_options(kFlightWidth, threads)), test_result()));
  }
}

TEST_CASE("two Densifiers at once give the results of each alone", "[densifier][threads]") {
  synth::Recipe recipe = small_recipe(kFlightWidth, 4);
  recipe.mission.first_id = 100;
  const synth::Mission other = synth::sphere_inside(recipe);
  const Recording other_alone = densify(other, fast_options());
  test_result();
  Recording first;
  Recording second;
  std::thread one([&] { first = densify(test_flight(), fast_options()); });
  std::thread two([&] { second = densify(other, fast_options()); });
  one.join();
  two.join();
  CHECK(same(first, test_result()));
  CHECK(same(second, other_alone));
}

TEST_CASE("spilling to a scratch directory changes no result", "[densifier]") {
  const pmsp_test::TempDir dir;
  DensifierOptions options = fast_options();
  options.advanced.free_space.whole_mission = true;
  options.advanced.free_space.history = 4;  // some points are delivered before the end
  const Recording memory = densify(test_flight(), options);
  options.scratch_folder = dir.path().string();
  CHECK(difference(densify(test_flight(), options), memory).empty());
  CHECK(dir.entries() == 0);
  options.scratch_folder = (dir / "missing").string();
  CHECK_THROWS_AS(densify(test_flight(), options), OutputError);
}

TEST_CASE("a Densifier may be used from another thread than its creator", "[densifier][threads]") {
  Recording recording;
  Densifier densifier(fast_options(), recording.callbacks());
  std::thread([&] { fly_through(densifier, test_flight()); }).join();
  CHECK(same(recording, test_result()));
}

TEST_CASE("callbacks run on the thread that calls add and flush", "[densifier][threads]") {
  CHECK(callbacks_elsewhere(fast_options(kTinyWidth)) == 0);
}

TEST_CASE("after cancel no result is delivered", "[densifier][threads]") {
  for (const std::size_t at : {std::size_t{1}, std::size_t{3}, std::size_t{7}}) {
    INFO("after " << at << " results");
    check_cancel(fast_options(), at, test_result());
  }
}

TEST_CASE("cancel stops a running match soon", "[densifier][threads]") {
  DensifierOptions options = fast_options();
  options.advanced.patchmatch.iterations = 100;  // minutes in all
  options.advanced.patchmatch.refinements = 32;
  Recording recording;
  Densifier densifier(options, recording.callbacks());
  densifier.add(synth::keyframe_of(test_flight(), 0));
  densifier.add(synth::keyframe_of(test_flight(), 1));
  std::atomic<bool> started{false};
  std::chrono::steady_clock::time_point cancelled_at;
  std::thread other([&] {
    while (!started) std::this_thread::yield();
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    cancelled_at = std::chrono::steady_clock::now();
    densifier.cancel();
  });
  started = true;
  densifier.flush();
  const auto returned = std::chrono::steady_clock::now();
  other.join();
  const double late = std::chrono::duration<double>(returned - cancelled_at).count();
  CAPTURE(late);
  CHECK(late > 0.0);  // it was still running
  CHECK(late < (kSanitized ? 20.0 : 2.0));
  CHECK(recording.order.empty());
  CHECK(densifier.stats().depth_maps == 0);
}
