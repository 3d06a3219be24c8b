// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace pmsp {

/// Array of numbers of a NumPy file.
struct NpyArray {
  std::vector<std::int64_t> sides;
  std::vector<double> values;  ///< last side fastest
};

/// Reads little-endian float32, float64, int32 or int64 in C order. Throws IoError, InvalidInput.
NpyArray read_npy_array(const std::filesystem::path& path);

}  // namespace pmsp
