// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include <atomic>
#include <cmath>
#include <random>
#include <stdexcept>

#include "pmsp-eval/nearest_point.h"
#include "pmsp-eval/parallel.h"
#include "pmsp-eval/statistics.h"

using namespace pmsp::eval;

TEST_CASE("the nearest point is the nearest of all") {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
  const auto draw = [&] { return Eigen::Vector3f{uniform(random), uniform(random), 0.1F * uniform(random)}; };
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 3000; ++i) points.push_back(draw());
  for (int i = 0; i < 100; ++i) points.push_back(points.front());  // many in one place
  const NearestPoint tree(points);
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3f query = 1.5F * draw();
    float best = 1e9F;
    for (const auto& p : points) best = std::min(best, (p - query).norm());
    const auto hit = tree.find(query);
    REQUIRE(hit.has_value());
    CHECK(hit->distance == Approx(best));
    CHECK((points[hit->index] - query).norm() == Approx(best));
    CHECK(tree.find(query, best * 1.01F).has_value());
    CHECK_FALSE(tree.find(query, best * 0.99F).has_value());
  }
}

TEST_CASE("an empty set has no nearest point") {
  const std::vector<Eigen::Vector3f> none;
  CHECK_FALSE(NearestPoint(none).find(Eigen::Vector3f::Zero()).has_value());
}

TEST_CASE("percentiles interpolate between ranks") {
  std::vector<double> values = {4.0, 1.0, 3.0, 2.0};
  CHECK(percentile(values, 50.0) == Approx(2.5));
  CHECK(percentile(values, 0.0) == 1.0);
  CHECK(percentile(values, 100.0) == 4.0);
  CHECK(percentile(values, 90.0) == Approx(3.7));
  std::vector<double> empty;
  CHECK(std::isnan(percentile(empty, 50.0)));
}

TEST_CASE("indices are spread evenly") {
  CHECK(spread_indices(5, 0) == std::vector<std::size_t>{0, 1, 2, 3, 4});
  CHECK(spread_indices(5, 9).size() == 5);
  CHECK(spread_indices(11, 3) == std::vector<std::size_t>{0, 5, 10});
  CHECK(spread_indices(11, 1) == std::vector<std::size_t>{5});
  CHECK(spread_indices(0, 3).empty());
}

TEST_CASE("parallel work covers everything once and propagates errors") {
  std::vector<std::atomic<int>> visits(1003);
  parallel_chunks(visits.size(), 10, 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) ++visits[i];
  });
  for (const auto& count : visits) CHECK(count == 1);
  parallel_chunks(0, 10, 4, [](std::size_t, std::size_t) { FAIL("no work to do"); });
  CHECK_THROWS_AS(parallel_chunks(100, 1, 3,
                                  [](std::size_t begin, std::size_t) {
                                    if (begin == 50) throw std::runtime_error("broken");
                                  }),
                  std::runtime_error);
}
