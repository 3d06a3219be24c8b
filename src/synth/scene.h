// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "synth/texture.h"

/// Scenes whose geometry is known exactly, for tests. World axes as those of an upright camera: x right, y down, z
/// forward.
namespace pmsp::synth {

struct Sphere {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius = 1.0;
};

/// A room when the camera is inside, a piece of furniture when it is outside.
struct Box {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_size = Eigen::Vector3d::Ones();
  Eigen::Matrix3d world_from_box = Eigen::Matrix3d::Identity();  ///< rotation
};

/// Without end, seen from both sides.
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

/// Flat round leaves inside a sphere, seen from both sides.
struct Foliage {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius = 1.0;
  struct Leaf {
    Eigen::Vector3d center, normal;  ///< normal: unit
  };
  std::vector<Leaf> leaves;
  double leaf_radius = 0.1;
};

/// `count` leaves at random places of the sphere, turned at random.
Foliage foliage(const Eigen::Vector3d& center, double radius, int count, double leaf_radius, std::uint64_t seed);

using Primitive = std::variant<Sphere, Box, Plane, Cylinder, Foliage>;

/// How a surface treats light beside showing its texture. Default: not at all.
struct Finish {
  double reflection = 0.0;  ///< share of the light that is mirrored head-on, 0 to 1; grows to 1 at grazing angles
  bool glass = false;       ///< the rest comes from behind, and the texture is not seen
};

/// What evaluations tell apart; the values of label images.
enum class Label : std::uint8_t { kOther, kThin, kGlossy, kBehindGlass, kSky, kRider, kMover };

/// What a ray meets that meets no surface. Default: one colour.
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

  /// The nearest surface along the ray; `direction` may have any length > 0. Glass and movers are no surfaces: what is
  /// behind them is hit, and has the label kBehindGlass or kMover.
  std::optional<Hit> intersect(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;

  /// Red, green, blue of the texture at a hit, not clamped.
  Eigen::Vector3d color(const Hit& hit) const;

  /// Red, green, blue that a camera sees along the ray: textures, reflections and what glass lets through. Not below 0;
  /// lamps exceed 255.
  Eigen::Vector3d radiance(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;

  /// Standard deviation of the brightness of the surface there [gray levels].
  double contrast(const Hit& hit) const;

  /// Whether the ray meets no surface, or only a mover.
  Label label_of_sky(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;

  /// Whether nothing stands between `origin` and `position`, which lies on a surface.
  bool visible(const Eigen::Vector3d& origin, const Eigen::Vector3d& position) const;

  /// The same scene in another unit of length: all lengths times `factor`, textures included.
  Scene scaled(double factor) const;

 private:
  struct Object {
    Primitive primitive;
    Texture texture;
    Finish finish;
    Label label = Label::kOther;
  };

  /// The nearest surface along the unit ray, without that of object `skipped` and, if not `all`, without glass and
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
