// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "pmsp/io/cloud.h"

namespace pmsp {

/// Keeps the most confident point of each cube, then an even sample of these. The selection depends on points and keys,
/// not on their order. Pending points are in a scratch folder.
class Thinning {
 public:
  using Take = std::function<void(const OutputPoint* points, std::size_t count)>;

  /// Throws OutputError if the scratch folder is not writable.
  Thinning(const ThinningOptions& options, const std::string& scratch_folder);
  ~Thinning();

  /// Throws InvalidInput if the cubes are too small to be counted.
  void add(const OutputPoint* points, std::size_t count);
  /// To be called after the last point: emits the kept points.
  void finish(const Take& take);

 private:
  class Voxels;
  class Sample;
  std::unique_ptr<Voxels> voxels_;  ///< nullptr = none
  std::unique_ptr<Sample> sample_;  ///< nullptr = none
};

}  // namespace pmsp
