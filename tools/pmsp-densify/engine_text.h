// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <future>
#include <string>

#include "arguments.h"
#include "pmsp/options.h"

namespace pmsp::tool {

/// Returns version, processor type and decoder: equal texts imply equal bytes for equal input. `options`: with
/// effective backend and simd, described by `backend`. The GPU model identifies its architecture.
std::string engine_text(const DensifierOptions& options, const std::string& backend, const Arguments& arguments);

/// Returns version, build type, compiler and, if readable, fingerprint of this program.
std::string build_text();

/// Starts the CUDA device, if one is used, while the map is being read; returns the time taken [s]. Errors are reported
/// later by the Densifier.
std::future<double> start_device(const DensifierOptions& options);

}  // namespace pmsp::tool
