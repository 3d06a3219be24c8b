// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "pmsp/api.h"
#include "workspace/record.h"
#include "workspace/step.h"

namespace pmsp::workspace {

/// Recorded planes that a step loses because of its inputs; moves and other source views are ignored.
struct Loss {
  std::size_t planes = 0;      ///< in the record
  std::size_t keyframes = 0;   ///< in the record
  std::size_t same = 0;        ///< of `keyframes`, with the same image
  std::size_t comparable = 0;  ///< of `planes`, of `same` keyframes
  std::size_t kept = 0;        ///< of `comparable`, with the same options, mask and engine
  std::string difference;      ///< "width 640 -> 64, seed 1 -> 2", if nearly none are kept
  bool is_other_mission = false;
  bool is_nearly_all = false;  ///< less than a tenth of `comparable` is kept
};

/// `images`: of the step's keyframes, see StepKeyframe. `inputs`: only options, engine and mask are compared. A
/// different lens distance alone is no loss: it is estimated again as a mission grows.
PMSP_API Loss loss_of(const Record& record, const StepInputs& inputs,
                      const std::map<std::int64_t, std::string>& images);

/// Returns the part of StepKeyframe::image for the image alone.
PMSP_API std::string image_alone(const std::string& image);

}  // namespace pmsp::workspace
