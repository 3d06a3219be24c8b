// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pmsp/advanced.h"
#include "pmsp/api.h"

namespace pmsp {

/// Instruction set of the CPU backend. kAvx2 and kAvx512 give the same bytes; kScalar has no fused
/// multiply-add: last digits differ.
enum class Simd { kAuto, kScalar, kAvx2, kAvx512 };

/// Compute backend.
enum class Backend {
  kAuto,  ///< CUDA if built in, with a usable device of sufficient memory; else the CPU
  kCpu,
  kCuda,  ///< BackendUnavailable if there is none
};

/// Presets: time per depth map against detail.
enum class Quality {
  kPaper,   ///< Surmann et al. 2022 as published, for comparison only
  kOnline,  ///< 640 x 320, 2 source views; keeps pace with a drone on a CPU
  kNormal,  ///< 1440 x 720, 4 source views
  kHigh,    ///< size of the images (DensifierOptions::width = 0), 6 source views
};

constexpr int kMaxDevices = 16;  ///< maximum number of DensifierOptions::devices

/// Options of a Densifier, by default those of Quality::kOnline.
struct PMSP_API DensifierOptions {
  /// Width of the depth maps [px], even, 32 to 16384. 0 = twice the height if that is set, else the width of the
  /// images, at most 5760; image widths below 1440 are enlarged by 1.5, up to 1440.
  int width = 640;
  int height = 320;        ///< height of the depth maps [px], even, 16 to 8192; 0 = by the aspect ratio of the images
  std::uint64_t seed = 1;  ///< random seed; same input, seed, backend and simd give the same bytes
  Backend backend = Backend::kAuto;
  /// CUDA devices as numbered by the driver, 0 to 255, at most 16; empty = all. One that is listed twice processes two
  /// keyframes at a time. Results do not depend on the devices.
  std::vector<int> devices = {0};
  int threads = 0;          ///< number of threads, 1 to 1024; 0 = one per CPU available to the process
  Simd simd = Simd::kAuto;  ///< kAuto = the widest of the machine
  /// Existing directory for temporary data of keyframes whose points are not final (about 17 bytes per pixel of
  /// the depth map; with `free_space.whole_mission` of most keyframes), of images that may be needed again (2.5 bytes
  /// per pixel), and of pending keyframes of `unordered`; "" = in memory. The data are deleted at the end. With CUDA
  /// it is used only if `unordered`, or for sequences that exceed the device memory. Does not change results.
  std::string scratch_folder;
  /// Baseline between the camera's two lens centres, along its forward axis, for panoramas stitched with one centre,
  /// -1e12 to 1e12 [map units; LiveDensifier: unit of the SLAM when the keyframe is added]; 0 = one centre. Rays with z
  /// > 0 start at (0, 0, lens_distance / 2), others at (0, 0, -lens_distance / 2). Depth maps contain ranges from the
  /// lens; clouds are in the camera frame. See LensDistanceEstimator (pmsp/calibration.h).
  double lens_distance = 0.0;
  bool unordered = false;    ///< no temporal order, as of photos: source views are chosen among all keyframes
  AdvancedOptions advanced;  ///< options of the stages

  void validate() const;  ///< checks all fields; throws InvalidOption
};

PMSP_API DensifierOptions preset(Quality quality);  ///< options of a preset

/// Replaces a width or height of 0 according to the images. Throws InvalidInput if the resulting size is invalid.
PMSP_API void fill_in_size(DensifierOptions& options, int image_width, int image_height);

/// Accepts "paper", "online", "normal", "high". Throws InvalidOption.
PMSP_API Quality quality_from_name(const std::string& name);

/// Accepts "auto", "scalar", "avx2", "avx512". Throws InvalidOption.
PMSP_API Simd simd_from_name(const std::string& name);
PMSP_API const char* name_of(Simd simd);  ///< inverse of simd_from_name

/// Accepts "auto", "cpu", "cuda". Throws InvalidOption.
PMSP_API Backend backend_from_name(const std::string& name);
PMSP_API const char* name_of(Backend backend);  ///< inverse of backend_from_name

}  // namespace pmsp
