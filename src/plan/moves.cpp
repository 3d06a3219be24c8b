// SPDX-License-Identifier: BSD-2-Clause
#include "plan/moves.h"

#include <cmath>

#include "equirect.h"
#include "util/eigen_kernels.h"

namespace pmsp {

double moved_angle(const PosePair& then, const PosePair& now, double distance) {
  const RigidTransform before = other_from_first(then.other, then.own);
  const RigidTransform after = other_from_first(now.other, now.own);
  const double scale_ratio = then.own.scale / then.other.scale;
  const double turned = (after.rotation - before.rotation).norm() / (std::sqrt(2.0) * scale_ratio);
  const double shifted =
      distance > 0.0 ? (after.translation - before.translation).norm() / (distance * scale_ratio) : 0.0;
  return turned + shifted;
}

double moved_px(const PosePair& then, const PosePair& now, double distance, int width) {
  return moved_angle(then, now, distance) * width / (2.0 * kernels::kPi);
}

}  // namespace pmsp
