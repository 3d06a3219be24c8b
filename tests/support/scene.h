// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <optional>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "support/texture.h"

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

using Primitive = std::variant<Sphere, Box, Plane>;

struct Hit {
  double distance = 0.0;  ///< Euclidean, from the ray's origin
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, world frame, facing the ray's origin
  int surface = 0;  ///< 8 x index of the primitive, + 2 x axis + (0 minus side, 1 plus side) for a box
};

class Scene {
 public:
  /// Returns the index of the primitive.
  int add(const Primitive& primitive, const TextureOptions& texture);

  /// The nearest surface along the ray; `direction` may have any length > 0.
  std::optional<Hit> intersect(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;

  /// Red, green, blue at a hit, not clamped.
  Eigen::Vector3d color(const Hit& hit) const;

  /// Standard deviation of the brightness of the surface there [gray levels].
  double contrast(const Hit& hit) const;

  /// Whether nothing stands between `origin` and `position`, which lies on a surface.
  bool visible(const Eigen::Vector3d& origin, const Eigen::Vector3d& position) const;

  /// The same scene in another unit of length: all lengths times `factor`, textures included.
  Scene scaled(double factor) const;

 private:
  struct Object {
    Primitive primitive;
    Texture texture;
  };
  std::vector<Object> objects_;
};

}  // namespace pmsp::synth
