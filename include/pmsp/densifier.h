// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/depth_map.h"
#include "pmsp/keyframe.h"
#include "pmsp/options.h"
#include "pmsp/plane_map.h"
#include "pmsp/point_cloud.h"

namespace pmsp {

struct Plan;  // pmsp/plan.h
struct PlanEntry;

/// What happened to the pixels of all keyframes so far, stage by stage, and how long it took. Of a Densifier that runs
/// part of a plan: of all that was worked on, the halo included; `points` and `points_repeated` are of those handed
/// out, `keyframes_*` of all that were added.
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
/// computed. All calls come from inside `add`, `flush` and `run`, on the thread that called them, in the order in which
/// the keyframes were added. They may call `cancel` and what is const of their Densifier, nothing else.
struct DensifierCallbacks {
  std::function<void(const DepthMap&)> raw_depth;       ///< straight from PatchMatch
  std::function<void(const DepthMap&)> filtered_depth;  ///< after the median and consistency filters
  std::function<void(const KeyframeCloud&)> cloud;      ///< a keyframe's share of the cloud; once for each depth map
  /// After the last pass and the median filter, for Shortcuts: of all keyframes that are matched, those too that a
  /// given plan's results merely depend on. In the order in which they are made.
  std::function<void(const PlaneMap&)> planes;
  /// Whether `planes` is to be called for this keyframe, whose planes are about to be made. Not set: for each.
  std::function<bool(std::int64_t keyframe_id)> wants_planes;
  /// What each keyframe is used for, and which others its results depend on, once nothing changes it any more. Not with
  /// a given plan.
  std::function<void(const PlanEntry&)> planned;
  /// After each step of work, some tens for each keyframe: for those who show how far `stats()` is.
  std::function<void()> worked;
};

/// How a run of a given plan matches a keyframe in less than all passes.
struct Shortcut {
  /// What there is of an earlier run (DensifierCallbacks::planes).
  enum class Planes {
    kNone,    ///< nothing
    kStart,   ///< planes that others look at, and that passes begin with
    kResult,  ///< what this run would make: the earlier one ran the same plan with the same shortcuts, and was
              ///< interrupted
  };
  Planes planes = Planes::kNone;
  /// Of PatchMatch, `patchmatch.geometric_passes` + 1 at most. With kStart the last ones, all geometric: 0 = the planes
  /// are kept. Else the first ones, 1 at least: others look at what they make in place of what the missing ones would.
  int passes = 0;
  bool images_first = false;  ///< kStart: the first of them looks at images alone, as planes of before a move agree
};

/// What is known beforehand of a run of a given plan.
struct Shortcuts {
  std::map<std::int64_t, Shortcut> keyframes;     ///< all others are matched in all passes
  std::function<PlaneMap(std::int64_t id)> load;  ///< planes of an earlier run, once at most for each, when needed
};

/// Gives a keyframe by its id. What its views point to stays until the next call, or until `run` returns. May call what
/// callbacks may; after `cancel` it may return anything.
using KeyframeSource = std::function<Keyframe(std::int64_t id)>;

/// Turns keyframes into dense points, one keyframe at a time, holding a small window of them:
/// PatchMatch-Stereo-Panorama (Surmann, Thurow, Slomma 2022) from images to points. Keyframes come in the order of
/// flight.
///
/// A Densifier has no global state; several may live in one process. One of them must not be used from two threads at
/// once. Results depend on input, seed and backend (plain CPU code, CPU with AVX2 or AVX-512, CUDA), not on the number
/// of threads.
///
/// What a callback throws comes out of `add`, `flush` or `run`. After that, or when these throw anything but the
/// InvalidInput that leaves all as it was, the Densifier is as after `cancel`.
class PMSP_API Densifier {
 public:
  /// Makes the plan (see make_plan) while keyframes come. Throws InvalidOption; BackendUnavailable when
  /// `options.backend` or `options.simd` asks for more than this machine or build has.
  Densifier(const DensifierOptions& options, DensifierCallbacks callbacks);

  /// Runs part of a given plan: what the results of the keyframes `ids` depend on. Callbacks come for these only, in
  /// the order of the plan, and give what a run of the whole plan gives, byte for byte, on the same backend. No ids, no
  /// results. `add` takes the keyframes of `halo(plan, ids, options, callbacks.cloud != nullptr).images`, all of them,
  /// in the order of the plan, with the poses and landmarks that the plan was made from. Fewer do where planes are
  /// asked for but neither clouds nor filtered depth maps: `images` names them.
  ///
  /// `options`: those that the plan was made with; with another seed, backend, size or number of threads it fits, too.
  /// Where images differ in size, give width and height: 0 follows the first one that comes. Throws InvalidInput where
  /// the plan lacks one of `ids`, or makes no sense with these options: a keyframe is there twice, or names others that
  /// are not there, lack what they should lend, are too many or lie too far away; a depth map lacks its neighbours or
  /// depth range. Throws InvalidOption, BackendUnavailable, and InvalidOption as `halo` does unless `ids` name all
  /// keyframes with a depth map.
  ///
  /// `shortcuts`: Throws InvalidInput where they name a keyframe that the plan lacks or a number of passes that does
  /// not fit, or there is nobody to load planes. What `load` gives must have the size of the depth maps, else
  /// InvalidInput comes out of `add`, `flush` and `run`.
  Densifier(const DensifierOptions& options, const Plan& plan, const std::vector<std::int64_t>& ids,
            DensifierCallbacks callbacks, Shortcuts shortcuts = {});

  ~Densifier();
  Densifier(Densifier&&) noexcept;
  Densifier& operator=(Densifier&&) noexcept;

  /// Takes one keyframe; image and mask are copied as far as they are needed. Returns whether the view filter accepted
  /// it, or, after `cancel`, false. Throws InvalidInput when image, mask, pose or landmarks are unusable (see
  /// Keyframe), or the id was added before: the Densifier then is as if the call had not been made. Throws DeviceError
  /// when the GPU fails, BackendUnavailable when only now, with sizes that follow the images, its memory turns out not
  /// to suffice, OutputError and IoError when the scratch folder cannot be written or read, which is opened now.
  ///
  /// With a given plan: returns whether the results asked for depend on the keyframe's image. Others are counted, but
  /// nothing else of them is looked at. Throws InvalidInput, too, when the plan has no such keyframe, or one that comes
  /// before it in the plan and whose image is needed has not come.
  bool add(const Keyframe& keyframe);

  /// Finishes what waits in the windows: after it, every accepted keyframe that has a neighbour has had its callbacks.
  /// More keyframes may follow; they start a new sequence. Throws DeviceError, OutputError and
  /// IoError, as `add`. With a given plan, throws InvalidInput when an image is missing that is needed, naming the
  /// first such keyframe: the Densifier then is as if the call had not been made.
  void flush();

  /// Runs a given plan to its end: asks for the keyframes that it needs, one at a time and in the order of the plan, in
  /// place of `add`, and flushes. Without a scratch folder it asks again for images of unordered sets, so that they
  /// take no memory meanwhile: in each pass over the keyframe itself and over each that is matched with it. An id
  /// stands for the same keyframe each time. Throws InvalidInput when there is no given plan, and all is as it was;
  /// else what `add`, `flush` and `keyframes` throw, and InvalidInput when another keyframe comes than was asked for:
  /// after any of these the Densifier is as after `cancel`.
  void run(const KeyframeSource& keyframes);

  /// Makes `add`, `flush` or `run` return early at the next safe point (between two iterations); may be called from any
  /// thread or a signal handler. Results that were handed out stay valid; nothing more is handed out, and no more is
  /// taken.
  void cancel() noexcept;
  bool cancelled() const noexcept;  ///< whether `cancel` was called, or an error left it so

  const DensifierStats& stats() const;  ///< of all that was done so far

  /// With a given plan: the keyframes that `add` needs, in the order of the plan. Without: none.
  std::vector<std::int64_t> images() const;

  /// The options in force: sizes filled in, backend, simd and threads resolved.
  const DensifierOptions& options() const;

  /// The backend in force in words, and why it is that one, for a log: "CUDA device 0, NVIDIA H200" or "CPU, 2 threads,
  /// avx512 (CUDA: no device answers)".
  const std::string& backend() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
