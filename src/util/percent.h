// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <string>

namespace pmsp {

/// Returns a share of 0 to 1 as a whole percentage: "43 %".
inline std::string percent(double share) { return std::to_string(std::lround(100.0 * share)) + " %"; }

}  // namespace pmsp
