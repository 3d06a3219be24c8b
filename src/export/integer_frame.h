// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <string>

#include <Eigen/Core>

#include "pmsp/io/cloud.h"

namespace pmsp {

/// Coordinates as integers: coordinate = number * scale + offset.
struct IntegerFrame {
  double scale = 1.0;
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();

  double steps(double coordinate, int axis) const { return std::floor((coordinate - offset[axis]) / scale + 0.5); }
  double coordinate(double steps, int axis) const { return steps * scale + offset[axis]; }
};

/// Returns the frame for a cloud of known centre and reach: powers of ten, for readability. 32 bits cover 214 times the
/// reach.
inline IntegerFrame integer_frame(const CloudHeader& header) {
  const auto ten_to = [](double exponent) { return std::stod("1e" + std::to_string(static_cast<int>(exponent))); };
  IntegerFrame frame;
  frame.scale = header.resolution > 0.0 ? header.resolution : ten_to(std::ceil(std::log10(header.reach * 1e-7)));
  const double step = ten_to(std::floor(std::log10(header.reach)));
  for (int i = 0; i < 3; ++i) frame.offset[i] = std::floor(header.center[i] / step + 0.5) * step;
  return frame;
}

}  // namespace pmsp
