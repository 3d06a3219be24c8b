// SPDX-License-Identifier: BSD-2-Clause
#include "cuda/cuda_engine.h"

#include <utility>

#include "cuda/cuda_processor.h"
#include "stage_engine.h"

namespace pmsp::cuda {

std::unique_ptr<Engine> make_engine(const EngineContext& context, Executor executor) {
  enable_peer_access(context.options.devices);
  return std::make_unique<StageEngine<CudaProcessor>>(context, std::move(executor));
}

}  // namespace pmsp::cuda
