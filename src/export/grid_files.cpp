// SPDX-License-Identifier: BSD-2-Clause
#include "export/grid_files.h"

#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "export/files.h"
#include "export/robot_map.h"
#include "pmsp/error.h"
#include "util/text.h"

namespace pmsp {
namespace {

std::filesystem::path with_ending(const std::filesystem::path& path, const char* ending) {
  std::filesystem::path beside = path;
  return beside.replace_extension() += ending;
}

/// Image of the grid, its first row on top.
template <class Pixel, class Value>
cv::Mat_<Pixel> grid_image(const FloorGrid& grid, const Value& value) {
  cv::Mat_<Pixel> image(grid.height(), grid.width());
  for (int y = 0; y < grid.height(); ++y) {
    for (int x = 0; x < grid.width(); ++x) image(grid.height() - 1 - y, x) = value(x, y);
  }
  return image;
}

std::vector<unsigned char> encoded(const std::filesystem::path& path, const char* extension, const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  bool is_encoded = false;
  try {
    is_encoded = cv::imencode(extension, image, bytes);
  } catch (const cv::Exception& error) {
    throw OutputError(path.string() + ": cannot be encoded: " + error.what());
  }
  if (!is_encoded) throw OutputError(path.string() + ": cannot be encoded by OpenCV");
  return bytes;
}

std::string yaml_of(const std::filesystem::path& path, const CloudHeader& header, const FloorGrid& grid) {
  std::string name;  // in double quotes
  for (const char c : path.filename().string()) name += c == '"' || c == '\\' ? std::string{'\\', c} : std::string{c};
  return "# " + origin_of_map(header) + "\n" + "image: \"" + name + "\"\n" + "mode: trinary\n" +
         "resolution: " + number_text(grid.cell(), "%.9g") + "\n" + "origin: [" + number_text(grid.low_x(), "%.9g") +
         ", " + number_text(grid.low_y(), "%.9g") + ", 0]\n" + "negate: 0\n" + "occupied_thresh: 0.65\n" +
         "free_thresh: 0.196\n";  // 205 lies between: unknown
}

/// World file: size of the pixels and centre of the first one, for GIS.
std::string world_file_of(const FloorGrid& grid) {
  std::string text;
  for (const double value : {grid.cell(), 0.0, 0.0, -grid.cell(), grid.low_x() + 0.5 * grid.cell(),
                             grid.low_y() + (grid.height() - 0.5) * grid.cell()}) {
    text += number_text(value, "%.12g") + "\n";
  }
  return text;
}

}  // namespace

std::string origin_of_map(const CloudHeader& header) {
  const bool is_metric = header.unit.kind == CloudUnit::Kind::kMetres;
  return header.generator + "; lengths in " + (is_metric ? "metres" : "map units, not metres");
}

std::vector<std::filesystem::path> files_beside_grid(const std::filesystem::path& path) {
  return {with_ending(path, ".yaml"), with_ending(path, ".elevation.tif"), with_ending(path, ".slope.tif"),
          with_ending(path, ".elevation.tfw"), with_ending(path, ".slope.tfw")};
}

void write_grid(const std::filesystem::path& path, const CloudHeader& header, const FloorGrid& grid) {
  const std::vector<std::filesystem::path> beside = files_beside_grid(path);
  AtomicFile pgm(path), yaml(beside[0]), elevation(beside[1]), slope(beside[2]);
  AtomicFile elevation_world(beside[3]), slope_world(beside[4]);
  const auto put = [](AtomicFile& file, const std::vector<unsigned char>& bytes) {
    file.write(bytes.data(), bytes.size());
  };
  put(pgm, encoded(path, ".pgm", grid_image<unsigned char>(grid, [&](int x, int y) { return grid.at(x, y); })));
  put(elevation,
      encoded(beside[1], ".tif", grid_image<float>(grid, [&](int x, int y) { return grid.elevation(x, y); })));
  put(slope, encoded(beside[2], ".tif", grid_image<float>(grid, [&](int x, int y) { return grid.slope(x, y); })));
  elevation_world.write(world_file_of(grid));
  slope_world.write(world_file_of(grid));
  yaml.write(yaml_of(path, header, grid));
  for (AtomicFile* const file : {&elevation, &slope, &elevation_world, &slope_world, &pgm, &yaml}) {
    file->commit();  // last the YAML, which names the PGM
  }
}

}  // namespace pmsp
