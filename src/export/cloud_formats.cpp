// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/io/cloud.h"
#include "util/text.h"

namespace pmsp {

// Each is defined in its format's file.
std::unique_ptr<CloudWriter> open_ply(const std::filesystem::path& path, const CloudHeader& header);
std::unique_ptr<CloudWriter> open_splat(const std::filesystem::path& path, const CloudHeader& header);
std::unique_ptr<CloudWriter> open_las(const std::filesystem::path& path, const CloudHeader& header);
std::unique_ptr<CloudWriter> open_colmap(const std::filesystem::path& path, const CloudHeader& header);
std::unique_ptr<CloudWriter> open_nerfstudio(const std::filesystem::path& path, const CloudHeader& header);
std::unique_ptr<CloudWriter> open_potree(const std::filesystem::path& path, const CloudHeader& header);
std::unique_ptr<CloudWriter> open_bt(const std::filesystem::path& path, const CloudHeader& header);
std::unique_ptr<CloudWriter> open_ot(const std::filesystem::path& path, const CloudHeader& header);
std::unique_ptr<CloudWriter> open_pgm(const std::filesystem::path& path, const CloudHeader& header);
bool is_colmap_name(const std::string& name);
bool is_nerfstudio_name(const std::string& name);
bool is_potree_name(const std::string& name);
std::vector<std::filesystem::path> files_beside_grid(const std::filesystem::path& path);

const std::vector<CloudFormat>& cloud_formats() {
  static const std::vector<CloudFormat> kFormats{
      {"ply", ".ply", "binary PLY, with normals, colour, confidence and views", nullptr, open_ply},
      {"splat", ".splat.ply", "Gaussian splats, a disc at each point, for viewers of 3DGS", nullptr, open_splat},
      {"las", ".las", "LAS 1.4, point format 7, with the same as extra bytes", nullptr, open_las},
      {"colmap", ".colmap", "model and images for COLMAP and trainers", is_colmap_name, open_colmap},
      {"nerfstudio", ".nerfstudio", "images, transforms.json and points for trainers", is_nerfstudio_name,
       open_nerfstudio},
      {"potree", ".potree", "Potree 2 octree, for viewers in a browser", is_potree_name, open_potree},
      {"bt", ".bt", "OctoMap of occupied and free cells, for robots", nullptr, open_bt, true},
      {"ot", ".ot", "OctoMap with the occupancy of each cell", nullptr, open_ot, true},
      {"pgm", ".pgm", "occupancy grid of the floor for Nav2, with YAML, and elevation and slope as TIFF", nullptr,
       open_pgm, true, files_beside_grid},
  };
  return kFormats;
}

const CloudFormat* find_cloud_format(const std::string& name) {
  for (const CloudFormat& format : cloud_formats()) {
    if (name == format.name) return &format;
  }
  return nullptr;
}

const CloudFormat* cloud_format_of(const std::filesystem::path& path) {
  const std::filesystem::path plain = path.has_filename() ? path : path.parent_path();  // "folder.potree/"
  const std::string name = lower_case(plain.filename().string());
  const CloudFormat* longest = nullptr;
  for (const CloudFormat& format : cloud_formats()) {
    const std::string extension = format.extension;
    const bool fits = name.size() > extension.size() && name.rfind(extension) == name.size() - extension.size();
    if (fits && (longest == nullptr || extension.size() > std::string(longest->extension).size())) longest = &format;
  }
  return longest;
}

void CloudWriter::set_window(std::int64_t, const std::vector<std::int64_t>&) {}

void CloudWriter::add_depth(const DepthMap&) {}

bool CloudWriter::wants_depth() const { return false; }

bool CloudWriter::add_parallel(std::size_t, const PointProducer&) { return false; }

}  // namespace pmsp
