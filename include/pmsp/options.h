// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pmsp/advanced.h"
#include "pmsp/api.h"

namespace pmsp {

/// Instruction set of the CPU backend. kAvx2 and kAvx512 give the same bytes; kScalar, plain code, gives others, since
/// it rounds multiply-adds twice.
enum class Simd { kAuto, kScalar, kAvx2, kAvx512 };

/// Where the stages run.
enum class Backend {
  kAuto,  ///< CUDA where it was built in, a device answers and its memory suffices; else the CPU
  kCpu,
  kCuda,
};

/// How much time a depth map may take.
enum class Quality {
  kPaper,   ///< Surmann et al. 2022 as published, none of what was added since; to compare with, not to use
  kOnline,  ///< 640 x 320, 2 neighbours; keeps up with a flying drone on a CPU
  kNormal,  ///< 1440 x 720, 4 neighbours
  kHigh,    ///< the images' own size, 1440 x 720 (of small images: half as much again) to 5760 x 2880, 6 neighbours
};

constexpr int kMostDevices = 16;  ///< that may share the work

/// Options of a Densifier. `preset` gives those of a quality.
struct PMSP_API DensifierOptions {
  int width = 640;         ///< of the depth maps [px], even, 32 to 16384; 0 = that of the images, at most 5760; below
                           ///< 1440, half as much again, up to that; or twice the height if one is given
  int height = 320;        ///< of the depth maps [px], even, 16 to 8192; 0 = as the images' shape asks
  std::uint64_t seed = 1;  ///< of the random planes; same input, seed and backend (see Simd, too), same bytes
  Backend backend = Backend::kAuto;
  /// CUDA devices that share the work, as the driver numbers them, 0 to 255, 16 at most; empty = all that there are.
  /// Results are those of one. A device that is named twice works on two keyframes at a time.
  std::vector<int> devices = {0};
  int threads = 0;          ///< 1 to 1024; 0 = one for each CPU that the process may use
  Simd simd = Simd::kAuto;  ///< kAuto takes the widest that this machine has
  /// An existing folder for what keyframes leave while they wait for their points' say (for long with
  /// `free_space.whole_mission`), about 17 bytes a pixel of those that wait, for the images of places that may be
  /// passed again (2.5 bytes a pixel), and in unordered sets for all that waits; "" = in memory. With CUDA it is used
  /// for sets, and for flights that would not find room on the device. It changes no byte of the result.
  std::string scratch_folder;
  /// Distance of the camera's two lenses along its forward axis, -1e12 to 1e12 [scene units; with LiveDensifier in the
  /// unit that the SLAM had when the keyframe came]: the forward half of the panorama (z > 0) is seen from half of it
  /// in front of the camera's centre, the other half from as much behind it, as where two fisheye images are stitched
  /// as if they had one centre. 0 = they have. See LensDistanceEstimator (pmsp/calibration.h). Depth maps then tell
  /// ranges from the lens; clouds are in the camera's frame as ever.
  double lens_distance = 0.0;
  bool unordered = false;  ///< keyframes are a set, such as photo captures: their order means nothing
  AdvancedOptions advanced;

  /// Checks all fields, those of the stages included. Throws InvalidOption.
  void validate() const;
};

/// The options that a quality stands for.
PMSP_API DensifierOptions preset(Quality quality);

/// Replaces a width or height of 0 by what an image of this size stands for. Throws InvalidInput if that is no size of
/// a depth map.
PMSP_API void fill_in_size(DensifierOptions& options, int image_width, int image_height);

/// "paper", "online", "normal" or "high". Throws InvalidOption for any other.
PMSP_API Quality quality_from_name(const std::string& name);

/// "auto", "scalar", "avx2" or "avx512". Throws InvalidOption for any other.
PMSP_API Simd simd_from_name(const std::string& name);
PMSP_API const char* name_of(Simd simd);  ///< as simd_from_name takes it

/// "auto", "cpu" or "cuda". Throws InvalidOption for any other.
PMSP_API Backend backend_from_name(const std::string& name);
PMSP_API const char* name_of(Backend backend);  ///< as backend_from_name takes it

}  // namespace pmsp
