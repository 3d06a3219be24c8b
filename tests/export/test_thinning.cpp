// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <map>
#include <set>

#include <catch2/catch.hpp>

#include "export/sample_points.h"
#include "export/thinning.h"
#include "pmsp/error.h"
#include "support/temp_dir.h"

using namespace pmsp;
using namespace pmsp_test;

namespace {

using Key = std::pair<std::int64_t, std::uint32_t>;

std::vector<OutputPoint> thinned(const ThinningOptions& options, const std::vector<OutputPoint>& points) {
  const TempDir scratch;
  std::vector<OutputPoint> kept;
  Thinning thinning(options, scratch.path().string());
  for (std::size_t i = 0; i < points.size(); i += 1000) {
    thinning.add(points.data() + i, std::min<std::size_t>(1000, points.size() - i));
  }
  thinning.finish([&](const OutputPoint* some, std::size_t count) { kept.insert(kept.end(), some, some + count); });
  CHECK(scratch.entries() == 0);
  return kept;
}

std::set<Key> keys_of(const std::vector<OutputPoint>& points) {
  std::set<Key> keys;
  for (const OutputPoint& p : points) keys.insert({p.keyframe_id, p.pixel});
  CHECK(keys.size() == points.size());
  return keys;
}

std::vector<OutputPoint> turned_round(std::vector<OutputPoint> points) {
  std::reverse(points.begin(), points.end());
  std::rotate(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(points.size() / 3), points.end());
  return points;
}

}  // namespace

TEST_CASE("only the most confident point of each voxel is kept") {
  const std::vector<OutputPoint> points = sample_points(100000);
  const double side = GENERATE(0.05, 0.3, 7.0);
  std::map<std::array<double, 3>, const OutputPoint*> best;
  for (const OutputPoint& p : points) {
    const OutputPoint*& it =
        best[{std::floor(p.position.x() / side), std::floor(p.position.y() / side), std::floor(p.position.z() / side)}];
    if (it == nullptr || p.confidence > it->confidence) it = &p;
  }
  std::set<Key> expected;
  for (const auto& [cell, p] : best) expected.insert({p->keyframe_id, p->pixel});
  CHECK(keys_of(thinned({side, 0}, points)) == expected);
}

TEST_CASE("voxels on either side of zero are distinct") {
  std::vector<OutputPoint> points = sample_points(4);
  points[0].position = {0.4, 0.4, 0.4};
  points[1].position = {-0.4, 0.4, 0.4};
  points[2].position = {-0.4, -0.4, 0.4};
  points[3].position = {-0.4, -0.4, -0.4};
  CHECK(thinned({1.0, 0}, points).size() == 4);
  CHECK(thinned({1.0, 0}, {points[3], points[3]}).size() == 1);
}

TEST_CASE("the kept points do not depend on their order") {
  std::vector<OutputPoint> points = sample_points(100000);
  for (std::size_t i = 0; i < points.size(); ++i) points[i].confidence = 0.25F * static_cast<float>(i % 4);  // ties
  const ThinningOptions options = GENERATE(ThinningOptions{0.3, 0}, ThinningOptions{0.0, 31415},
                                           ThinningOptions{0.3, 10000}, ThinningOptions{0.0, 70000});
  const std::set<Key> kept = keys_of(thinned(options, points));
  CHECK(kept == keys_of(thinned(options, turned_round(points))));
  if (options.max_points > 0) CHECK(kept.size() == static_cast<std::size_t>(options.max_points));
}

TEST_CASE("a share of the points is even over the keyframes and a smaller one is a subset of a larger one") {
  const std::vector<OutputPoint> points = sample_points(100000);
  const std::vector<OutputPoint> some = thinned({0.0, 20000}, points);
  std::map<std::int64_t, int> of_keyframe;
  for (const OutputPoint& p : some) ++of_keyframe[p.keyframe_id];
  CHECK(of_keyframe.size() == 200);
  for (const auto& [id, count] : of_keyframe) CHECK((count > 50 && count < 160));  // 100, 6 sigma
  const std::set<Key> large = keys_of(some), small = keys_of(thinned({0.0, 500}, points));
  CHECK(std::includes(large.begin(), large.end(), small.begin(), small.end()));
}

TEST_CASE("thinning of nothing, of one point, and to more than there are") {
  const ThinningOptions options = GENERATE(ThinningOptions{0.3, 0}, ThinningOptions{0.0, 5}, ThinningOptions{1e-7, 5});
  CHECK(thinned(options, {}).empty());
  CHECK(thinned(options, sample_points(1)).size() == 1);
  CHECK(thinned(options, sample_points(5)).size() == 5);
}

TEST_CASE("a voxel size with too many voxels is refused") {
  std::vector<OutputPoint> points = sample_points(1);
  points[0].position.x() = 1e12;
  CHECK_THROWS_AS(thinned({1e-6, 0}, points), InvalidInput);
}
