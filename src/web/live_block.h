// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <string>

#include "pmsp/api.h"
#include "pmsp/types.h"

namespace pmsp::web {

/// How many of so many points the live page is given of a keyframe.
constexpr std::size_t kMostLivePoints = 40'000;

/// An even share of a cloud: of each run of points the first one. Pixels and agreements are left out.
PMSP_API KeyframeCloud thinned(const KeyframeCloud& cloud, std::size_t most);

/// A keyframe's points for the page: corner (3 x 64 bits) and side (64 bits) of the cube around them in the frame of
/// the keyframe, then their columns as in a PageNode (export/page_cloud.h), without keyframes.
PMSP_API std::string live_block(const KeyframeCloud& cloud);

}  // namespace pmsp::web
