// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include "pmsp/io/cloud.h"

namespace pmsp_test {

/// Points all over a box of 20 x 10 x 4 around (1000, -500, 30), no two alike.
inline std::vector<pmsp::OutputPoint> sample_points(std::size_t count) {
  std::vector<pmsp::OutputPoint> points(count);
  std::uint64_t state = 12345;
  const auto draw = [&state] {
    state = state * 6364136223846793005U + 1442695040888963407U;
    return static_cast<double>(state >> 33) / 2147483648.0;
  };
  for (std::size_t i = 0; i < count; ++i) {
    pmsp::OutputPoint& p = points[i];
    p.position = {1000.0 + 20.0 * draw() - 10.0, -500.0 + 10.0 * draw() - 5.0, 30.0 + 4.0 * draw() - 2.0};
    p.normal = Eigen::Vector3d{draw() - 0.5, draw() - 0.5, draw() - 0.5}.normalized().cast<float>();
    p.confidence = static_cast<float>(draw());
    p.keyframe_id = static_cast<std::int64_t>(i / 500);
    p.pixel = static_cast<std::uint32_t>(3 * (i % 500));
    p.color = {static_cast<std::uint8_t>(i % 256), static_cast<std::uint8_t>(255 - i % 256),
               static_cast<std::uint8_t>(i % 7)};
    p.views = static_cast<std::uint8_t>(3 + i % 5);
  }
  return points;
}

inline pmsp::CloudHeader sample_header() {
  pmsp::CloudHeader header;
  header.generator = "a test";
  header.comments = {"first", "second"};
  header.center = {1000.0, -500.0, 30.0};
  header.reach = 12.0;
  return header;
}

/// A little-endian number at an offset of a text. Throws if the text is too short.
template <class T>
T number_at(const std::string& bytes, std::size_t at) {
  if (at + sizeof(T) > bytes.size()) throw std::runtime_error("the file ends before byte " + std::to_string(at));
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

}  // namespace pmsp_test
