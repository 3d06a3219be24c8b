// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/image.h"

namespace pmsp {

/// What a PLY holds, as columns. Missing columns are empty. Colours given as numbers from 0 to 1 are scaled to 255;
/// comment lines without words are left out. Confidence and views are taken with or without "scalar_" before the name.
struct PlyCloud {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Vector3f> normals;
  std::vector<Rgb> colors;
  std::vector<float> confidence;
  std::vector<std::uint8_t> views;
  std::vector<std::string> comments;
};

/// Reads the vertices of a PLY, ascii or binary of either byte order; other elements are passed over. Throws IoError,
/// or InvalidInput with the line or byte: broken or cut off, no x y z, a position that is not finite.
PMSP_API PlyCloud read_ply(const std::filesystem::path& path);

}  // namespace pmsp
