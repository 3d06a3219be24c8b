// SPDX-License-Identifier: BSD-2-Clause
// LAS 1.0 to 1.4 (ASPRS), uncompressed: positions, colours, and the extra bytes that las.cpp writes.
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <sstream>
#include <string>

#include "export/cloud_fields.h"

namespace pmsp {
namespace {

constexpr std::size_t kShortestHeader = 227;  ///< versions 1.0 to 1.2
constexpr std::size_t kHeader14 = 375;
constexpr std::size_t kRecordHeader = 54;
constexpr std::size_t kDescriptorBytes = 192;  ///< size of a descriptor
constexpr std::uint8_t kCompressed = 0xC0;

struct PointFormat {
  std::size_t bytes;   ///< size of a point without extra bytes
  std::size_t colors;  ///< offset of red, green, blue; 0 = none
};
constexpr std::array<PointFormat, 11> kPointFormats{
    {{20, 0}, {28, 0}, {26, 20}, {34, 28}, {57, 0}, {63, 28}, {30, 0}, {36, 30}, {38, 30}, {59, 0}, {67, 30}}};

template <class T>
T number_at(const std::string& bytes, std::size_t at) {
  return get_little<T>(bytes.data() + at);
}

/// NUL-terminated text.
std::string text_at(const std::string& bytes, std::size_t at, std::size_t size) {
  const std::string text = bytes.substr(at, size);
  return text.substr(0, text.find('\0'));
}

/// Data types of extra bytes, from 1.
constexpr std::array<NumberType, 10> kExtraTypes{
    NumberType::kUint8, NumberType::kInt8,   NumberType::kUint16, NumberType::kInt16, NumberType::kUint32,
    NumberType::kInt32, NumberType::kUint64, NumberType::kInt64,  NumberType::kFloat, NumberType::kDouble};

std::optional<CloudField> field_named(const std::string& name) {
  constexpr std::array<std::pair<const char*, CloudField>, 5> kNames{
      {{"NormalX", kNx}, {"NormalY", kNy}, {"NormalZ", kNz}, {"confidence", kConfidence}, {"views", kViews}}};
  for (const auto& [known, field] : kNames) {
    if (name == known) return field;
  }
  return std::nullopt;
}

class LasReader final : public CloudReader {
 public:
  explicit LasReader(const std::filesystem::path& path) : input_(path) {
    info_.format = "LAS";
    read_header();
    read_records();
    find_levels();
    records_.describe(info_);
    read_origin(info_);
  }

  void read(const Take& take) override { records_.read(input_, info_, take); }

 private:
  std::string bytes(std::size_t count) { return {input_.take(count), count}; }

  void read_header() {
    const std::string start = bytes(kShortestHeader);
    const auto major = number_at<std::uint8_t>(start, 24), minor = number_at<std::uint8_t>(start, 25);
    if (major != 1 || minor > 4) {
      input_.fail("is LAS " + std::to_string(major) + "." + std::to_string(minor) + "; expected 1.0 to 1.4");
    }
    header_bytes_ = number_at<std::uint16_t>(start, 94);
    const std::size_t shortest = minor == 4 ? kHeader14 : kShortestHeader;
    if (header_bytes_ < shortest) {
      input_.fail("has a header of " + std::to_string(header_bytes_) + " bytes, expected at least " +
                  std::to_string(shortest) + "; the file may be damaged");
    }
    info_.day_of_year = number_at<std::uint16_t>(start, 90);
    info_.year = number_at<std::uint16_t>(start, 92);
    if (info_.day_of_year > 366 || info_.year > 9999) info_.day_of_year = info_.year = 0;
    records_.begin = number_at<std::uint32_t>(start, 96);
    record_count_ = number_at<std::uint32_t>(start, 100);
    const auto format = number_at<std::uint8_t>(start, 104);
    if ((format & kCompressed) != 0) {
      input_.fail("is compressed (LAZ), expected LAS; convert it: laszip -i IN.laz -o OUT.las");
    }
    if (format >= kPointFormats.size()) {
      input_.fail("has points of format " + std::to_string(format) + ", expected 0 to 10; the file may be damaged");
    }
    records_.bytes = number_at<std::uint16_t>(start, 105);
    records_.count = number_at<std::uint32_t>(start, 107);
    const PointFormat& layout = kPointFormats[format];
    extra_at_ = layout.bytes;
    if (records_.bytes < layout.bytes) {
      input_.fail("has points of " + std::to_string(records_.bytes) + " bytes, expected at least " +
                  std::to_string(layout.bytes) + " of format " + std::to_string(format) + "; the file may be damaged");
    }
    for (std::size_t i = 0; i < 3; ++i) {
      const auto scale = number_at<double>(start, 131 + 8 * i), shift = number_at<double>(start, 155 + 8 * i);
      if (!std::isfinite(scale) || scale == 0.0 || !std::isfinite(shift)) {
        input_.fail("has a scale or an offset of coordinates that is no number; the file may be damaged");
      }
      records_.numbers[kX + i] = {4 * i, NumberType::kInt32, scale, shift, true};
      if (layout.colors > 0) {
        records_.numbers[kRed + i] = {layout.colors + 2 * i, NumberType::kUint16, 1.0, 0.0, true};
      }
    }
    if (minor == 4) records_.count = number_at<std::uint64_t>(start + bytes(kHeader14 - kShortestHeader), 247);
    const std::uint64_t room = input_.size() > records_.begin ? input_.size() - records_.begin : 0;
    if (records_.begin < header_bytes_ || records_.count > room / records_.bytes) {
      input_.fail("announces " + std::to_string(records_.count) + " points of " + std::to_string(records_.bytes) +
                  " bytes from byte " + std::to_string(records_.begin) + ", but has only " +
                  std::to_string(input_.size()) + " bytes; is it cut off?");
    }
  }

  /// Reads the variable length records between header and points.
  void read_records() {
    std::uint64_t at = header_bytes_;
    for (std::uint32_t i = 0; i < record_count_ && at + kRecordHeader <= records_.begin; ++i) {
      input_.seek(at);
      const std::string head = bytes(kRecordHeader);
      const std::string user = text_at(head, 2, 16);
      const auto id = number_at<std::uint16_t>(head, 18);
      const std::size_t size = number_at<std::uint16_t>(head, 20);
      at += kRecordHeader + size;
      if (at > records_.begin) input_.fail("has a record that reaches into the points; the file may be damaged");
      if (user == "LASF_Spec" && id == 4) read_extra_bytes(bytes(size));
      if (user == "LASF_Projection" && id == 2112) info_.wkt = text_at(bytes(size), 0, size);
      if (user == "LASF_Spec" && id == 3) {
        std::istringstream lines(text_at(bytes(size), 0, size));
        for (std::string line; std::getline(lines, line);) {
          if (!line.empty() && line.back() == '\r') line.pop_back();
          if (!line.empty()) info_.comments.push_back(line);
        }
      }
    }
  }

  void read_extra_bytes(const std::string& descriptors) {
    std::size_t place = extra_at_;
    for (std::size_t at = 0; at + kDescriptorBytes <= descriptors.size(); at += kDescriptorBytes) {
      const auto type = number_at<std::uint8_t>(descriptors, at + 2),
                 options = number_at<std::uint8_t>(descriptors, at + 3);
      const std::size_t kind = (type + kExtraTypes.size() - 1) % kExtraTypes.size();  // types from 11 on are arrays
      const std::size_t elements = type == 0 ? 0 : 1 + (type - 1U) / kExtraTypes.size();
      const std::size_t size = type == 0 ? options : elements * size_of(kExtraTypes[kind]);
      if (place + size > records_.bytes) return;
      const std::optional<CloudField> field = field_named(text_at(descriptors, at + 4, 32));
      if (field && elements == 1) {
        const auto scale = (options & 8U) != 0 ? number_at<double>(descriptors, at + 112) : 1.0;
        const auto shift = (options & 16U) != 0 ? number_at<double>(descriptors, at + 136) : 0.0;
        records_.numbers[*field] = {place, kExtraTypes[kind], scale, shift, true};
      }
      place += size;
    }
  }

  /// Colours have 16 bits, but many programs store 8-bit values; decided by the maximum of a sample.
  void find_levels() {
    constexpr std::uint64_t kSample = 1000;
    if (!records_.numbers[kRed].is_there) return;
    double most = 0.0;
    const std::uint64_t step = std::max<std::uint64_t>(records_.count / kSample, 1);
    for (std::uint64_t i = 0; i < records_.count; i += step) {
      input_.seek(records_.begin + i * records_.bytes);
      const CloudNumbers v = records_.numbers_of(input_.take(records_.bytes));
      most = std::max({most, v[kRed], v[kGreen], v[kBlue]});
    }
    records_.color_scale = most > 255.0 ? 1.0 / 257.0 : 1.0;
  }

  BinaryInput input_;
  PointRecords records_;
  std::size_t header_bytes_ = 0, extra_at_ = 0;
  std::uint32_t record_count_ = 0;
};

}  // namespace

std::unique_ptr<CloudReader> open_las_reader(const std::filesystem::path& path) {
  return std::make_unique<LasReader>(path);
}

}  // namespace pmsp
