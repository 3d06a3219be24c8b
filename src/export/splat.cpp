// SPDX-License-Identifier: BSD-2-Clause
// Gaussian splats: the PLY of "3D Gaussian Splatting" (Kerbl et al. 2023), with colours as spherical harmonics of
// degree 0. A disc at each point: its size from the spacing of the points, its axis from the normal.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "export/little_endian.h"
#include "export/ply_header.h"
#include "export/point_spacing.h"
#include "export/record_file.h"
#include "export/spool.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud.h"
#include "util/thread_pool.h"

namespace pmsp {
namespace {

constexpr std::size_t kNumbers = 17;  ///< of a splat
constexpr float kSize = 0.8F;         ///< standard deviation along the surface, in spacings of the points
constexpr float kThickness = 0.1F;    ///< the same along the normal
constexpr float kLeastOpacity = 0.05F, kMostOpacity = 0.99F;
constexpr float kHarmonic = 0.28209479F;         ///< spherical harmonic of degree 0, 1 / (2 sqrt(pi))
constexpr std::int64_t kPointsAtOnce = 1 << 20;  ///< points at a time
constexpr std::int64_t kMostSlabs = 16;
constexpr std::size_t kBins = 4096;

/// Point as it is written, 32 bytes.
struct Surfel {
  Eigen::Vector3f position, normal;
  float confidence;
  Rgb color;
};

std::string splat_properties() {
  std::string lines;
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
                           "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    lines += std::string("property float ") + name + "\n";
  }
  return lines;
}

/// Shortest rotation of the z axis to a unit vector, as quaternion w, x, y, z.
std::array<float, 4> rotation_to(const Eigen::Vector3f& normal) {
  const float w = 1.0F + normal.z();
  const float norm = std::sqrt(w * w + normal.x() * normal.x() + normal.y() * normal.y());
  if (!(norm > 1e-6F)) return {0.0F, 1.0F, 0.0F, 0.0F};
  return {w / norm, -normal.y() / norm, normal.x() / norm, 0.0F};
}

/// Opacity 1 - (1 - confidence)^2, of which neighbouring discs make a closed surface, as viewers store it: before the
/// logistic function. Points without confidence are opaque.
float opacity_of(float confidence) {
  const float lacks = 1.0F - confidence;
  const float opacity =
      confidence > 0.0F ? std::clamp(1.0F - lacks * lacks, kLeastOpacity, kMostOpacity) : kMostOpacity;
  return std::log(opacity / (1.0F - opacity));
}

void put_splat(char* to, const Surfel& point, float spacing) {
  for (int i = 0; i < 3; ++i) to = put_little(to, point.position[i]);
  for (int i = 0; i < 3; ++i) to = put_little(to, point.normal[i]);
  for (const std::uint8_t value : {point.color.r, point.color.g, point.color.b}) {
    to = put_little(to, (static_cast<float>(value) / 255.0F - 0.5F) / kHarmonic);
  }
  to = put_little(to, opacity_of(point.confidence));
  const bool has_normal = !point.normal.isZero(0.0F);
  const float along = std::log(kSize * spacing);
  for (const float scale : {along, along, has_normal ? std::log(kThickness * spacing) : along}) {
    to = put_little(to, scale);
  }
  const std::array<float, 4> rotation =
      has_normal ? rotation_to(point.normal) : std::array<float, 4>{1.0F, 0.0F, 0.0F, 0.0F};
  for (const float value : rotation) to = put_little(to, value);
}

class Splats final : public CloudWriter {
 public:
  Splats(const std::filesystem::path& path, const CloudHeader& header)
      : scratch_(header.scratch.string()),
        least_spacing_(static_cast<float>(1e-6 * header.reach)),
        threads_(header.threads),
        points_(scratch_, 1),
        header_(header.comments, splat_properties()),
        file_(path, header_.text(0), kNumbers * sizeof(float), header.threads) {
    if (!needs_double(header)) return;
    throw InvalidOption(path.string() +
                        ": splats have coordinates of 32 bits, too coarse this far from the origin; move the cloud "
                        "there with --transform, or leave this output out");
  }

  void add(const OutputPoint* points, std::size_t count) override {
    for (const OutputPoint* point = points; point != points + count; ++point) {
      points_.add(0, {point->position.cast<float>(), point->normal, point->confidence, point->color});
    }
  }

  void finish() override {
    ThreadPool pool(threads_);
    write(points_, 0, pool);
    file_.patch(0, header_.text(file_.points()));
    file_.commit();
  }

 private:
  /// Writes the points of a list. Those that exceed memory are divided first: points at a boundary lack neighbours on
  /// its other side, which adds little to their spacing.
  void write(Spool<Surfel>& spool, std::size_t list, ThreadPool& pool) {
    const std::int64_t count = spool.size(list);
    if (count > kPointsAtOnce && divide(spool, list, pool)) return;
    std::vector<Surfel> points;
    points.reserve(static_cast<std::size_t>(count));
    spool.read(list, [&](const Surfel* some, std::size_t number) { points.insert(points.end(), some, some + number); });
    spool.drop(list);
    std::vector<Eigen::Vector3f> positions;
    positions.reserve(points.size());
    for (const Surfel& point : points) positions.push_back(point.position);
    const std::vector<float> spacing = point_spacing(positions, pool);
    file_.fill(points.size(), [&](std::size_t first, std::size_t number, char* to) {
      for (std::size_t i = first; i < first + number; ++i, to += kNumbers * sizeof(float)) {
        put_splat(to, points[i], std::max(spacing[i], least_spacing_));
      }
    });
  }

  /// Divides a list into slabs across its longest side, of about equal numbers of points, and writes these. False if
  /// all points coincide.
  bool divide(Spool<Surfel>& spool, std::size_t list, ThreadPool& pool) {
    Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::max()), high = -low;
    spool.read(list, [&](const Surfel* some, std::size_t number) {
      for (const Surfel* point = some; point != some + number; ++point) {
        low = low.cwiseMin(point->position);
        high = high.cwiseMax(point->position);
      }
    });
    Eigen::Index axis = 0;
    const float side = (high - low).maxCoeff(&axis);
    if (!(side > 0.0F)) return false;
    const auto bin_of = [&](const Surfel& point) {
      const float at = (point.position[axis] - low[axis]) / side * static_cast<float>(kBins);
      return std::min(static_cast<std::size_t>(at), kBins - 1);
    };
    std::vector<std::int64_t> counts(kBins, 0);
    spool.read(list, [&](const Surfel* some, std::size_t number) {
      for (std::size_t i = 0; i < number; ++i) ++counts[bin_of(some[i])];
    });
    const std::int64_t total = spool.size(list), slabs = std::min(2 * total / kPointsAtOnce + 1, kMostSlabs);
    std::vector<std::size_t> slab_of(kBins);
    std::int64_t before = 0;
    for (std::size_t bin = 0; bin < kBins; ++bin) {  // by the middle of the bin: the first and the last differ
      slab_of[bin] = static_cast<std::size_t>((2 * before + counts[bin]) * slabs / (2 * total));
      before += counts[bin];
    }
    Spool<Surfel> divided(scratch_, static_cast<std::size_t>(slabs));
    spool.read(list, [&](const Surfel* some, std::size_t number) {
      for (std::size_t i = 0; i < number; ++i) divided.add(slab_of[bin_of(some[i])], some[i]);
    });
    spool.drop(list);
    for (std::size_t slab = 0; slab < static_cast<std::size_t>(slabs); ++slab) write(divided, slab, pool);
    return true;
  }

  std::string scratch_;
  float least_spacing_;
  int threads_;
  Spool<Surfel> points_;
  PlyHeader header_;
  RecordFile file_;
};

}  // namespace

std::unique_ptr<CloudWriter> open_splat(const std::filesystem::path& path, const CloudHeader& header) {
  return std::make_unique<Splats>(path, header);
}

}  // namespace pmsp
