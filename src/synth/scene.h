// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "synth/texture.h"

/// Scenes with exactly known geometry, for tests. World axes as of an upright camera: x right, y down, z forward.
namespace pmsp::synth {

struct Sphere {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius = 1.0;
};

/// Room if the camera is inside, else furniture.
struct Box {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_size = Eigen::Vector3d::Ones();
  Eigen::Matrix3d world_from_box = Eigen::Matrix3d::Identity();  ///< rotation
};

/// Infinite, visible from both sides.
struct Plane {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitY();  ///< unit
};

/// With flat ends.
struct Cylinder {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitY();  ///< unit
  double radius = 0.5;
  double half_length = 1.0;
};

/// Flat round leaves inside a sphere, visible from both sides.
struct Foliage {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius = 1.0;
  struct Leaf {
    Eigen::Vector3d center, normal;  ///< normal: unit
  };
  std::vector<Leaf> leaves;
  double leaf_radius = 0.1;
};

/// Returns `count` leaves at random positions of the sphere, with random normals.
Foliage foliage(const Eigen::Vector3d& center, double radius, int count, double leaf_radius, std::uint64_t seed);

using Primitive = std::variant<Sphere, Box, Plane, Cylinder, Foliage>;

/// Reflection and transparency of a surface, besides its texture. Default: none.
struct Finish {
  double reflection = 0.0;  ///< share of reflected light at normal incidence, 0 to 1; grows to 1 at grazing angles
  bool glass = false;       ///< other light comes from behind, and the texture is invisible
};

/// Classes of pixels in evaluations; values of label images.
enum class Label : std::uint8_t { kOther, kThin, kGlossy, kBehindGlass, kSky, kRider, kMover };

/// Background of rays without surface. Default: one colour.
struct Sky {
  Eigen::Vector3d horizon = Eigen::Vector3d(200.0, 215.0, 235.0);  ///< red, green, blue
  Eigen::Vector3d zenith = Eigen::Vector3d(200.0, 215.0, 235.0);
  double cloud_contrast = 0.0;  ///< standard deviation of the brightness [gray levels]
  Eigen::Vector3d sun = Eigen::Vector3d(0.4, -0.7, 0.6).normalized();  ///< direction
  double sun_radius_deg = 0.0;                                         ///< 0 = no sun
  std::uint64_t seed = 1;                                              ///< of the clouds
};

struct Hit {
  double distance = 0.0;  ///< Euclidean, from the ray's origin
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, world frame, facing the ray's origin
  int surface = 0;  ///< 8 x index of the primitive, + 2 x axis + (0 minus side, 1 plus side) for a box
  Label label = Label::kOther;
};

class Scene {
 public:
  /// Returns the index of the primitive.
  int add(const Primitive& primitive, const TextureOptions& texture, const Finish& finish = {},
          Label label = Label::kOther);

  void set_sky(const Sky& sky);

  /// Returns the nearest surface along the ray; `direction`: of any length > 0. Glass and movers are skipped: hits
  /// behind them have the label kBehindGlass or kMover.
  std::optional<Hit> intersect(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;

  /// Returns the texture's colour at a hit (red, green, blue), not clamped.
  Eigen::Vector3d color(const Hit& hit) const;

  /// Returns the visible colour along the ray (red, green, blue): textures, reflections and transmission. Not below 0;
  /// lamps exceed 255.
  Eigen::Vector3d radiance(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;

  /// Returns the standard deviation of the surface's brightness [gray levels].
  double contrast(const Hit& hit) const;

  /// Returns the label of a ray without surface: kMover if it first hits a mover, else kSky.
  Label label_of_sky(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;

  /// Whether `position`, on a surface, is visible from `origin`.
  bool visible(const Eigen::Vector3d& origin, const Eigen::Vector3d& position) const;

  /// Returns the scene in another unit of length: all lengths times `factor`, textures included.
  Scene scaled(double factor) const;

 private:
  struct Object {
    Primitive primitive;
    Texture texture;
    Finish finish;
    Label label = Label::kOther;
  };

  /// Returns the nearest surface along the unit ray, without object `skipped` and, unless `all`, without glass and
  /// movers.
  std::optional<Hit> nearest(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray, int skipped, bool all) const;
  Eigen::Vector3d sky_color(const Eigen::Vector3d& ray) const;
  Eigen::Vector3d radiance(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray, int skipped, int bounces) const;
  const Object& object_of(const Hit& hit) const { return objects_[static_cast<std::size_t>(hit.surface / 8)]; }

  static bool is_seen_through(const Object& object) { return object.finish.glass || object.label == Label::kMover; }

  std::vector<Object> objects_;
  Sky sky_;
  Texture clouds_{TextureOptions{}};
  bool has_seen_through_ = false;
};

}  // namespace pmsp::synth
