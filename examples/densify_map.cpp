// SPDX-License-Identifier: BSD-2-Clause
// Makes a cloud of a SLAM's map and the images of its keyframes: densify_map MAP IMAGES CLOUD
#include <cstdio>
#include <exception>

#include <pmsp/io/densify.h>

int main(int argc, char** argv) {
  if (argc != 4) return std::fprintf(stderr, "usage: densify_map MAP IMAGES CLOUD\n"), 2;
  try {
    const pmsp::SlamMap map = pmsp::read_map(argv[1]);
    const auto images = pmsp::open_image_folder(map, argv[2]);
    const pmsp::DensifierOptions options = pmsp::preset(pmsp::Quality::kOnline);
    pmsp::CloudOutput cloud(argv[3], pmsp::cloud_header_of(map, options));
    pmsp::DensifyExtras extras;
    extras.image_folder = argv[2];  // with masks beside the images
    pmsp::densify(map, *images, options, cloud, extras);
    cloud.commit();
    std::printf("%s: %lld points\n", argv[3], static_cast<long long>(cloud.points()));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "densify_map: %s\n", error.what());
    return 1;
  }
}
