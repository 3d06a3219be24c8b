// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <future>
#include <string>

#include "arguments.h"
#include "pmsp/options.h"

namespace pmsp::tool {

/// Version, kind of processor and decoder: what makes the same bytes of the same input has the same text. `options`:
/// with backend and simd in force, which `backend` has in words. A GPU's model stands for its architecture.
std::string engine_text(const DensifierOptions& options, const std::string& backend, const Arguments& arguments);

/// This very program: version, kind of build, compiler, fingerprint of its bytes where these can be read.
std::string build_text();

/// Starts a CUDA device, if there is one to be used, while the map is being read, and says what it took [s]. What
/// stands in the way is told by the Densifier that is made later.
std::future<double> start_device(const DensifierOptions& options);

}  // namespace pmsp::tool
