// SPDX-License-Identifier: BSD-2-Clause
#include "synth/texture.h"

#include <cmath>

#include <Eigen/Geometry>

#include "synth/rng.h"

namespace pmsp::synth {
namespace {

std::uint32_t hash_corner(std::int64_t x, std::int64_t y, std::int64_t z, std::uint32_t seed) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 0x8da6b343U ^ static_cast<std::uint32_t>(y) * 0xd8163841U ^
                    static_cast<std::uint32_t>(z) * 0xcb1ab31fU ^ seed;
  h = (h ^ (h >> 16)) * 0x85ebca6bU;
  h = (h ^ (h >> 13)) * 0xc2b2ae35U;
  return h ^ (h >> 16);
}

double fade(double t) { return t * t * t * (t * (t * 6.0 - 15.0) + 10.0); }

/// Returns brightness, red, green, blue: four independent noises with corner values in [-1, 1].
Eigen::Array4d value_noise(const Eigen::Vector3d& p, std::uint32_t seed) {
  const Eigen::Vector3d cell(std::floor(p.x()), std::floor(p.y()), std::floor(p.z()));
  const auto x = static_cast<std::int64_t>(cell.x());
  const auto y = static_cast<std::int64_t>(cell.y());
  const auto z = static_cast<std::int64_t>(cell.z());
  const double wx[2] = {1.0 - fade(p.x() - cell.x()), fade(p.x() - cell.x())};
  const double wy[2] = {1.0 - fade(p.y() - cell.y()), fade(p.y() - cell.y())};
  const double wz[2] = {1.0 - fade(p.z() - cell.z()), fade(p.z() - cell.z())};
  Eigen::Array4d sum = Eigen::Array4d::Zero();
  for (int corner = 0; corner < 8; ++corner) {
    const int i = corner & 1;
    const int j = (corner >> 1) & 1;
    const int k = corner >> 2;
    const std::uint32_t h = hash_corner(x + i, y + j, z + k, seed);
    const Eigen::Array4d value(h & 255U, (h >> 8) & 255U, (h >> 16) & 255U, h >> 24);
    sum += wx[i] * wy[j] * wz[k] * value;
  }
  return sum / 127.5 - 1.0;
}

}  // namespace

TextureOptions plain(const Eigen::Vector3d& color) {
  TextureOptions options;
  options.base = color;
  options.contrast = 0.0;
  options.shading = 0.0;
  return options;
}

TextureOptions textured(std::uint64_t seed) {
  TextureOptions options;
  options.seed = seed;
  for (int c = 0; c < 3; ++c) {
    options.base[c] = 95.0 + 70.0 * uniform(seed, static_cast<std::uint64_t>(c));
  }
  return options;
}

TextureOptions weak(std::uint64_t seed) {
  TextureOptions options = textured(seed);
  options.base = Eigen::Vector3d(205.0, 200.0, 190.0);
  options.contrast = 3.0;
  options.chroma = 0.15;
  return options;
}

TextureOptions painted(std::uint64_t seed) {
  TextureOptions options;
  options.seed = seed;
  options.base = Eigen::Vector3d(205.0, 200.0, 190.0);
  options.coarsest = 3.0;
  options.octaves = 1;
  options.contrast = 8.0;
  options.chroma = 0.0;
  return options;
}

Texture::Texture(const TextureOptions& options) : options_(options) {
  // Standard deviation of noise interpolated over three axes between uniform corner values.
  constexpr double kNoiseDeviation = 0.40;
  double power = 0.0;
  for (int i = 0; i < options.octaves; ++i) {
    const auto draw = [&](int k) { return uniform(options.seed, static_cast<std::uint64_t>(100 + 8 * i + k)); };
    const Eigen::Vector3d axis(draw(0) - 0.5, draw(1) - 0.5, draw(2) - 0.5);
    const Eigen::AngleAxisd turn(0.5 + 2.0 * draw(3), (axis + Eigen::Vector3d(0.0, 0.0, 1e-3)).normalized());
    Octave octave;
    octave.lattice_from_world = turn.toRotationMatrix() * (std::pow(2.0, i) / options.coarsest);
    octave.offset = 50.0 * Eigen::Vector3d(draw(4), draw(5), draw(6));
    octave.amplitude = std::pow(options.persistence, i);
    octave.seed = static_cast<std::uint32_t>(mix(options.seed, static_cast<std::uint64_t>(i)));
    power += octave.amplitude * octave.amplitude;
    octaves_.push_back(octave);
  }
  for (Octave& octave : octaves_) {
    octave.amplitude *= options.contrast / (kNoiseDeviation * std::sqrt(power));
  }
}

Eigen::Vector3d Texture::color(const Eigen::Vector3d& position, const Eigen::Vector3d& normal) const {
  Eigen::Array4d noise = Eigen::Array4d::Zero();
  if (options_.contrast > 0.0) {
    for (const Octave& octave : octaves_) {
      noise += octave.amplitude *
               value_noise(octave.lattice_from_world * (position - options_.origin) + octave.offset, octave.seed);
    }
  }
  const Eigen::Vector3d light(0.51, -0.80, 0.32);
  const double shade = 1.0 + options_.shading * normal.dot(light);
  const Eigen::Vector3d color_noise = (noise[0] + options_.chroma * noise.tail<3>()).matrix();
  return (options_.base + color_noise) * shade;
}

}  // namespace pmsp::synth
