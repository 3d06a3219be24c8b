// SPDX-License-Identifier: BSD-2-Clause
#include "export/cloud_frame.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "elementary.h"
#include "export/fit_similarity.h"
#include "export/number_table.h"
#include "pmsp/error.h"
#include "util/text.h"

namespace pmsp {
namespace {

std::string short_text(double value) { return number_text(value, "%.4g"); }

void align(const FrameOptions& options, const SlamMap& map, const ImageFiles& images, CloudFrame& frame) {
  const bool is_exif = options.align == kAlignExif;
  std::string origin;
  const std::vector<Anchor> anchors =
      is_exif ? gps_anchors(map, images, origin) : read_anchors(options.align, map, options.align_time_offset, images);
  std::vector<Eigen::Vector3d> source, target;
  Eigen::Matrix3d turn = Eigen::Matrix3d::Zero();
  bool has_turns = true;
  for (const Anchor& anchor : anchors) {
    source.push_back(anchor.in_map);
    target.push_back(anchor.in_file);
    has_turns = has_turns && anchor.file_from_map;
    if (anchor.file_from_map) turn += *anchor.file_from_map;
  }
  const std::string name = is_exif ? "the images' EXIF data" : options.align.string();
  if (anchors.size() < 3) {
    throw InvalidInput(name + ": " + std::to_string(anchors.size()) + (is_exif ? " positions" : " points") +
                       ", expected at least 3");
  }
  const bool is_line = is_a_line(target) || is_a_line(source);
  if (is_line && !has_turns) {
    throw InvalidInput(
        name + ": points lie on a line, so that the rotation around it is undetermined; add points off the line");
  }
  try {
    frame.file_from_map = is_line ? with_rotation(nearest_rotation(turn), source, target) : umeyama(source, target);
  } catch (const InvalidInput& error) {
    throw InvalidInput(name + ": " + error.what());
  }
  for (const Anchor& anchor : anchors) {
    frame.residuals.push_back({anchor.name, (frame.file_from_map * anchor.in_map - anchor.in_file).norm()});
  }
  const auto worst = std::max_element(frame.residuals.begin(), frame.residuals.end(),
                                      [](const Residual& a, const Residual& b) { return a.distance < b.distance; });
  frame.description = "aligned with " + std::to_string(anchors.size()) + " points of " + name + ": scale " +
                      short_text(frame.file_from_map.scale) + ", residuals " + short_text(frame.residual_rms()) +
                      " (RMS), " + short_text(worst->distance) + " at most (" + worst->name + ")";
  if (is_exif) frame.description += "; metres east, north and up of " + origin;
}

void turn_up(const SlamMap& map, CloudFrame& frame) {
  double spread_deg = 0.0;
  const Eigen::Vector3d up = up_of_cameras(map, spread_deg);
  const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ());
  frame.file_from_map.rotation = turn.toRotationMatrix();
  frame.up_spread_deg = spread_deg;
  frame.description =
      "z is up, by the mean vertical axis of the cameras (median deviation " + short_text(spread_deg) + " degrees)";
}

}  // namespace

double CloudFrame::residual_rms() const {
  double sum = 0.0;
  for (const Residual& residual : residuals) sum += residual.distance * residual.distance;
  return residuals.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(residuals.size()));
}

double CloudFrame::residual_max() const {
  double most = 0.0;
  for (const Residual& residual : residuals) most = std::max(most, residual.distance);
  return most;
}

CloudUnit unit_of_frame(const FrameOptions& options) {
  constexpr double kRounding = 1e-6;  // of a matrix written as text
  if (options.scale) return {CloudUnit::Kind::kMetres, "--scale"};
  if (!options.transform.empty() && std::abs(read_similarity(options.transform).scale - 1.0) > kRounding) {
    return {CloudUnit::Kind::kMetres, "--transform"};
  }
  if (options.align == kAlignExif) return {CloudUnit::Kind::kMetres, "--align exif"};
  if (!options.align.empty()) return {CloudUnit::Kind::kMetres, "--align"};
  return {CloudUnit::Kind::kMap, ""};
}

CloudFrame find_cloud_frame(const FrameOptions& options, const SlamMap& map, const ImageFiles& images) {
  CloudFrame frame;
  frame.unit = unit_of_frame(options);
  if (!options.align.empty()) align(options, map, images, frame);
  if (options.up) turn_up(map, frame);
  if (!options.transform.empty()) frame.file_from_map = read_similarity(options.transform) * frame.file_from_map;
  if (options.scale) {
    frame.file_from_map =
        Similarity{*options.scale, Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()} * frame.file_from_map;
  }
  return frame;
}

Similarity read_similarity(const std::filesystem::path& path) {
  std::vector<double> v;
  for (const NumberRow& row : read_number_table(path)) {
    if (!row.name.empty()) {
      throw InvalidInput(path.string() + ": line " + std::to_string(row.line) + ": \"" + row.name + "\" is no number");
    }
    v.insert(v.end(), row.numbers.begin(), row.numbers.end());
  }
  if (v.size() != 16) {
    throw InvalidInput(path.string() + ": holds " + std::to_string(v.size()) +
                       " numbers; expected the 16 of a 4 x 4 matrix, row by row");
  }
  if (v[12] != 0.0 || v[13] != 0.0 || v[14] != 0.0 || v[15] != 1.0) {
    throw InvalidInput(path.string() + ": the last row of the matrix is not 0 0 0 1; are rows and columns swapped?");
  }
  Eigen::Matrix3d m;
  for (int row = 0; row < 3; ++row) m.row(row) << v[4 * row], v[4 * row + 1], v[4 * row + 2];
  const double determinant = m.determinant();
  const double scale = std::cbrt(determinant);
  const bool is_rotation =
      determinant > 0.0 &&
      (m.transpose() * m / (scale * scale) - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-3;
  if (!is_rotation) {
    throw InvalidInput(path.string() +
                       ": the matrix is no rotation times a scale > 0 (it mirrors, shears or stretches); expected one");
  }
  return {scale, nearest_rotation(m), {v[3], v[7], v[11]}};
}

Eigen::Vector3d up_of_cameras(const SlamMap& map, double& spread_deg) {
  std::vector<Eigen::Vector3d> ups;
  for (const MapKeyframe& keyframe : map.keyframes) {
    ups.emplace_back(-keyframe.cam_from_world.rotation.row(1).transpose());
  }
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& one : ups) up += one;
  // Approximate minimum of the sum of angles (iteratively reweighted), robust to a few cameras lying on their side.
  for (int i = 0; i < 20 && up.norm() > 0.0; ++i) {
    const Eigen::Vector3d before = up.normalized();
    up.setZero();
    for (const Eigen::Vector3d& one : ups) up += one / std::max((one - before).norm(), 1e-3);
  }
  std::vector<double> angles;
  if (up.norm() > 0.0) up.normalize();
  for (const Eigen::Vector3d& one : ups)
    angles.push_back(std::acos(std::clamp(one.dot(up), -1.0, 1.0)) / kernels::kDegree);
  std::sort(angles.begin(), angles.end());
  spread_deg = angles.empty() ? 180.0 : angles[angles.size() / 2];
  constexpr double kMostSpread = 45.0;
  if (spread_deg > kMostSpread) {
    throw InvalidInput("--up: the cameras have no direction in common that could be up (median deviation " +
                       short_text(spread_deg) + " degrees); give --transform or --align");
  }
  return up;
}

}  // namespace pmsp
