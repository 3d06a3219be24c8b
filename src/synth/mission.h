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

/// A flight on a straight line, swaying a little from side to side and turning a little, as drones do.
struct Flight {
  Eigen::Vector3d start = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< not vertical
  double step = 0.4;                                     ///< from one keyframe to the next [scene units]
  int keyframes = 7;
  double sway = 0.06;       ///< amplitude across the line [scene units]
  double wobble_deg = 2.0;  ///< amplitude of the camera's turning
  double yaw_deg = 0.0;     ///< of the camera against the direction of flight; positive looks to the right
};

/// cam_from_world of each keyframe.
std::vector<RigidTransform> fly(const Flight& flight);

/// The same camera turned about its own y axis; positive turns right, so the image's content moves left.
RigidTransform yawed(const RigidTransform& cam_from_world, double yaw_deg);

struct LandmarkOptions {
  int count = 1500;
  int min_views = 3;   ///< keyframes that must see a landmark
  double noise = 0.0;  ///< standard deviation of each coordinate, relative to the distance from the first observer
  double min_contrast = 0.0;       ///< of the surfaces that have landmarks [gray levels]
  double max_latitude_deg = 80.0;  ///< not observed nearer to a pole, as feature detectors don't
  std::uint64_t seed = 7;
};

struct MissionOptions {
  RenderOptions render;
  double gain_drift = 0.0;  ///< amplitude of the exposure's change over the keyframes, relative
  /// Adds what is only there in keyframe `index`, labelled kMover; empty = nothing.
  std::function<void(Scene& scene, std::size_t index)> movers;
  double fps = 10.0;  ///< keyframe i has the timestamp i / fps
  std::int64_t first_id = 0;
  LandmarkOptions landmarks;
};

/// A keyframe with what it sees and what is true. Members of Keyframe mean the same here.
struct Frame {
  std::int64_t id = 0;
  double timestamp = 0.0;
  RigidTransform cam_from_world;
  Image<Rgb> image;
  Image<float> depth;
  Image<Eigen::Vector3f> normal;
  Image<int> surface;
  Image<std::uint8_t> label;        ///< as in RenderedView
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
  std::vector<SurfacePoint> points;  ///< the landmarks without noise; points[i].id == i
  Image<std::uint8_t> mask;          ///< empty, or as Keyframe::mask, for all frames
};

Mission make_mission(const Scene& scene, const std::vector<RigidTransform>& poses, int width, int height,
                     const MissionOptions& options = {});

/// What a Densifier is given. The views point into `mission`.
Keyframe keyframe_of(const Mission& mission, std::size_t index);

/// The same mission in another unit of length: equal images, all lengths times `factor`.
Mission scaled(const Mission& mission, double factor);

/// The same mission with all cameras turned right by whole columns: images and truth are rolled to the left, nothing is
/// rendered again.
Mission turned(const Mission& mission, int columns);

/// Share of the pixels with truth, 0 to 1, where `depth` is there and deviates from `truth` by at most `relative`.
/// `counts`, where given, tells which pixels (x, y) are looked at.
double share_within(const Image<float>& depth, const Image<float>& truth, double relative,
                    const std::function<bool(int, int)>& counts = {});

/// What the ready-made missions below have in common.
struct Recipe {
  int width = 640;
  int height = 320;
  int keyframes = 7;
  double yaw_deg = 0.0;       ///< turns all cameras
  bool weak_texture = false;  ///< plaster instead of strong texture
  std::uint64_t texture_seed = 1;
  MissionOptions mission;
  bool overexposed_sky = false;  ///< of yard
  bool rider = false;            ///< a dashboard, a hand, a head and a pole that the camera carries along
  int movers = 0;                ///< walking figures around the flight; from the third on, a bus, too
};

/// Ready-made missions. Successive keyframes see the nearer surfaces under 6 to 15 degrees of parallax. They throw
/// InvalidOption when the flight would be longer than the scene.
Mission textured_room(const Recipe& recipe = {});  ///< 6 x 3 x 8 room with furniture, flight along its length
Mission empty_room(const Recipe& recipe = {});     ///< the same without furniture
/// The room with painted walls and ceiling, a door, pictures, skirting boards and a lamp: as flats are.
Mission painted_room(const Recipe& recipe = {});
/// A long room with a mirroring floor, a polished column and a glass wall, behind which there is a street.
Mission glossy_room(const Recipe& recipe = {});
/// A long room with poles, rails, hanging cables and chairs in front of its walls.
Mission thin_room(const Recipe& recipe = {});
/// A lawn between houses, with trees, a fence, wires and a sky with clouds and sun.
Mission yard(const Recipe& recipe = {});
/// Rooms that one to three panoramas see, 1.5 m apart; `keyframes` is without influence, there are no movers.
Mission flat_photos(const Recipe& recipe = {});
Mission sphere_inside(const Recipe& recipe = {});  ///< sphere of radius 2.8 around the flight
Mission slanted_plane(const Recipe& recipe = {});  ///< plane, slanted in all directions, in a dome of radius 3
Mission corridor_across_seam(
    const Recipe& recipe = {});                     ///< flight sideways; the wall behind the camera crosses the seam
Mission floor_at_nadir(const Recipe& recipe = {});  ///< floor below the camera, in a dome of radius 3.6
                                                    ///< (surfaces 0: plane or floor, 8: dome)

}  // namespace pmsp::synth
