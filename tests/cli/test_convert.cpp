// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cstdint>
#include <utility>

#include <catch2/catch.hpp>

#include "cli/command.h"
#include "pmsp/io/cloud.h"
#include "report_page.h"
#include "web/page.h"

using namespace pmsp;
using namespace pmsp_test;
using Catch::Contains;

namespace fs = std::filesystem;

namespace {

Result convert(const fs::path& from, const fs::path& to, const Words& more = {}) {
  return densify(joined({"convert", from.string(), "-o", to.string()}, more));
}

CloudInfo info_of(const fs::path& path) { return open_cloud(path)->info(); }

double distance(const Similarity& a, const Similarity& b) {
  double most = 0.0;
  for (const Eigen::Vector3d& x : {Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(-3, 1, 0), Eigen::Vector3d(0, 0, 5)}) {
    most = std::max(most, (a * x - b * x).norm());
  }
  return most;
}

/// A run with a workspace, made once for all tests: c.ply and work/.
const fs::path& mission_run() {
  static const TempDir dir;
  static const Result result =
      densify(quick_run(dir / "c.ply", {"-o", (dir / "c.las").string(), "--workspace", (dir / "work").string()}));
  require_ok(result);
  return dir.path();
}

}  // namespace

TEST_CASE("convert on a workspace gives the bytes of a run with the same options", "[convert]") {
  const TempDir dir;
  const Words options = GENERATE(Words{}, Words{"--scale", "2.5", "--up", "--voxel", "0.1", "--max-points", "900"},
                                 Words{"--crop", "-9,-9,-9,9,9,0.5", "--date", "2026-03-14"});
  const auto outputs = [&](const std::string& name) {
    return Words{"-o", (dir / (name + ".ply")).string(),    "-o", (dir / (name + ".las")).string(),
                 "-o", (dir / (name + ".potree")).string(), "-o", (dir / (name + ".splat.ply")).string()};
  };
  Words run = quick_run("", joined(outputs("run"), options));
  run.erase(std::find(run.begin(), run.end(), "-o"), std::find(run.begin(), run.end(), "-o") + 2);
  require_ok(densify(run));
  require_ok(densify(joined(joined({"convert", (mission_run() / "work").string()}, outputs("made")), options)));
  CHECK((read_text(dir / "made.ply") == read_text(dir / "run.ply")));  // not to be printed
  CHECK((read_text(dir / "made.las") == read_text(dir / "run.las")));
  CHECK((read_text(dir / "made.splat.ply") == read_text(dir / "run.splat.ply")));
  require_ok(convert(dir / "run.ply", dir / "again.splat.ply"));
  CHECK((read_text(dir / "again.splat.ply") == read_text(dir / "run.splat.ply")));
  for (const char* file : {"metadata.json", "octree.bin", "hierarchy.bin"}) {
    CHECK((read_text(dir / "made.potree" / file) == read_text(dir / "run.potree" / file)));
  }
}

TEST_CASE("a cloud survives conversion through all formats", "[convert]") {
  const TempDir dir;
  const fs::path cloud = mission_run() / "c.ply";
  require_ok(convert(cloud, dir / "same.ply"));
  CHECK((read_text(dir / "same.ply") == read_text(cloud)));
  require_ok(convert(cloud, dir / "c.las"));
  require_ok(convert(dir / "c.las", dir / "back.ply"));
  const PlyCloud before = read_ply(cloud), after = read_ply(dir / "back.ply");
  REQUIRE(after.positions.size() == before.positions.size());
  CHECK(after.comments == before.comments);
  CHECK(after.normals == before.normals);
  CHECK(after.colors == before.colors);
  CHECK(after.confidence == before.confidence);
  CHECK(after.views == before.views);
  double most = 0.0;
  for (std::size_t i = 0; i < before.positions.size(); ++i) {
    most = std::max(most, (after.positions[i] - before.positions[i]).cwiseAbs().maxCoeff());
  }
  CHECK(most < 2e-5);
  require_ok(convert(dir / "c.las", dir / "c.potree"));
  require_ok(convert(dir / "c.potree", dir / "c2.las"));
  CHECK(info_of(dir / "c2.las").comments == before.comments);
  CHECK(info_of(dir / "c2.las").points == static_cast<std::int64_t>(before.positions.size()));
}

TEST_CASE("the header of a converted cloud has the whole transform from the map", "[convert]") {
  const TempDir dir;
  write_text(dir / "m.txt", "0 -1 0 0\n1 0 0 5\n0 0 1 0\n0 0 0 1\n");
  write_text(dir / "n.txt", "1 0 0 3\n0 0 -1 0\n0 1 0 1\n0 0 0 1\n");
  const Words first{"--transform", (dir / "m.txt").string()}, second{"--transform", (dir / "n.txt").string()};
  require_ok(convert(mission_run() / "c.ply", dir / "a.ply", joined(first, {"--scale", "2", "--double"})));
  require_ok(convert(dir / "a.ply", dir / "b.las", joined(second, {"--scale", "0.5"})));
  const CloudInfo a = info_of(dir / "a.ply"), b = info_of(dir / "b.las");
  CHECK(info_of(mission_run() / "c.ply").unit.kind == CloudUnit::Kind::kMap);
  CHECK(a.unit.by == "--scale");
  const Similarity m{1.0, (Eigen::Matrix3d() << 0, -1, 0, 1, 0, 0, 0, 0, 1).finished(), {0, 5, 0}};
  const Similarity n{1.0, (Eigen::Matrix3d() << 1, 0, 0, 0, 0, -1, 0, 1, 0).finished(), {3, 0, 1}};
  const auto scaled = [](double scale) {
    return Similarity{scale, Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()};
  };
  REQUIRE((a.file_from_map && b.file_from_map));
  CHECK(distance(*a.file_from_map, scaled(2.0) * m) < 1e-9);
  const Similarity all = scaled(0.5) * n * scaled(2.0) * m;
  CHECK(distance(*b.file_from_map, all) < 1e-9);
  const PlyCloud cloud = read_ply(mission_run() / "c.ply");
  std::size_t at = 0, wrong = 0;
  open_cloud(dir / "b.las")->read([&](const OutputPoint* points, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i, ++at) {
      wrong += (points[i].position - all * cloud.positions[at]).norm() > 1e-4;
      wrong += (points[i].normal - all.rotation.cast<float>() * cloud.normals[at]).norm() > 1e-5F;
    }
  });
  CHECK(at == cloud.positions.size());
  CHECK(wrong == 0);
}

TEST_CASE("a known length sets the scale", "[convert]") {
  const TempDir dir;
  const fs::path cloud = mission_run() / "c.ply";
  const Words length{"--length", "-1,2,3", "-1,2,-1", "8"};
  const Result result = require_ok(convert(cloud, dir / "c.ply", length));
  CHECK_THAT(result.err, Contains("scale: 2\n") && Contains("lengths in metres, by --length"));
  CHECK(info_of(dir / "c.ply").unit.kind == CloudUnit::Kind::kMetres);
  CHECK(read_ply(dir / "c.ply").positions[7] == 2.0 * read_ply(cloud).positions[7]);
  write_text(dir / "m.txt", "4 0 0 0\n0 4 0 0\n0 0 4 0\n0 0 0 1\n");
  require_ok(convert(cloud, dir / "d.las", joined(length, {"--transform", (dir / "m.txt").string()})));
  CHECK(info_of(dir / "d.las").file_from_map->scale == Approx(2.0));
  for (const Words& bad : {Words{"--length", "1,2", "1,2,3", "1"}, Words{"--length", "1,2,3", "1,2,3", "1"},
                           Words{"--length", "1,2,3", "1,2,4", "0"}, Words{"--length", "1,2,3", "1,2,4"},
                           joined(length, {"--scale", "2"})}) {
    const Result refused = convert(cloud, dir / "e.ply", bad);
    CHECK(refused.code == 2);
    CHECK_THAT(refused.err, Contains("--length"));
  }
}

TEST_CASE("map units are never called metres", "[convert]") {
  if (!web::has_report_page()) return;
  const TempDir dir;
  const auto report = [&](const fs::path& from, const Words& more) {
    return densify(joined({"report", from.string(), "-o", (dir / "r.html").string(), "--force"}, more));
  };
  const auto refused = [](const Result& result) {
    CHECK(result.code == 2);
    CHECK_THAT(result.err, Contains("--scale") && Contains("--align") && Contains("--length"));
  };
  refused(report(mission_run() / "c.ply", {"--unit", "m"}));
  refused(report(mission_run() / "c.las", {"--unit", "m"}));
  refused(report(mission_run() / "work", {"--unit", "metres"}));
  refused(densify(quick_run(dir / "c.ply", {"--report", (dir / "r.html").string(), "--report-unit", "m"})));
  CHECK(dir.entries() == 0);
  require_ok(report(mission_run() / "c.las", {}));
  CHECK_THAT(read_text(dir / "r.html"),
             Contains("\"unit\":\"map units\"") && Contains("map units (no scale is known)"));
  for (const char* name : {"m.ply", "m.las", "m.potree"}) {
    require_ok(convert(mission_run() / "c.ply", dir / name, {"--scale", "1"}));
    INFO(name);
    require_ok(report(dir / name, {"--unit", "m"}));
    require_ok(report(dir / name, {}));
    CHECK_THAT(read_text(dir / "r.html"), Contains("\"unit\":\"m\"") && Contains("metres, by --scale"));
    CHECK(report(dir / name, {"--unit", "ft"}).code == 2);
  }
  write_text(dir / "foreign.ply",
             "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float "
             "z\nend_header\n0 0 0\n1 2 3\n");
  require_ok(report(dir / "foreign.ply", {"--unit", "m"}));
  CHECK_THAT(read_text(dir / "r.html"), Contains("is from --unit"));
}

TEST_CASE("unsupported conversions are refused with the remedy", "[convert]") {
  const TempDir dir;
  const fs::path cloud = mission_run() / "c.ply";
  const auto refused = [&](int code, const fs::path& from, const fs::path& to, const Words& more,
                           const std::string& why) {
    const Result result = convert(from, to, more);
    INFO(result.err);
    CHECK(result.code == code);
    CHECK_THAT(result.err, Contains(why));
  };
  refused(2, cloud, dir / "c.colmap", {}, "write it with `run -o`");
  refused(2, cloud, dir / "c.nerfstudio", {}, "dataset of images");
  refused(2, cloud, dir / "c.ply", {"--align", "exif"}, "needs the images");
  refused(2, cloud, dir / "c.ply", {"--up"}, "--map MAP");
  refused(2, cloud, cloud, {"--force"}, "would overwrite");
  refused(2, mission_run() / "work", mission_run() / "work" / "c.ply", {}, "would overwrite");
  refused(2, cloud, dir / "c.xyz", {}, "no format has the extension");
  refused(3, dir / "none.ply", dir / "c.ply", {}, "none.ply");
  refused(5, cloud, dir / "c.ply", {"--crop", "90,90,90,91,91,91"}, "lies in the box of --crop");
  CHECK(densify({"convert", cloud.string()}).code == 2);
  CHECK(dir.entries() == 0);
  write_text(dir / "old.las", "old");
  refused(6, cloud, dir / "old.las", {}, "exists already");
  require_ok(convert(cloud, dir / "old.las", {"--force"}));
  std::string laz = read_text(dir / "old.las");
  laz[104] = static_cast<char>(0x87);
  write_text(dir / "c.laz", laz);
  refused(3, dir / "c.laz", dir / "c.ply", {}, "laszip");
  write_text(dir / "ids.txt", "1 0 0 0\n2 1 0 0\n3 0 1 0\n");
  refused(3, cloud, dir / "c.ply", {"--align", (dir / "ids.txt").string()}, "--map MAP");
  write_text(dir / "tum.txt", "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n2 0 1 0 0 0 0 1\n");
  refused(3, mission_run() / "work", dir / "c.ply", {"--align", (dir / "tum.txt").string()}, "--map MAP");
}

TEST_CASE("with the map a cloud is oriented upright and aligned as by a run", "[convert]") {
  const TempDir dir;
  write_text(dir / "m.txt", "0 -1 0 0\n1 0 0 5\n0 0 1 0\n0 0 0 1\n");
  require_ok(
      convert(mission_run() / "c.ply", dir / "a.ply", {"--transform", (dir / "m.txt").string(), "--scale", "3"}));
  const std::string map = (mission() / "map.msg").string();
  require_ok(convert(dir / "a.ply", dir / "up.ply", {"--up", "--map", map, "--scale", "0.5"}));
  require_ok(densify(quick_run(dir / "run.ply", {"--up", "--scale", "1.5"})));
  const Similarity run = *info_of(dir / "run.ply").file_from_map, up = *info_of(dir / "up.ply").file_from_map;
  CHECK(up.scale == Approx(1.5));
  CHECK((up.rotation.row(2) - run.rotation.row(2)).norm() < 1e-9);  // up is determined, the rotation about it is free
  // Control points lie in the frame of the input.
  write_text(dir / "points.txt", "0 0 0 10 0 0\n3 0 0 10 1 0\n0 3 0 9 0 0\n0 0 3 10 0 1\n");
  require_ok(convert(dir / "a.ply", dir / "al.ply", {"--align", (dir / "points.txt").string()}));
  const CloudInfo aligned = info_of(dir / "al.ply");
  CHECK(aligned.unit.by == "--align");
  CHECK(aligned.file_from_map->scale == Approx(1.0));
}

TEST_CASE("a cloud of another program is converted and missing fields stay missing", "[convert]") {
  const TempDir dir;
  write_text(dir / "a.ply",
             "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double "
             "z\nend_header\n500000.25 0 0\n500001.25 2 3\n500002.5 1 1\n");
  const Result result = require_ok(convert(dir / "a.ply", dir / "b.las"));
  CHECK_THAT(result.err, Contains("no normals, colours, confidence, views"));
  const CloudInfo info = info_of(dir / "b.las");
  CHECK((!info.has_normals && !info.has_colors && !info.has_confidence && !info.has_views));
  CHECK(info.unit.kind == CloudUnit::Kind::kUnknown);
  const Result splats = convert(dir / "a.ply", dir / "a.splat.ply");
  CHECK(splats.code == 3);
  CHECK_THAT(splats.err, Contains("contains no normals") && Contains("CloudCompare"));
  require_ok(convert(dir / "b.las", dir / "c.ply", {"--scale", "2"}));
  const PlyCloud back = read_ply(dir / "c.ply");
  REQUIRE(back.positions.size() == 3);
  CHECK((back.positions[2] - 2.0 * Eigen::Vector3d(500002.5, 1, 1)).norm() < 1e-5);
  CHECK(info_of(dir / "c.ply").unit.kind == CloudUnit::Kind::kMetres);
}
