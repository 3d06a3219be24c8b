// SPDX-License-Identifier: BSD-2-Clause
#define CATCH_CONFIG_RUNNER
#include <catch2/catch.hpp>
#include <iostream>

#include "cuda/cuda_engine.h"

/// Exit code of a test that cannot run here (CTest's SKIP_RETURN_CODE).
constexpr int kSkipped = 77;

int main(int argc, char** argv) {
  const pmsp::cuda::Device device = pmsp::cuda::find_device(0);
  if (!device.why_not.empty()) {
    std::cout << "skipped: CUDA device 0: " << device.why_not << '\n';
    return kSkipped;
  }
  std::cout << "CUDA device 0: " << device.name << ", " << (device.free_bytes >> 20U) << " MiB free" << std::endl;
  return Catch::Session().run(argc, argv);
}
