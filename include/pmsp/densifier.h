// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "pmsp/api.h"
#include "pmsp/options.h"
#include "pmsp/types.h"

namespace pmsp {

/// Numbers of keyframes, pixels and points so far, and the time of each stage.
struct DensifierStats {
  std::int64_t keyframes_added = 0;
  std::int64_t keyframes_accepted = 0;           ///< by the view filter
  std::int64_t keyframes_rejected = 0;           ///< by the view filter: parallax, too few common landmarks, or blur
  std::int64_t keyframes_blurred = 0;            ///< rejected because of blur
  std::int64_t depth_maps = 0;                   ///< of accepted keyframes; the following two have none
  std::int64_t keyframes_without_neighbour = 0;  ///< accepted, without a source view at another position
  std::int64_t keyframes_without_range = 0;      ///< accepted, without landmarks for a depth range
  std::int64_t pixels = 0;                       ///< unmasked pixels of the depth maps
  std::int64_t pixels_matched = 0;               ///< with a plane after PatchMatch
  std::int64_t pixels_after_median = 0;          ///< with a plane after the 3 x 3 median filter
  std::int64_t pixels_after_consistency = 0;     ///< with a depth
  std::int64_t pixels_far = 0;       ///< without depth, since too far for parallax in several keyframes, such as sky
  std::int64_t points_fused = 0;     ///< before the free-space test
  std::int64_t points_repeated = 0;  ///< removed as duplicates, after the free-space test
  std::int64_t points = 0;           ///< in the cloud; 0 without `DensifierCallbacks::cloud`
  double work_done = 0.0;            ///< [passes of PatchMatch, approximately]
  double work_remaining = 0.0;       ///< remaining, for the keyframes added so far [as work_done]
  double seconds_prepare = 0.0;      ///< resizing, gray levels, cube maps [s]
  double seconds_init = 0.0;         ///< initial planes and plane priors [s]
  double seconds_patchmatch = 0.0;   ///< [s]
  double seconds_median = 0.0;       ///< [s]
  double seconds_consistency = 0.0;  ///< [s]
  double seconds_fusion = 0.0;       ///< [s]
  double seconds_free_space = 0.0;   ///< [s]
  double seconds_duplicates = 0.0;   ///< duplicate removal and output of the points [s]
};

/// Receivers of results. Unset members are not called, and results needed only by them are not computed. Called
/// inside `add` and `flush`, on the thread of the caller, in the order of the keyframes. They may call `cancel` and
/// const members of their Densifier, nothing else.
struct DensifierCallbacks {
  std::function<void(const DepthMap&)> raw_depth;       ///< after PatchMatch
  std::function<void(const DepthMap&)> filtered_depth;  ///< after the median and consistency filters
  std::function<void(const KeyframeCloud&)> cloud;      ///< points of a keyframe, once per depth map
  std::function<void()> progress;                       ///< called after each task, about 11 per keyframe
};

/// PatchMatch-Stereo-Panorama (Surmann, Thurow, Slomma 2022) over a small window of keyframes in temporal order.
///
/// There is no global state: instances are independent, but one must not be used by two threads at once. Results depend
/// on input, seed and backend (scalar CPU code, AVX2 or AVX-512, CUDA), not on the number of threads.
///
/// Exceptions of callbacks leave `add` or `flush`. After any exception but InvalidInput the Densifier is cancelled.
class PMSP_API Densifier {
 public:
  /// Throws InvalidOption; BackendUnavailable if backend or simd is not supported by the machine or the build.
  Densifier(const DensifierOptions& options, DensifierCallbacks callbacks);

  virtual ~Densifier();
  Densifier(Densifier&&) noexcept;
  Densifier& operator=(Densifier&&) noexcept;

  /// Adds a keyframe, copies its images and blocks while depth maps are computed. Returns whether the view filter
  /// accepts it; false after `cancel`.
  ///
  /// Throws InvalidInput, with no effect, if image, mask, prior depth, pose or landmarks are invalid (see Keyframe) or
  /// the id was added before; DeviceError if the GPU fails; BackendUnavailable if GPU memory is too small for depth
  /// maps of the size of the images; OutputError or IoError if the scratch folder cannot be written or read.
  bool add(const Keyframe& keyframe);

  /// Completes all pending keyframes: afterwards the callbacks have been called for every depth map. Keyframes added
  /// later, with new ids, start a new sequence. Throws DeviceError, OutputError, IoError as `add`.
  void flush();

  /// Makes `add` or `flush` return at the next safe point (between two iterations). May be called from any thread or a
  /// signal handler. Delivered results stay valid; no more are delivered, and no more keyframes accepted.
  void cancel() noexcept;
  bool cancelled() const noexcept;  ///< after `cancel`, or any exception but InvalidInput

  const DensifierStats& stats() const;  ///< so far

  const DensifierOptions& options()
      const;  ///< in effect, sizes, backend, simd and threads resolved; sizes of 0 after the first `add`

  /// Description of the backend and its reason: "CUDA device 0, NVIDIA H200", "CPU, 2 threads, avx512 (CUDA: ...)".
  const std::string& backend() const;

 protected:
  struct Impl;
  explicit Densifier(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
