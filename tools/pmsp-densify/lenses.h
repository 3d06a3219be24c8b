// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <optional>
#include <string>

#include "arguments.h"
#include "pmsp/io/map.h"
#include "pmsp/lens_distance.h"
#include "pmsp/options.h"

namespace pmsp::tool {

/// What is known of the camera's lenses.
struct Lenses {
  double distance = 0.0;                  ///< to go on with (DensifierOptions::lens_distance)
  std::optional<LensDistance> estimated;  ///< where it was not given
};

/// `recorded`: options of a workspace's record, "{}" = there are none; what was found significant once stays. Looks at
/// some of the images; where one of them is of no use nothing is estimated, and the run will say why.
Lenses find_lenses(const Arguments& arguments, const DensifierOptions& options, const SlamMap& map,
                   const std::string& recorded);

/// One sentence for people; "" where nothing was estimated.
std::string describe(const Lenses& lenses);

}  // namespace pmsp::tool
