// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <string>

#include "pmsp/error.h"
#include "support/temp_dir.h"
#include "workspace/artefact_file.h"
#include "workspace/fingerprint.h"

using namespace pmsp;
using namespace pmsp::workspace;
using Catch::Contains;
using pmsp_test::read_text;
using pmsp_test::TempDir;
using pmsp_test::write_text;

namespace {

PlaneMap some_planes() {
  PlaneMap planes(8, 4);
  planes.keyframe_id = -7;
  planes.cam_from_world.translation = {1.0 / 3.0, -2.5, 1e-9};
  planes.scale = 1.25;
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 8; ++x) {
      const float at = static_cast<float>(8 * y + x);
      planes.x(x, y) = at / 7.0F;
      planes.y(x, y) = -at;
      planes.z(x, y) = 1.0F / (1.0F + at);
      planes.score(x, y) = at / 32.0F;
    }
  }
  return planes;
}

KeyframeCloud some_points(bool with_keys) {
  KeyframeCloud cloud;
  cloud.keyframe_id = 12;
  cloud.scale = 0.5;
  cloud.cam_from_world.translation = {0.0, 1.0 / 7.0, 2.0};
  for (int i = 0; i < 5; ++i) {
    CloudPoint point;
    point.position = {1.0F / static_cast<float>(i + 1), 2.0F, -3.0F};
    point.normal = {0.0F, 0.6F, -0.8F};
    point.color = {static_cast<std::uint8_t>(i), 200, 3};
    point.views = static_cast<std::uint8_t>(3 + i);
    point.confidence = 0.1F * static_cast<float>(i);
    cloud.points.push_back(point);
    if (!with_keys) continue;
    cloud.pixels.push_back(static_cast<std::uint32_t>(10 * i));
    cloud.agree.push_back(static_cast<std::uint32_t>(i));
  }
  if (with_keys) cloud.window_ids = {11, 13};
  return cloud;
}

}  // namespace

TEST_CASE("planes and points are read back unchanged") {
  const TempDir dir;
  const PlaneMap planes = some_planes();
  planes_file(dir / "p", planes)->commit();
  const PlaneMap same = read_planes(dir / "p");
  CHECK(same.keyframe_id == planes.keyframe_id);
  CHECK(same.pose() == planes.pose());
  CHECK((same.width() == 8 && same.height() == 4));
  CHECK(same.x.pixels() == planes.x.pixels());
  CHECK(same.y.pixels() == planes.y.pixels());
  CHECK(same.z.pixels() == planes.z.pixels());
  CHECK(same.score.pixels() == planes.score.pixels());
  for (const bool with_keys : {false, true}) {
    const KeyframeCloud cloud = some_points(with_keys);
    points_file(dir / "c", cloud)->commit();
    const KeyframeCloud back = read_points(dir / "c");
    CHECK(back.keyframe_id == cloud.keyframe_id);
    CHECK(back.pose() == cloud.pose());
    CHECK(back.pixels == cloud.pixels);
    CHECK(back.agree == cloud.agree);
    CHECK(back.window_ids == cloud.window_ids);
    REQUIRE(back.points.size() == cloud.points.size());
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
      CHECK(back.points[i].position == cloud.points[i].position);
      CHECK(back.points[i].normal == cloud.points[i].normal);
      CHECK(back.points[i].color.r == cloud.points[i].color.r);
      CHECK(back.points[i].color.g == cloud.points[i].color.g);
      CHECK(back.points[i].color.b == cloud.points[i].color.b);
      CHECK(back.points[i].views == cloud.points[i].views);
      CHECK(back.points[i].confidence == cloud.points[i].confidence);
    }
  }
}

TEST_CASE("a damaged file is refused by name for damage at any offset") {
  const TempDir dir;
  planes_file(dir / "planes", some_planes())->commit();
  points_file(dir / "points", some_points(true))->commit();
  const std::string planes = read_text(dir / "planes");
  const std::string points = read_text(dir / "points");
  for (std::size_t at = 0; at < planes.size(); at += 13) {
    std::string broken = planes;
    broken[at] = static_cast<char>(broken[at] ^ 4);
    write_text(dir / "planes", broken);
    CHECK_THROWS_WITH(read_planes(dir / "planes"), Contains("planes") && Contains("delete it and run again"));
    write_text(dir / "planes", planes.substr(0, at));
    CHECK_THROWS_AS(read_planes(dir / "planes"), IoError);
  }
  for (std::size_t at = 0; at < points.size(); at += 13) {
    std::string broken = points;
    broken[at] = static_cast<char>(broken[at] ^ 4);
    write_text(dir / "points", broken);
    CHECK_THROWS_AS(read_points(dir / "points"), IoError);
    write_text(dir / "points", points.substr(0, at));
    CHECK_THROWS_AS(read_points(dir / "points"), IoError);
  }
  write_text(dir / "planes", points);
  CHECK_THROWS_AS(read_planes(dir / "planes"), IoError);  // sound, but something else
  CHECK_THROWS_AS(read_planes(dir / "nothing"), IoError);
}

TEST_CASE("fingerprints differ for different inputs") {
  CHECK(Fingerprint().text().size() == 32);
  CHECK(Fingerprint().add("ab").add("c").text() == Fingerprint().add("ab").add("c").text());
  CHECK(Fingerprint().add("ab").add("c").text() != Fingerprint().add("a").add("bc").text());
  CHECK(Fingerprint().add(1.0).text() != Fingerprint().add(2.0).text());
  const TempDir dir;
  write_text(dir / "a", std::string(3000000, 'x'));
  write_text(dir / "b", std::string(3000000, 'x'));
  write_text(dir / "c", std::string(2999999, 'x') + "y");
  CHECK(fingerprint_of_file(dir / "a") == fingerprint_of_file(dir / "b"));
  CHECK(fingerprint_of_file(dir / "a") != fingerprint_of_file(dir / "c"));
  CHECK_THROWS_AS(fingerprint_of_file(dir / "d"), IoError);
}
