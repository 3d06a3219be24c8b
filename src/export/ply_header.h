// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pmsp/io/cloud.h"

namespace pmsp {

/// Header of a binary PLY with one element, vertex, whose count becomes known at the end.
class PlyHeader {
 public:
  /// `properties`: lines "property TYPE NAME" of the vertex.
  PlyHeader(const std::vector<std::string>& comments, const std::string& properties);

  /// Returns the header; of the same length for any count.
  std::string text(std::int64_t vertices) const;

 private:
  std::string before_, after_;  ///< lines before and after the count
};

/// Returns whether the resolution of float at the cloud's distance from the origin is worse than 1e-6 of the reach.
bool needs_double(const CloudHeader& header);

}  // namespace pmsp
