// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <string>

#include "engine.h"

namespace pmsp {

/// Returns an engine for `options.backend`. Writes the choice into `options` (backend, devices, threads, simd, scratch
/// folder) and, with the reason, into `description`. Throws BackendUnavailable.
std::unique_ptr<Engine> make_engine(const EngineContext& context, DensifierOptions& options, std::string& description);

}  // namespace pmsp
