// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "pmsp/io/cloud.h"

namespace pmsp {

/// Keeps of each cube the most confident point, then an even share of what is left. Which points stay follows from the
/// points and their keys, not from the order in which they come. What waits lies in a scratch folder.
class Thinning {
 public:
  using Take = std::function<void(const OutputPoint* points, std::size_t count)>;

  /// Throws OutputError when nothing can be written there.
  Thinning(const ThinningOptions& options, const std::string& scratch_folder);
  ~Thinning();

  /// Throws InvalidInput where the cubes are so small that they cannot be counted.
  void add(const OutputPoint* points, std::size_t count);
  /// After the last point: hands on those that stay.
  void finish(const Take& take);

 private:
  class Voxels;
  class Sample;
  std::unique_ptr<Voxels> voxels_;  ///< nullptr = none
  std::unique_ptr<Sample> sample_;  ///< nullptr = none
};

}  // namespace pmsp
