// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"

namespace pmsp::tool {

/// Sources and hidden share of a mission's masks.
struct MaskReport {                   // NOLINT(bugprone-exception-escape): a JSON value is assigned by value
  std::string text;                   ///< for people; "" = no mask
  std::vector<std::string> warnings;  ///< probable mistakes
  nlohmann::ordered_json json;        ///< for --stats; null = no mask
};

/// Evaluates the masks of all images, or of an evenly spread sample. Throws as MaskSource::look.
MaskReport look_at_masks(const Arguments& arguments, const SlamMap& map, const ImageSource& source, MaskSource& masks);

}  // namespace pmsp::tool
