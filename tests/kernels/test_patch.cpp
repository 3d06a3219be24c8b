// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <vector>

#include "kernels/kernel_helpers.h"
#include "patch.h"
#include "pmsp/stages.h"
#include "sphere/panorama_data.h"
#include "synth/mission.h"

using namespace pmsp;
using pmsp::kernels::Vec3;
using pmsp::test::cast;
using pmsp::test::Draws;
using pmsp::test::frame_at;
namespace k = pmsp::kernels;
using Source = k::SourceView<k::CubeView>;

namespace {

constexpr int kWidth = 640;
constexpr int kHeight = 320;

Image<float> gray_of(const Image<Rgb>& image) {
  Image<float> gray(image.width(), image.height());
  for (std::size_t i = 0; i < gray.size(); ++i) {
    const Rgb& p = image.pixels()[i];
    gray.pixels()[i] = 0.299F * p.r + 0.587F * p.g + 0.114F * p.b;
  }
  return gray;
}

CubeMap cube_of(const Image<float>& gray, float gain = 1.0F, float offset = 0.0F) {
  ThreadPool pool(0);
  Image<float> changed = gray;
  for (float& value : changed.pixels()) value = gain * value + offset;
  return make_cube_map(changed, cube_size_for(gray.width()), pool);
}

CubeMap noise_cube(std::uint64_t seed) {
  Draws draws(seed);
  Image<float> noise(kWidth, kHeight);
  for (float& value : noise.pixels()) value = static_cast<float>(draws.uniform(0.0, 255.0));
  return cube_of(noise);
}

/// A pixel whose surface is known, plane enough and seen by the neighbours under some parallax.
struct Sample {
  k::PatchFrame<double> frame;
  Vec3<double> plane;
  double depth;
};

/// A room with strong texture seen from three poses; the middle one is the reference.
class Room {
 public:
  Room() : params(test::patch_params(kWidth)) {
    synth::Recipe recipe;
    recipe.keyframes = 3;
    recipe.mission.render.samples = 2;
    recipe.mission.landmarks.count = 1;
    mission = std::make_unique<synth::Mission>(synth::empty_room(recipe));
    for (const synth::Frame& frame : mission->frames) {
      grays.push_back(gray_of(frame.image));
      cubes.push_back(cube_of(grays.back()));
    }
    choose_samples();
  }

  Source view(std::size_t frame) const { return view(frame, cubes[frame]); }
  Source view(std::size_t frame, const CubeMap& image) const {
    return {image.view(),
            CubeMap().view(),
            to_rigid(mission->frames[frame].cam_from_world * mission->frames[1].cam_from_world.inverse()),
            {nullptr, nullptr, nullptr, 0, 0}};
  }
  k::CubeView reference() const { return cubes[1].view(); }

  k::PatchParams params;
  std::unique_ptr<synth::Mission> mission;
  std::vector<Image<float>> grays;
  std::vector<CubeMap> cubes;
  std::vector<Sample> samples;

 private:
  bool is_flat_around(int x, int y) const {
    const synth::Frame& frame = mission->frames[1];
    for (int dy = -6; dy <= 6; dy += 6) {
      for (int dx = -6; dx <= 6; dx += 6) {
        if (frame.surface((x + dx + kWidth) % kWidth, std::clamp(y + dy, 0, kHeight - 1)) != frame.surface(x, y))
          return false;
      }
    }
    return true;
  }

  void choose_samples() {
    const synth::Frame& frame = mission->frames[1];
    const RigidTransform other_from_ref = mission->frames[2].cam_from_world * frame.cam_from_world.inverse();
    const Eigen::Vector3d center = other_from_ref.center();
    Draws draws(11);
    for (int i = 0; i < 20000 && samples.size() < 600; ++i) {
      const int x = draws.below(kWidth);
      const int y = draws.below(kHeight);
      const k::PatchFrame<double> at = frame_at(x + 0.5, y + 0.5, kWidth, kHeight, params.spacing);
      const Eigen::Vector3f n = frame.normal(x, y);
      const Vec3<double> normal{n.x(), n.y(), n.z()};
      const double depth = frame.depth(x, y);
      const Vec3<double> other_to_point = depth * at.bearing - Vec3<double>{center.x(), center.y(), center.z()};
      const double parallax = k::angle_between(at.bearing, other_to_point);
      if (k::dot(normal, at.bearing) > -0.6 || parallax < 5.0 / 57.3 || !is_flat_around(x, y)) continue;
      samples.push_back({at, k::plane_from(1.0 / depth, normal, at.bearing), depth});
    }
  }
};

const Room& room() {
  static const Room instance;
  return instance;
}

template <class F>
k::PatchFrame<F> frame_cast(const k::PatchFrame<double>& frame) {
  return {cast<F>(frame.bearing), cast<F>(frame.right), cast<F>(frame.down)};
}

template <class F>
k::ViewWeights<F> alike() {
  k::ViewWeights<F> weights;
  k::set_equal_weights(weights);
  return weights;
}

template <class F>
F score(const k::CubeView& reference, const k::PatchParams& params, const Sample& sample,
        const std::vector<Source>& views, double depth_factor = 1.0) {
  const k::PatchFrame<F> frame = frame_cast<F>(sample.frame);
  k::ReferencePatch<F> patch;
  k::load_patch(patch, reference, frame, params, false);
  k::ViewWeights<F> weights = alike<F>();
  return k::plane_score(patch, frame, views.data(), static_cast<int>(views.size()),
                        cast<F>((1.0 / depth_factor) * sample.plane), params, weights, false);
}

float score(const Sample& sample, const std::vector<Source>& views, double depth_factor = 1.0) {
  return score<float>(room().reference(), room().params, sample, views, depth_factor);
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

/// The depth factor of the highest score among steps of 1 % around the truth.
double best_factor(const Sample& sample, const std::vector<Source>& views) {
  double best = 0.0;
  float highest = -2.0F;
  for (int step = -20; step <= 20; ++step) {
    const double factor = std::pow(1.01, step);
    const float value = score(sample, views, factor);
    if (value <= highest) continue;
    highest = value;
    best = factor;
  }
  return best;
}

double sigma(const k::ReferencePatch<double>& patch, const k::PatchParams& params, bool fine = false) {
  return k::sigma_color<double>(patch, params, fine ? k::kFineSigmaPerSpread : k::kSigmaPerSpread);
}

k::PatchParams checking_layout() {
  k::PatchParams params = room().params;
  params.disagreement_cost = 0.5F;
  params.disagreement_tolerance = 0.1F;
  return params;
}

/// A frame's own depth map, as it truly is, or `nearer` times as far away.
class TrueSurface {
 public:
  explicit TrueSurface(const synth::Frame& frame, double nearer = 1.0) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const Vec3<double> bearing = frame_at(x + 0.5, y + 0.5, kWidth, kHeight).bearing;
        const Eigen::Vector3f n = frame.normal(x, y);
        const double depth = nearer * static_cast<double>(frame.depth(x, y));
        const Vec3<double> plane = k::plane_from(1.0 / depth, Vec3<double>{n.x(), n.y(), n.z()}, bearing);
        planes_[0].push_back(static_cast<float>(plane.x));
        planes_[1].push_back(static_cast<float>(plane.y));
        planes_[2].push_back(static_cast<float>(plane.z));
      }
    }
  }

  k::PlaneMapView view() const { return {planes_[0].data(), planes_[1].data(), planes_[2].data(), kWidth, kHeight}; }

 private:
  std::vector<float> planes_[3];
};

}  // namespace

TEST_CASE("score: near 1 for the true plane and clearly lower at a depth error of 5 %") {
  REQUIRE(room().samples.size() == 600);
  const std::vector<Source> views = {room().view(0), room().view(2)};
  std::vector<double> at_truth;
  std::vector<double> drops;
  int truth_wins = 0;
  for (const Sample& sample : room().samples) {
    const double truth = score(sample, views);
    const double other = std::max(score(sample, views, 1.05), score(sample, views, 1.0 / 1.05));
    at_truth.push_back(truth);
    drops.push_back(truth - other);
    if (truth > other) ++truth_wins;
    REQUIRE(truth <= 1.0001);
    REQUIRE(other >= -1.0001);
  }
  INFO("median " << median(at_truth) << ", drop " << median(drops) << ", truth wins " << truth_wins);
  CHECK(median(at_truth) > 0.95);
  CHECK(median(drops) > 0.1);
  CHECK(truth_wins > 580);
}

TEST_CASE("score: the true slant beats a plane that faces the camera") {
  const std::vector<Source> views = {room().view(0), room().view(2)};
  int slanted = 0;
  int truth_wins = 0;
  for (const Sample& sample : room().samples) {
    Sample frontal = sample;
    frontal.plane = (1.0 / sample.depth) * sample.frame.bearing;
    if (k::angle_between(sample.plane, frontal.plane) < 0.6) continue;
    ++slanted;
    if (score(sample, views) > score(frontal, views)) ++truth_wins;
  }
  REQUIRE(slanted > 100);
  INFO(truth_wins << " of " << slanted);
  CHECK(truth_wins > 0.9 * slanted);
}

TEST_CASE("score: invariant to gain and offset of a source view") {
  const CubeMap dim = cube_of(room().grays[2], 0.6F, 20.0F);
  double sum = 0.0;
  std::vector<double> differences;
  for (const Sample& sample : room().samples) {
    const double plain = score(sample, {room().view(2)});
    const double dimmed = score(sample, {room().view(2, dim)});
    differences.push_back(std::fabs(plain - dimmed));
    sum += differences.back() / static_cast<double>(room().samples.size());
  }
  INFO("mean " << sum << ", worst " << *std::max_element(differences.begin(), differences.end()));
  CHECK(sum < 0.005);
  CHECK(*std::max_element(differences.begin(), differences.end()) < 0.05);
}

TEST_CASE("score: without texture in reference or source view or both it is small and never NaN") {
  for (const float level : {0.0F, 127.3F, 255.0F}) {
    const CubeMap plain = cube_of(Image<float>(kWidth, kHeight, level));
    for (std::size_t i = 0; i < 100; ++i) {
      const Sample& sample = room().samples[i];
      const float both = score<float>(plain.view(), room().params, sample, {room().view(2, plain)});
      const float reference = score<float>(plain.view(), room().params, sample, {room().view(2)});
      const float neighbour = score(sample, {room().view(2, plain)});
      REQUIRE(std::fabs(both) < 0.05F);
      REQUIRE(std::fabs(reference) < 0.05F);
      REQUIRE(std::fabs(neighbour) < 0.05F);
    }
  }
}

TEST_CASE("score: a nearly uniform patch scores far lower than the same patch with texture") {
  // a contrast of +- 1 gray level is rounding noise, not texture
  std::vector<Image<float>> faint = {room().grays[1], room().grays[2]};
  for (Image<float>& gray : faint) {
    for (float& value : gray.pixels()) value = 128.0F + 0.01F * (value - 128.0F);
  }
  const CubeMap reference = cube_of(faint[0]);
  const CubeMap neighbour = cube_of(faint[1]);
  std::vector<double> scores;
  for (const Sample& sample : room().samples) {
    scores.push_back(score<float>(reference.view(), room().params, sample, {room().view(2, neighbour)}));
  }
  CHECK(median(scores) < 0.5);
}

TEST_CASE("score: invariant to the order of the source views") {
  const CubeMap garbage = noise_cube(3);
  std::vector<Source> views = {room().view(0), room().view(2), room().view(0, garbage), room().view(1, garbage)};
  std::vector<int> order = {0, 1, 2, 3};
  for (std::size_t i = 0; i < 40; ++i) {
    const Sample& sample = room().samples[i];
    const float expected = score(sample, views, 1.01);
    do {
      std::vector<Source> permuted;
      for (const int view : order) permuted.push_back(views[static_cast<std::size_t>(view)]);
      REQUIRE(score(sample, permuted, 1.01) == Approx(expected).margin(2e-6));
    } while (std::next_permutation(order.begin(), order.end()));
  }
}

TEST_CASE("score: one view twice scores like the view alone") {
  for (std::size_t i = 0; i < 100; ++i) {
    const Sample& sample = room().samples[i];
    const Source view = room().view(2);
    REQUIRE(score(sample, {view, view}) == Approx(score(sample, {view})).margin(1e-6));
    REQUIRE(score(sample, std::vector<Source>(8, view)) == Approx(score(sample, {view})).margin(1e-6));
  }
}

TEST_CASE("score: one unrelated source view lowers it but does not change the best depth") {
  const CubeMap garbage = noise_cube(5);
  const std::vector<Source> orders[] = {{room().view(2), room().view(0, garbage)},
                                        {room().view(0, garbage), room().view(2)}};
  int alone_right = 0;
  int still_right[2] = {0, 0};
  int lower = 0;
  for (std::size_t i = 0; i < 150; ++i) {
    const Sample& sample = room().samples[i];
    const double alone = best_factor(sample, {room().view(2)});
    if (std::fabs(alone - 1.0) > 0.025) continue;
    ++alone_right;
    for (int order = 0; order < 2; ++order) {
      if (std::fabs(best_factor(sample, orders[order]) - 1.0) < 0.035) ++still_right[order];
    }
    if (score(sample, orders[0]) < score(sample, {room().view(2)})) ++lower;
  }
  INFO(alone_right << " right alone; with garbage " << still_right[0] << " and " << still_right[1]);
  CHECK(alone_right > 130);
  CHECK(still_right[0] > 0.95 * alone_right);
  CHECK(still_right[1] == still_right[0]);
  CHECK(lower > 0.95 * alone_right);
}

TEST_CASE("score: a masked source view gives exactly -1") {
  ThreadPool pool(0);
  const CubeMap none = make_matchable_cube(Image<std::uint8_t>(kWidth, kHeight, 0), cube_size_for(kWidth), 3.0, pool);
  const CubeMap all = make_matchable_cube(Image<std::uint8_t>(kWidth, kHeight, 255), cube_size_for(kWidth), 3.0, pool);
  for (std::size_t i = 0; i < 100; ++i) {
    const Sample& sample = room().samples[i];
    Source view = room().view(2);
    const float open = score(sample, {view});
    view.matchable = all.view();
    REQUIRE(score(sample, {view}) == open);
    view.matchable = none.view();
    REQUIRE(score(sample, {view}) == -1.0F);
  }
}

TEST_CASE("reference patch: weights sum to 1, contrast is centred and has unit variance where there is texture") {
  for (std::size_t i = 0; i < 200; ++i) {
    const k::PatchFrame<float> frame = frame_cast<float>(room().samples[i].frame);
    k::ReferencePatch<float> patch;
    k::load_patch(patch, room().reference(), frame, room().params, false);
    double weights = 0.0;
    double sum = 0.0;
    double square = 0.0;
    for (int n = 0; n < k::kPatchSamples; ++n) {
      REQUIRE(patch.weight(n) >= 0.0F);
      weights += patch.weight(n);
      sum += patch.value(n);
      square += static_cast<double>(patch.value(n)) * patch.value(n) / patch.weight(n);
    }
    REQUIRE(weights == Approx(1.0).epsilon(1e-5));
    REQUIRE(std::fabs(sum) < 1e-4);
    const double variance = patch.variance;
    REQUIRE(square == Approx(variance / (variance + room().params.min_variance)).epsilon(1e-3));
  }
}

TEST_CASE("score in float and in double agree") {
  const std::vector<Source> views = {room().view(0), room().view(2)};
  double worst = 0.0;
  Draws draws(12);
  for (const Sample& sample : room().samples) {
    const double factor = draws.uniform(0.7, 1.4);
    const double in_float = score<float>(room().reference(), room().params, sample, views, factor);
    const double in_double = score<double>(room().reference(), room().params, sample, views, factor);
    worst = std::max(worst, std::fabs(in_float - in_double));
  }
  INFO("worst " << worst);
  CHECK(worst < 1e-3);
}

TEST_CASE("bilateral weights: pixels beyond a silhouette have no weight and texture keeps its weight") {
  k::PatchParams params = room().params;
  params.min_sigma_color = 4.0F;
  params.max_sigma_color = 20.0F;
  Draws draws(21);
  k::ReferencePatch<double> smooth;
  k::ReferencePatch<double> textured;
  for (int i = 0; i < k::kPatchSamples; ++i) {  // a third lies on something else
    smooth.put(i, 0.0, draws.uniform(-1.0, 1.0) + (i % k::kPatchSide >= 4 ? 60.0 : 0.0));
    textured.put(i, 0.0, draws.uniform(-40.0, 40.0));
  }
  CHECK(sigma(smooth, params) == Approx(4.0));
  CHECK(sigma(textured, params) == Approx(20.0));
  for (double& value : smooth.values) value *= 3.0;  // in between it grows with the spread
  CHECK(sigma(smooth, params) > 4.5);
  CHECK(sigma(smooth, params) < 15.0);
  CHECK(sigma(smooth, params, true) < 0.7 * sigma(smooth, params));
  params.min_sigma_color = 20.0F;
  CHECK(sigma(smooth, params) == Approx(20.0));
}

TEST_CASE("geometric consistency: the score decreases by the difference to a source view's depth map") {
  const Room& scene = room();
  const k::PatchParams params = checking_layout();
  const TrueSurface surface(scene.mission->frames[2]);
  const Source without = scene.view(2);
  Source with = without;
  with.surface = surface.view();
  int agreed = 0;
  for (const Sample& sample : scene.samples) {
    k::ReferencePatch<double> patch;
    k::load_patch(patch, scene.reference(), sample.frame, params, true);
    const auto lost = [&](double factor) {
      const Vec3<double> plane = factor * sample.plane;
      return k::view_result(patch, sample.frame, without, plane, params).score -
             k::view_result(patch, sample.frame, with, plane, params).score;
    };
    REQUIRE(lost(1.0) >= 0.0);
    agreed += lost(1.0) < 0.01 ? 1 : 0;
    REQUIRE(lost(1.0 / 1.3) == Approx(0.5));  // 30 % behind all existing surfaces
  }
  CHECK(agreed > 0.95 * static_cast<double>(scene.samples.size()));
}

TEST_CASE("a source view that sees the plane occluded has no weight") {
  const Room& scene = room();
  const k::PatchParams params = checking_layout();
  const TrueSurface before(scene.mission->frames[0]);
  const TrueSurface after(scene.mission->frames[2]);
  const TrueSurface in_front(scene.mission->frames[2], 0.7);  // a thing between that neighbour and all that it sees
  Source views[2] = {scene.view(0), scene.view(2)};
  double clear = 0.0;
  double hidden = 0.0;
  double plain = 0.0;
  double both_hidden = 0.0;
  for (const Sample& sample : scene.samples) {
    const auto found = [&](const k::PlaneMapView& first, const k::PlaneMapView& second, bool fine) {
      k::ReferencePatch<double> patch;
      k::load_patch(patch, scene.reference(), sample.frame, params, fine);
      views[0].surface = first;
      views[1].surface = second;
      k::ViewWeights<double> weights = alike<double>();
      return k::plane_score(patch, sample.frame, views, 2, sample.plane, params, weights, false);
    };
    clear += found(before.view(), after.view(), true);
    hidden += found(before.view(), in_front.view(), true);
    plain += found(before.view(), in_front.view(), false);
    both_hidden += found(in_front.view(), in_front.view(), true);
  }
  const double count = static_cast<double>(scene.samples.size());
  CHECK(hidden / count == Approx(clear / count).margin(0.03));
  CHECK(plain / count < hidden / count - 0.1);  // without texture there is no evidence for a plane behind a surface
  CHECK(both_hidden / count < hidden / count - 0.3);  // at least one view must see it
}

TEST_CASE("a source view with a low score for the pixel's plane has little weight for its other hypotheses") {
  const Room& scene = room();
  const CubeMap other_place = noise_cube(31);
  const Source views[3] = {scene.view(0), scene.view(2, other_place), scene.view(2)};
  double gained = 0.0;
  int unheard = 0;
  for (const Sample& sample : scene.samples) {
    k::ReferencePatch<double> patch;
    k::load_patch(patch, scene.reference(), sample.frame, scene.params, false);
    k::ViewWeights<double> weights = alike<double>();
    const auto scored = [&](double factor, bool weigh) {
      return k::plane_score(patch, sample.frame, views, 3, factor * sample.plane, scene.params, weights, weigh);
    };
    const double before = scored(1.01, false);
    const double own = scored(1.0, true);
    REQUIRE(own == Approx(scored(1.0, false)));
    gained += (scored(1.01, false) - before) / static_cast<double>(scene.samples.size());
    unheard += weights.of[1] < 0.05 * std::min(weights.of[0], weights.of[2]) ? 1 : 0;
  }
  CHECK(unheard > 0.95 * static_cast<double>(scene.samples.size()));
  CHECK(gained > 0.1);  // a third of the mean over all was its score, which is half of the plane's
}

TEST_CASE("two source views have equal weight and none is lost where all scores are low") {
  const Room& scene = room();
  const CubeMap other_place = noise_cube(32);
  const Source views[3] = {scene.view(0, other_place), scene.view(2, other_place), scene.view(0, other_place)};
  const Sample& sample = scene.samples.front();
  k::ReferencePatch<float> patch;
  const k::PatchFrame<float> frame = frame_cast<float>(sample.frame);
  k::load_patch(patch, scene.reference(), frame, scene.params, false);
  for (const int count : {2, 3}) {
    k::ViewWeights<float> weights = alike<float>();
    const float own =
        k::plane_score(patch, frame, views, count, cast<float>(sample.plane), scene.params, weights, true);
    INFO(count << " views, score " << own);
    CHECK(std::fabs(own) < 0.9F);  // a number
    CHECK((weights.of[0] == 1.0F) == (count == 2));
    CHECK(weights.of[1] > 0.0F);
    CHECK(weights.of[2] > 0.0F);
  }
}
