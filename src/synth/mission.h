// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "pmsp/types.h"
#include "synth/render.h"
#include "synth/scene.h"

namespace pmsp::synth {

/// Straight trajectory with some lateral sway and rotation, as of drones.
struct Flight {
  Eigen::Vector3d start = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< not vertical
  double step = 0.4;                                     ///< distance of successive keyframes [m]
  int keyframes = 7;
  double sway = 0.06;       ///< lateral amplitude [m]
  double wobble_deg = 2.0;  ///< amplitude of the camera's rotation
  double yaw_deg = 0.0;     ///< of the camera relative to the direction; positive looks to the right
};

/// Returns cam_from_world of each keyframe.
std::vector<RigidTransform> fly(const Flight& flight);

/// Returns the camera rotated about its own y axis; positive turns right: content of the image moves left.
RigidTransform yawed(const RigidTransform& cam_from_world, double yaw_deg);

struct LandmarkOptions {
  int count = 1500;
  int min_views = 3;   ///< minimum number of keyframes that observe a landmark
  double noise = 0.0;  ///< standard deviation of each coordinate, relative to the distance from the first observer
  double min_contrast = 0.0;       ///< minimum, of surfaces with landmarks [gray levels]
  double max_latitude_deg = 80.0;  ///< beyond it there are no observations, as with feature detectors
  std::uint64_t seed = 7;
};

struct MissionOptions {
  RenderOptions render;
  double gain_drift = 0.0;  ///< amplitude of exposure changes over the keyframes, relative
  /// Adds objects of keyframe `index`, labelled kMover; empty = none.
  std::function<void(Scene& scene, std::size_t index)> movers;
  double fps = 10.0;  ///< keyframe i has the timestamp i / fps
  std::int64_t first_id = 0;
  LandmarkOptions landmarks;
};

/// Keyframe with ground truth. Members of Keyframe have the same meaning.
struct Frame {
  std::int64_t id = 0;
  double timestamp = 0.0;
  RigidTransform cam_from_world;
  Image<Rgb> image;
  Image<float> depth;
  Image<Eigen::Vector3f> normal;
  Image<int> surface;
  Image<std::uint8_t> label;        ///< see RenderedView
  std::vector<Landmark> landmarks;  ///< ascending id, with noise
};

struct SurfacePoint {
  std::int64_t id = 0;
  Eigen::Vector3d position_world = Eigen::Vector3d::Zero();  ///< exact
};

struct Mission {
  Scene scene;
  int width = 0;
  int height = 0;
  std::vector<Frame> frames;
  std::vector<SurfacePoint> points;  ///< landmarks without noise; points[i].id == i
  Image<std::uint8_t> mask;          ///< empty, or as Keyframe::mask, for all frames
};

Mission make_mission(const Scene& scene, const std::vector<RigidTransform>& poses, int width, int height,
                     const MissionOptions& options = {});

/// Returns the input of a Densifier; its views refer to `mission`.
Keyframe keyframe_of(const Mission& mission, std::size_t index);

/// Returns the mission in another unit of length: equal images, all lengths times `factor`.
Mission scaled(const Mission& mission, double factor);

/// Returns the mission with all cameras rotated right by whole columns: images and truth are shifted left, not rendered
/// again.
Mission turned(const Mission& mission, int columns);

/// Returns the share of pixels with truth, 0 to 1, whose `depth` exists and deviates by at most `relative`. `counts`:
/// selects pixels (x, y); empty = all.
double share_within(const Image<float>& depth, const Image<float>& truth, double relative,
                    const std::function<bool(int, int)>& counts = {});

/// Common options of the ready-made missions below.
struct Recipe {
  int width = 640;
  int height = 320;
  int keyframes = 7;
  double yaw_deg = 0.0;       ///< rotates all cameras
  bool weak_texture = false;  ///< plaster instead of strong texture
  std::uint64_t texture_seed = 1;
  MissionOptions mission;
  bool overexposed_sky = false;  ///< of yard
  bool rider = false;            ///< dashboard, hand, head and pole that move with the camera
  int movers = 0;                ///< walking figures around the trajectory; from the third on, a bus, too
};

/// Ready-made missions. Successive keyframes have a parallax of 6 to 15 degrees to the nearer surfaces. They throw
/// InvalidOption if the trajectory is longer than the scene.
Mission textured_room(const Recipe& recipe = {});  ///< 6 x 3 x 8 room with furniture, trajectory along its length
Mission empty_room(const Recipe& recipe = {});     ///< textured_room without furniture
/// Room with painted walls and ceiling, a door, pictures, skirting boards and a lamp, as in flats.
Mission painted_room(const Recipe& recipe = {});
/// Long room with a mirroring floor, a polished column and a glass wall in front of a street.
Mission glossy_room(const Recipe& recipe = {});
/// Long room with poles, rails, hanging cables and chairs in front of its walls.
Mission thin_room(const Recipe& recipe = {});
/// Lawn between houses, with trees, a fence, wires and a sky with clouds and sun.
Mission yard(const Recipe& recipe = {});
/// Rooms with one to three panoramas each, 1.5 m apart; `keyframes` and movers are ignored.
Mission flat_photos(const Recipe& recipe = {});
Mission sphere_inside(const Recipe& recipe = {});  ///< sphere of radius 2.8 around the trajectory
Mission slanted_plane(const Recipe& recipe = {});  ///< plane, slanted in all directions, in a dome of radius 3
Mission corridor_across_seam(
    const Recipe& recipe = {});  ///< sideways trajectory; the wall behind the camera crosses the seam
Mission floor_at_nadir(const Recipe& recipe = {});  ///< floor below the camera, in a dome of radius 3.6
                                                    ///< (surfaces 0: plane or floor, 8: dome)

}  // namespace pmsp::synth
