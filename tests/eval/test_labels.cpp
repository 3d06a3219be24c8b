// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include <cmath>
#include <vector>

#include "eval/eval_flight.h"
#include "pmsp-eval/image_compare.h"
#include "pmsp-eval/label_measures.h"
#include "pmsp-eval/view_measures.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"
#include "pmsp/io/depth.h"
#include "support/temp_dir.h"

using namespace pmsp::eval;
using pmsp::Image;
using pmsp::RigidTransform;

namespace {

constexpr int kLabelWidth = 80;
constexpr int kLabelHeight = 40;

LabelTable measured(const Image<float>& estimate, const Image<float>& truth, const Image<std::uint8_t>& labels,
                    const LabelOptions& options = {}) {
  Image<float> metres = estimate;
  for (float& value : metres.pixels()) value *= static_cast<float>(options.scale);
  return measure_labels(estimate, relative_error(metres, truth, 0), truth, labels, options);
}

}  // namespace

TEST_CASE("known errors give exact shares by label") {
  // Eight stripes of ten columns, the last four glossy: right, 8 % and 20 % off, and missing; each behind and in front.
  const float factors[8] = {1.0F, 1.08F, 1.2F, 0.0F, 1.0F, 0.92F, 0.8F, 0.0F};
  Image<float> estimate(kLabelWidth, kLabelHeight);
  Image<std::uint8_t> labels(kLabelWidth, kLabelHeight);
  for (int y = 0; y < kLabelHeight; ++y) {
    for (int x = 0; x < kLabelWidth; ++x) {
      estimate(x, y) = 4.0F * factors[x / 10];
      labels(x, y) = x < 40 ? kOther : kGlossy;
    }
  }
  Image<float> truth(2 * kLabelWidth, 2 * kLabelHeight, 2.0F);
  LabelOptions options;
  options.scale = 0.5;
  const LabelTable table = measured(estimate, truth, labels, options);
  REQUIRE(table.size() == 3);
  const LabelMeasures& all = table.at(kAllLabels);
  const LabelMeasures& other = table.at(kOther);
  const LabelMeasures& glossy = table.at(kGlossy);
  CHECK(glossy.pixels / all.pixels == Approx(0.5));
  CHECK(all.missing_share() == Approx(0.25));
  CHECK(all.wrong_share() == Approx(0.5));
  CHECK(all.behind_share() == Approx(1.0 / 6.0));
  CHECK(other.behind_share() == Approx(1.0 / 3.0));
  CHECK(other.in_front_share() == 0.0);
  CHECK(glossy.behind_share() == 0.0);
  CHECK(glossy.in_front_share() == Approx(1.0 / 3.0));
  options.max_relative_error = 0.1;
  CHECK(measured(estimate, truth, labels, options).at(kGlossy).wrong_share() == Approx(0.25));

  const LabelTable unlabelled = measured(estimate, truth, {}, options);
  REQUIRE(unlabelled.size() == 1);
  CHECK(unlabelled.at(kAllLabels).behind_share() == Approx(1.0 / 6.0));
  truth = Image<float>(kLabelWidth, kLabelHeight);  // no truth, no figures
  CHECK(measured(estimate, truth, labels, options).at(kAllLabels).pixels == 0.0);
}

TEST_CASE("a lost thin structure is missing or wrong and a grown one is measured beside it across the seam") {
  Image<float> truth(kLabelWidth, kLabelHeight, 3.0F);
  Image<std::uint8_t> labels(kLabelWidth, kLabelHeight);
  for (int y = 15; y < 25; ++y) {
    truth(0, y) = 2.0F;
    labels(0, y) = kThin;
  }
  LabelOptions options;
  options.beside_px = 3;
  const LabelMeasures right = measured(truth, truth, labels, options).at(kThin);
  CHECK(right.missing_share() == 0.0);
  CHECK(right.wrong_share() == 0.0);
  CHECK(right.grown_share() == 0.0);

  Image<float> lost(kLabelWidth, kLabelHeight, 3.0F);
  for (int y = 15; y < 20; ++y) lost(0, y) = 0.0F;
  const LabelMeasures half = measured(lost, truth, labels, options).at(kThin);
  CHECK(half.missing_share() == Approx(0.5));
  CHECK(half.wrong_share() == Approx(0.5));
  CHECK(half.behind_share() == Approx(1.0));

  const Image<float> slack = relative_error(lost, truth, 1);  // the wall is one pixel aside
  CHECK(measure_labels(lost, slack, truth, labels, options).at(kThin).wrong_share() == Approx(0.5));

  Image<float> grown = truth;
  for (int y = 15; y < 25; ++y) grown(kLabelWidth - 2, y) = grown(1, y) = 2.0F;
  grown(10, 20) = 2.0F;  // too far from it to be counted
  grown(1, 13) = 2.5F;   // wrong, but not its depth
  const LabelMeasures more = measured(grown, truth, labels, options).at(kThin);
  CHECK(more.wrong_share() == 0.0);
  CHECK(more.grown_share() == Approx(20.0 / (6.0 * 10.0 + 7.0 * 6.0)).epsilon(0.02));
}

TEST_CASE("growth of thin structures is the same in any unit of the estimates") {
  const Image<float> truth(kLabelWidth, kLabelHeight, 3.0F);
  Image<float> thing = truth;
  Image<float> estimate(kLabelWidth, kLabelHeight, 6.0F);
  Image<std::uint8_t> labels(kLabelWidth, kLabelHeight);
  for (int y = 15; y < 25; ++y) {
    thing(40, y) = 2.0F;
    labels(40, y) = kThin;
    estimate(40, y) = estimate(41, y) = 4.0F;
  }
  LabelOptions options;
  options.beside_px = 1;
  options.scale = 0.5;
  CHECK(measured(estimate, thing, labels, options).at(kThin).grown_share() ==
        Approx(10.0 / (2.0 * 10.0 + 2.0 * 3.0)).epsilon(0.02));
}

TEST_CASE("points count as behind only if they are behind in every view") {
  // Two views of a sphere; the second one sees an obstacle at 1 m instead of it ahead, where x and y are small.
  const int height = 60;
  const auto view = [&](double along_x) {
    TrueView result{{Eigen::Matrix3d::Identity(), {-along_x, 0.0, 0.0}},
                    Image<float>(2 * height, height),
                    Image<std::uint8_t>(2 * height, height)};
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < 2 * height; ++x) {
        const Eigen::Vector3d ray = pmsp::bearing_from_pixel({x + 0.5, y + 0.5}, 2 * height, height);
        result.range(x, y) = static_cast<float>(pmsp_test::sphere(4.0)({along_x, 0.0, 0.0}, ray));
        result.labels(x, y) = ray.y() > 0.0 ? kGlossy : kOther;
      }
    }
    return result;
  };
  std::vector<TrueView> views = {view(0.0), view(0.5)};
  views[1].range(height, height / 2) = 1.0F;
  const auto share = [&](const Eigen::Vector3f& point) { return count_behind({point}, views, 0.1, 1); };
  const Eigen::Vector3f ahead(0.5F, 0.05F, 4.0F);  // on the sphere, hidden from the second view only
  CHECK(share(ahead).at(kAllLabels) == 0);
  CHECK(share(1.05F * ahead).at(kAllLabels) == 0);
  CHECK(share(0.5F * ahead).at(kAllLabels) == 0);
  CHECK(share(1.2F * ahead).at(kAllLabels) == 1);
  const auto below = count_behind({{0.0F, 5.0F, 0.1F}, {0.0F, -5.0F, 0.1F}, {0.0F, 5.0F, 0.5F}}, views, 0.1, 2);
  CHECK(below.at(kAllLabels) == 3);
  CHECK(below.at(kGlossy) == 2);
  CHECK(below.at(kOther) == 1);
  views[0].range = views[1].range = Image<float>(2 * height, height);  // nothing is known
  CHECK(share(1.2F * ahead).at(kAllLabels) == 0);
}

TEST_CASE("a view without truth in a direction does not prevent a point from counting as behind") {
  std::vector<TrueView> views(2);
  for (TrueView& view : views) view.range = Image<float>(kLabelWidth, kLabelHeight, 4.0F);
  const Eigen::Vector3f beyond(0.5F, 0.2F, 5.0F);
  CHECK(count_behind({beyond}, views, 0.1, 1).at(kAllLabels) == 1);
  for (TrueView& view : views) {
    view.range = Image<float>(kLabelWidth, kLabelHeight);
    CHECK(count_behind({beyond}, views, 0.1, 1).at(kAllLabels) == (&view == &views.front() ? 1 : 0));
  }
}

TEST_CASE("label images are found beside the range maps and reach the measures of clouds") {
  const pmsp_test::TempDir folder;
  const pmsp_test::Flight flight(pmsp_test::sphere(4.0), 3, 0.3);
  flight.write_truth(folder.path(), 60);
  CHECK(GroundTruth::load_labels(GroundTruth(folder.path(), {}).range_maps()[0]).empty());

  std::filesystem::create_directory(folder / "label");
  Image<float> label(120, 60, 7.0F);
  label(3, 2) = 1.0F;
  for (const char* name : {"000000.png", "1_label.png"}) pmsp::write_png16(folder / "label" / name, label, 1.0);
  const GroundTruth truth(folder.path(), {});
  CHECK(GroundTruth::load_labels(truth.range_maps()[0])(3, 2) == kThin);
  CHECK(GroundTruth::load_labels(truth.range_maps()[0])(4, 2) == 7);
  CHECK(GroundTruth::load_labels(truth.range_maps()[2]).empty());

  const Alignment alignment = align(flight.keyframes(), truth.trajectory());
  const AlignedCloud cloud =
      align_cloud(flight.points(60, 1.3), flight.keyframes(), alignment.truth_from_map, truth.origin());
  ViewOptions options;
  options.height = 30;
  const ViewMeasures measures = measure_views(cloud, alignment, truth, options);
  const LabelTable& table = measures.mean.labels;
  CHECK(label_name(7) == "label 7");
  CHECK(table.at(7).behind_share() > 0.99);
  CHECK(table.at(7).pixels == Approx(2.0 / 3.0 * table.at(kAllLabels).pixels).epsilon(0.01));
  const std::vector<TrueView>& views = measures.truth;
  REQUIRE(views.size() == 3);
  CHECK(views[2].labels.empty());
  CHECK(views[1].labels.width() == 60);
  CHECK(count_behind(cloud.points, views, 0.1, 0).at(kAllLabels) == cloud.points.size());

  pmsp::write_png16(folder.path() / "label" / "000002.png", Image<float>(5, 4), 1.0);
  const GroundTruth broken(folder.path(), {});
  CHECK_THROWS_AS(GroundTruth::load_labels(broken.range_maps()[2]), pmsp::InvalidInput);
}

TEST_CASE("estimates of sky and riders are wrong and do not count as pixels with truth") {
  Image<float> truth(kLabelWidth, kLabelHeight, 2.0F);
  Image<float> estimate = truth;
  Image<std::uint8_t> labels(kLabelWidth, kLabelHeight);
  for (int y = 0; y < kLabelHeight; ++y) {
    for (int x = 0; x < 20; ++x) {
      truth(x, y) = 0.0F;
      labels(x, y) = x < 10 ? kSky : kRider;
      if (x % 10 < 5) estimate(x, y) = 0.0F;
    }
  }
  const LabelTable table = measured(estimate, truth, labels);
  for (const int label : {kSky, kRider}) {
    CHECK(table.at(label).missing_share() == Approx(0.5));
    CHECK(table.at(label).wrong_share() == Approx(0.5));
    CHECK(table.at(label).in_front_share() == Approx(1.0));
  }
  CHECK(table.at(kAllLabels).pixels == Approx(table.at(kOther).pixels));
  CHECK(table.at(kAllLabels).wrong_share() == 0.0);
}

TEST_CASE("points in front of sky and movers are counted and those on the surface behind are not") {
  TrueView view;
  view.range = Image<float>(kLabelWidth, kLabelHeight, 4.0F);
  view.labels = Image<std::uint8_t>(kLabelWidth, kLabelHeight);
  for (int y = 0; y < kLabelHeight; ++y) {
    for (int x = 0; x < kLabelWidth; ++x) {
      if (y >= kLabelHeight / 2) continue;
      view.labels(x, y) = x < kLabelWidth / 2 ? kSky : kMover;
      if (x < kLabelWidth / 2) view.range(x, y) = 0.0F;
    }
  }
  const Eigen::Vector3f in_sky(-1.0F, -1.0F, 0.5F);
  const Eigen::Vector3f on_mover(1.0F, -1.0F, 0.5F);
  const Eigen::Vector3f below(1.0F, 1.0F, 0.5F);
  const auto counts = [&](const Eigen::Vector3f& point) { return count_floating({point}, {view}, 0.05, 1); };
  CHECK(counts(in_sky) == std::map<int, std::size_t>{{kSky, 1}});
  CHECK(counts(100.0F * in_sky) == std::map<int, std::size_t>{{kSky, 1}});
  CHECK(counts(on_mover) == std::map<int, std::size_t>{{kMover, 1}});
  CHECK(counts(4.0F * on_mover.normalized()).empty());
  CHECK(counts(below).empty());
  view.labels = {};
  CHECK(counts(in_sky).empty());
}
