// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "kernels/kernel_helpers.h"
#include "pmsp/stages.h"
#include "sphere/cube_map.h"
#include "sphere/panorama_data.h"

using namespace pmsp;
using pmsp::kernels::Vec3;
using pmsp::test::cast;
using pmsp::test::Draws;
using pmsp::test::frame_at;
namespace k = pmsp::kernels;

namespace {

/// Gray values that change slowly with the direction.
double smooth(const Vec3<double>& d) { return 128.0 + 55.0 * d.x + 40.0 * d.y * d.z - 30.0 * d.z * d.z * d.x; }

Image<float> image_of_smooth(int width, int height) {
  Image<float> image(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      image(x, y) = static_cast<float>(smooth(frame_at(x + 0.5, y + 0.5, width, height).bearing));
  }
  return image;
}

Image<float> image_of_noise(int width, int height, std::uint64_t seed) {
  Draws draws(seed);
  Image<float> image(width, height);
  for (float& value : image.pixels()) value = static_cast<float>(draws.uniform(0.0, 255.0));
  return image;
}

/// Axes, edges and corners of the cube, exactly and a little beside, in several lengths.
std::vector<Vec3<float>> special_directions() {
  std::vector<float> values;
  for (const float value : {-1.0F, 0.0F, 1.0F, 0.3F}) {
    values.push_back(value);
    values.push_back(std::nextafter(value, 2.0F));
    values.push_back(std::nextafter(value, -2.0F));
  }
  std::vector<Vec3<float>> directions;
  for (const float x : values) {
    for (const float y : values) {
      for (const float z : values) {
        if (std::max({std::fabs(x), std::fabs(y), std::fabs(z)}) < 0.1F) continue;
        for (const float length : {1.0F, 1.7e-5F, 3.3e6F}) directions.push_back({length * x, length * y, length * z});
      }
    }
  }
  return directions;
}

void check_address(const Vec3<float>& p, const k::CubeView& cube) {
  const int size = static_cast<int>(2.0F * cube.half_size);
  const k::CubePoint<float> at = k::cube_point(p, cube);
  const int column = static_cast<int>(at.u);
  const int row = static_cast<int>(at.v);
  INFO(p.x << " " << p.y << " " << p.z << " -> " << at.u << " " << at.v);
  REQUIRE(at.u > -1.0F);
  REQUIRE(at.v > -1.0F);
  REQUIRE(column <= size);
  REQUIRE(row <= size);
  REQUIRE(at.face_start % cube.face_elements == 0);
  REQUIRE(at.face_start >= 0);
  REQUIRE(at.face_start <= 5 * cube.face_elements);
}

k::CubeView addresses_only(int size) {
  CubeMap map;
  map.size = size;
  return map.view();
}

constexpr int kMaskWidth = 256;
constexpr int kMaskHeight = 128;

struct MarginCounts {
  int masked_open = 0;  ///< directions inside masked pixels that may be matched
  int in_margin = 0;    ///< directions clearly within the radius of a masked pixel's centre ...
  int margin_open = 0;  ///< ... that may be matched
  int far_blocked = 0;  ///< directions far from any masked pixel that may not
};

/// Compares the usable cube of a mask, with a radius of 3 pixels, with the distances to the masked pixels.
template <class IsMasked>
MarginCounts count_margin(const IsMasked& is_masked) {
  constexpr double kPixel = 2.0 * kernels::kPi / kMaskWidth;
  constexpr double kRadius = 3.0 * kPixel;
  ThreadPool pool(2);
  Image<std::uint8_t> usable(kMaskWidth, kMaskHeight, 255);
  std::vector<Vec3<double>> masked;
  for (int y = 0; y < kMaskHeight; ++y) {
    for (int x = 0; x < kMaskWidth; ++x) {
      if (!is_masked(x, y)) continue;
      usable(x, y) = 0;
      masked.push_back(frame_at(x + 0.5, y + 0.5, kMaskWidth, kMaskHeight).bearing);
    }
  }
  const CubeMap map = make_matchable_cube(usable, cube_size_for(kMaskWidth), 3.0, pool);
  const k::CubeView cube = map.view();
  MarginCounts counts;
  Draws draws(10);
  for (int i = 0; i < 40000; ++i) {
    const Vec3<double> d = draws.direction();
    double cosine = -1.0;
    for (const Vec3<double>& m : masked) cosine = std::max(cosine, k::dot(d, m));
    const double distance = std::acos(std::min(1.0, cosine));
    const bool open = k::sample(cube, cast<float>(d)) > 127.0F;
    if (distance < 0.4 * kPixel && open) ++counts.masked_open;
    if (distance < kRadius - 0.75 * kPixel) {
      ++counts.in_margin;
      if (open) ++counts.margin_open;
    }
    if (distance > std::sqrt(2.0) * kRadius + 2.0 * kPixel && !open) ++counts.far_blocked;
  }
  return counts;
}

}  // namespace

TEST_CASE("cube addresses lie inside the buffer for all directions") {
  const std::vector<Vec3<float>> special = special_directions();
  for (const int size : {8, 9, 101, 204, 1834, 4096}) {
    const k::CubeView cube = addresses_only(size);
    for (const Vec3<float>& p : special) check_address(p, cube);
    Draws draws(static_cast<std::uint64_t>(size));
    for (int i = 0; i < 30000; ++i) {
      const Vec3<float> d = cast<float>(draws.direction());
      check_address(d, cube);
      const Vec3<float> edge{d.x, d.x, d.z};
      if (edge.x != 0.0F) check_address(edge, cube);
    }
  }
}

TEST_CASE("each face is that of the largest coordinate and its address reproduces the direction") {
  const k::CubeView cube = addresses_only(100);
  Draws draws(5);
  for (int i = 0; i < 20000; ++i) {
    const Vec3<double> d = draws.direction();
    const double c[3] = {d.x, d.y, d.z};
    int lookahead = 0;
    for (int a = 1; a < 3; ++a) {
      if (std::fabs(c[a]) > std::fabs(c[lookahead])) lookahead = a;
    }
    const double first = c[lookahead == 0 ? 1 : 0] / std::fabs(c[lookahead]);
    const double second = c[lookahead == 2 ? 1 : 2] / std::fabs(c[lookahead]);
    const k::CubePoint<double> at = k::cube_point(d, cube);
    REQUIRE(at.face_start == (2 * lookahead + (c[lookahead] < 0.0 ? 1 : 0)) * cube.face_elements);
    REQUIRE(at.u == Approx(50.5 + 50.0 * first).margin(1e-9));
    REQUIRE(at.v == Approx(50.5 + 50.0 * second).margin(1e-9));
    const k::CubePoint<float> near = k::cube_point(cast<float>(d), cube);
    if (near.face_start != at.face_start) continue;  // on an edge, rounding decides
    REQUIRE(std::fabs(near.u - at.u) < 1e-4);
    REQUIRE(std::fabs(near.v - at.v) < 1e-4);
  }
}

TEST_CASE("a sample is within a gray level of a smooth image in every direction") {
  ThreadPool pool(2);
  const int width = 512;
  const Image<float> image = image_of_smooth(width, width / 2);
  for (const int size : {cube_size_for(width), 101, 127}) {
    const CubeMap map = make_cube_map(image, size, pool);
    const k::CubeView cube = map.view();
    double worst = 0.0;
    const auto check = [&](const Vec3<float>& p) {
      const Vec3<double> d = k::normalized(cast<double>(p));
      worst = std::max(worst, std::fabs(k::sample(cube, p) - smooth(d)));
      worst = std::max(worst, std::fabs(k::sample(cube, cast<double>(p)) - smooth(d)));
    };
    for (const Vec3<float>& p : special_directions()) check(p);
    Draws draws(6);
    for (int i = 0; i < 100000; ++i) check(cast<float>(draws.direction()));
    for (int i = 0; i < 5000; ++i) {
      const double turn = draws.uniform(0.0, 2.0 * kernels::kPi);
      const double near = std::pow(10.0, draws.uniform(-7.0, -1.0));
      check(cast<float>(Vec3<double>{near * std::sin(turn), i % 2 == 0 ? 1.0 : -1.0, near * std::cos(turn)}));  // poles
      check(cast<float>(Vec3<double>{near * std::sin(turn), draws.uniform(-3.0, 3.0), -1.0}));                  // seam
    }
    INFO("size " << size << ": worst " << worst);
    CHECK(worst <= 1.0);
  }
}

TEST_CASE("samples are continuous across the cube's edges and corners, whatever the image") {
  ThreadPool pool(2);
  for (const int size : {40, 41}) {
    const CubeMap map = make_cube_map(image_of_noise(128, 64, 7), size, pool);
    const k::CubeView cube = map.view();
    Draws draws(8);
    double worst = 0.0;
    for (int i = 0; i < 30000; ++i) {
      const double along = i % 10 == 0 ? (i % 20 == 0 ? 1.0 : -1.0) : draws.uniform(-1.0, 1.0);
      const double a = draws.uniform() < 0.5 ? 1.0 : -1.0;
      const double b = draws.uniform() < 0.5 ? 1.0 : -1.0;
      const double step = 1e-6;
      const Vec3<double> edges[3][2] = {{{a, b * (1 - step), along}, {a * (1 - step), b, along}},
                                        {{a, along, b * (1 - step)}, {a * (1 - step), along, b}},
                                        {{along, a, b * (1 - step)}, {along, a * (1 - step), b}}};
      for (const auto& pair : edges) {
        worst = std::max(worst, std::fabs(k::sample(cube, pair[0]) - k::sample(cube, pair[1])));
        worst = std::max(worst, static_cast<double>(std::fabs(k::sample(cube, cast<float>(pair[0])) -
                                                              k::sample(cube, cast<float>(pair[1])))));
      }
    }
    INFO("worst " << worst);
    CHECK(worst < 0.05);
  }
}

TEST_CASE("a sample at a node is the node's value, and it is linear between nodes") {
  ThreadPool pool(1);
  constexpr int kSize = 16;
  const CubeMap map = make_cube_map(image_of_noise(64, 32, 9), kSize, pool);
  const k::CubeView cube = map.view();
  const auto node = [&](int i, int j) {  // of the face +x
    return static_cast<double>(map.quads[static_cast<std::size_t>(j * (kSize + 1) + i)] & 0xffffU) / k::kUnitsPerGray;
  };
  for (int j = 1; j < kSize; ++j) {
    for (int i = 1; i < kSize; ++i) {
      const auto at = [&](double di, double dj) {
        const auto coordinate = [&](double k) { return 3.0 * ((2.0 * k - 1.0) / kSize - 1.0); };
        return k::sample(cube, Vec3<double>{3.0, coordinate(i + di), coordinate(j + dj)});
      };
      REQUIRE(at(1e-9, 1e-9) == Approx(node(i, j)).margin(1e-5));
      const double above = 0.75 * node(i, j) + 0.25 * node(i + 1, j);
      const double below = 0.75 * node(i, j + 1) + 0.25 * node(i + 1, j + 1);
      REQUIRE(at(0.25, 0.5) == Approx(0.5 * above + 0.5 * below).margin(1e-5));
    }
  }
}

TEST_CASE("the largest faces that the options allow are addressed exactly") {
  const int size = cube_size_for(16384);
  const std::size_t side = static_cast<std::size_t>(size) + 1;
  // calloc, because its pages cost nothing until they are written; one face is all that a direction near +x reaches
  const std::unique_ptr<std::uint64_t, decltype(&std::free)> face(
      static_cast<std::uint64_t*>(std::calloc(side * side, sizeof(std::uint64_t))), &std::free);
  REQUIRE(face != nullptr);
  k::CubeView cube = addresses_only(size);
  cube.quads = face.get();
  for (const int row : {10, size / 2, size - 8, size - 3}) {
    for (const int column : {11, size - 10, size - 5}) {
      std::uint64_t& quad = face.get()[static_cast<std::size_t>(row) * side + static_cast<std::size_t>(column)];
      quad = 0xc8c8c8c8c8c8c8c8U;  // 200 at all four corners
      const auto coordinate = [&](int node) { return static_cast<float>(2.0 * node / size - 1.0); };
      const float seen = k::sample(cube, Vec3<float>{1.0F, coordinate(column), coordinate(row)});
      INFO("row " << row << ", column " << column << " of faces of " << size);
      CHECK(seen == Approx(200.0));
      quad = 0;
    }
  }
}

TEST_CASE("usable cube: large masked areas and a margin around them are 0 and the rest is usable") {
  const std::vector<std::pair<Vec3<double>, double>> areas = {{{0.02, 0.1, -1.0}, 0.15},
                                                              {{0.0, 1.0, 0.02}, 0.3},
                                                              {{0.05, -1.0, 0.0}, 0.1},
                                                              {{1.0, 0.9, 0.8}, 0.2},
                                                              {{1.0, 0.0, 0.0}, 0.1}};
  const MarginCounts counts = count_margin([&](int x, int y) {
    const Vec3<double> d = frame_at(x + 0.5, y + 0.5, kMaskWidth, kMaskHeight).bearing;
    return std::any_of(areas.begin(), areas.end(),
                       [&](const auto& area) { return k::angle_between(d, area.first) < area.second; });
  });
  INFO(counts.margin_open << " of " << counts.in_margin << " in the margin are open");
  CHECK(counts.in_margin > 1000);
  CHECK(counts.masked_open == 0);
  CHECK(counts.margin_open == 0);
  CHECK(counts.far_blocked == 0);
}

TEST_CASE("usable cube: single masked pixels and thin lines have the same margin") {
  const MarginCounts counts = count_margin([&](int x, int y) {
    const bool speck = (x % 37 == 5 && y % 29 == 11 && y > 20 && y < 110);
    const bool line = x == 200 && y > 30 && y < 100;
    return speck || line;
  });
  INFO(counts.masked_open << " masked directions and " << counts.margin_open << " of " << counts.in_margin
                          << " in the margin are open");
  CHECK(counts.in_margin > 1000);
  CHECK(counts.masked_open == 0);
  CHECK(counts.margin_open == 0);
  CHECK(counts.far_blocked == 0);
}

TEST_CASE("an empty cube map has a view without quads: usable everywhere") {
  CHECK(CubeMap().view().quads == nullptr);
  CHECK(cube_size_for(640) == 204);
  CHECK(cube_size_for(2) == 8);
}

TEST_CASE("images are matched at their own width up to the limit and in the depth map's aspect ratio") {
  const auto size = [](int image_width, int width, int height, double scale) {
    const ImageSize found = matching_size(image_width, width, height, scale);
    return std::pair(found.width, found.height);
  };
  CHECK(size(1920, 640, 320, 2.0) == std::pair(1280, 640));
  CHECK(size(1920, 640, 320, 1.0) == std::pair(640, 320));
  CHECK(size(1920, 1440, 720, 2.0) == std::pair(1920, 960));
  CHECK(size(960, 1440, 720, 2.0) == std::pair(960, 480));
  CHECK(size(1920, 640, 322, 1.0) == std::pair(640, 322));
  CHECK(size(1000, 640, 320, 0.301) == std::pair(192, 96));
  CHECK(size(16, 16384, 2, 2.0) == std::pair(16, 2));
}

TEST_CASE("a panorama keeps detail finer than the depth map's pixels up to the requested width") {
  const Executor executor(1);
  Image<Rgb> image(256, 128);
  for (int y = 0; y < 128; ++y) {
    for (int x = 0; x < 256; ++x) image(x, y) = (x / 2) % 2 == 0 ? Rgb{80, 80, 80} : Rgb{120, 120, 120};
  }
  const auto contrast = [&](double scale) {  // at the equator, ahead: two image pixels are half a pixel of the map
    std::optional<CubeNodes> nodes;
    const PanoramaData data = prepare_panorama(image.view(), {}, 64, 32, scale, executor, nodes);
    float least = 255.0F;
    float most = 0.0F;
    for (int i = 0; i < 64; ++i) {
      const float lon = 0.01F * static_cast<float>(i);
      const float gray = k::sample(data.gray.view(), Vec3<float>{std::sin(lon), 0.0F, std::cos(lon)});
      least = std::min(least, gray);
      most = std::max(most, gray);
    }
    CHECK(data.color.width() == 64);
    return most - least;
  };
  CHECK(contrast(1.0) < 4.0F);
  CHECK(contrast(4.0) > 30.0F);
  CHECK(contrast(8.0) == contrast(4.0));  // there are no finer images
}

TEST_CASE("an image's cube does not depend on the previous image") {
  const Executor executor(2);
  const auto image_of = [](int width, int height, std::uint8_t level) {
    Image<Rgb> image(width, height);
    Draws draws(level);
    for (Rgb& pixel : image.pixels()) {
      const auto value = static_cast<std::uint8_t>(draws.uniform(0.0, 255.0));
      pixel = {value, value, level};
    }
    return image;
  };
  std::optional<CubeNodes> nodes;
  std::uint8_t level = 1;
  for (const auto& [width, height] :
       {std::pair(256, 128), std::pair(256, 128), std::pair(128, 64), std::pair(256, 96)}) {
    const Image<Rgb> image = image_of(width, height, level++);
    std::optional<CubeNodes> none;
    const PanoramaData alone = prepare_panorama(image.view(), {}, 128, 64, 2.0, executor, none);
    const PanoramaData after = prepare_panorama(image.view(), {}, 128, 64, 2.0, executor, nodes);
    CHECK(after.gray.size == alone.gray.size);
    CHECK(after.gray.quads == alone.gray.quads);
  }
}

TEST_CASE("a cube is restored unchanged from its nodes") {
  pmsp::ThreadPool pool(2);
  for (const int size : {8, 10, 26}) {
    pmsp::Image<float> gray(4 * size, 2 * size);
    Draws draws(static_cast<std::uint64_t>(size));
    for (float& value : gray.pixels()) value = static_cast<float>(draws.uniform(0.0, 255.0));
    const pmsp::CubeMap made = pmsp::make_cube_map(gray, size, pool);
    std::vector<std::uint16_t> nodes(pmsp::node_count(size));
    pmsp::write_nodes(made, nodes.data());
    CHECK(nodes.size() * sizeof(std::uint16_t) < made.quads.size() * sizeof(std::uint64_t) / 2);
    const pmsp::CubeMap again = pmsp::cube_of_nodes(nodes.data(), size, pool);
    CHECK(again.size == made.size);
    CHECK(again.quads == made.quads);
  }
}
