// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "arguments.h"
#include "pmsp/io/image_source.h"
#include "pmsp/io/map.h"
#include "pmsp/io/workspace/record.h"
#include "pmsp/lens_distance.h"
#include "pmsp/options.h"

namespace pmsp::tool {

/// What is known of the camera's lenses.
struct Lenses {
  double distance = 0.0;                  ///< to go on with (DensifierOptions::lens_distance)
  std::optional<LensDistance> estimated;  ///< where it was not given
  std::size_t images = 0;                 ///< keyframes that had one then; 0 = nothing was estimated
};

/// `images`: of all keyframes, before the first is read. `growing`: more will come. `recorded`: of a workspace, {} =
/// there is none; what was found significant once stays, and all else until there are other images, or twice as many
/// while more will come. Looks at some of them; where one is of no use nothing is estimated, and the run will say why.
Lenses find_lenses(const Arguments& arguments, const DensifierOptions& options, const SlamMap& map,
                   const ImageSource& images, bool growing, const workspace::Record& recorded);

/// One sentence for people; "" where nothing was estimated.
std::string describe(const Lenses& lenses);

}  // namespace pmsp::tool
