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

/// A cube of the cloud in a page. Its points come as one block, number by number, least significant byte first:
/// positions (3 x 16 bits each, 0 = the cube's low face, 65535 = its high one), colours (3 x 8 bits), confidence (8
/// bits, 255 = 1), views (8 bits), normals (2 x 8 bits, signed, octahedral), keyframe (16 bits: its place among those
/// told, 65535 = none).
struct PageNode {
  int level = 0;                   ///< of the root 0; a cube has half the side of one of the level above
  std::array<double, 3> corner{};  ///< from the page's origin
  double side = 0.0;
  std::uint32_t points = 0;
  std::string bytes;
};

/// A cloud as a page holds it: an octree of the most confident points, coarse levels first, so that what is drawn is
/// even at any time. It takes points as any writer does; where they are more than the page may hold, the finest levels
/// go, and of the last one that stays an even share.
class PMSP_API PageCloud final : public CloudWriter {
 public:
  static constexpr std::size_t kPointBytes = 15;
  static constexpr std::int64_t kMostPoints = 5'000'000;

  /// Points are sorted in the header's scratch folder. `most_points`: 0 to kMostPoints. `keyframes`: ids in the order
  /// in which points name them; those after the 65535th are not named. Throws OutputError.
  PageCloud(const CloudHeader& header, std::int64_t most_points, const std::vector<std::int64_t>& keyframes);
  ~PageCloud() override;

  void add(const OutputPoint* points, std::size_t count) override;
  void finish() override;

  /// Points that came.
  std::int64_t points_in() const;
  /// Of all that came, by tenths of confidence: [0, 0.1), ..., [0.9, 1].
  const std::array<std::int64_t, 10>& confidences() const;
  /// What node corners count from, in the frame of the file.
  const Eigen::Vector3d& origin() const;

  // After finish().
  std::int64_t points() const;                 ///< that the page holds
  const std::vector<PageNode>& nodes() const;  ///< coarse levels first

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A unit vector as two numbers of 8 bits (octahedral: Meyer et al. 2010, "On floating-point normal vectors").
PMSP_API std::array<std::int8_t, 2> octahedral(const std::array<float, 3>& normal);

/// As base64 (RFC 4648) at the end of `text`.
PMSP_API void append_base64(std::string& text, const std::string& bytes);

}  // namespace pmsp
