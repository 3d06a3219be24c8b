// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "export/little_endian.h"
#include "io/binary_input.h"
#include "pmsp/io/cloud.h"

namespace pmsp {

enum class NumberType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble, kInt64, kUint64 };

inline std::size_t size_of(NumberType type) {
  constexpr std::array<std::size_t, 10> kSizes{1, 1, 2, 2, 4, 4, 4, 8, 8, 8};
  return kSizes[static_cast<std::size_t>(type)];
}

inline double load_number(const char* bytes, NumberType type, bool big_endian = false) {
  const auto load = [&](auto zero) { return static_cast<double>(get_number<decltype(zero)>(bytes, big_endian)); };
  switch (type) {
    case NumberType::kInt8:
      return load(std::int8_t{});
    case NumberType::kUint8:
      return load(std::uint8_t{});
    case NumberType::kInt16:
      return load(std::int16_t{});
    case NumberType::kUint16:
      return load(std::uint16_t{});
    case NumberType::kInt32:
      return load(std::int32_t{});
    case NumberType::kUint32:
      return load(std::uint32_t{});
    case NumberType::kFloat:
      return load(0.0F);
    case NumberType::kInt64:
      return load(std::int64_t{});
    case NumberType::kUint64:
      return load(std::uint64_t{});
    case NumberType::kDouble:
      break;
  }
  return load(0.0);
}

/// Fields of a point in a file.
enum CloudField { kX, kY, kZ, kNx, kNy, kNz, kRed, kGreen, kBlue, kConfidence, kViews, kCloudFields };
using CloudNumbers = std::array<double, kCloudFields>;

inline std::uint8_t to_byte(double value) {
  return static_cast<std::uint8_t>(value >= 255.0 ? 255.0 : value > 0.0 ? value + 0.5 : 0.0);
}

/// Points of a file, emitted in batches.
class PointBatch {
 public:
  /// `color_scale`: factor from the file's colours to 0 to 255.
  PointBatch(const CloudInfo& info, double color_scale, const CloudReader::Take& take)
      : info_(info), color_scale_(color_scale), take_(take) {
    points_.reserve(kMost);
  }

  /// Adds the next point; fields missing in the file are ignored. Throws InvalidInput if the position is not finite.
  void add(const CloudNumbers& v, const BinaryInput& input) {
    if (!std::isfinite(v[kX]) || !std::isfinite(v[kY]) || !std::isfinite(v[kZ])) {
      input.fail("point " + std::to_string(number_) + ", before " + input.here() +
                 ", has a position that is not finite");
    }
    OutputPoint point;
    point.position = {v[kX], v[kY], v[kZ]};
    if (info_.has_normals) {
      const Eigen::Vector3f normal = Eigen::Vector3d(v[kNx], v[kNy], v[kNz]).cast<float>();
      if (normal.allFinite()) point.normal = normal;
    }
    point.color = {kGrey, kGrey, kGrey};
    if (info_.has_colors) {
      point.color = {to_byte(v[kRed] * color_scale_), to_byte(v[kGreen] * color_scale_),
                     to_byte(v[kBlue] * color_scale_)};
    }
    if (info_.has_confidence && v[kConfidence] > 0.0) {
      point.confidence = static_cast<float>(std::min(v[kConfidence], 1.0));
    }
    if (info_.has_views) point.views = to_byte(v[kViews]);
    point.keyframe_id = -1 - (number_ >> 32);
    point.pixel = static_cast<std::uint32_t>(number_++ & 0xffffffff);
    points_.push_back(point);
    if (points_.size() == kMost) flush();
  }

  void flush() {
    if (!points_.empty()) take_(points_.data(), points_.size());
    points_.clear();
  }

 private:
  static constexpr std::size_t kMost = std::size_t{1} << 14;
  static constexpr std::uint8_t kGrey = 200;

  const CloudInfo& info_;
  double color_scale_;
  const CloudReader::Take& take_;
  std::int64_t number_ = 0;
  std::vector<OutputPoint> points_;
};

/// Points as little-endian records of fixed size.
struct PointRecords {
  struct Number {
    std::size_t at = 0;
    NumberType type = NumberType::kFloat;
    double scale = 1.0, shift = 0.0;
    bool is_there = false;
  };

  std::uint64_t begin = 0, count = 0;
  std::size_t bytes = 0;  ///< of a record
  std::array<Number, kCloudFields> numbers;
  double color_scale = 1.0;

  bool has(CloudField first, int count_of) const {
    for (int i = 0; i < count_of; ++i) {
      if (!numbers[static_cast<std::size_t>(first + i)].is_there) return false;
    }
    return true;
  }
  void describe(CloudInfo& info) const {
    info.points = static_cast<std::int64_t>(count);
    info.has_normals = has(kNx, 3);
    info.has_colors = has(kRed, 3);
    info.has_confidence = has(kConfidence, 1);
    info.has_views = has(kViews, 1);
  }

  CloudNumbers numbers_of(const char* record) const {
    CloudNumbers v{};
    for (std::size_t i = 0; i < v.size(); ++i) {
      const Number& it = numbers[i];
      if (it.is_there) v[i] = load_number(record + it.at, it.type) * it.scale + it.shift;
    }
    return v;
  }

  void read(BinaryInput& input, const CloudInfo& info, const CloudReader::Take& take) const {
    PointBatch batch(info, color_scale, take);
    input.seek(begin);
    for (std::uint64_t i = 0; i < count; ++i) {
      batch.add(numbers_of(input.take(bytes)), input);
    }
    batch.flush();
  }
};

}  // namespace pmsp
