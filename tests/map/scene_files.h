// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "pmsp/io/map.h"

/// Writers for the readers of src/io, by the formats' specifications. A map is written in each format's own
/// conventions, so that reading reproduces it.
namespace pmsp::test {

enum class Fault {
  none,
  mirrored,  ///< images mirrored after the reconstruction: left is right in places
  inverted,  ///< inverted poses
  shifted    ///< keypoints off by half a pixel
};

/// Keyframes along a curve in a ball of landmarks, each seen by all keyframes; with image names in subfolders.
SlamMap sample_scene(int keyframes = 8, int landmarks = 150);

/// The map with a fault, as written by a program with that fault.
SlamMap with_fault(SlamMap map, Fault fault);

void write_colmap_text(const std::filesystem::path& folder, const SlamMap& map);
void write_colmap_binary(const std::filesystem::path& folder, const SlamMap& map, bool with_rigs = true);
/// reconstruction.json and tracks.csv; `others`: further reconstructions in the same file.
void write_opensfm(const std::filesystem::path& folder, const SlamMap& map, const std::vector<SlamMap>& others = {});
void write_openmvg(const std::filesystem::path& file, const SlamMap& map, const std::string& root_path = "images");
/// transforms.json and points.ply. Image names become images/NAME.
void write_nerfstudio(const std::filesystem::path& folder, const SlamMap& map);
void write_metashape(const std::filesystem::path& file, const SlamMap& map);
/// cameras.sfm, with structure; images are named by absolute paths, /data/NAME.
void write_alicevision(const std::filesystem::path& file, const SlamMap& map);
/// Twelve numbers a line, without times.
void write_kitti(const std::filesystem::path& file, const SlamMap& map);
/// Nanoseconds from `first` [s], quaternions with w first, and what else EuRoC's ground truth has; with its header.
void write_euroc(const std::filesystem::path& file, const SlamMap& map, double first = 1.6e9);
/// The trajectory; and list and points beside it, images.txt and points.ply.
void write_tum(const std::filesystem::path& file, const SlamMap& map);
void write_points(const std::filesystem::path& file, const SlamMap& map);
/// Poses and cameras of a video NAME, without its images, depth and masks.
void write_vipe(const std::filesystem::path& folder, const SlamMap& map, const std::string& name = "flight");
/// Bytes of a NumPy file; `type`: "<f4".
std::string npy_bytes(const std::string& type, const std::string& shape, const std::string& values);

/// A format with its writer, for tests of all formats.
struct FormatFiles {
  const char* name;
  bool has_observations;
  bool has_points;
  /// Writes into an empty directory and returns the MAP argument.
  std::function<std::filesystem::path(const std::filesystem::path&, const SlamMap&)> write;
  std::vector<std::string> files;  ///< all written files, to be damaged
  ReadMapOptions options(const std::filesystem::path& folder) const;
};
const std::vector<FormatFiles>& all_formats();

}  // namespace pmsp::test
