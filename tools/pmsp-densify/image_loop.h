// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>

#include "decoder.h"
#include "interrupt.h"
#include "pmsp/io/image_source.h"
#include "pmsp/io/pairing.h"
#include "time_account.h"

namespace pmsp::tool {

/// Looks at image after image, while other threads decode the next ones.
struct ImageLoop {
  ImageReader& images;
  TimeAccount* time = nullptr;  ///< that waiting is counted in

  /// A keyframe before the next image turned out to have none.
  std::function<void(const SkippedKeyframe&)> lost;
  /// `keyframe`: with the image; the mask is left out.
  std::function<void(std::size_t index, Keyframe& keyframe)> visit;

  struct End {
    std::size_t images = 0;
    std::string first_error;  ///< why the first one cannot be read, where none can
    std::optional<PairingVerifier::Verdict> pairing;
  };
  /// Throws Interrupted, and as ImageReader::next.
  End operator()(const InterruptGuard& guard) const;
};

}  // namespace pmsp::tool
