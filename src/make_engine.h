// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <string>

#include "engine.h"

namespace pmsp {

/// The engine that `options.backend` asks for. Writes the choice into `options` (backend, threads, simd) and, in words,
/// with the reason, into `description`. Throws BackendUnavailable.
std::unique_ptr<Engine> make_engine(const EngineContext& context, DensifierOptions& options, std::string& description);

}  // namespace pmsp
