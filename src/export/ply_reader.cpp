// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include "export/cloud_fields.h"
#include "io/text_input.h"
#include "pmsp/io/cloud.h"
#include "util/number_from.h"

namespace pmsp {
namespace {

using Type = NumberType;
enum class Format { kAscii, kLittleEndian, kBigEndian };

struct Property {
  std::string name;
  Type type = Type::kFloat;
  bool is_list = false;
  Type count_type = Type::kUint8;
};

struct Element {
  std::string name;
  std::int64_t count = 0;
  std::vector<Property> properties;
};

struct Header {
  Format format = Format::kAscii;
  std::vector<Element> elements;
  std::vector<std::string> comments;
};

constexpr std::size_t kMaxHeaderLine = 1 << 16;
constexpr std::size_t kMaxHeaderLines = 1 << 16;
constexpr std::size_t kMaxToken = 512;
constexpr const char* kContinued = "... ";

bool is_float(Type type) { return type == Type::kFloat || type == Type::kDouble; }

std::optional<Type> type_from_name(const std::string& name) {
  constexpr std::array<std::array<const char*, 2>, 8> kNames{{{"char", "int8"},
                                                              {"uchar", "uint8"},
                                                              {"short", "int16"},
                                                              {"ushort", "uint16"},
                                                              {"int", "int32"},
                                                              {"uint", "uint32"},
                                                              {"float", "float32"},
                                                              {"double", "float64"}}};
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (name == kNames[i][0] || name == kNames[i][1]) return static_cast<Type>(i);
  }
  return std::nullopt;
}

class HeaderParser {
 public:
  explicit HeaderParser(BinaryInput& input) : input_(input) {}

  Header parse() {
    if (next_line() != "ply") input_.fail("is no PLY: the first line is not \"ply\"");
    for (;;) {
      const std::string line = next_line();
      const std::vector<std::string> words = words_of(line, " \t");
      if (words.empty()) continue;
      if (words[0] == "end_header") break;
      if (words[0] == "comment") {
        if (words.size() > 1) add_comment(line.substr(line.find("comment") + 8));
      } else if (words[0] == "format") {
        format(words);
      } else if (words[0] == "element") {
        element(words);
      } else if (words[0] == "property") {
        property(words);
      } else if (words[0] != "obj_info") {
        fail("starts with \"" + words[0].substr(0, 40) +
             "\"; expected format, comment, element, property or end_header");
      }
    }
    if (!has_format_) input_.fail("has no format line in its header");
    return header_;
  }

 private:
  [[noreturn]] void fail(const std::string& what) { input_.fail("header line " + std::to_string(line_) + " " + what); }

  std::string next_line() {
    if (++line_ > kMaxHeaderLines) fail("exceeds the limit of lines before end_header");
    std::string line;
    if (!input_.line(line, kMaxHeaderLine)) fail("is cut off: the file ends before end_header");
    if (!line.empty() && line.back() == '\r') line.pop_back();
    return line;
  }

  // Joins lines that the writer in ply.cpp split ("... ").
  void add_comment(const std::string& text) {
    if (text.rfind(kContinued, 0) == 0 && !header_.comments.empty()) {
      header_.comments.back() += text.substr(std::string(kContinued).size());
    } else {
      header_.comments.push_back(text);
    }
  }

  void format(const std::vector<std::string>& words) {
    const std::string name = words.size() == 3 && words[2] == "1.0" ? words[1] : "";
    if (name == "ascii") {
      header_.format = Format::kAscii;
    } else if (name == "binary_little_endian") {
      header_.format = Format::kLittleEndian;
    } else if (name == "binary_big_endian") {
      header_.format = Format::kBigEndian;
    } else {
      fail("names an unknown format; expected ascii, binary_little_endian or binary_big_endian, and 1.0");
    }
    has_format_ = true;
  }

  void element(const std::vector<std::string>& words) {
    Element element;
    if (words.size() == 3) {
      const auto count = plain_number_from<std::int64_t>(words[2]);
      if (count && *count >= 0) {
        element.count = *count;
        element.name = words[1];
        header_.elements.push_back(element);
        return;
      }
    }
    fail("is no element with a count: expected \"element NAME COUNT\", COUNT a whole number >= 0");
  }

  void property(const std::vector<std::string>& words) {
    if (header_.elements.empty()) fail("is a property before any element");
    Property property;
    property.is_list = words.size() == 5 && words[1] == "list";
    if (!property.is_list && words.size() != 3) fail("is no property: expected \"property TYPE NAME\"");
    const std::optional<Type> type = type_from_name(words[words.size() - 2]);
    const std::optional<Type> count_type = property.is_list ? type_from_name(words[2]) : Type::kUint8;
    if (!type || !count_type || is_float(*count_type)) {
      fail("has an unknown type; expected char, uchar, short, ushort, int, uint, float or double");
    }
    property.name = words.back();
    property.type = *type;
    property.count_type = *count_type;
    std::vector<Property>& properties = header_.elements.back().properties;
    for (const Property& other : properties) {
      if (other.name == property.name) fail("repeats the property \"" + property.name.substr(0, 40) + "\"");
    }
    properties.push_back(property);
  }

  BinaryInput& input_;
  Header header_;
  std::size_t line_ = 0;
  bool has_format_ = false;
};

// Numbers of the body in sequence, for all formats.
class Body {
 public:
  Body(BinaryInput& input, Format format)
      : input_(input), ascii_(format == Format::kAscii), big_endian_(format == Format::kBigEndian) {}

  double number(Type type) { return ascii_ ? token() : load_number(input_.take(size_of(type)), type, big_endian_); }

  void skip_list(const Property& property) {
    const double count = number(property.count_type);
    if (!(count >= 0)) input_.refuse("a list with a negative length");
    check_size(count, property.type);
    for (auto left = static_cast<std::int64_t>(std::ceil(count)); left > 0; --left) number(property.type);
  }

  // Throws unless `count` numbers can still follow; to be called before allocating or looping.
  void check_size(double count, Type type) const {
    const double bytes = ascii_ ? 2.0 * count - 1.0 : count * static_cast<double>(size_of(type));
    if (bytes > static_cast<double>(input_.remaining())) input_.refuse("a list that is longer than the file");
  }

  void check_size(const Element& element) const {
    double bytes = 0.0;
    for (const Property& property : element.properties) {
      bytes += ascii_ ? 2.0 : static_cast<double>(size_of(property.is_list ? property.count_type : property.type));
    }
    if (element.count > 0 && element.properties.empty()) input_.fail("element " + element.name + " has no property");
    const double last = ascii_ && element.count > 0 ? 1.0 : 0.0;  // no separator after the last number
    if (bytes * static_cast<double>(element.count) - last > static_cast<double>(input_.remaining())) {
      input_.fail("announces " + std::to_string(element.count) + " of element " + element.name.substr(0, 40) +
                  ", but only " + std::to_string(input_.remaining()) + " bytes follow; is it cut off?");
    }
  }

 private:
  double token() {
    const std::string text = input_.word(kMaxToken);
    if (text.empty()) input_.require(1);
    const std::optional<double> value = number_from<double>(text);
    if (!value) input_.fail("\"" + text.substr(0, 40) + "\" before " + input_.here() + " is no number");
    return *value;
  }

  BinaryInput& input_;
  bool ascii_;
  bool big_endian_;
};

// Targets of the vertices' properties.
struct VertexLayout {
  std::array<const Property*, kCloudFields> property{};
  std::vector<int> slot;  // per property, -1 = unused

  bool has(CloudField first, int count) const {
    for (int i = 0; i < count; ++i) {
      if (property[static_cast<std::size_t>(first + i)] == nullptr) return false;
    }
    return true;
  }
};

VertexLayout layout_of(const Element& vertex, const BinaryInput& input) {
  constexpr std::array<const char*, kCloudFields> kNames{"x",   "y",     "z",    "nx",         "ny",   "nz",
                                                         "red", "green", "blue", "confidence", "views"};
  constexpr std::size_t kPrefix = sizeof("scalar_") - 1;  // absent in files of libpmsp before 0.2
  VertexLayout layout;
  for (const Property& property : vertex.properties) {
    const bool has_prefix = property.name == "scalar_confidence" || property.name == "scalar_views";
    const std::string name = has_prefix ? property.name.substr(kPrefix) : property.name;
    const auto* found = std::find(kNames.begin(), kNames.end(), name);
    const bool wanted = found != kNames.end() && !property.is_list;
    layout.slot.push_back(wanted ? static_cast<int>(found - kNames.begin()) : -1);
    if (wanted) layout.property[static_cast<std::size_t>(found - kNames.begin())] = &property;
  }
  if (!layout.has(kX, 3)) input.fail("element vertex lacks a property x, y or z");
  return layout;
}

void skip_element(const Element& element, Body& body) {
  for (std::int64_t i = 0; i < element.count; ++i) {
    for (const Property& property : element.properties) {
      if (property.is_list) {
        body.skip_list(property);
      } else {
        body.number(property.type);
      }
    }
  }
}

class PlyReader final : public CloudReader {
 public:
  explicit PlyReader(const std::filesystem::path& path) : input_(path), header_(HeaderParser(input_).parse()) {
    info_.format = "PLY";
    info_.comments = header_.comments;
    Body body(input_, header_.format);
    for (const Element& element : header_.elements) {
      body.check_size(element);
      if (element.name == "vertex") {
        vertex_ = &element;
        break;
      }
      skip_element(element, body);
    }
    if (vertex_ == nullptr) input_.fail("has no element vertex");
    begin_ = input_.position();
    layout_ = layout_of(*vertex_, input_);
    info_.points = vertex_->count;
    info_.has_normals = layout_.has(kNx, 3);
    info_.has_colors = layout_.has(kRed, 3);
    info_.has_confidence = layout_.has(kConfidence, 1);
    info_.has_views = layout_.has(kViews, 1);
    info_.double_positions = layout_.property[kX]->type == Type::kDouble;
    read_origin(info_);
  }

  void read(const Take& take) override {
    const bool unit_colors = info_.has_colors && is_float(layout_.property[kRed]->type);  // 0 to 1 instead of 0 to 255
    PointBatch batch(info_, unit_colors ? 255.0 : 1.0, take);
    input_.seek(begin_);
    Body body(input_, header_.format);
    CloudNumbers v{};
    for (std::int64_t i = 0; i < vertex_->count; ++i) {
      for (std::size_t p = 0; p < vertex_->properties.size(); ++p) {
        const Property& property = vertex_->properties[p];
        if (property.is_list) {
          body.skip_list(property);
          continue;
        }
        const double value = body.number(property.type);
        if (layout_.slot[p] >= 0) v[static_cast<std::size_t>(layout_.slot[p])] = value;
      }
      batch.add(v, input_);
    }
    batch.flush();
  }

 private:
  BinaryInput input_;
  Header header_;
  const Element* vertex_ = nullptr;
  std::uint64_t begin_ = 0;
  VertexLayout layout_;
};

}  // namespace

std::unique_ptr<CloudReader> open_ply_reader(const std::filesystem::path& path) {
  return std::make_unique<PlyReader>(path);
}

PlyCloud read_ply(const std::filesystem::path& path) {
  PlyReader reader(path);
  const CloudInfo& info = reader.info();
  const auto count = static_cast<std::size_t>(info.points);
  PlyCloud cloud;
  cloud.comments = info.comments;
  cloud.positions.reserve(count);
  if (info.has_normals) cloud.normals.reserve(count);
  if (info.has_colors) cloud.colors.reserve(count);
  if (info.has_confidence) cloud.confidence.reserve(count);
  if (info.has_views) cloud.views.reserve(count);
  reader.read([&](const OutputPoint* points, std::size_t number) {
    for (const OutputPoint* point = points; point != points + number; ++point) {
      cloud.positions.push_back(point->position);
      if (info.has_normals) cloud.normals.push_back(point->normal);
      if (info.has_colors) cloud.colors.push_back(point->color);
      if (info.has_confidence) cloud.confidence.push_back(point->confidence);
      if (info.has_views) cloud.views.push_back(point->views);
    }
  });
  return cloud;
}

}  // namespace pmsp
