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

/// Counts what happens to a live map. Of two versions the later one is the higher; 0 = the empty map at the start.
using LiveVersion = std::uint64_t;

/// A keyframe's points at one moment. A viewer draws `cloud->points` with `pose`: where only the pose has changed, what
/// it has on the GPU stays.
struct LiveCloud {
  std::int64_t keyframe_id = 0;
  std::int64_t map_id = 0;  ///< of the SLAM's map that the pose belongs to
  KeyframePose pose;        ///< the newest one; that of `cloud` is as it was when the points were made
  std::shared_ptr<const KeyframeCloud> cloud;  ///< never null; does not change
  bool preliminary = false;                    ///< final points will replace these
  LiveVersion cloud_since = 0;                 ///< version that brought these points
  LiveVersion pose_since = 0;                  ///< version that brought this pose
};

/// A live map at one moment. It never changes, and costs nothing to hold but the clouds that it names.
struct LiveSnapshot {
  LiveVersion version = 0;
  std::vector<LiveCloud> clouds;  ///< by ascending keyframe id
};

/// What makes one version of a live map of an earlier one. Each keyframe is in one list at most.
struct LiveChanges {
  LiveVersion from = 0;
  LiveVersion to = 0;
  bool reset = false;  ///< the map began anew in between: drop all that is there first; all clouds are in `added`
  std::vector<LiveCloud> added;
  std::vector<LiveCloud> replaced;  ///< other points, perhaps at another pose
  std::vector<LiveCloud> moved;     ///< the same points at another pose or in another map
  std::vector<std::int64_t> removed;
  bool empty() const { return !reset && added.empty() && replaced.empty() && moved.empty() && removed.empty(); }
};

enum class PixelFormat { kRgb, kBgr, kGray };  ///< 3, 3 and 1 bytes a pixel

/// A keyframe's image that the caller and the LiveDensifier own together. Nobody may write to it any more.
struct LiveImage {
  std::shared_ptr<const void> owner;  ///< keeps the pixels alive; let go of when they are no longer needed
  const std::uint8_t* data = nullptr;
  int width = 0;              ///< [px], even, 16 or more
  int height = 0;             ///< [px], even, 8 or more
  std::ptrdiff_t stride = 0;  ///< bytes from one row to the next; 0 = rows follow one another without a gap
  PixelFormat format = PixelFormat::kRgb;
};

/// A keyframe as a SLAM knows it at the moment. Frames and units as in Keyframe.
struct LiveKeyframe {
  std::int64_t id = 0;
  RigidTransform cam_from_world;
  std::vector<Landmark> landmarks;  ///< that it observes; where none are given again, the last ones stay
  LiveImage image;                  ///< of a keyframe that is new; of others not looked at
  /// Depth from elsewhere, as Keyframe::prior_depth, in the unit that the SLAM has when the keyframe comes (a scale
  /// that is found later does no harm); null = none. Of a keyframe that is new; of others not looked at. Nobody may
  /// write to it any more.
  std::shared_ptr<const Image<float>> prior_depth;
  double pose_error = 0.0;  ///< as Keyframe::pose_error; of a keyframe that is new, of others not looked at
  std::int64_t map_id = 0;  ///< the SLAM's map, where it has several: keyframes of two maps never meet
};

struct PMSP_API LiveOptions {
  /// Size, quality, seed, backend. With `free_space.whole_mission` points of a place that several keyframes see are
  /// made by one of them, wherever these are; else only neighbours are asked, and keyframes that a loop closure brings
  /// together.
  /// `unordered` must be false and `scratch_folder` empty; `pipelined` and `expected_keyframes` are ignored.
  DensifierOptions densifier = preset(Quality::kOnline);
  /// Of the worker threads, on Linux, 0 to 19, as of the command `nice`; 19: they run only where a core is idle. More
  /// than 0: on a GPU, at the lowest priority.
  int nice = 19;
  /// Where `densifier.lens_distance` is 0: whether to estimate it (LensDistanceEstimator) from the first 24 used
  /// keyframes, or from 8 or more when `finish` is called before. Where it is significant, what has been matched by
  /// then is matched anew. From then on it is fixed. Takes about a second of processor time once, and up to 2 MiB for
  /// each of these keyframes.
  bool calibrate_lenses = true;
  /// Whether to find what the camera carries along (RigMaskEstimator) from the same keyframes. No cloud shows it from
  /// then on.
  bool find_rig = true;
  bool previews = true;  ///< preliminary points at half the size, as soon as the next keyframe has come
  /// For all that is kept of keyframes besides their points, 1 to 1000000; on a GPU, there. What neighbouring keyframes
  /// need of each other must find room: 13 to 19 of them, with about 50 bytes a pixel.
  int memory_mib = 2048;
  /// Keyframes that wait for their first depth map, 4 to 100000; those needed least are left out.
  int max_waiting = 100;
  /// A keyframe is used when this many newer ones have come, 0 to 1000, and it has moved by no more than `ripe_move` of
  /// its median distance from its landmarks since the last one came; or when `ripe_at_latest` have come. What is
  /// matched while poses still move has to be matched again: as measured with stella_vslam, a keyframe moves by this
  /// little when about eighteen newer ones have come, and by less than `max_move_px` from then on. Previews do not
  /// wait.
  int ripe_after = 3;
  int ripe_at_latest = 24;
  double ripe_move = 0.00012;
  /// Keyframes are matched again when their poses or scales, relative to those of their neighbours, have changed so
  /// that what they see has moved by more than this, 0.001 to 100 [px of the depth map]: where neighbours are a tenth
  /// of the depth away, 0.04 px of 640 are four thousandths of the depth.
  double max_move_px = 0.04;
  std::shared_ptr<const Image<std::uint8_t>> mask;  ///< of all keyframes, as Keyframe::mask; null = none

  /// Throws InvalidOption.
  void validate() const;
};

/// What has happened since the beginning, resets included.
struct LiveStats {
  std::int64_t added = 0;
  std::int64_t erased = 0;
  std::int64_t resets = 0;
  std::int64_t used = 0;              ///< by the view filter
  std::int64_t not_needed = 0;        ///< left out by the view filter, or since the place has been seen often enough
  std::int64_t left_out_late = 0;     ///< left out because the work fell behind
  std::int64_t previews = 0;          ///< preliminary clouds
  std::int64_t previews_late = 0;     ///< not made any more because the work fell behind
  std::int64_t passes = 0;            ///< of PatchMatch, for final points
  std::int64_t matched_again = 0;     ///< because poses had moved
  std::int64_t clouds = 0;            ///< final ones that were published, each version counts
  std::int64_t rescaled = 0;          ///< times that a keyframe's scale has changed
  std::int64_t images_dropped = 0;    ///< for memory: these keyframes are not matched again
  std::int64_t keyframes_frozen = 0;  ///< for memory: their points are only moved from now on
  std::int64_t errors = 0;            ///< keyframes that failed, callbacks that threw, devices that broke
  std::string last_error;
  bool failed = false;          ///< the worker could not go on: what is told from now on is passed over
  std::int64_t memory_mib = 0;  ///< kept at the moment
  double lens_distance = 0.0;   ///< in force, see LiveOptions::calibrate_lenses [scene units]; 0 = one centre
  double rig = 0.0;             ///< share of the sphere that the rig covers, see LiveOptions::find_rig
};

/// What is still to be done at the moment.
struct LiveBacklog {
  std::int64_t unripe = 0;    ///< keyframes whose poses and landmarks are waited for
  std::int64_t waiting = 0;   ///< used ones without final points
  std::int64_t refining = 0;  ///< used ones whose final points will become better yet
  bool idle = true;           ///< nothing can be done before something comes
};

/// Called on a worker thread. They may call any member of the LiveDensifier but `wait` and the destructor; what they
/// throw is counted as an error.
struct LiveCallbacks {
  std::function<void(LiveVersion)> changed;          ///< there are new points
  std::function<void(const std::string&)> on_error;  ///< what went wrong, and with what
};

/// Makes the dense map of a running SLAM, and keeps it true while the SLAM moves, adds and removes keyframes.
///
/// Work is done by threads of its own, at low priority. All members may be called from any thread, return at once and
/// hold no lock of the caller's; what `update`, `sync`, `erase` and `reset` say about places holds in each snapshot
/// that is taken after they have returned. Results depend on when what has come, and how fast the machine is.
///
/// When it falls behind, keyframes get fewer passes first; then those are left out that show least that others do not.
/// What was saved is made up for when there is time. A SLAM that moves keyframes by similarities and tells no scale
/// need not: it is found from baselines and landmarks.
class PMSP_API LiveDensifier {
 public:
  /// Throws InvalidOption, BackendUnavailable, DeviceError.
  explicit LiveDensifier(const LiveOptions& options, LiveCallbacks callbacks = {});
  ~LiveDensifier();  ///< stops whatever is being done
  LiveDensifier(const LiveDensifier&) = delete;
  LiveDensifier& operator=(const LiveDensifier&) = delete;

  /// A new keyframe, with its image; ids grow. One that is there already is taken for an update. Throws InvalidInput,
  /// as Densifier::add, and nothing has changed.
  void add(LiveKeyframe keyframe);

  /// Poses, map ids and, where given, landmarks as they are now. Keyframes that are not known are passed over. Throws
  /// InvalidInput, and nothing has changed.
  void update(const std::vector<LiveKeyframe>& keyframes);

  /// All keyframes as they are now, for a SLAM that can only be polled: what has moved is updated, what is new and has
  /// an image is added, what is not there any more is erased. Throws InvalidInput, and nothing has changed.
  void sync(const std::vector<LiveKeyframe>& keyframes);

  /// Their points go; where a neighbour has seen the place, its own ones come back. Unknown ids are passed over.
  void erase(const std::vector<std::int64_t>& ids);

  void reset();   ///< all is gone; ids may begin again
  void pause();   ///< no new work is begun; places are followed all the same
  void resume();  ///< takes `pause` back
  void finish();  ///< no keyframe comes for now: none waits for newer ones. The next `add` takes it back

  /// Waits until nothing is left to do, at most so long. Returns whether that is so; never while paused. Not under a
  /// lock that a callback takes, nor is the destructor.
  bool wait(std::chrono::milliseconds at_most) const;

  std::shared_ptr<const LiveSnapshot> snapshot() const;  ///< never null
  LiveChanges changes_since(LiveVersion version) const;  ///< that a snapshot or change has told
  LiveStats stats() const;                               ///< since the beginning
  LiveBacklog backlog() const;                           ///< at the moment
  std::string backend() const;                           ///< see Densifier::backend

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
