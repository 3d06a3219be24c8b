// SPDX-License-Identifier: BSD-2-Clause
// LAS 1.4 - R15 (ASPRS, 2019): the public header, variable length records, point data record format 7.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <mutex>
#include <string>

#include "export/integer_frame.h"
#include "export/little_endian.h"
#include "export/record_file.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud.h"
#include "util/text.h"

namespace pmsp {
namespace {

using Integers = std::array<std::int32_t, 3>;

constexpr std::uint16_t kHeaderBytes = 375;
constexpr std::uint16_t kFormat7Bytes = 36;
constexpr std::uint16_t kExtraBytes = 4 * sizeof(float) + 1;
constexpr std::uint16_t kRecordBytes = kFormat7Bytes + kExtraBytes;
constexpr std::uint16_t kWktBit = 1 << 4;  // global encoding; formats 6 and up have WKT only
constexpr std::int64_t kBoundsOffset = 179;
constexpr std::int64_t kCountOffset = 247;
constexpr std::size_t kReturns = 15;
constexpr std::size_t kMostInRecord = 65535;

std::string padded(std::string text, std::size_t bytes) {
  text.resize(bytes, '\0');
  return text;
}

/// Variable length record.
std::string record(const char* user, std::uint16_t id, const char* description, const std::string& data) {
  std::string text;
  append_little(text, std::uint16_t{0});
  text += padded(user, 16);
  append_little(text, id);
  append_little(text, static_cast<std::uint16_t>(data.size()));
  return text + padded(description, 32) + data;
}

/// Descriptor of an extra-bytes field.
std::string extra_bytes(std::uint8_t type, const char* name, const char* description) {
  std::string text;
  append_little(text, std::uint16_t{0});
  append_little(text, type);
  append_little(text, std::uint8_t{0});  // options: neither range nor scale
  text += padded(name, 32);
  text.append(4 + 5 * 24, '\0');
  return text + padded(description, 32);
}

std::string records(const std::filesystem::path& path, const CloudHeader& header, std::uint32_t& count) {
  constexpr std::uint8_t kUint8Type = 1, kFloatType = 9;
  std::string text =
      record("LASF_Spec", 4, "Extra bytes",
             extra_bytes(kFloatType, "NormalX", "unit normal") + extra_bytes(kFloatType, "NormalY", "") +
                 extra_bytes(kFloatType, "NormalZ", "") + extra_bytes(kFloatType, "confidence", "0 to 1") +
                 extra_bytes(kUint8Type, "views", "depth maps that agree"));
  count = 1;
  std::string lines;
  for (const std::string& comment : header.comments) lines += comment + "\n";
  if (!lines.empty()) {
    text += record("LASF_Spec", 3, "How this cloud was made", lines.substr(0, kMostInRecord - 1) + '\0');
    ++count;
  }
  if (!header.wkt.empty()) {
    if (header.wkt.size() + 1 > kMostInRecord) {
      throw OutputError(path.string() + ": the coordinate system takes " + std::to_string(header.wkt.size()) +
                        " bytes as WKT, LAS stores at most " + std::to_string(kMostInRecord - 1) +
                        "; give a shorter text");
    }
    text += record("LASF_Projection", 2112, "OGC WKT", header.wkt + '\0');
    ++count;
  }
  return text;
}

class Las final : public CloudWriter {
 public:
  Las(const std::filesystem::path& path, const CloudHeader& header)
      : name_(path.string()),
        frame_(integer_frame(header)),
        file_(path, first_bytes(path, header), kRecordBytes, header.threads) {}

  void add(const OutputPoint* points, std::size_t count) override { file_.add(points, count, encoder()); }

  bool add_parallel(std::size_t count, const PointProducer& producer) override {
    file_.add(count, producer, encoder());
    return true;
  }

  void finish() override {
    file_.patch(kBoundsOffset, bounds());
    file_.patch(kCountOffset, counts(file_.points()));
    file_.commit();
  }

 private:
  std::string first_bytes(const std::filesystem::path& path, const CloudHeader& header) const {
    std::uint32_t record_count = 0;
    const std::string variable = records(path, header, record_count);
    std::string text = "LASF";
    append_little(text, std::uint16_t{0});  // file source id
    append_little(text, kWktBit);
    text.append(16, '\0');  // project id
    append_little(text, std::uint8_t{1});
    append_little(text, std::uint8_t{4});
    text += padded("OTHER", 32) + padded(header.generator.substr(0, 31), 32);
    append_little(text, static_cast<std::uint16_t>(header.day_of_year));
    append_little(text, static_cast<std::uint16_t>(header.year));
    append_little(text, kHeaderBytes);
    append_little(text, static_cast<std::uint32_t>(kHeaderBytes + variable.size()));
    append_little(text, record_count);
    append_little(text, std::uint8_t{7});
    append_little(text, kRecordBytes);
    text.append(6 * sizeof(std::uint32_t), '\0');  // legacy counts, 0 for formats 6 and up
    for (int i = 0; i < 3; ++i) append_little(text, frame_.scale);
    for (int i = 0; i < 3; ++i) append_little(text, frame_.offset[i]);
    text += bounds();
    text.append(sizeof(std::uint64_t) + sizeof(std::uint64_t) + sizeof(std::uint32_t), '\0');  // waveforms, EVLRs
    return text + counts(0) + variable;
  }

  std::string bounds() const {
    std::string text;
    for (std::size_t i = 0; i < 3; ++i) {
      const bool is_empty = low_[i] > high_[i];
      const auto value = [&](std::int32_t at) { return is_empty ? 0.0 : frame_.coordinate(at, static_cast<int>(i)); };
      append_little(text, value(high_[i]));
      append_little(text, value(low_[i]));
    }
    return text;
  }

  static std::string counts(std::int64_t points) {
    std::string text;
    append_little(text, static_cast<std::uint64_t>(points));
    append_little(text, static_cast<std::uint64_t>(points));  // first returns, the only ones
    for (std::size_t i = 1; i < kReturns; ++i) append_little(text, std::uint64_t{0});
    return text;
  }

  std::function<void(const OutputPoint*, std::size_t, char*)> encoder() {
    return [this](const OutputPoint* first, std::size_t number, char* to) {
      Integers low, high;
      low.fill(std::numeric_limits<std::int32_t>::max());
      high.fill(std::numeric_limits<std::int32_t>::min());
      for (const OutputPoint* point = first; point != first + number; ++point) to = put(*point, to, low, high);
      const std::lock_guard<std::mutex> lock(mutex_);
      for (std::size_t i = 0; i < 3; ++i) {
        low_[i] = std::min(low_[i], low[i]);
        high_[i] = std::max(high_[i], high[i]);
      }
    };
  }

  char* put(const OutputPoint& point, char* to, Integers& low, Integers& high) const {
    for (int i = 0; i < 3; ++i) {
      const double steps = frame_.steps(point.position[i], i);
      if (!(std::abs(steps) <= std::numeric_limits<std::int32_t>::max())) refuse(point);
      const auto value = static_cast<std::int32_t>(steps);
      const auto axis = static_cast<std::size_t>(i);
      low[axis] = std::min(low[axis], value);
      high[axis] = std::max(high[axis], value);
      to = put_little(to, value);
    }
    to = put_little(to, std::uint16_t{0});    // intensity
    to = put_little(to, std::uint8_t{0x11});  // return 1 of 1
    to = put_little(to, std::uint8_t{0});     // flags
    to = put_little(to, std::uint8_t{0});     // class: never classified
    to = put_little(to, std::uint8_t{0});     // user data
    to = put_little(to, std::int16_t{0});     // scan angle
    to = put_little(to, std::uint16_t{0});    // point source
    to = put_little(to, 0.0);                 // GPS time
    for (const std::uint8_t value : {point.color.r, point.color.g, point.color.b}) {
      to = put_little(to, static_cast<std::uint16_t>(value * 257));
    }
    for (int i = 0; i < 3; ++i) to = put_little(to, point.normal[i]);
    to = put_little(to, point.confidence);
    return put_little(to, point.views);
  }

  [[noreturn]] void refuse(const OutputPoint& point) const {
    throw OutputError(name_ + ": point " + std::to_string(point.position.x()) + " " +
                      std::to_string(point.position.y()) + " " + std::to_string(point.position.z()) +
                      " is out of range for a resolution of " + number_text(frame_.scale) +
                      "; give a larger --resolution, or exclude it with --crop");
  }

  std::string name_;
  IntegerFrame frame_;
  std::mutex mutex_;
  Integers low_{std::numeric_limits<std::int32_t>::max(), std::numeric_limits<std::int32_t>::max(),
                std::numeric_limits<std::int32_t>::max()};
  Integers high_{std::numeric_limits<std::int32_t>::min(), std::numeric_limits<std::int32_t>::min(),
                 std::numeric_limits<std::int32_t>::min()};
  RecordFile file_;
};

}  // namespace

std::unique_ptr<CloudWriter> open_las(const std::filesystem::path& path, const CloudHeader& header) {
  return std::make_unique<Las>(path, header);
}

}  // namespace pmsp
