// SPDX-License-Identifier: BSD-2-Clause
#include "cpu/cpu_engine.h"

#include <utility>

#include "cpu/cpu_processor.h"
#include "stage_engine.h"

namespace pmsp::cpu {

std::unique_ptr<Engine> make_engine(const EngineContext& context, Executor executor) {
  return std::make_unique<StageEngine<CpuProcessor>>(context, std::move(executor));
}

}  // namespace pmsp::cpu
