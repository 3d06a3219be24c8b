// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <list>

#include "core/recording.h"
#include "cuda/cuda_engine.h"
#include "cuda/memory.h"
#include "devices.h"
#include "pmsp/error.h"
#include "support/temp_dir.h"

using namespace pmsp;
using namespace pmsp::test;

namespace {

/// Allocates all device memory except about `left` bytes. (Not to be used while others need the device.)
class Hog {
 public:
  explicit Hog(std::size_t left) {
    for (std::size_t block = std::size_t{1} << 36U; block >= std::size_t{1} << 20U;) {
      std::size_t free = 0;
      std::size_t total = 0;
      PMSP_CUDA_CHECK(cudaMemGetInfo(&free, &total));
      if (free < left + block) {
        block /= 2;
        continue;
      }
      void* memory = nullptr;
      if (cudaMalloc(&memory, block) == cudaSuccess) {
        blocks_.push_back(memory);
      } else {
        cudaGetLastError();  // clears it
        block /= 2;
      }
    }
  }
  ~Hog() {
    for (void* memory : blocks_) cudaFree(memory);
  }
  Hog(const Hog&) = delete;
  Hog& operator=(const Hog&) = delete;

 private:
  std::list<void*> blocks_;
};

constexpr std::size_t kMiB = std::size_t{1} << 20U;

constexpr int kWide = 1280;  ///< depth maps large enough that their memory shows

DensifierOptions wide_options() {
  DensifierOptions options = preset(Quality::kOnline);
  options.width = kWide;
  options.height = kWide / 2;
  options.backend = Backend::kCuda;
  return options;
}

}  // namespace

TEST_CASE("the memory estimate covers a short mission without much excess", "[cuda][memory]") {
  constexpr int kImageWidth = 320;
  const synth::Mission mission = synth::empty_room(small_recipe(kImageWidth, 7));
  DensifierOptions options = preset(Quality::kNormal);
  options.backend = Backend::kCuda;
  options.advanced.expected_keyframes = static_cast<std::int64_t>(mission.frames.size());
  Recording recording;
  const std::size_t before = cuda::find_device(0).free_bytes;
  Densifier densifier(options, recording.callbacks());
  fly_through(densifier, mission);
  const std::size_t after = cuda::find_device(0).free_bytes;
  const std::size_t taken = before > after ? before - after : 0;
  const std::size_t needed = device_memory_needed(options);
  const std::size_t predicted = device_memory_needed(options, kImageWidth);
  CAPTURE(taken / kMiB, needed / kMiB, predicted / kMiB);
  CHECK(taken < needed + 256 * kMiB);  // code and stacks come on top, once
  CHECK(taken > predicted / 10 * 7);
}

TEST_CASE("results that exceed device memory are spilled to the scratch directory without other changes",
          "[cuda][memory]") {
  const pmsp_test::TempDir dir;
  const synth::Mission mission = synth::empty_room(small_recipe(320, 7));
  DensifierOptions options = preset(Quality::kNormal);
  options.width = 320;
  options.height = 160;
  options.backend = Backend::kCuda;
  const Recording expected = densify(mission, options);
  options.scratch_folder = dir.path().string();
  CHECK(Densifier(options, {}).options().scratch_folder.empty());
  const Hog hog(device_memory_needed(options) + 60 * kMiB);
  Recording recording;
  Densifier densifier(options, recording.callbacks());
  CHECK(densifier.options().scratch_folder == options.scratch_folder);
  fly_through(densifier, mission);
  CHECK(difference(recording, expected) == "");
  options.scratch_folder.clear();
  CHECK_THROWS_WITH(Densifier(options, {}), Catch::Contains("scratch_folder"));
}

TEST_CASE("without enough memory auto selects the CPU and cuda reports the memory needed", "[cuda][memory]") {
  DensifierOptions options = preset(Quality::kOnline);
  options.width = 2880;
  options.height = 1440;
  options.backend = Backend::kCuda;
  Densifier(options, {});  // context and code are there
  const Hog hog(device_memory_needed(options) / 2);
  CHECK(free_device_memory(0) > 0);
  CHECK_THROWS_AS(Densifier(options, {}), BackendUnavailable);
  CHECK_THROWS_WITH(Densifier(options, {}), Catch::Contains("MiB") && Catch::Contains("2880 x 1440"));
  options.backend = Backend::kAuto;
  Densifier densifier(options, {});
  CHECK(densifier.options().backend == Backend::kCpu);
  CHECK_THAT(densifier.backend(), Catch::Contains("MiB"));
}

TEST_CASE("the previous content of device memory has no effect", "[cuda][memory]") {
  const synth::Mission mission = synth::empty_room(small_recipe(kWide, 4));
  const DensifierOptions options = wide_options();
  const Recording expected = densify(mission, options);
  for (const int byte : {0x47, 0xff, 0x47}) {
    {
      const cuda::DeviceArray<unsigned char> memory(cuda::find_device(0).free_bytes / 2);
      PMSP_CUDA_CHECK(cudaMemset(memory.get(), byte, memory.size()));
      PMSP_CUDA_CHECK(cudaDeviceSynchronize());
    }
    CHECK(difference(densify(mission, options), expected) == "");
  }
}

TEST_CASE("memory exhausted during a mission is a DeviceError and the next Densifier works", "[cuda][memory]") {
  const synth::Mission mission = synth::empty_room(small_recipe(kWide, 4));
  const DensifierOptions options = wide_options();
  const Recording expected = densify(mission, options);
  {
    Recording recording;
    Densifier densifier(options, recording.callbacks());
    const Hog hog(20 * kMiB);
    CHECK_THROWS_AS(fly_through(densifier, mission), DeviceError);
  }
  CHECK(difference(densify(mission, options), expected) == "");
}
