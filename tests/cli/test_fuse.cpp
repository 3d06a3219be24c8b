// SPDX-License-Identifier: BSD-2-Clause
// fuse: existing depth maps instead of those of PatchMatch.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "depth_output.h"
#include "export/little_endian.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/depth.h"
#include "pmsp/io/map.h"

using namespace pmsp;
using namespace pmsp_test;
using Catch::Contains;

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

namespace {

std::vector<std::string> quick_fuse(const fs::path& depth, const fs::path& output,
                                    const std::vector<std::string>& more = {}) {
  std::vector<std::string> words{"fuse",
                                 depth.string(),
                                 (mission() / "map.msg").string(),
                                 "--images",
                                 (mission() / "images").string(),
                                 "-o",
                                 output.string(),
                                 "--quality",
                                 "online"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

using Cell = std::array<std::int64_t, 3>;

/// Equal up to rounding of the view weights.
bool is_alike(const Rgb& a, const Rgb& b) {
  return std::abs(a.r - b.r) <= 2 && std::abs(a.g - b.g) <= 2 && std::abs(a.b - b.b) <= 2;
}

/// Share of the points of `a` that have one of `b` within `distance`, of the same colour.
double share_found(const PlyCloud& a, const PlyCloud& b, double distance) {
  const auto cell_of = [&](const Eigen::Vector3d& p) {
    return Cell{std::llround(p.x() / distance), std::llround(p.y() / distance), std::llround(p.z() / distance)};
  };
  std::multimap<Cell, std::size_t> cells;
  for (std::size_t i = 0; i < b.positions.size(); ++i) cells.emplace(cell_of(b.positions[i]), i);
  std::size_t found = 0;
  for (std::size_t i = 0; i < a.positions.size(); ++i) {
    const Cell at = cell_of(a.positions[i]);
    bool there = false;
    for (int k = 0; k < 27 && !there; ++k) {
      const auto [from, to] = cells.equal_range({at[0] + k / 9 - 1, at[1] + k / 3 % 3 - 1, at[2] + k % 3 - 1});
      there = std::any_of(from, to, [&](const auto& entry) {
        return (a.positions[i] - b.positions[entry.second]).norm() < distance &&
               is_alike(a.colors[i], b.colors[entry.second]);
      });
    }
    found += there ? 1 : 0;
  }
  return static_cast<double>(found) / static_cast<double>(a.positions.size());
}

void check_same(const fs::path& a, const fs::path& b, double distance, double share) {
  const PlyCloud first = read_ply(a), second = read_ply(b);
  CAPTURE(a.string(), first.positions.size(), second.positions.size());
  CHECK(share_found(first, second, distance) > share);
  CHECK(share_found(second, first, distance) > share);
}

/// The true depth maps of the mission in metres, named like the images.
void write_truth(const fs::path& folder, const std::function<void(const fs::path& name, Image<float>& depth)>& write) {
  fs::create_directories(folder);
  for (const fs::directory_entry& file : fs::directory_iterator(mission() / "gt/range_mm")) {
    Image<float> depth = read_png16(file.path(), 0.001);
    write(folder / file.path().stem(), depth);
  }
}

void write_npy(const fs::path& path, const Image<float>& image) {
  std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': (" + std::to_string(image.height()) + ", " +
                       std::to_string(image.width()) + "), }";
  while ((10 + header.size() + 1) % 64 != 0) header += ' ';
  std::string file = "\x93NUMPY";
  file += std::string("\x01\x00", 2);
  append_little(file, static_cast<std::uint16_t>(header.size() + 1));
  file += header + "\n";
  for (const float value : image.pixels()) append_little(file, value);
  write_text(path, file);
}

std::size_t points_in_stats(const fs::path& stats) {
  return Json::parse(read_text(stats))["points"].get<std::size_t>();
}

}  // namespace

TEST_CASE("depth maps of a run, fused again, give its cloud", "[fuse]") {
  const TempDir dir;
  const Result run =
      densify(quick_run(dir / "run.ply", {"--depth-maps", (dir / "filtered").string(), "--raw-depth-maps",
                                          (dir / "raw").string(), "--depth-format", "pfm,exr,png",
                                          "--no-median-weighted", "--mask", (mission() / "mask.png").string()}));
  INFO(run.err);
  REQUIRE(run.code == 0);
  for (const char* kind : {"raw", "filtered"}) {
    const fs::path index = dir / kind / "index.json";
    const Json all = Json::parse(read_text(index));
    const auto only = [&](const std::vector<const char*>& keys) {  // one format of them
      Json some = all;
      for (Json& map : some["maps"]) {
        for (const char* key : {"depth", "normal", "confidence", "depth_png", "normal_png", "confidence_png", "exr"}) {
          if (std::none_of(keys.begin(), keys.end(), [&](const char* k) { return std::string(k) == key; }))
            map.erase(key);
        }
      }
      write_text(index, some.dump());
    };
    const auto fused = [&](const std::string& name) {
      const Result result = densify(quick_fuse(dir / kind, dir / (name + ".ply"), {"--force"}));
      INFO(result.err);
      REQUIRE(result.code == 0);
      CHECK_THAT(result.err, Contains("(" + std::string(kind) + "), used at 128 x 64"));
      return dir / (name + ".ply");
    };
    CAPTURE(kind);
    only({"depth", "normal", "confidence"});
    check_same(dir / "run.ply", fused("pfm"), 1e-4, 0.996);  // depth maps do not distinguish far from unknown pixels
    only({"exr"});
    check_same(dir / "run.ply", fused("exr"), 1e-4, 0.996);
    only({"depth_png", "normal_png", "confidence_png"});
    check_same(dir / "run.ply", fused("png"), 2e-3, 0.98);
  }
}

TEST_CASE("fuse writes the outputs and statistics of run", "[fuse]") {
  const TempDir dir;
  REQUIRE(densify(quick_run(dir / "run.ply", {"--raw-depth-maps", (dir / "raw").string()})).code == 0);
  const Result result = densify(
      quick_fuse(dir / "raw", dir / "c.las",
                 {"-o", (dir / "c.ply").string(), "--stats", (dir / "s.json").string(), "--depth-maps",
                  (dir / "d").string(), "--preview", (dir / "look").string(), "--voxel", "0.05", "--scale", "2"}));
  INFO(result.err);
  REQUIRE(result.code == 0);
  const Json stats = Json::parse(read_text(dir / "s.json"));
  CHECK(stats["external_depths"]["kind"] == "raw");
  CHECK(stats["external_depths"]["maps"].size() == 5);
  CHECK(stats["keyframes"]["depth_maps"] == 5);
  CHECK(stats["pixels"]["unmasked"] == 5 * 128 * 64);
  CHECK(stats["pixels"]["matched"] > 4 * 128 * 64);
  CHECK(stats["pixels"]["after_median"] <= stats["pixels"]["matched"]);
  CHECK(stats["points_written"] < stats["points"]);
  CHECK(fs::file_size(dir / "c.las") > 1000);
  CHECK(Json::parse(read_text(dir / "d/index.json"))["maps"].size() == 5);
  CHECK(fs::exists(dir / "look"));
}

TEST_CASE("fuse counts unmasked pixels like run", "[fuse]") {
  const TempDir dir;
  const std::vector<std::string> mask{"--mask", (mission() / "mask.png").string(), "--stats"};
  const auto with_stats = [&](const char* name) {
    std::vector<std::string> words = mask;
    words.push_back((dir / name).string());
    return words;
  };
  std::vector<std::string> more = with_stats("run.json");
  more.insert(more.end(), {"--raw-depth-maps", (dir / "raw").string()});
  REQUIRE(densify(quick_run(dir / "run.ply", more)).code == 0);
  REQUIRE(densify(quick_fuse(dir / "raw", dir / "fuse.ply", with_stats("fuse.json"))).code == 0);
  const Json run = Json::parse(read_text(dir / "run.json"))["pixels"];
  CHECK(run["unmasked"] < 5 * 128 * 64);
  CHECK(Json::parse(read_text(dir / "fuse.json"))["pixels"]["unmasked"] == run["unmasked"]);
}

TEST_CASE("depth maps are found by image names in any format and unit", "[fuse]") {
  const TempDir dir;
  std::size_t k = 0;
  write_truth(dir / "mixed", [&](const fs::path& name, Image<float>& depth) {  // one format per keyframe
    if (k % 3 == 0) write_pfm(name.string() + ".pfm", depth);
    if (k % 3 == 1) write_exr(name.string() + ".exr", {{"Z", depth}});
    if (k % 3 == 2) write_npy(name.string() + ".npy", depth);
    ++k;
  });
  write_truth(dir / "mm",
              [&](const fs::path& name, Image<float>& depth) { write_png16(name.string() + ".png", depth, 1000.0); });
  write_truth(dir / "disparity", [&](const fs::path& name, Image<float>& depth) {
    for (float& value : depth.pixels()) value = value > 0.0F ? 100.0F / value + 7.0F : 0.0F;
    write_pfm(name.string() + ".pfm", depth);
  });
  const auto fuse = [&](const std::string& name, const std::vector<std::string>& more) {
    std::vector<std::string> words{"--stats", (dir / (name + ".json")).string(), "--force", "--width", "128"};
    words.insert(words.end(), more.begin(), more.end());
    return densify(quick_fuse(dir / name, dir / (name + ".ply"), words));
  };
  const Result mixed = fuse("mixed", {});
  INFO(mixed.err);
  REQUIRE(mixed.code == 0);
  const std::size_t points = points_in_stats(dir / "mixed.json");
  CHECK(points > 3000);

  const Result wrong = fuse("mm", {});
  CHECK(wrong.code == 3);
  CHECK_THAT(wrong.err, Contains("times those of the landmarks") && Contains("--depth-scale 0.001"));
  REQUIRE(fuse("mm", {"--depth-scale", "0.001"}).code == 0);
  const Result small = fuse("mm", {"--depth-scale", "0.0005"});
  CHECK(small.code == 3);
  CHECK_THAT(small.err, Contains("0.5 times those of the landmarks") && Contains("--depth-scale 0.001"));
  check_same(dir / "mixed.ply", dir / "mm.ply", 5e-3, 0.95);

  CHECK(fuse("disparity", {}).code == 3);
  const Result disparity = fuse("disparity", {"--depth-scale", "auto"});
  INFO(disparity.err);
  REQUIRE(disparity.code == 0);
  CHECK(Json::parse(read_text(dir / "disparity.json"))["external_depths"]["maps"][0]["model"] == "inverse depth");
  CHECK(points_in_stats(dir / "disparity.json") > points / 2);
}

TEST_CASE("unusable depth maps are skipped and reported", "[fuse]") {
  const TempDir dir;
  std::vector<fs::path> files;
  write_truth(dir / "depth", [&](const fs::path& name, Image<float>& depth) {
    files.push_back(name.string() + ".pfm");
    write_pfm(files.back(), depth);
  });
  REQUIRE(files.size() >= 5);
  write_text(files[0], "Pf\n640 320\n-1\n");
  write_pfm(files[1], Image<float>(64, 32));  // no depth at all
  const Result some = densify(quick_fuse(dir / "depth", dir / "some.ply", {"--width", "128"}));
  INFO(some.err);
  CHECK(some.code == 0);
  CHECK_THAT(some.err, Contains("is it cut off?") && Contains("no pixel has a depth") && Contains("depth: 3 of 5"));

  write_pfm(files[0], Image<float>(2, 1, 3.0F));
  write_pfm(files[2], Image<float>(64, 64, 3.0F));
  const Result shape = densify(quick_fuse(dir / "depth", dir / "shape.ply", {"--no-verify"}));
  INFO(shape.err);
  CHECK(shape.code == 0);
  CHECK_THAT(shape.err, Contains("is 2 x 1, expected the shape of its image") && Contains("depth: 2 of 5") &&
                            Contains("used at 256 x 128"));

  for (const fs::path& file : files) fs::remove(file);
  const Result none = densify(quick_fuse(dir / "depth", dir / "none.ply"));
  CHECK(none.code == 3);
  CHECK_THAT(none.err, Contains("contains no depth image of any of the 5 keyframes") && Contains("a/7.pfm"));
  CHECK(densify(quick_fuse(dir / "nothing", dir / "none.ply")).code == 3);
  CHECK_FALSE(fs::exists(dir / "none.ply"));
}

TEST_CASE("a broken image skips only its keyframe in a fusion", "[fuse]") {
  const TempDir dir;
  REQUIRE(densify(quick_run(dir / "run.ply", {"--raw-depth-maps", (dir / "raw").string()})).code == 0);
  fs::copy(mission() / "images", dir / "images");
  std::vector<fs::path> images;
  for (const fs::directory_entry& file : fs::directory_iterator(dir / "images")) images.push_back(file.path());
  std::sort(images.begin(), images.end());
  write_text(images[2], read_text(images[2]).substr(0, 2000));
  const Result result = densify({"fuse", (dir / "raw").string(), (mission() / "map.msg").string(), "--images",
                                 (dir / "images").string(), "-o", (dir / "c.ply").string()});
  INFO(result.err);
  CHECK(result.code == 0);
  CHECK_THAT(result.err, Contains("skipped"));
  const std::size_t points = read_ply(dir / "c.ply").positions.size();
  CHECK(points > 1000);
  CHECK(points < read_ply(dir / "run.ply").positions.size());
}

TEST_CASE("fuse reports missing inputs", "[fuse]") {
  const TempDir dir;
  fs::create_directories(dir / "depth");
  CHECK_THAT(densify({"fuse"}).err, Contains("DIR and MAP are missing"));
  CHECK_THAT(densify({"fuse", (dir / "depth").string()}).err, Contains("MAP is missing"));
  const Result scale = densify(quick_fuse(dir / "depth", dir / "c.ply", {"--depth-scale", "0"}));
  CHECK(scale.code == 2);
  CHECK_THAT(scale.err, Contains("--depth-scale") && Contains("auto"));
  const Result own = densify(quick_fuse(dir / "depth", dir / "c.ply", {"--depth-maps", (dir / "depth").string()}));
  CHECK(own.code == 2);
  CHECK_THAT(own.err, Contains("is the directory of the depth images"));
  CHECK(densify(quick_fuse(dir / "depth", dir / "c.ply", {"--workspace", (dir / "w").string()})).code == 2);
}

TEST_CASE("depth maps are written in map units for any scale of their keyframe", "[fuse]") {
  const TempDir dir;
  const SlamMap map = read_map(mission() / "map.msg");
  DepthMap depth;
  depth.keyframe_id = map.keyframes.front().id;
  depth.depth = Image<float>(32, 16, 3.0F);
  depth.normal = Image<Eigen::Vector3f>(32, 16, Eigen::Vector3f(0.0F, 0.0F, -1.0F));
  depth.confidence = Image<float>(32, 16, 0.5F);
  depth.scale = 0.25;
  tool::DepthMapFolder folder(dir / "d", map, tool::DepthFormats(), {"filtered", 0.001, 0.02, {}});
  folder.write(depth);
  folder.write_index();
  folder.commit();
  const Json index = Json::parse(read_text(dir / "d/index.json"));
  CHECK(index["lens_distance"] == 0.02);
  CHECK(read_pfm(dir / "d" / index["maps"][0]["depth"].get<std::string>())(5, 5) == 0.75F);
}
