// SPDX-License-Identifier: BSD-2-Clause
#include "image_loop.h"

#include <utility>

namespace pmsp::tool {

ImageLoop::End ImageLoop::operator()(const InterruptGuard& guard) const {
  End end;
  for (;; ++end.images) {
    ImageReader::Read read = [this] {
      const TimeAccount::Scope waiting(time, Busy::kWait);
      return images.next();
    }();
    if (read.pairing) end.pairing = read.pairing;
    guard.check();
    for (const SkippedKeyframe& skipped : read.skipped) lost(skipped);
    if (!read.item) break;
    visit(end.images, read.keyframe);
    images.let_go(std::move(*read.item));
    guard.check();
  }
  if (end.images == 0) end.first_error = images.first_error();
  return end;
}

}  // namespace pmsp::tool
