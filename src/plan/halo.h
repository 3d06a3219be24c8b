// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "pmsp/options.h"
#include "pmsp/plan.h"

namespace pmsp {

/// Throws InvalidOption where first planes form a chain through the whole flight.
void refuse_endless_chain(const DensifierOptions& options);

/// As `halo`, however long that chain is.
Halo find_halo(const Plan& plan, const std::vector<std::int64_t>& ids, const DensifierOptions& options, bool points);

}  // namespace pmsp
