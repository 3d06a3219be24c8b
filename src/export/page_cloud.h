// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/io/cloud.h"

namespace pmsp {

/// Cube of a page's cloud. Its points are one block, field by field, least significant byte first: positions (3 x 16
/// bits each, 0 = low face of the cube, 65535 = high face), colours (3 x 8 bits), confidence (8 bits, 255 = 1), views
/// (8 bits), normals (2 x 8 bits, signed, octahedral), keyframe (16 bits: index into `keyframes`, 65535 = none).
struct PageNode {
  int level = 0;                   ///< 0 = root; the side halves with each level
  std::array<double, 3> corner{};  ///< from the page's origin
  double side = 0.0;
  std::uint32_t points = 0;
  std::string bytes;
};

/// Cloud of a page: an octree of the most confident points, coarse levels first, so that any prefix is an even sample.
/// If points exceed the limit, the finest levels are dropped, and the last remaining one is sampled evenly.
class PMSP_API PageCloud final : public CloudWriter {
 public:
  static constexpr std::size_t kPointBytes = 15;
  static constexpr std::int64_t kMostPoints = 5'000'000;

  /// Points are sorted in the header's scratch folder. `most_points`: 0 to kMostPoints. `keyframes`: ids by index;
  /// those after the 65535th have no index. Throws OutputError.
  PageCloud(const CloudHeader& header, std::int64_t most_points, const std::vector<std::int64_t>& keyframes);
  ~PageCloud() override;

  void add(const OutputPoint* points, std::size_t count) override;
  void finish() override;

  /// Number of points received.
  std::int64_t points_in() const;
  /// Histogram of the confidence of all received points: [0, 0.1), ..., [0.9, 1].
  const std::array<std::int64_t, 10>& confidences() const;
  /// Origin of node corners, in the frame of the file.
  const Eigen::Vector3d& origin() const;

  // After finish().
  std::int64_t points() const;                 ///< in the page
  const std::vector<PageNode>& nodes() const;  ///< coarse levels first

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Returns a unit vector as two 8-bit numbers (octahedral: Meyer et al. 2010, "On floating-point normal vectors").
PMSP_API std::array<std::int8_t, 2> octahedral(const std::array<float, 3>& normal);

/// Appends base64 (RFC 4648) to `text`.
PMSP_API void append_base64(std::string& text, const std::string& bytes);

}  // namespace pmsp
