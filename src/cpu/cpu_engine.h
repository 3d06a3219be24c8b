// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>

#include "engine.h"
#include "pmsp/stages.h"

namespace pmsp::cpu {

/// Stages on the CPU, one after the other; each delivers its result before it returns.
std::unique_ptr<Engine> make_engine(const EngineContext& context, Executor executor);

}  // namespace pmsp::cpu
