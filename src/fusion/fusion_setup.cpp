// SPDX-License-Identifier: BSD-2-Clause
#include "fusion/fusion_setup.h"

#include <cmath>

namespace pmsp {
namespace {

float min_cos_normals(const FusionOptions& options) {
  return static_cast<float>(std::cos(options.max_normal_deg * kernels::kPi / 180.0));
}

}  // namespace

kernels::FusionLimits fusion_limits(const FusionOptions& options) {
  return {static_cast<float>(options.max_relative_depth), min_cos_normals(options),
          static_cast<float>(options.min_confidence), static_cast<float>(options.suppression)};
}

kernels::DuplicateLimits duplicate_limits(const FusionOptions& options) {
  return {static_cast<float>(options.spacing_px), static_cast<float>(options.max_relative_depth),
          min_cos_normals(options)};
}

kernels::FreeSpaceLimits free_space_limits(const FreeSpaceOptions& options) {
  const float tolerance = static_cast<float>(options.max_relative_depth);
  return {1.0F - static_cast<float>(options.min_relative_gap), 1.0F - tolerance, 1.0F + tolerance};
}

}  // namespace pmsp
