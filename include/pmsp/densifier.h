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

/// Counts of keyframes, pixels and points so far, stage by stage, and the time of each.
struct DensifierStats {
  std::int64_t keyframes_added = 0;
  std::int64_t keyframes_accepted = 0;  ///< by the view filter
  std::int64_t keyframes_rejected = 0;  ///< by the view filter: too little or too much parallax, too few landmarks in
                                        ///< common, blurred
  std::int64_t keyframes_blurred = 0;   ///< those of them that are blurred
  std::int64_t depth_maps = 0;          ///< of accepted keyframes; the two counts below are those that got none
  std::int64_t keyframes_without_neighbour = 0;  ///< no other accepted keyframe near in time, from another place
  std::int64_t keyframes_without_range = 0;      ///< no landmark to tell a depth range from
  std::int64_t pixels = 0;                       ///< unmasked pixels of these depth maps
  std::int64_t pixels_matched = 0;               ///< with an estimate after PatchMatch
  std::int64_t pixels_after_median = 0;          ///< before the weighted one gives planes to pixels without
  std::int64_t pixels_after_consistency = 0;     ///< with a depth
  std::int64_t pixels_far = 0;    ///< too far for any parallax, such as the sky, as other keyframes confirm; no depth
  std::int64_t points_fused = 0;  ///< of pixels, before the free-space filter
  std::int64_t points_repeated = 0;  ///< left out after it, since another keyframe makes the point of their place
  std::int64_t points = 0;           ///< in the cloud; 0 when no callback takes it
  double work_done = 0.0;            ///< steps of work on keyframes [passes of PatchMatch, roughly, in time]
  double work_to_come = 0.0;         ///< on the keyframes that are there by now; later ones bring theirs
  double seconds_prepare = 0.0;      ///< resizing, gray values, cube maps [s]
  double seconds_init = 0.0;         ///< [s]
  double seconds_patchmatch = 0.0;   ///< [s]
  double seconds_median = 0.0;       ///< [s]
  double seconds_consistency = 0.0;  ///< [s]
  double seconds_fusion = 0.0;       ///< [s]
  double seconds_free_space = 0.0;   ///< [s]
  double seconds_ownership = 0.0;    ///< which keyframe makes the point of a place, and those points [s]
};

/// Receives results as soon as they are final. Members that are not set are not called, and what only they need is not
/// computed. All calls come from inside `add` and `flush`, on the thread that called them, in the order in which
/// the keyframes were added. They may call `cancel` and what is const of their Densifier, nothing else.
struct DensifierCallbacks {
  std::function<void(const DepthMap&)> raw_depth;       ///< straight from PatchMatch
  std::function<void(const DepthMap&)> filtered_depth;  ///< after the median and consistency filters
  std::function<void(const KeyframeCloud&)> cloud;      ///< a keyframe's share of the cloud; once for each depth map
  std::function<void()> worked;  ///< progress: after each step of work, some tens of times per keyframe
};

/// Turns keyframes into dense points, one keyframe at a time, holding a small window of them:
/// PatchMatch-Stereo-Panorama (Surmann, Thurow, Slomma 2022) from images to points. Keyframes come in the order of
/// flight.
///
/// A Densifier has no global state; several may live in one process. One of them must not be used from two threads at
/// once. Results depend on input, seed and backend (plain CPU code, CPU with AVX2 or AVX-512, CUDA), not on the number
/// of threads.
///
/// What a callback throws comes out of `add` or `flush`. After that, or when these throw anything but the
/// InvalidInput that leaves all as it was, the Densifier is as after `cancel`.
class PMSP_API Densifier {
 public:
  /// Throws InvalidOption; BackendUnavailable when
  /// `options.backend` or `options.simd` asks for more than this machine or build has.
  Densifier(const DensifierOptions& options, DensifierCallbacks callbacks);

  virtual ~Densifier();
  Densifier(Densifier&&) noexcept;
  Densifier& operator=(Densifier&&) noexcept;

  /// Takes one keyframe; image and mask are copied as far as they are needed. Returns whether the view filter accepted
  /// it, or, after `cancel`, false. Throws InvalidInput when image, mask, pose or landmarks are unusable (see
  /// Keyframe), or the id was added before: the Densifier then is as if the call had not been made. Throws DeviceError
  /// when the GPU fails, BackendUnavailable when only now, with sizes that follow the images, its memory turns out not
  /// to suffice, OutputError and IoError when the scratch folder cannot be written or read, which is opened now.
  bool add(const Keyframe& keyframe);

  /// Finishes what waits in the windows: after it, every accepted keyframe that has a neighbour has had its callbacks.
  /// More keyframes may follow; they start a new sequence. Throws DeviceError, OutputError and
  /// IoError, as `add`.
  void flush();

  /// Makes `add` or `flush` return early at the next safe point (between two iterations); may be called from any
  /// thread or a signal handler. Results that were handed out stay valid; nothing more is handed out, and no more is
  /// taken.
  void cancel() noexcept;
  bool cancelled() const noexcept;  ///< whether `cancel` was called, or an error left it so

  const DensifierStats& stats() const;  ///< of all that was done so far

  /// The options in force: sizes filled in, backend, simd and threads resolved.
  const DensifierOptions& options() const;

  /// The backend in force in words, and why it is that one, for a log: "CUDA device 0, NVIDIA H200" or "CPU, 2 threads,
  /// avx512 (CUDA: no device answers)".
  const std::string& backend() const;

 protected:
  struct Impl;
  explicit Densifier(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
