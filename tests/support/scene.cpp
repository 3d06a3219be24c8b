// SPDX-License-Identifier: BSD-2-Clause
#include "support/scene.h"

#include <cmath>
#include <limits>
#include <utility>

namespace pmsp::synth {
namespace {

/// Hits nearer than this, relative to the primitive's own size, are the surface that the ray starts from.
constexpr double kMinDistance = 1e-9;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct LocalHit {
  double distance = kInfinity;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  int face = 0;
};

LocalHit hit(const Sphere& sphere, const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) {
  LocalHit result;
  const Eigen::Vector3d from_center = origin - sphere.center;
  const double b = from_center.dot(ray);
  const double discriminant = b * b - from_center.squaredNorm() + sphere.radius * sphere.radius;
  if (discriminant < 0.0) {
    return result;
  }
  const double root = std::sqrt(discriminant);
  for (const double t : {-b - root, -b + root}) {
    if (t > kMinDistance * sphere.radius) {
      result.distance = t;
      result.normal = (from_center + t * ray) / sphere.radius;
      break;
    }
  }
  return result;
}

LocalHit hit(const Plane& plane, const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) {
  LocalHit result;
  const double height = plane.normal.dot(plane.point - origin);
  const double slope = plane.normal.dot(ray);
  if (slope != 0.0 && height / slope > 0.0) {
    result.distance = height / slope;
    result.normal = plane.normal;
  }
  return result;
}

LocalHit hit(const Box& box, const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) {
  LocalHit result;
  const Eigen::Vector3d o = box.world_from_box.transpose() * (origin - box.center);
  const Eigen::Vector3d d = box.world_from_box.transpose() * ray;
  double entry = -kInfinity;
  double exit = kInfinity;
  int entry_axis = 0;
  int exit_axis = 0;
  for (int axis = 0; axis < 3; ++axis) {
    if (d[axis] == 0.0) {
      if (std::abs(o[axis]) > box.half_size[axis]) {
        return result;
      }
      continue;
    }
    double near_side = (-box.half_size[axis] - o[axis]) / d[axis];
    double far_side = (box.half_size[axis] - o[axis]) / d[axis];
    if (near_side > far_side) {
      std::swap(near_side, far_side);
    }
    if (near_side > entry) {
      entry = near_side;
      entry_axis = axis;
    }
    if (far_side < exit) {
      exit = far_side;
      exit_axis = axis;
    }
  }
  const double min_distance = kMinDistance * box.half_size.maxCoeff();
  if (entry > exit || exit <= min_distance) {
    return result;
  }
  const bool from_outside = entry > min_distance;
  const int axis = from_outside ? entry_axis : exit_axis;
  const bool plus_side = (d[axis] > 0.0) != from_outside;
  result.distance = from_outside ? entry : exit;
  result.normal = box.world_from_box.col(axis) * (plus_side ? 1.0 : -1.0);
  result.face = 2 * axis + (plus_side ? 1 : 0);
  return result;
}

Primitive scaled_primitive(const Primitive& primitive, double factor) {
  if (const auto* sphere = std::get_if<Sphere>(&primitive)) {
    return Sphere{sphere->center * factor, sphere->radius * factor};
  }
  if (const auto* box = std::get_if<Box>(&primitive)) {
    return Box{box->center * factor, box->half_size * factor, box->world_from_box};
  }
  const auto& plane = std::get<Plane>(primitive);
  return Plane{plane.point * factor, plane.normal};
}

}  // namespace

int Scene::add(const Primitive& primitive, const TextureOptions& texture) {
  objects_.push_back({primitive, Texture(texture)});
  return static_cast<int>(objects_.size()) - 1;
}

std::optional<Hit> Scene::intersect(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  const Eigen::Vector3d ray = direction.normalized();
  LocalHit nearest;
  int nearest_object = -1;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    const LocalHit candidate = std::visit([&](const auto& p) { return hit(p, origin, ray); }, objects_[i].primitive);
    if (candidate.distance < nearest.distance) {
      nearest = candidate;
      nearest_object = static_cast<int>(i);
    }
  }
  if (nearest_object < 0) {
    return std::nullopt;
  }
  const bool facing = nearest.normal.dot(ray) < 0.0;
  Hit result;
  result.distance = nearest.distance;
  result.position = origin + nearest.distance * ray;
  result.normal = facing ? nearest.normal : Eigen::Vector3d(-nearest.normal);
  result.surface = 8 * nearest_object + nearest.face;
  return result;
}

Eigen::Vector3d Scene::color(const Hit& hit) const {
  return objects_[static_cast<std::size_t>(hit.surface / 8)].texture.color(hit.position, hit.normal);
}

double Scene::contrast(const Hit& hit) const {
  return objects_[static_cast<std::size_t>(hit.surface / 8)].texture.options().contrast;
}

bool Scene::visible(const Eigen::Vector3d& origin, const Eigen::Vector3d& position) const {
  const double distance = (position - origin).norm();
  const std::optional<Hit> first = intersect(origin, position - origin);
  return first && first->distance > distance * (1.0 - 1e-6);
}

Scene Scene::scaled(double factor) const {
  Scene result;
  for (const Object& object : objects_) {
    TextureOptions texture = object.texture.options();
    texture.coarsest *= factor;
    result.add(scaled_primitive(object.primitive, factor), texture);
  }
  return result;
}

}  // namespace pmsp::synth
