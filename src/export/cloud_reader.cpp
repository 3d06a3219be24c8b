// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/io/cloud.h"

#include <cmath>
#include <system_error>

#include <Eigen/LU>
#include <nlohmann/json.hpp>

#include "export/fit_similarity.h"
#include "io/binary_input.h"
#include "pmsp/error.h"
#include "workspace/workspace_cloud.h"

namespace pmsp {

std::unique_ptr<CloudReader> open_ply_reader(const std::filesystem::path& path);
std::unique_ptr<CloudReader> open_las_reader(const std::filesystem::path& path);
std::unique_ptr<CloudReader> open_potree_reader(const std::filesystem::path& folder);
std::unique_ptr<CloudReader> open_colmap_reader(const std::filesystem::path& folder);

namespace {

std::unique_ptr<CloudReader> open_folder(const std::filesystem::path& path) {
  std::error_code ignored;
  if (workspace::is_workspace(path)) return std::make_unique<workspace::WorkspaceCloud>(path);
  if (std::filesystem::exists(path / "metadata.json", ignored)) return open_potree_reader(path);
  if (std::filesystem::exists(path / "sparse" / "0" / "points3D.bin", ignored)) return open_colmap_reader(path);
  if (std::filesystem::exists(path / "points.ply", ignored)) return open_ply_reader(path / "points.ply");
  throw InvalidInput(path.string() +
                     ": is no cloud; expected a PLY or a LAS, or a directory of `run --workspace` or Potree");
}

/// From a 4 x 4 matrix.
std::optional<Similarity> similarity_from(const nlohmann::json& rows, double scale) {
  Similarity similarity;
  similarity.scale = scale;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) similarity.rotation(r, c) = rows.at(r).at(c).get<double>() / scale;
    similarity.translation[r] = rows.at(r).at(3).get<double>();
  }
  const Eigen::Matrix3d error = similarity.rotation.transpose() * similarity.rotation - Eigen::Matrix3d::Identity();
  const bool is_sound = std::isfinite(scale) && scale > 0.0 && similarity.translation.allFinite() &&
                        error.cwiseAbs().maxCoeff() < 1e-6 && similarity.rotation.determinant() > 0.0;
  return is_sound ? std::optional<Similarity>(similarity) : std::nullopt;
}

}  // namespace

std::unique_ptr<CloudReader> open_cloud(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return open_folder(path);
  BinaryInput in(path);
  if (in.take_if("LASF")) return open_las_reader(path);
  if (in.take_if("ply")) return open_ply_reader(path);
  in.fail("is neither a PLY nor a LAS; convert other formats with CloudCompare or pdal translate");
}

std::optional<std::pair<Eigen::Vector3d, Eigen::Vector3d>> bounds_of(CloudReader& cloud) {
  std::optional<std::pair<Eigen::Vector3d, Eigen::Vector3d>> box;
  cloud.read([&](const OutputPoint* points, std::size_t count) {
    if (!box) box.emplace(points->position, points->position);
    for (const OutputPoint* point = points; point != points + count; ++point) {
      box->first = box->first.cwiseMin(point->position);
      box->second = box->second.cwiseMax(point->position);
    }
  });
  return box;
}

void read_origin(CloudInfo& info) {
  const std::string cloud = "cloud {", of_map = "frame of the SLAM map, its unit of length";
  for (const std::string& comment : info.comments) {
    if (comment.rfind(of_map, 0) == 0) {
      info.file_from_map = Similarity{};
      info.unit.kind = CloudUnit::Kind::kMap;
    }
    if (comment.rfind(cloud, 0) != 0) continue;
    const nlohmann::json json = nlohmann::json::parse(comment.substr(cloud.size() - 1), nullptr, false);
    if (!json.is_object()) continue;
    try {
      const auto scale = json.at("scale").get<double>();
      info.file_from_map = similarity_from(json.at("file_from_map"), scale);
      if (!info.file_from_map) continue;
      // Clouds of earlier versions do not contain their unit.
      const std::string unit = json.value("unit", scale == 1.0 ? "map" : "m");
      info.unit = {unit == "m"     ? CloudUnit::Kind::kMetres
                   : unit == "map" ? CloudUnit::Kind::kMap
                                   : CloudUnit::Kind::kUnknown,
                   unit == "m" ? json.value("unit_by", "its transform") : ""};
      for (const nlohmann::json& lacks : json.value("lacks", nlohmann::json::array())) {
        info.has_normals = info.has_normals && lacks != "normals";
        info.has_colors = info.has_colors && lacks != "colours";
        info.has_confidence = info.has_confidence && lacks != "confidence";
        info.has_views = info.has_views && lacks != "views";
      }
    } catch (const nlohmann::json::exception&) {  // comment of another program
    }
  }
}

}  // namespace pmsp
