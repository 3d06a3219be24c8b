// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <optional>
#include <string>
#include <system_error>

#include "pmsp/error.h"
#include "pmsp/io/files.h"
#include "pmsp/io/ply.h"

namespace pmsp {
namespace {

enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };
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

std::size_t size_of(Type type) {
  constexpr std::array<std::size_t, 8> kSizes{1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<std::size_t>(type)];
}

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

template <class T>
double load(const unsigned char* bytes, bool swap) {
  unsigned char ordered[sizeof(T)];
  std::memcpy(ordered, bytes, sizeof(T));
  if (swap) std::reverse(ordered, ordered + sizeof(T));
  T value;
  std::memcpy(&value, ordered, sizeof(T));
  return static_cast<double>(value);
}

double load(const unsigned char* bytes, Type type, bool swap) {
  switch (type) {
    case Type::kInt8:
      return load<std::int8_t>(bytes, swap);
    case Type::kUint8:
      return load<std::uint8_t>(bytes, swap);
    case Type::kInt16:
      return load<std::int16_t>(bytes, swap);
    case Type::kUint16:
      return load<std::uint16_t>(bytes, swap);
    case Type::kInt32:
      return load<std::int32_t>(bytes, swap);
    case Type::kUint32:
      return load<std::uint32_t>(bytes, swap);
    case Type::kFloat:
      return load<float>(bytes, swap);
    case Type::kDouble:
      break;
  }
  return load<double>(bytes, swap);
}

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> words;
  std::size_t at = 0;
  while ((at = line.find_first_not_of(" \t", at)) != std::string::npos) {
    const std::size_t end = std::min(line.find_first_of(" \t", at), line.size());
    words.push_back(line.substr(at, end - at));
    at = end;
  }
  return words;
}

// The file as a stream of lines, tokens or bytes, through a buffer of fixed size.
class Input {
 public:
  explicit Input(const std::filesystem::path& path) : name_(path.string()) {
    require_regular_file(path);
    std::error_code error;
    stream_.open(path, std::ios::binary);
    size_ = std::filesystem::file_size(path, error);
    if (!stream_ || error) throw IoError(name_ + ": cannot be opened for reading");
    buffer_.resize(std::size_t{1} << 20);
  }

  [[noreturn]] void fail(const std::string& what) const { throw InvalidInput(name_ + ": " + what); }
  std::string here() const { return "byte " + std::to_string(position()); }
  std::uint64_t position() const { return consumed_ + at_; }
  std::uint64_t remaining() const { return size_ > position() ? size_ - position() : 0; }

  int get() {
    if (at_ == end_ && !refill()) return -1;
    return buffer_[at_++];
  }

  // At most buffer-size bytes; valid until the next call.
  const unsigned char* take(std::size_t bytes) {
    while (end_ - at_ < bytes) {
      if (!refill()) fail("ends at byte " + std::to_string(size_) + ", in the middle of the data");
    }
    at_ += bytes;
    return buffer_.data() + at_ - bytes;
  }

 private:
  bool refill() {
    std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(at_), buffer_.begin() + static_cast<std::ptrdiff_t>(end_),
              buffer_.begin());
    consumed_ += at_;
    end_ -= at_;
    at_ = 0;
    stream_.read(reinterpret_cast<char*>(buffer_.data() + end_), static_cast<std::streamsize>(buffer_.size() - end_));
    const std::streamsize got = stream_.gcount();
    end_ += static_cast<std::size_t>(got);
    return got > 0;
  }

  std::string name_;
  std::ifstream stream_;
  std::uint64_t size_ = 0;
  std::uint64_t consumed_ = 0;
  std::vector<unsigned char> buffer_;
  std::size_t at_ = 0;
  std::size_t end_ = 0;
};

class HeaderParser {
 public:
  explicit HeaderParser(Input& input) : input_(input) {}

  Header parse() {
    if (next_line() != "ply") input_.fail("is no PLY: the first line is not \"ply\"");
    for (;;) {
      const std::string line = next_line();
      const std::vector<std::string> words = split(line);
      if (words.empty()) continue;
      if (words[0] == "end_header") break;
      if (words[0] == "comment") {
        if (words.size() > 1) header_.comments.push_back(line.substr(line.find("comment") + 8));
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
    if (++line_ > kMaxHeaderLines) fail("follows, and still no end_header");
    std::string line;
    for (int c = input_.get(); c != '\n'; c = input_.get()) {
      if (c < 0) fail("is cut off: the file ends before end_header");
      line.push_back(static_cast<char>(c));
      if (line.size() > kMaxHeaderLine) fail("is longer than " + std::to_string(kMaxHeaderLine) + " characters");
    }
    if (!line.empty() && line.back() == '\r') line.pop_back();
    return line;
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
      const std::string& digits = words[2];
      const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), element.count);
      if (error == std::errc() && end == digits.data() + digits.size() && element.count >= 0) {
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
    if (!type || !count_type || *count_type == Type::kFloat || *count_type == Type::kDouble) {
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

  Input& input_;
  Header header_;
  std::size_t line_ = 0;
  bool has_format_ = false;
};

// Numbers of the body, one after the other, whatever the format.
class Body {
 public:
  Body(Input& input, Format format) : input_(input), ascii_(format == Format::kAscii) {
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
    swap_ = format == Format::kLittleEndian;
#else
    swap_ = format == Format::kBigEndian;
#endif
  }

  double number(Type type) { return ascii_ ? token() : load(input_.take(size_of(type)), type, swap_); }

  void skip_list(const Property& property) {
    const double count = number(property.count_type);
    if (!(count >= 0)) input_.fail(input_.here() + ": a list with a negative length");
    check_size(count, property.type);
    for (auto left = static_cast<std::int64_t>(std::ceil(count)); left > 0; --left) number(property.type);
  }

  // Whether `count` numbers can still follow; asked before anything of that size is allocated or looped over.
  void check_size(double count, Type type) const {
    const double bytes = ascii_ ? 2.0 * count - 1.0 : count * static_cast<double>(size_of(type));
    if (bytes > static_cast<double>(input_.remaining())) too_large();
  }

  void check_size(const Element& element) const {
    double bytes = 0.0;
    for (const Property& property : element.properties) {
      bytes += ascii_ ? 2.0 : static_cast<double>(size_of(property.is_list ? property.count_type : property.type));
    }
    if (element.count > 0 && element.properties.empty()) input_.fail("element " + element.name + " has no property");
    const double last = ascii_ && element.count > 0 ? 1.0 : 0.0;  // the last number needs no blank behind it
    if (bytes * static_cast<double>(element.count) - last > static_cast<double>(input_.remaining())) {
      input_.fail("announces " + std::to_string(element.count) + " of element " + element.name.substr(0, 40) +
                  ", but only " + std::to_string(input_.remaining()) + " bytes follow; is it cut off?");
    }
  }

 private:
  [[noreturn]] void too_large() const { input_.fail(input_.here() + ": a list that is longer than the file"); }

  double token() {
    int c = input_.get();
    while (c == ' ' || c == '\t' || c == '\n' || c == '\r') c = input_.get();
    std::string text;
    while (c >= 0 && c != ' ' && c != '\t' && c != '\n' && c != '\r' && text.size() < kMaxToken) {
      text.push_back(static_cast<char>(c));
      c = input_.get();
    }
    if (text.empty()) input_.fail("ends at " + input_.here() + ", in the middle of the data");
    const char* first = text.data() + (text[0] == '+' ? 1 : 0);
    double value = 0.0;
    const auto [end, error] = std::from_chars(first, text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) {
      input_.fail("\"" + text.substr(0, 40) + "\" before " + input_.here() + " is no number");
    }
    return value;
  }

  Input& input_;
  bool ascii_;
  bool swap_ = false;
};

// Where a property of the vertices goes.
enum Slot { kX, kY, kZ, kNx, kNy, kNz, kRed, kGreen, kBlue, kConfidence, kViews, kSlots };

struct VertexLayout {
  std::array<const Property*, kSlots> property{};
  std::vector<int> slot;  // of each property, -1 = not wanted

  bool has(Slot first, int count) const {
    for (int i = 0; i < count; ++i) {
      if (property[static_cast<std::size_t>(first + i)] == nullptr) return false;
    }
    return true;
  }
};

VertexLayout layout_of(const Element& vertex, const Input& input) {
  constexpr std::array<const char*, kSlots> kNames{"x",   "y",     "z",    "nx",         "ny",   "nz",
                                                   "red", "green", "blue", "confidence", "views"};
  constexpr std::size_t kPrefix = sizeof("scalar_") - 1;  // before 0.2, our files had no such prefix
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

std::uint8_t to_byte(double value) {
  return static_cast<std::uint8_t>(value >= 255.0 ? 255.0 : value > 0.0 ? value + 0.5 : 0.0);
}

void read_vertices(const Element& vertex, Body& body, Input& input, PlyCloud& cloud) {
  const VertexLayout layout = layout_of(vertex, input);
  const bool normals = layout.has(kNx, 3);
  const bool colors = layout.has(kRed, 3);
  const bool confidence = layout.has(kConfidence, 1);
  const bool views = layout.has(kViews, 1);
  const bool unit_colors = colors && layout.property[kRed]->type >= Type::kFloat;  // 0 to 1 instead of 0 to 255
  const std::size_t count = static_cast<std::size_t>(vertex.count);
  cloud.positions.reserve(count);
  if (normals) cloud.normals.reserve(count);
  if (colors) cloud.colors.reserve(count);
  if (confidence) cloud.confidence.reserve(count);
  if (views) cloud.views.reserve(count);
  std::array<double, kSlots> v{};
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t p = 0; p < vertex.properties.size(); ++p) {
      const Property& property = vertex.properties[p];
      if (property.is_list) {
        body.skip_list(property);
        continue;
      }
      const double value = body.number(property.type);
      if (layout.slot[p] >= 0) v[static_cast<std::size_t>(layout.slot[p])] = value;
    }
    const Eigen::Vector3d position(v[kX], v[kY], v[kZ]);
    if (!position.allFinite()) {
      input.fail("vertex " + std::to_string(i) + ", before " + input.here() + ", has a position that is not finite");
    }
    cloud.positions.push_back(position);
    if (normals) cloud.normals.push_back(Eigen::Vector3d(v[kNx], v[kNy], v[kNz]).cast<float>());
    const double scale = unit_colors ? 255.0 : 1.0;
    if (colors) {
      cloud.colors.push_back({to_byte(v[kRed] * scale), to_byte(v[kGreen] * scale), to_byte(v[kBlue] * scale)});
    }
    if (confidence) cloud.confidence.push_back(static_cast<float>(v[kConfidence]));
    if (views) cloud.views.push_back(to_byte(v[kViews]));
  }
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

}  // namespace

PlyCloud read_ply(const std::filesystem::path& path) {
  Input input(path);
  const Header header = HeaderParser(input).parse();
  PlyCloud cloud;
  cloud.comments = header.comments;
  Body body(input, header.format);
  for (const Element& element : header.elements) {
    body.check_size(element);
    if (element.name == "vertex") {
      read_vertices(element, body, input, cloud);
      return cloud;
    }
    skip_element(element, body);
  }
  input.fail("has no element vertex");
}

}  // namespace pmsp
