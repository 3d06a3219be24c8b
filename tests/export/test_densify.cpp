// SPDX-License-Identifier: BSD-2-Clause
#include <filesystem>

#include <catch2/catch.hpp>

#include "pmsp/error.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/densify.h"
#include "pmsp/io/depth.h"
#include "support/temp_dir.h"

using namespace pmsp;
using Catch::Contains;
using pmsp_test::TempDir;

namespace {

const std::filesystem::path kData = PMSP_DATA;

DensifierOptions quick() {
  DensifierOptions options;
  options.width = 128;
  options.height = 64;
  options.advanced.patchmatch.iterations = 1;
  options.advanced.patchmatch.geometric_passes = 0;
  options.advanced.view_filter.min_parallax_deg = 0.1;
  return options;
}

}  // namespace

TEST_CASE("a map and its images become a cloud in one call") {
  const TempDir dir;
  const SlamMap map = read_map(kData / "map.msg");
  const auto images = open_image_folder(map, kData / "images");
  CloudOutput output(dir / "cloud.ply", cloud_header_of(map));
  DensifyExtras extras;
  std::size_t calls = 0;
  extras.progress = [&](std::size_t done, std::size_t all) {
    CHECK(done == ++calls);
    CHECK(all == images->keyframe_ids().size());
    return true;
  };
  const DensifierStats stats = densify(map, *images, quick(), output, extras);
  CHECK(calls == images->keyframe_ids().size());
  CHECK(stats.keyframes_added == static_cast<std::int64_t>(calls));
  CHECK(stats.points > 1000);
  CHECK_FALSE(std::filesystem::exists(dir / "cloud.ply"));
  output.commit();
  CHECK(static_cast<std::int64_t>(read_ply(dir / "cloud.ply").positions.size()) == stats.points);
  CHECK(output.points() == stats.points);
}

TEST_CASE("the progress callback can stop the work and delivered results are kept") {
  const SlamMap map = read_map(kData / "map.msg");
  const auto images = open_image_folder(map, kData / "images");
  DensifyExtras extras;
  extras.progress = [](std::size_t done, std::size_t) { return done < 2; };
  CHECK(densify(map, *images, quick(), DensifierCallbacks(), extras).keyframes_added == 2);
}

TEST_CASE("masks beside the images are used if the image folder is given") {
  const TempDir dir;
  const SlamMap map = read_map(kData / "map.msg");
  std::filesystem::copy(kData / "images", dir / "images");
  Image<float> half(64, 32, 1.0F);
  std::fill_n(half.row(0), half.size() / 2, 0.0F);
  std::filesystem::create_directory(dir / "masks");
  for (const auto& file : std::filesystem::directory_iterator(dir / "images"))
    write_png16(dir / "masks" / file.path().filename().replace_extension(".png"), half, 65535.0);
  const auto pixels = [&](const std::filesystem::path& image_folder) {
    const auto images = open_image_folder(map, dir / "images");
    DensifyExtras extras;
    extras.image_folder = image_folder;
    return densify(map, *images, quick(), DensifierCallbacks(), extras).pixels;
  };
  CHECK(static_cast<double>(pixels(dir / "images")) < 0.6 * static_cast<double>(pixels({})));
}

TEST_CASE("input that cannot give points is refused with the remedy") {
  SlamMap map = read_map(kData / "map.msg");
  const auto images = open_image_folder(map, kData / "images");
  SlamMap mirrored = map;
  for (MapKeyframe& keyframe : mirrored.keyframes) {
    for (MapObservation& observation : keyframe.observations) {
      observation.pixel.x() = static_cast<float>(map.cameras[0].width) - observation.pixel.x();
    }
  }
  CHECK_THROWS_WITH(densify(mirrored, *images, quick(), DensifierCallbacks()), Contains("mirror"));
}

TEST_CASE("a map without landmarks gets them from the images") {
  SlamMap map = read_map(kData / "map.msg");
  map.landmarks.clear();
  for (MapKeyframe& keyframe : map.keyframes) keyframe.observations.clear();
  const auto images = open_image_folder(map, kData / "images");
  CHECK(densify(map, *images, quick(), DensifierCallbacks()).depth_maps > 1);
}

TEST_CASE("a cloud's format follows from its name") {
  const TempDir dir;
  const CloudHeader header;
  CHECK_THROWS_AS(CloudOutput(dir / "cloud.obj", header), InvalidOption);
  CHECK_THROWS_WITH(CloudOutput(dir / "cloud.obj", header), Contains(".obj") && Contains(".las"));
  for (const char* name : {"cloud", "cloud.PLY", "cloud.las"}) {
    INFO(name);
    CloudOutput(dir / name, header).commit();
    CHECK(std::filesystem::exists(dir / name));
  }
}
