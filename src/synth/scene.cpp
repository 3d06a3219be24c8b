// SPDX-License-Identifier: BSD-2-Clause
#include "synth/scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "elementary.h"
#include "synth/rng.h"

namespace pmsp::synth {
namespace {

/// Distance, relative to the primitive's size, below which a hit is the surface where the ray starts.
constexpr double kMinDistance = 1e-9;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kNoObject = -1;
constexpr int kMaxBounces = 3;  // further reflections are too faint to be visible

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

LocalHit hit(const Cylinder& cylinder, const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) {
  const Eigen::Vector3d from_center = origin - cylinder.center;
  const double start = from_center.dot(cylinder.axis);
  const double rise = ray.dot(cylinder.axis);
  const Eigen::Vector3d across_start = from_center - start * cylinder.axis;
  const Eigen::Vector3d across = ray - rise * cylinder.axis;
  LocalHit result;
  const auto consider = [&](double t, const Eigen::Vector3d& normal) {
    if (t > kMinDistance * cylinder.radius && t < result.distance) {
      result.distance = t;
      result.normal = normal;
    }
  };
  const double a = across.squaredNorm();
  const double b = across_start.dot(across);
  const double discriminant = b * b - a * (across_start.squaredNorm() - cylinder.radius * cylinder.radius);
  if (discriminant < 0.0) {
    return result;
  }
  if (a > 0.0) {
    for (const double root : {-std::sqrt(discriminant), std::sqrt(discriminant)}) {
      const double t = (root - b) / a;
      if (std::abs(start + t * rise) <= cylinder.half_length) {
        consider(t, (across_start + t * across) / cylinder.radius);
      }
    }
  }
  if (rise != 0.0) {
    for (const double side : {-1.0, 1.0}) {
      const double t = (side * cylinder.half_length - start) / rise;
      if ((across_start + t * across).squaredNorm() <= cylinder.radius * cylinder.radius) {
        consider(t, side * cylinder.axis);
      }
    }
  }
  return result;
}

LocalHit hit(const Foliage& foliage, const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) {
  LocalHit result;
  const Eigen::Vector3d to_center = foliage.center - origin;
  const double reach = foliage.radius + foliage.leaf_radius;
  if ((to_center - to_center.dot(ray) * ray).squaredNorm() > reach * reach) {
    return result;
  }
  for (const Foliage::Leaf& leaf : foliage.leaves) {
    const double slope = leaf.normal.dot(ray);
    const double t = leaf.normal.dot(leaf.center - origin) / slope;
    if (!(t > kMinDistance * foliage.radius) || t >= result.distance ||
        (origin + t * ray - leaf.center).squaredNorm() > foliage.leaf_radius * foliage.leaf_radius) {
      continue;
    }
    result.distance = t;
    result.normal = leaf.normal;
  }
  return result;
}

/// Returns the share of reflected light (Schlick's approximation of Fresnel's equations).
double mirrored_share(double head_on, double cos_incidence) {
  return head_on + (1.0 - head_on) * std::pow(1.0 - cos_incidence, 5);
}

Primitive scaled_primitive(const Primitive& primitive, double factor) {
  if (const auto* sphere = std::get_if<Sphere>(&primitive)) {
    return Sphere{sphere->center * factor, sphere->radius * factor};
  }
  if (const auto* box = std::get_if<Box>(&primitive)) {
    return Box{box->center * factor, box->half_size * factor, box->world_from_box};
  }
  if (const auto* cylinder = std::get_if<Cylinder>(&primitive)) {
    return Cylinder{cylinder->center * factor, cylinder->axis, cylinder->radius * factor,
                    cylinder->half_length * factor};
  }
  if (const auto* leaves = std::get_if<Foliage>(&primitive)) {
    Foliage result{leaves->center * factor, leaves->radius * factor, leaves->leaves, leaves->leaf_radius * factor};
    for (Foliage::Leaf& leaf : result.leaves) {
      leaf.center *= factor;
    }
    return result;
  }
  const auto& plane = std::get<Plane>(primitive);
  return Plane{plane.point * factor, plane.normal};
}

constexpr double kSunBrightness = 5000.0;

}  // namespace

Foliage foliage(const Eigen::Vector3d& center, double radius, int count, double leaf_radius, std::uint64_t seed) {
  Foliage result{center, radius, {}, leaf_radius};
  for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(count); ++i) {
    const auto direction = [&](std::uint64_t draw) {
      return Eigen::Vector3d(gaussian(seed, draw), gaussian(seed, draw + 1), gaussian(seed, draw + 2)).normalized();
    };
    const double distance = radius * std::cbrt(uniform(mix(seed, 1), i));
    result.leaves.push_back({center + distance * direction(6 * i), direction(6 * i + 3)});
  }
  return result;
}

void Scene::set_sky(const Sky& sky) {
  sky_ = sky;
  TextureOptions clouds;
  clouds.coarsest = 0.5;  // on the unit sphere
  clouds.octaves = 5;
  clouds.persistence = 0.6;
  clouds.contrast = sky.cloud_contrast;
  clouds.chroma = 0.0;
  clouds.shading = 0.0;
  clouds.base = Eigen::Vector3d::Zero();
  clouds.seed = sky.seed;
  clouds_ = Texture(clouds);
}

Eigen::Vector3d Scene::sky_color(const Eigen::Vector3d& ray) const {
  if (ray.dot(sky_.sun) > std::cos(sky_.sun_radius_deg * kernels::kPi / 180.0)) {
    return Eigen::Vector3d::Constant(kSunBrightness);
  }
  const double height = std::clamp(-ray.y(), 0.0, 1.0);
  const Eigen::Vector3d color = sky_.horizon + height * (sky_.zenith - sky_.horizon);
  if (sky_.cloud_contrast <= 0.0) {
    return color;
  }
  return (color + clouds_.color(ray, ray)).cwiseMax(0.0);
}

int Scene::add(const Primitive& primitive, const TextureOptions& texture, const Finish& finish, Label label) {
  objects_.push_back({primitive, Texture(texture), finish, label});
  has_seen_through_ = has_seen_through_ || is_seen_through(objects_.back());
  return static_cast<int>(objects_.size()) - 1;
}

std::optional<Hit> Scene::nearest(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray, int skipped,
                                  bool all) const {
  LocalHit nearest;
  int nearest_object = -1;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    if (static_cast<int>(i) == skipped || (!all && is_seen_through(objects_[i]))) {
      continue;
    }
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
  result.label = object_of(result).label;
  return result;
}

std::optional<Hit> Scene::intersect(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  const Eigen::Vector3d ray = direction.normalized();
  std::optional<Hit> result = nearest(origin, ray, kNoObject, false);
  if (result && has_seen_through_) {
    const Object& first = object_of(*nearest(origin, ray, kNoObject, true));
    if (is_seen_through(first)) {
      result->label = first.finish.glass ? Label::kBehindGlass : Label::kMover;
    }
  }
  return result;
}

Label Scene::label_of_sky(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  const std::optional<Hit> first = nearest(origin, direction.normalized(), kNoObject, true);
  return first && first->label == Label::kMover ? Label::kMover : Label::kSky;
}

Eigen::Vector3d Scene::color(const Hit& hit) const { return object_of(hit).texture.color(hit.position, hit.normal); }

Eigen::Vector3d Scene::radiance(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  return radiance(origin, direction.normalized(), kNoObject, kMaxBounces);
}

Eigen::Vector3d Scene::radiance(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray, int skipped,
                                int bounces) const {
  const std::optional<Hit> hit = nearest(origin, ray, skipped, true);
  if (!hit) {
    return sky_color(ray);
  }
  const Finish& finish = object_of(*hit).finish;
  // A pane is hit only once, at its near side.
  const int pane = finish.glass ? hit->surface / 8 : kNoObject;
  const Eigen::Vector3d own =
      finish.glass ? radiance(hit->position, ray, pane, bounces) : color(*hit).cwiseMax(0.0).eval();
  if (finish.reflection <= 0.0 || bounces == 0) {
    return own;
  }
  const double cos_incidence = -hit->normal.dot(ray);
  const double share = mirrored_share(finish.reflection, cos_incidence);
  const Eigen::Vector3d mirrored = ray + 2.0 * cos_incidence * hit->normal;
  return (1.0 - share) * own + share * radiance(hit->position, mirrored, pane, bounces - 1);
}

double Scene::contrast(const Hit& hit) const { return object_of(hit).texture.options().contrast; }

bool Scene::visible(const Eigen::Vector3d& origin, const Eigen::Vector3d& position) const {
  const double distance = (position - origin).norm();
  const std::optional<Hit> first = intersect(origin, position - origin);
  return first && first->distance > distance * (1.0 - 1e-6);
}

Scene Scene::scaled(double factor) const {
  Scene result;
  result.set_sky(sky_);
  for (const Object& object : objects_) {
    TextureOptions texture = object.texture.options();
    texture.coarsest *= factor;
    result.add(scaled_primitive(object.primitive, factor), texture, object.finish, object.label);
  }
  return result;
}

}  // namespace pmsp::synth
