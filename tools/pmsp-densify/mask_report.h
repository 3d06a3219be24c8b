// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"

namespace pmsp::tool {

/// Where the masks of a mission come from, and what they hide.
struct MaskReport {                   // NOLINT(bugprone-exception-escape): a JSON value is assigned by value
  std::string text;                   ///< for people; "" = no mask
  std::vector<std::string> warnings;  ///< what is wrong with them, probably
  nlohmann::ordered_json json;        ///< for --stats; null = no mask
};

/// Looks at the masks of all images, or at some, evenly spread. Throws as MaskSource::look.
MaskReport look_at_masks(const Arguments& arguments, const SlamMap& map, const ImageSource& source, MaskSource& masks);

}  // namespace pmsp::tool
