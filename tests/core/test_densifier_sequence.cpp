// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "core/recording.h"
#include "machine.h"

using namespace pmsp;
using namespace pmsp::test;
using Eigen::Vector3d;

namespace {

std::vector<std::int64_t> ids_of_kind(const Recording& recording, char kind) {
  std::vector<std::int64_t> ids;
  for (const auto& [what, id] : recording.order) {
    if (what == kind) ids.push_back(id);
  }
  return ids;
}

/// Keyframes `from` to `to` - 1 of the test flight.
synth::Mission part(std::size_t from, std::size_t to) {
  synth::Mission mission = test_flight();
  mission.frames.erase(mission.frames.begin() + static_cast<std::ptrdiff_t>(to), mission.frames.end());
  mission.frames.erase(mission.frames.begin(), mission.frames.begin() + static_cast<std::ptrdiff_t>(from));
  return mission;
}

}  // namespace

TEST_CASE("results of each keyframe are delivered once and in order including both ends", "[densifier]") {
  const std::vector<std::int64_t> all = {0, 1, 2, 3, 4, 5, 6};
  for (const char kind : {'r', 'f', 'c'}) {
    INFO(kind);
    CHECK(ids_of_kind(test_result(), kind) == all);
  }
  for (const std::int64_t id : all) {
    const auto at = [&](char kind) {
      return std::find(test_result().order.begin(), test_result().order.end(), std::pair<char, std::int64_t>(kind, id));
    };
    CHECK(at('r') < at('f'));
    CHECK(at('f') < at('c'));
  }
  for (const KeyframeCloud& cloud : test_result().clouds) {
    INFO(cloud.keyframe_id);
    CHECK_FALSE(cloud.points.empty());
  }
}

TEST_CASE("a sequence of one keyframe gives no results and of two both", "[densifier]") {
  CHECK(densify(part(0, 1), fast_options()).order.empty());
  CHECK(densify(part(0, 0), fast_options()).order.empty());
  for (const std::size_t count : {std::size_t{2}, std::size_t{3}}) {
    const Recording recording = densify(part(0, count), fast_options());
    CHECK(recording.raw.size() == count);
    CHECK(recording.filtered.size() == count);
    REQUIRE(recording.clouds.size() == count);
    CHECK(filled(recording.filtered[0].depth) > (kSanitized ? 0.0 : 0.25));
    CHECK_FALSE(recording.clouds[0].points.empty());
  }
}

TEST_CASE("results are delivered during the mission", "[densifier]") {
  const synth::Mission flight = synth::empty_room(small_recipe(kTinyWidth, 14));
  Recording recording;
  DensifierOptions options = fast_options(kTinyWidth);
  options.advanced.patchmatch.geometric_passes = 0;
  Densifier densifier(options, recording.callbacks());
  constexpr std::size_t kMatched = 2;  // keyframes for each pass of matching
  constexpr std::size_t kLate = 10;    // two more each for consistency, fusion and two rounds of duplicate removal
  for (std::size_t i = 0; i < flight.frames.size(); ++i) {
    REQUIRE(densifier.add(synth::keyframe_of(flight, i)));
    INFO("after keyframe " << i);
    CHECK(recording.raw.size() == (i < kMatched ? 0 : i - kMatched + 1));
    CHECK(recording.clouds.size() == (i < kLate ? 0 : i - kLate + 1));
  }
  densifier.flush();
  CHECK(recording.clouds.size() == flight.frames.size());
}

TEST_CASE("a flush twice or at once without keyframes has no effect", "[densifier]") {
  Recording recording;
  Densifier densifier(fast_options(), recording.callbacks());
  densifier.flush();
  fly_through(densifier, test_flight());
  densifier.flush();
  CHECK(same(recording, test_result()));
}

TEST_CASE("after a flush a new sequence starts as in a new Densifier", "[densifier]") {
  synth::Recipe recipe = small_recipe(kFlightWidth, 4);
  recipe.mission.first_id = 100;
  const synth::Mission second = synth::sphere_inside(recipe);
  Recording both;
  Densifier densifier(fast_options(), both.callbacks());
  fly_through(densifier, test_flight());
  const std::size_t first_order = both.order.size();
  const std::size_t first_clouds = both.clouds.size();
  fly_through(densifier, second);
  const Recording alone = densify(second, fast_options());
  REQUIRE(both.order.size() == first_order + alone.order.size());
  REQUIRE(both.clouds.size() == first_clouds + alone.clouds.size());
  for (std::size_t i = 0; i < alone.clouds.size(); ++i) CHECK(same(both.clouds[first_clouds + i], alone.clouds[i]));
  CHECK(densifier.stats().keyframes_accepted == 11);
  CHECK(densifier.stats().depth_maps == 11);
}

TEST_CASE("pose errors lower the confidences and change no depth", "[densifier]") {
  const auto densified = [](double pose_error, bool free_space) {
    Recording recording;
    DensifierOptions options = fast_options();
    options.advanced.free_space.enabled = free_space;
    Densifier densifier(options, recording.callbacks());
    for (std::size_t i = 0; i < test_flight().frames.size(); ++i) {
      Keyframe keyframe = synth::keyframe_of(test_flight(), i);
      keyframe.pose_error = pose_error;
      densifier.add(keyframe);
    }
    densifier.flush();
    return recording;
  };
  const auto median_error = [](const Recording& recording) {
    std::vector<float> errors;
    for (const KeyframeCloud& cloud : recording.clouds) {
      for (const CloudPoint& point : cloud.points) errors.push_back(1.0F / point.confidence - 1.0F);
    }
    REQUIRE_FALSE(errors.empty());
    const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
    std::nth_element(errors.begin(), middle, errors.end());
    return *middle;
  };
  for (const bool free_space : {true, false}) {
    INFO(free_space);
    const Recording exact = densified(0.0, free_space);
    const Recording off = densified(0.01, free_space);
    CHECK(median_error(off) > 1.5F * median_error(exact));
    CHECK(static_cast<double>(off.points()) > 0.9 * static_cast<double>(exact.points()));
    for (std::size_t k = 0; k < exact.filtered.size(); ++k) {
      CHECK(off.filtered[k].depth.pixels() == exact.filtered[k].depth.pixels());
      int surer = 0;
      for (std::size_t i = 0; i < exact.filtered[k].depth.size(); ++i) {
        surer += off.filtered[k].confidence.pixels()[i] > exact.filtered[k].confidence.pixels()[i] ? 1 : 0;
      }
      CHECK(surer == 0);
    }
  }
}

TEST_CASE("keyframes rejected by the view filter do not affect the result", "[densifier]") {
  Recording with;
  Recording without;
  Densifier densifier(fast_options(), with.callbacks());
  Densifier other(fast_options(), without.callbacks());
  for (std::size_t i = 0; i < test_flight().frames.size(); ++i) {
    Keyframe keyframe = synth::keyframe_of(test_flight(), i);
    keyframe.id *= 2;
    CHECK(densifier.add(keyframe));
    CHECK(other.add(keyframe));
    keyframe.id += 1;  // from the same place
    CHECK_FALSE(densifier.add(keyframe));
  }
  densifier.flush();
  other.flush();
  CHECK(same(with, without));
  CHECK(densifier.stats().keyframes_added == 14);
  CHECK(densifier.stats().keyframes_accepted == 7);
  CHECK(densifier.stats().keyframes_rejected == 7);
}

TEST_CASE("a blurred keyframe is skipped and counted", "[densifier]" PMSP_ACCURACY) {
  Recording recording;
  Densifier densifier(fast_options(), recording.callbacks());
  for (std::size_t i = 0; i < test_flight().frames.size(); ++i) {
    Keyframe keyframe = synth::keyframe_of(test_flight(), i);
    Image<Rgb> gray(kFlightWidth, kFlightHeight);
    for (int y = 0; y < kFlightHeight; ++y) {
      for (int x = 0; x < kFlightWidth; ++x) {
        int sum = 0;
        for (int k = 0; k < 8; ++k) sum += test_flight().frames[i].image((x + k) % kFlightWidth, y).g;
        const auto mean = static_cast<std::uint8_t>(sum / 8);
        gray(x, y) = {mean, mean, mean};
      }
    }
    if (i == 3) keyframe.image = std::as_const(gray).view();
    CHECK(densifier.add(keyframe) == (i != 3));
  }
  densifier.flush();
  CHECK(ids_of_kind(recording, 'c') == std::vector<std::int64_t>{0, 1, 2, 4, 5, 6});
  CHECK(densifier.stats().keyframes_blurred == 1);
  CHECK(densifier.stats().keyframes_rejected == 1);
}

TEST_CASE("accepted keyframes without a depth map are counted by reason", "[densifier]") {
  Densifier alone(fast_options(kTinyWidth), {});
  alone.add(synth::keyframe_of(test_flight(), 0));
  alone.flush();
  CHECK(alone.stats().keyframes_without_neighbour == 1);
  CHECK(alone.stats().depth_maps == 0);

  DensifierOptions options = fast_options(kTinyWidth);
  options.advanced.view_filter.enabled = false;
  options.advanced.init.range_margin = 1.0;  // one landmark then gives no range
  Recording recording;
  Densifier densifier(options, recording.callbacks());
  for (std::size_t i = 0; i < 4; ++i) {
    Keyframe keyframe = synth::keyframe_of(test_flight(), i);
    if (i == 1) keyframe.landmarks.resize(1);
    if (i == 2) keyframe.landmarks.clear();
    densifier.add(keyframe);
  }
  densifier.flush();
  CHECK(ids_of_kind(recording, 'c') == std::vector<std::int64_t>{0, 3});
  CHECK(densifier.stats().depth_maps == 2);
  CHECK(densifier.stats().keyframes_without_range == 2);
  CHECK(densifier.stats().keyframes_without_neighbour == 0);
}

TEST_CASE("statistics are consistent", "[densifier]") {
  Recording recording;
  DensifierOptions options = fast_options();
  options.advanced.median.weighted = GENERATE(false, true);
  Densifier densifier(options, recording.callbacks());
  fly_through(densifier, test_flight());
  const DensifierStats& stats = densifier.stats();
  const auto depths = [](const std::vector<DepthMap>& maps) {
    double sum = 0.0;
    for (const DepthMap& map : maps) sum += filled(map.depth) * static_cast<double>(map.depth.size());
    return std::llround(sum);
  };
  CHECK(stats.keyframes_added == 7);
  CHECK(stats.keyframes_accepted == 7);
  CHECK(stats.keyframes_rejected == 0);
  CHECK(stats.depth_maps == 7);
  CHECK(stats.keyframes_without_neighbour == 0);
  CHECK(stats.keyframes_without_range == 0);
  CHECK(stats.pixels == 7 * kFlightWidth * kFlightHeight);
  CHECK(stats.pixels_matched >= depths(recording.raw));  // far pixels have no depth
  CHECK(stats.pixels_after_median <= stats.pixels_matched);
  // The weighted median gives planes to pixels that the median filter left without.
  const std::int64_t before = options.advanced.median.weighted ? stats.pixels : stats.pixels_after_median;
  CHECK(stats.pixels_after_consistency <= before);
  CHECK(stats.pixels_after_consistency == depths(recording.filtered));
  CHECK(stats.points == static_cast<std::int64_t>(recording.points()));
  for (const double seconds : {stats.seconds_prepare, stats.seconds_init, stats.seconds_patchmatch,
                               stats.seconds_median, stats.seconds_consistency, stats.seconds_fusion}) {
    CHECK(seconds > 0.0);
    CHECK(seconds < 600.0);
  }
}

TEST_CASE("the cloud lies on the room's walls without double surfaces", "[densifier]" PMSP_ACCURACY) {
  const synth::Mission room = synth::textured_room(small_recipe(256, 5));
  const Recording recording = densify(room, fast_options(256));
  const double share = points_on_surface(room.scene, recording.clouds, 0.02);
  CAPTURE(share);
  CHECK(share > 0.86);  // in the direction of motion, wrong depths of several maps agree with each other
  std::size_t kept = 0;
  std::size_t most = 0;
  for (const DepthMap& map : recording.filtered) {
    const auto here = static_cast<std::size_t>(std::llround(filled(map.depth) * static_cast<double>(map.depth.size())));
    kept += here;
    most = std::max(most, here);
  }
  CAPTURE(kept, most, recording.points());
  CHECK(recording.points() < kept * 2 / 3);
  CHECK(recording.points() > most);
}

TEST_CASE("filtering raises the share of good depths", "[densifier]" PMSP_ACCURACY) {
  for (std::size_t i = 0; i < test_result().raw.size(); ++i) {
    const auto share = [&](const DepthMap& map) {
      const Image<float>& truth = test_flight().frames[i].depth;
      return synth::share_within(map.depth, truth, 0.02, [&](int x, int y) { return map.depth(x, y) > 0.0F; });
    };
    INFO("keyframe " << i);
    CHECK(share(test_result().filtered[i]) > share(test_result().raw[i]));
  }
}

TEST_CASE("images may be freed once add returns", "[densifier]") {
  Recording recording;
  Densifier densifier(fast_options(), recording.callbacks());
  for (std::size_t i = 0; i < test_flight().frames.size(); ++i) {
    auto image = std::make_unique<Image<Rgb>>(test_flight().frames[i].image);
    auto mask = std::make_unique<Image<std::uint8_t>>(kFlightWidth, kFlightHeight, std::uint8_t{255});
    Keyframe keyframe = synth::keyframe_of(test_flight(), i);
    keyframe.image = std::as_const(*image).view();
    densifier.add(keyframe);
    std::fill(image->pixels().begin(), image->pixels().end(), Rgb{});
    image.reset();
    mask.reset();
  }
  densifier.flush();
  CHECK(same(recording, test_result()));
}

TEST_CASE("images with padded rows give the same result", "[densifier]") {
  Recording recording;
  Densifier densifier(fast_options(), recording.callbacks());
  for (std::size_t i = 0; i < test_flight().frames.size(); ++i) {
    const Image<Rgb>& image = test_flight().frames[i].image;
    Image<Rgb> padded(image.width() + 5, image.height(), {255, 0, 255});
    for (int y = 0; y < image.height(); ++y) std::copy(image.row(y), image.row(y) + image.width(), padded.row(y));
    Keyframe keyframe = synth::keyframe_of(test_flight(), i);
    keyframe.image = {padded.row(0), image.width(), image.height(), padded.width()};
    densifier.add(keyframe);
  }
  densifier.flush();
  CHECK(same(recording, test_result()));
}

TEST_CASE("depth maps have the requested size or that of the images", "[densifier]") {
  const synth::Mission two = part(0, 2);
  DensifierOptions options = fast_options();
  const auto size_with = [&](int width, int height) {
    options.width = width;
    options.height = height;
    Recording recording;
    Densifier densifier(options, recording.callbacks());
    fly_through(densifier, two);
    const Image<float>& depth = recording.filtered.at(0).depth;
    CHECK(densifier.options().width == depth.width());
    CHECK(densifier.options().height == depth.height());
    return std::pair{depth.width(), depth.height()};
  };
  CHECK(size_with(0, 0) == std::pair{kFlightWidth * 3 / 2, kFlightHeight * 3 / 2});  // small ones are enlarged
  CHECK(size_with(64, 0) == std::pair{64, 32});
  CHECK(size_with(0, 40) == std::pair{80, 40});
  CHECK(size_with(96, 52) == std::pair{96, 52});
  CHECK(size_with(160, 80) == std::pair{160, 80});  // larger than the images
}

TEST_CASE("the resolved options contain no automatic values", "[densifier]") {
  DensifierOptions options = fast_options(kFlightWidth, 0);
  options.simd = Simd::kAuto;
  const Densifier densifier(options, {});
  CHECK(densifier.options().threads >= 1);
  CHECK(densifier.options().simd == widest_simd());
}

TEST_CASE("a cloud follows its keyframe when poses are corrected", "[densifier]" PMSP_ACCURACY) {
  // The whole map turned and moved, as by a loop closure: same points in the camera frames, attached to the new poses.
  const RigidTransform moved_from_world{
      Eigen::AngleAxisd(1.1, Vector3d(0.2, 1.0, -0.4).normalized()).toRotationMatrix(), Vector3d(20.0, -7.0, 3.0)};
  synth::Mission moved = test_flight();
  for (synth::Frame& frame : moved.frames) {
    frame.cam_from_world = frame.cam_from_world * moved_from_world.inverse();
    for (Landmark& landmark : frame.landmarks) landmark.position_world = moved_from_world * landmark.position_world;
  }
  const Recording recording = densify(moved, fast_options());
  REQUIRE(recording.clouds.size() == test_result().clouds.size());
  for (std::size_t i = 0; i < recording.clouds.size(); ++i) {
    INFO("keyframe " << i);
    CHECK(agreement(recording.raw[i].depth, test_result().raw[i].depth, 0.01) > 0.97);
    KeyframeCloud cloud = recording.clouds[i];
    CHECK(cloud.cam_from_world.translation == moved.frames[i].cam_from_world.translation);
    cloud.cam_from_world = test_flight().frames[i].cam_from_world;  // the corrected pose
    CHECK(points_on_surface(test_flight().scene, {cloud}, 0.02) >
          points_on_surface(test_flight().scene, {test_result().clouds[i]}, 0.02) - 0.02);
  }
}

TEST_CASE("callbacks are optional", "[densifier]") {
  Densifier densifier(fast_options(), {});
  fly_through(densifier, test_flight());
  std::size_t kept = 0;
  for (const DepthMap& map : test_result().filtered) {
    kept += static_cast<std::size_t>(std::llround(filled(map.depth) * static_cast<double>(map.depth.size())));
  }
  CHECK(densifier.stats().pixels_after_consistency == static_cast<std::int64_t>(kept));
  CHECK(densifier.stats().points == 0);  // none were requested
}

TEST_CASE("a moved Densifier continues", "[densifier]") {
  Recording recording;
  auto first = std::make_unique<Densifier>(fast_options(), recording.callbacks());
  for (std::size_t i = 0; i < 3; ++i) first->add(synth::keyframe_of(test_flight(), i));
  Densifier second(std::move(*first));
  first.reset();
  for (std::size_t i = 3; i < 7; ++i) second.add(synth::keyframe_of(test_flight(), i));
  second.flush();
  CHECK(same(recording, test_result()));
}

TEST_CASE("masked pixels stay empty through all stages", "[densifier][mask]") {
  synth::Mission masked = part(0, 4);
  masked.mask = Image<std::uint8_t>(kFlightWidth, kFlightHeight, 255);
  for (int y = kFlightHeight * 3 / 4; y < kFlightHeight; ++y) {
    for (int x = 0; x < kFlightWidth; ++x) masked.mask(x, y) = 0;
  }
  const Recording recording = densify(masked, fast_options());
  for (const DepthMap& map : recording.filtered) {
    int below = 0;
    for (int y = kFlightHeight * 3 / 4; y < kFlightHeight; ++y) {
      for (int x = 0; x < kFlightWidth; ++x) below += map.depth(x, y) > 0.0F ? 1 : 0;
    }
    CHECK(below == 0);
    CHECK(filled(map.depth) > (kSanitized ? 0.0 : 0.2));
  }
}

TEST_CASE("warping the previous planes and sparse points can be switched off", "[densifier]" PMSP_ACCURACY) {
  DensifierOptions options = fast_options();
  const Recording warm = densify(part(0, 4), options);
  options.advanced.init.warp_previous = false;
  const Recording cold = densify(part(0, 4), options);
  options.advanced.init.sparse_points = false;
  const Recording colder = densify(part(0, 4), options);
  CHECK_FALSE(same(cold, colder));
  CHECK(cold.clouds.size() == 4);
  const auto share = [&](const Recording& recording) {
    double sum = 0.0;
    for (std::size_t i = 1; i < 4; ++i) {
      sum += synth::share_within(recording.raw[i].depth, test_flight().frames[i].depth, 0.02);
    }
    return sum / 3.0;
  };
  CAPTURE(share(warm), share(cold), share(colder));
  CHECK_FALSE(same(warm, cold));
  CHECK(share(warm) > share(colder) - 0.01);
  // Its purpose: consecutive keyframes need fewer iterations.
  options.advanced.init = {};
  options.advanced.patchmatch.iterations = 1;
  options.advanced.patchmatch.geometric_passes = 0;
  const double soon = share(densify(part(0, 4), options));
  options.advanced.init.warp_previous = false;
  CHECK(soon > share(densify(part(0, 4), options)) + 0.02);
}

TEST_CASE("duplicate removal over the whole mission delivers points at the end in order", "[densifier]") {
  for (const bool whole : {false, true}) {
    INFO(whole);
    DensifierOptions options = fast_options();
    options.advanced.free_space.whole_mission = whole;
    options.advanced.patchmatch.geometric_passes = 0;  // each would make all results later, and so would wider windows
    options.advanced.consistency.window = options.advanced.fusion.window = 3;
    options.advanced.consistency.min_views = 2;
    std::vector<std::int64_t> emitted;
    DensifierCallbacks callbacks;
    callbacks.cloud = [&](const KeyframeCloud& cloud) { emitted.push_back(cloud.keyframe_id); };
    Densifier densifier(options, callbacks);
    for (std::size_t i = 0; i < test_flight().frames.size(); ++i) densifier.add(synth::keyframe_of(test_flight(), i));
    CHECK(emitted.empty() == whole);
    densifier.flush();
    CHECK(emitted.size() == static_cast<std::size_t>(densifier.stats().depth_maps));
    CHECK(std::is_sorted(emitted.begin(), emitted.end()));
    CHECK(densifier.stats().points <= densifier.stats().points_fused);
  }
}

TEST_CASE("a second pass over the same places adds few points and duplicates are counted", "[densifier]") {
  const auto fly_twice = [](bool whole_mission, bool flush_between) {
    DensifierOptions options = fast_options(kTinyWidth);
    options.advanced.fusion.spacing_px = 1.0;
    options.advanced.free_space.whole_mission = whole_mission;
    Recording recording;
    Densifier densifier(options, recording.callbacks());
    for (std::size_t i = 0; i < 7; ++i) densifier.add(synth::keyframe_of(test_flight(), i));
    if (flush_between) densifier.flush();
    for (std::size_t i = 0; i < 7; ++i) {
      Keyframe again = synth::keyframe_of(test_flight(), 6 - i);
      again.id += 1000;
      densifier.add(again);
    }
    densifier.flush();
    CHECK(densifier.stats().points == static_cast<std::int64_t>(recording.points()));
    return densifier.stats();
  };
  const DensifierStats window = fly_twice(false, false);
  const DensifierStats mission = fly_twice(true, false);
  CHECK(mission.points_fused == window.points_fused);
  CHECK(mission.points + mission.points_repeated <= mission.points_fused);
  // Of the tiny maps under sanitizers, whose depths are poor, few points meet again.
  CHECK(mission.points < (kSanitized ? window.points : window.points * 9 / 10));
  CHECK(fly_twice(true, true).points > mission.points);  // a new sequence, perhaps in another frame
}
