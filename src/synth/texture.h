// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace pmsp::synth {

/// Solid texture: colour as a function of the position in the world, or relative to a moving object.
struct TextureOptions {
  double coarsest = 0.36;     ///< size of the largest blobs [m]
  int octaves = 4;            ///< blobs halve in size with each
  double persistence = 0.85;  ///< ratio of amplitudes of successive octaves
  double contrast = 40.0;     ///< standard deviation of the brightness [gray levels]; 0 = a single colour
  double chroma = 0.3;        ///< amplitude of the colour relative to that of the brightness
  double shading = 0.10;      ///< relative change of brightness with the surface normal
  Eigen::Vector3d base = Eigen::Vector3d(128.0, 128.0, 128.0);  ///< mean colour, red, green, blue, 0 to 255
  std::uint64_t seed = 1;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< reference of positions, for moving objects
};

/// Strong contrast on all scales.
TextureOptions textured(std::uint64_t seed);

/// Plaster: contrast of a few gray levels.
TextureOptions weak(std::uint64_t seed);

/// Paint without texture; brightness falls off slightly over metres. Units are metres.
TextureOptions painted(std::uint64_t seed);

/// One colour (red, green, blue) in every direction.
TextureOptions plain(const Eigen::Vector3d& color);

/// Octaves of value noise. The lattice of each octave has its own rotation, so that no wall is parallel to a lattice
/// plane.
class Texture {
 public:
  explicit Texture(const TextureOptions& options);

  /// Returns red, green, blue, not clamped.
  Eigen::Vector3d color(const Eigen::Vector3d& position, const Eigen::Vector3d& normal) const;

  const TextureOptions& options() const { return options_; }

 private:
  struct Octave {
    Eigen::Matrix3d lattice_from_world;
    Eigen::Vector3d offset;
    double amplitude = 0.0;
    std::uint32_t seed = 0;
  };
  TextureOptions options_;
  std::vector<Octave> octaves_;
};

}  // namespace pmsp::synth
