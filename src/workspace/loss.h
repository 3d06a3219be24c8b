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

/// What a step loses of the planes that a record names, by its inputs; moves and other neighbours are not looked at.
struct Loss {
  std::size_t planes = 0;      ///< that the record names
  std::size_t keyframes = 0;   ///< of the record
  std::size_t same = 0;        ///< of these, with the same image
  std::size_t comparable = 0;  ///< planes of these
  std::size_t kept = 0;        ///< of these, made with the options, mask and engine of the step
  std::string difference;      ///< "width 640 -> 64, seed 1 -> 2", where nearly none are kept
  bool is_other_mission = false;
  bool is_nearly_all = false;  ///< less than a tenth of what can be compared is kept
};

/// `images`: of the step's keyframes, see StepKeyframe. Of `inputs`, options, engine and mask are looked at. Another
/// distance of the lenses alone is no loss: it is estimated again as a mission grows.
PMSP_API Loss loss_of(const Record& record, const StepInputs& inputs,
                      const std::map<std::int64_t, std::string>& images);

/// The part of StepKeyframe::image that stands for the image alone.
PMSP_API std::string image_alone(const std::string& image);

}  // namespace pmsp::workspace
