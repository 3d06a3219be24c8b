// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/options.h"
#include "pmsp/types.h"

namespace pmsp {

/// Version of a live map, incremented by each change; 0 = the empty map at the start.
using LiveVersion = std::uint64_t;

/// Points of a keyframe, to be drawn with `pose`. If only the pose changes, GPU buffers of `cloud->points` stay valid.
struct LiveCloud {
  std::int64_t keyframe_id = 0;
  std::int64_t map_id = 0;  ///< map of the SLAM, see LiveKeyframe::map_id
  KeyframePose pose;        ///< current pose and scale, to draw `cloud->points` with; `cloud->pose()` is older
  std::shared_ptr<const KeyframeCloud> cloud;  ///< never null, immutable
  bool preliminary = false;                    ///< to be replaced by final points
  LiveVersion cloud_since = 0;                 ///< version that added these points
  LiveVersion pose_since = 0;                  ///< version that set this pose
};

/// Immutable state of a live map at one version. Retains its clouds, no images or depth maps.
struct LiveSnapshot {
  LiveVersion version = 0;
  std::vector<LiveCloud> clouds;  ///< by ascending keyframe id
};

/// Differences between two versions of a live map. Each keyframe is in at most one list.
struct LiveChanges {
  LiveVersion from = 0;
  LiveVersion to = 0;
  bool reset = false;  ///< the map was reset in between: remove all clouds first; `added` contains the complete map
  std::vector<LiveCloud> added;
  std::vector<LiveCloud> replaced;  ///< with other points, possibly at another pose
  std::vector<LiveCloud> moved;     ///< same points at another pose or scale, or in another map
  std::vector<std::int64_t> removed;
  bool empty() const { return !reset && added.empty() && replaced.empty() && moved.empty() && removed.empty(); }
};

enum class PixelFormat { kRgb, kBgr, kGray };  ///< 3, 3 and 1 bytes per pixel

/// Equirectangular image of a keyframe, 8 bits per channel. Shared: pixels must not change while `owner` is held.
struct LiveImage {
  std::shared_ptr<const void> owner;  ///< keeps the pixels alive, not null; released when no longer needed
  const std::uint8_t* data = nullptr;
  int width = 0;              ///< [px], even, at least 16
  int height = 0;             ///< [px], even, at least 8
  std::ptrdiff_t stride = 0;  ///< bytes between the starts of rows; 0 = rows without padding
  PixelFormat format = PixelFormat::kRgb;
};

/// State of a keyframe, in frames and units of Keyframe. Image, prior depth, pose error: ignored in updates.
struct LiveKeyframe {
  std::int64_t id = 0;
  RigidTransform cam_from_world;
  std::vector<Landmark> landmarks;  ///< observed landmarks; empty in an update = unchanged
  LiveImage image;
  /// See Keyframe::prior_depth; in the unit of the SLAM at the time of `add`; null = none. Must not change any more.
  std::shared_ptr<const Image<float>> prior_depth;
  double pose_error = 0.0;  ///< see Keyframe::pose_error
  std::int64_t map_id = 0;  ///< map of the SLAM; keyframes of different maps never share points or depth
};

struct PMSP_API LiveOptions {
  /// Size, seed, backend, stages. `unordered` must be false and `scratch_folder` empty; `pipelined` and
  /// `expected_keyframes` are ignored. Duplicates (points of one surface from several keyframes) are removed among all
  /// keyframes with `free_space.whole_mission`, which delays no points here; else within FusionOptions::window and
  /// between keyframes that a loop closure has brought together.
  DensifierOptions densifier = preset(Quality::kOnline);
  int nice = 19;  ///< niceness added to the worker threads, 0 to 19, Linux only; 19 = nearly idle cores only
  /// Estimates `densifier.lens_distance`, if that is 0, with a LensDistanceEstimator from the first 24 accepted
  /// keyframes, or from at least 8 at `finish`. A significant distance is fixed then, and earlier depth maps are
  /// computed again. Memory: up to 2 MiB for each of these keyframes.
  bool calibrate_lenses = true;
  /// Masks the rig (camera mount, vehicle, operator) with a RigMaskEstimator, from the same keyframes, in all clouds.
  bool find_rig = true;
  bool previews = true;  ///< preliminary points at half the resolution, published when the next keyframe arrives
  /// Maximum memory of images and depth maps, with CUDA of the device [MiB], 1 to 1000000. Minimum: 13 (kOnline) to 19
  /// (kHigh) keyframes of 50 to 90 bytes per depth map pixel, more with larger images; else InvalidOption, or an error
  /// for each keyframe if the size of the depth maps is 0.
  int memory_mib = 2048;
  /// Maximum number of accepted keyframes without a depth map, 4 to 100000; beyond it the most redundant ones are
  /// dropped.
  int max_waiting = 100;
  /// Minimum number of newer keyframes before a keyframe with a stable pose is processed, 0 to 1000; 0 = at once. Does
  /// not delay previews.
  int stable_after = 3;
  /// Number of newer keyframes after which a keyframe with an unstable pose is processed too, `stable_after` to 1000; a
  /// third of it if the worker is idle.
  int stable_at_latest = 24;
  /// Maximum translation of a stable pose between two `add`, relative to the median distance of its landmarks, 0 to 1.
  /// Larger values process keyframes earlier, and some of them twice.
  double stable_move = 0.00012;
  /// Displacement of surface points in source views, by changes of relative pose or scale, above which a depth map is
  /// computed again [px of the depth map], 0.001 to 100. With a baseline of a tenth of the depth, 0.04 px of 640
  /// correspond to 0.4 % of the depth.
  double max_move_px = 0.04;
  std::shared_ptr<const Image<std::uint8_t>> mask;  ///< for all keyframes, see Keyframe::mask; null = none

  void validate() const;  ///< throws InvalidOption
};

/// Counts since construction, across resets.
struct LiveStats {
  std::int64_t added = 0;
  std::int64_t erased = 0;
  std::int64_t resets = 0;
  std::int64_t used = 0;              ///< accepted by the view filter
  std::int64_t not_needed = 0;        ///< rejected by the view filter, or sufficiently covered by others
  std::int64_t dropped_late = 0;      ///< dropped because the work fell behind
  std::int64_t previews = 0;          ///< preliminary clouds
  std::int64_t previews_late = 0;     ///< previews skipped because the work fell behind
  std::int64_t passes = 0;            ///< passes of PatchMatch for final points
  std::int64_t matched_again = 0;     ///< depth maps computed again because poses had changed
  std::int64_t clouds = 0;            ///< published final clouds, each version counted
  std::int64_t rescaled = 0;          ///< changes of a keyframe's scale
  std::int64_t images_dropped = 0;    ///< images released for memory; their depth maps are not computed again
  std::int64_t keyframes_frozen = 0;  ///< depth maps released for memory; their points are only moved
  std::int64_t errors = 0;            ///< failed keyframes, exceptions of callbacks, device errors
  std::string last_error;
  bool failed = false;          ///< the worker stopped on an unrecoverable error; further calls are ignored
  std::int64_t memory_mib = 0;  ///< current memory, see LiveOptions::memory_mib
  double lens_distance = 0.0;   ///< in effect, see LiveOptions::calibrate_lenses [map units]; 0 = one centre
  double rig = 0.0;             ///< share of the solid angle covered by the rig, 0 to 1, see LiveOptions::find_rig
};

/// Pending work.
struct LiveBacklog {
  std::int64_t unstable = 0;  ///< keyframes whose poses are not yet stable
  std::int64_t waiting = 0;   ///< accepted keyframes without final points
  std::int64_t refining = 0;  ///< accepted keyframes whose final points are still improved
  bool idle = true;           ///< no work until the next call
};

/// Called on a worker thread. May call all members except `wait` and the destructor; exceptions count as errors.
struct LiveCallbacks {
  std::function<void(LiveVersion)> changed;          ///< new points, or dropped previews; not for updates of poses
  std::function<void(const std::string&)> on_error;  ///< error message, with the keyframe or device concerned
};

/// Maintains the dense map of a running SLAM while keyframes are added, moved and removed.
///
/// Members return at once, except `wait` and the destructor, may be called from any thread, invoke no callback on
/// it, and have no effect if they throw. Snapshots taken after `update`, `sync`, `erase` or `reset` contain its
/// effect. Work is done by own threads at low priority; results depend on timing.
///
/// If the work falls behind, keyframes get fewer geometric passes, then the most redundant ones are dropped. Skipped
/// passes are run when the worker is idle. Scale changes after a monocular loop closure are estimated from baselines
/// and landmarks; the caller passes poses only.
class PMSP_API LiveDensifier {
 public:
  /// Throws InvalidOption, BackendUnavailable, DeviceError.
  explicit LiveDensifier(const LiveOptions& options, LiveCallbacks callbacks = {});
  ~LiveDensifier();  ///< cancels work in progress; blocks until the worker has ended
  LiveDensifier(const LiveDensifier&) = delete;
  LiveDensifier& operator=(const LiveDensifier&) = delete;

  /// Adds (with image) or updates a keyframe; ids ascending in time, unique in all maps. Throws InvalidInput as
  /// Densifier::add.
  void add(LiveKeyframe keyframe);

  /// Sets pose and map id of existing keyframes, and landmarks unless empty. Ignores unknown ids. Throws InvalidInput.
  void update(const std::vector<LiveKeyframe>& keyframes);

  /// Sets the complete state of a SLAM that can only be polled: updates existing keyframes, adds new ones that have
  /// an image, ignores new ones without, erases all others. Throws InvalidInput.
  void sync(const std::vector<LiveKeyframe>& keyframes);

  /// Removes keyframes and their points; other keyframes get back points removed as duplicates of these. Ignores
  /// unknown ids.
  void erase(const std::vector<std::int64_t>& ids);

  void reset();   ///< removes all keyframes; ids may restart, lens distance and rig are estimated again
  void pause();   ///< starts no further work; changes are queued, pose updates still move points
  void resume();  ///< ends `pause`
  void finish();  ///< expects no more keyframes: pending ones are processed at once; ends with the next `add`

  /// Blocks until the worker is idle or `at_most` has elapsed. Returns whether it is idle, never while paused. The
  /// worker does not become idle, and the destructor deadlocks, while the caller holds a lock that a callback acquires.
  bool wait(std::chrono::milliseconds at_most) const;

  std::shared_ptr<const LiveSnapshot> snapshot() const;  ///< current state, never null
  LiveChanges changes_since(LiveVersion version) const;  ///< the complete map if it was reset since
  LiveStats stats() const;
  LiveBacklog backlog() const;
  std::string backend() const;  ///< see Densifier::backend

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
