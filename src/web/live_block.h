// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <string>

#include "pmsp/api.h"
#include "pmsp/types.h"

namespace pmsp::web {

/// Maximum number of points of a keyframe in the live page.
constexpr std::size_t kMaxLivePoints = 40'000;

/// Returns at most `most` points, evenly selected, without `pixels`, `agree` and `window_ids`.
PMSP_API KeyframeCloud thinned(const KeyframeCloud& cloud, std::size_t most);

/// Encodes points for the page: corner (3 x 64 bits) and side (64 bits) of their bounding cube in the frame of the
/// keyframe, then their columns as in a PageNode (export/page_cloud.h), without keyframes.
PMSP_API std::string live_block(const KeyframeCloud& cloud);

}  // namespace pmsp::web
