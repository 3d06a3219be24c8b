// SPDX-License-Identifier: BSD-2-Clause
#include "plan/moves.h"

#include <cmath>

#include "equirect.h"
#include "util/eigen_kernels.h"

namespace pmsp {

double moved_angle(const PosePair& then, const PosePair& now, double range) {
  const RigidTransform before = other_from_first(then.other, then.own);
  const RigidTransform after = other_from_first(now.other, now.own);
  const double scale_ratio = then.own.scale / then.other.scale;
  const double turned = (after.rotation - before.rotation).norm() / (std::sqrt(2.0) * scale_ratio);
  const double shifted = range > 0.0 ? (after.translation - before.translation).norm() / (range * scale_ratio) : 0.0;
  return turned + shifted;
}

double moved_px(const PosePair& then, const PosePair& now, double range, int width) {
  return moved_angle(then, now, range) * width / (2.0 * kernels::kPi);
}

}  // namespace pmsp
