// SPDX-License-Identifier: BSD-2-Clause
#include "synth/render.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>
#include <thread>
#include <vector>

#include "pmsp/camera.h"
#include "synth/rng.h"

namespace pmsp::synth {
namespace {

std::uint8_t to_level(double value) { return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0))); }

class Renderer {
 public:
  Renderer(const Scene& scene, const RigidTransform& cam_from_world, const RenderOptions& options, RenderedView& view)
      : scene_(scene),
        cam_from_world_(cam_from_world),
        center_(cam_from_world.center()),
        options_(options),
        view_(view) {}

  void render_row(int y) const {
    for (int x = 0; x < view_.image.width(); ++x) {
      render_truth(x, y);
      render_color(x, y);
    }
  }

 private:
  struct Ray {
    Eigen::Vector3d origin;
    Eigen::Vector3d direction;
  };

  Ray ray(double u, double v, double lens_distance) const {
    const Eigen::Vector3d bearing = bearing_from_pixel({u, v}, view_.image.width(), view_.image.height());
    const Eigen::Vector3d lens(0.0, 0.0, bearing.z() < 0.0 ? -0.5 * lens_distance : 0.5 * lens_distance);
    const Eigen::Matrix3d world_from_cam = cam_from_world_.rotation.transpose();
    return {center_ + world_from_cam * lens, world_from_cam * bearing};
  }

  void render_truth(int x, int y) const {
    const Ray centre = ray(x + 0.5, y + 0.5, 0.0);
    if (is_rider(x + 0.5, y + 0.5)) {
      view_.label(x, y) = static_cast<std::uint8_t>(Label::kRider);
    } else if (const std::optional<Hit> hit = scene_.intersect(centre.origin, centre.direction)) {
      view_.depth(x, y) = static_cast<float>(hit->distance);
      view_.normal(x, y) = (cam_from_world_.rotation * hit->normal).cast<float>();
      view_.surface(x, y) = hit->surface;
      view_.label(x, y) = static_cast<std::uint8_t>(hit->label);
    } else {
      view_.label(x, y) = static_cast<std::uint8_t>(scene_.label_of_sky(centre.origin, centre.direction));
    }
  }

  void render_color(int x, int y) const {
    const int n = options_.samples;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        const auto place = [&](int k) { return 0.5 + ((k + 0.5) / n - 0.5) * options_.footprint_px; };
        const double v = std::clamp(y + place(j), 0.0, static_cast<double>(view_.image.height()));
        sum += sample_color(x + place(i), v);
      }
    }
    Eigen::Vector3d color = sum * (options_.gain * shading(x, y) / (n * n));
    if (options_.noise_sigma > 0.0) {
      const auto pixel = static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(view_.image.width()) +
                         static_cast<std::uint64_t>(x);
      for (int c = 0; c < 3; ++c) {
        color[c] += options_.noise_sigma * gaussian(options_.seed, 3 * pixel + static_cast<std::uint64_t>(c));
      }
    }
    view_.image(x, y) = {to_level(color[0]), to_level(color[1]), to_level(color[2])};
  }

  bool is_rider(double u, double v) const {
    const auto bearing = [&] { return bearing_from_pixel({u, v}, view_.image.width(), view_.image.height()); };
    return options_.rider != nullptr && options_.rider->intersect(Eigen::Vector3d::Zero(), bearing()).has_value();
  }

  Eigen::Vector3d sample_color(double u, double v) const {
    if (is_rider(u, v)) {
      return options_.rider->radiance(Eigen::Vector3d::Zero(),
                                      bearing_from_pixel({u, v}, view_.image.width(), view_.image.height()));
    }
    const Ray sample = ray(u, v, options_.lens_distance);
    return scene_.radiance(sample.origin, sample.direction).cwiseMin(options_.brightest);
  }

  /// Returns the transmission of the lens.
  double shading(int x, int y) const {
    const double forward = bearing_from_pixel({x + 0.5, y + 0.5}, view_.image.width(), view_.image.height()).z();
    const double beside = 1.0 - std::abs(forward);
    return (1.0 - options_.vignetting * beside * beside) * (forward < 0.0 ? 1.0 - options_.lens_gain : 1.0);
  }

  const Scene& scene_;
  const RigidTransform& cam_from_world_;
  const Eigen::Vector3d center_;
  const RenderOptions& options_;
  RenderedView& view_;
};

}  // namespace

RenderedView render(const Scene& scene, const RigidTransform& cam_from_world, int width, int height,
                    const RenderOptions& options) {
  RenderedView view{Image<Rgb>(width, height), Image<float>(width, height),
                    Image<Eigen::Vector3f>(width, height, Eigen::Vector3f::Zero()), Image<int>(width, height, -1),
                    Image<std::uint8_t>(width, height)};
  const Renderer renderer(scene, cam_from_world, options, view);
  std::atomic<int> next_row{0};
  const auto work = [&] {
    for (int y = next_row++; y < height; y = next_row++) {
      renderer.render_row(y);
    }
  };
  const unsigned wanted =
      options.threads > 0 ? static_cast<unsigned>(options.threads) : std::max(1U, std::thread::hardware_concurrency());
  std::vector<std::thread> helpers;
  for (unsigned i = 1; i < wanted; ++i) {
    helpers.emplace_back(work);
  }
  work();
  for (std::thread& helper : helpers) {
    helper.join();
  }
  return view;
}

}  // namespace pmsp::synth
