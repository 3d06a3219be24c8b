// SPDX-License-Identifier: BSD-2-Clause
//
// Maps of OpenVSLAM and stella_vslam as MessagePack, https://github.com/msgpack/msgpack/blob/master/spec.md: cameras by
// name, keyframes and landmarks by id. The file is read once from front to back; descriptors and images, most of its
// bytes, are skipped.
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "binary_input.h"
#include "map_raw.h"

namespace pmsp::map_detail {
namespace {

/// Field that is read of a camera, keyframe or landmark.
struct Field {
  const char* key;
  const char* expected;
  bool is_required;
};
constexpr std::array<Field, 4> kCameraFields{{{"model_type", "a string", true},
                                              {"cols", "a whole number", true},
                                              {"rows", "a whole number", true},
                                              {"fps", "a number", true}}};
constexpr std::array<Field, 8> kKeyframeFields{{{"ts", "a number", true},
                                                {"src_frm_id", "a whole number >= 0", false},
                                                {"cam", "a string", true},
                                                {"rot_cw", "an array of 4 numbers (x, y, z, w)", true},
                                                {"trans_cw", "an array of 3 numbers", true},
                                                {"lm_ids", "an array of landmark ids", true},
                                                {"keypts", "an array of keypoints", false},
                                                {"undist_keypts", "an array of keypoints", false}}};
constexpr std::array<Field, 2> kLandmarkFields{
    {{"pos_w", "an array of 3 numbers", true}, {"color", "an array of 3 numbers", false}}};
constexpr const char* kPoint = "[x, y], two numbers";
constexpr const char* kPointField = "\"pt\": [x, y]";

enum class Kind { null, boolean, number, string, binary, array, map };

const char* name_of(Kind kind) {
  constexpr std::array<const char*, 7> kNames{"null",        "a boolean", "a number", "a string",
                                              "binary data", "an array",  "a map"};
  return kNames[static_cast<std::size_t>(kind)];
}

/// A value without its bytes, elements or pairs, which follow in the file.
struct Value {
  Kind kind = Kind::null;
  std::uint64_t size = 0;  ///< bytes of a string or of binary data, elements of an array, pairs of a map
  double number = 0.0;
  std::optional<std::int64_t> integer = std::nullopt;  ///< the number if it is whole
};

Value real(double number) {
  constexpr double kExact = 9007199254740992.0;  // 2^53: all integers up to here are doubles
  Value value{Kind::number, 0, number, std::nullopt};
  if (std::abs(number) <= kExact && std::floor(number) == number) value.integer = static_cast<std::int64_t>(number);
  return value;
}

Value whole(std::int64_t number) { return {Kind::number, 0, static_cast<double>(number), number}; }

Value whole(std::uint64_t number) {
  if (number <= static_cast<std::uint64_t>(INT64_MAX)) return whole(static_cast<std::int64_t>(number));
  return {Kind::number, 0, static_cast<double>(number)};
}

std::optional<std::int64_t> parse_id(const std::string& text) {
  if (text.empty() || text.size() > 18 || text.find_first_not_of("0123456789") != std::string::npos) return {};
  return std::stoll(text);
}

class MapReader {
 public:
  explicit MapReader(const std::filesystem::path& path) : in_(path) {
    map_.path = path;
    map_.dialect = Dialect::msgpack;
  }

  RawMap read() {
    for (std::uint64_t left = next(Kind::map, "a map").size; left > 0; --left) {
      section_ = key();
      const auto section = std::find_if(sections_.begin(), sections_.end(),
                                        [&](const Section& candidate) { return section_ == candidate.name; });
      if (section != sections_.end()) {
        read_section(*section);
        continue;
      }
      has_frame_next_id_ |= section_ == "frame_next_id";
      has_next_id_ |= section_ == "keyframe_next_id" || section_ == "landmark_next_id";
      has_orb_params_ |= section_ == "orb_params";
      has_dense_points_ |= section_ == "dense_points";
      skip();
    }
    if (in_.remaining() > 0) in_.refuse("more data after the end of the map, expected none");
    for (const Section& section : sections_) {
      if (section.is_read) continue;
      in_.fail(std::string("has no \"") + section.name +
               "\": expected cameras, keyframes and landmarks, as in a map of OpenVSLAM or stella_vslam");
    }
    map_.format = format() + ", MessagePack";
    map_.keypoint_field = has_undistorted_ ? "undist_keypts" : "keypts";
    map_.pixels_in_another_grid = has_color_ && !has_next_id_;
    return std::move(map_);
  }

 private:
  struct Section {
    const char* name;
    void (MapReader::*read_entry)();
    bool is_read = false;
  };

  // ---- values

  [[noreturn]] void fail(const std::string& what) const { pmsp::fail(map_.path, where(), what); }
  [[noreturn]] void wrong_type(const char* expected, const std::string& found) const {
    fail(std::string("expected ") + expected + ", found " + found);
  }
  [[noreturn]] void broken(const std::string& what) const {
    in_.refuse("broken MessagePack data" + inside() + " (" + what + ")");
  }

  std::string where() const {
    if (entry_.empty() && field_.empty()) return section_.empty() ? "" : in_quotes(section_);
    const std::string index = index_ ? "[" + std::to_string(*index_) + "]" : "";
    return place(Dialect::msgpack, section_, entry_, field_) + index;
  }
  std::string inside() const { return where().empty() ? "" : " inside " + where(); }

  void require(std::uint64_t bytes) const {
    if (bytes <= in_.remaining()) return;
    pmsp::fail(map_.path, "byte " + std::to_string(in_.size()),
               "the file ends" + inside() + " before the map is complete: it is truncated; copy it again");
  }
  /// Checks the size of a string or of binary data: at most the rest of the file and 1 MiB.
  void check_bytes(std::uint64_t bytes) const {
    require(bytes);
    if (bytes > std::uint64_t{1} << 20) {
      in_.refuse("a string or binary block of more than a mebibyte, expected no such thing in a map");
    }
  }

  template <class T>
  T big() {
    require(sizeof(T));
    return get_big<T>(in_.take(sizeof(T)));
  }
  /// Reads a size of 1, 2 or 4 bytes for `code` 0, 1 or 2.
  std::uint64_t size(unsigned code) {
    return code == 0 ? big<std::uint8_t>() : code == 1 ? big<std::uint16_t>() : big<std::uint32_t>();
  }

  Value head() {
    const unsigned first = big<std::uint8_t>();
    if (first < 0x80) return whole(std::uint64_t{first});
    if (first < 0x90) return {Kind::map, first & 0x0FU};
    if (first < 0xA0) return {Kind::array, first & 0x0FU};
    if (first < 0xC0) return {Kind::string, first & 0x1FU};
    if (first >= 0xE0) return whole(std::int64_t{static_cast<std::int8_t>(first)});
    switch (first) {
      case 0xC0:
        return {Kind::null};
      case 0xC1:
        broken("0xc1 begins no value");
      case 0xC2:
      case 0xC3:
        return {Kind::boolean};
      case 0xCA:
        return real(static_cast<double>(big<float>()));
      case 0xCB:
        return real(big<double>());
      case 0xCC:
      case 0xCD:
      case 0xCE:
        return whole(size(first - 0xCC));
      case 0xCF:
        return whole(big<std::uint64_t>());
      case 0xD0:
        return whole(std::int64_t{big<std::int8_t>()});
      case 0xD1:
        return whole(std::int64_t{big<std::int16_t>()});
      case 0xD2:
        return whole(std::int64_t{big<std::int32_t>()});
      case 0xD3:
        return whole(big<std::int64_t>());
      default:
        break;
    }
    if (first < 0xC7) return {Kind::binary, size(first - 0xC4)};
    if (first < 0xCA) return {Kind::binary, 1 + size(first - 0xC7)};  // the first byte is a type
    if (first < 0xD9) return {Kind::binary, 1 + (1U << (first - 0xD4))};
    if (first < 0xDC) return {Kind::string, size(first - 0xD9)};
    return {first < 0xDE ? Kind::array : Kind::map, size(1 + (first & 1U))};
  }

  Value next() {
    const Value value = head();
    if (value.kind == Kind::string || value.kind == Kind::binary) check_bytes(value.size);
    return value;
  }

  Value next(Kind kind, const char* expected) {
    const Value value = next();
    if (value.kind != kind) wrong_type(expected, name_of(value.kind));
    return value;
  }

  /// Returns the bytes of a string; valid until the next value.
  std::string_view text(const Value& value) {
    const auto bytes = static_cast<std::size_t>(value.size);
    return {in_.take(bytes), bytes};
  }
  std::string_view key() {
    const Value value = next();
    if (value.kind != Kind::string) broken(std::string("a key is ") + name_of(value.kind) + ", expected a string");
    return text(value);
  }

  /// Skips a value and its elements.
  void skip() {
    for (std::uint64_t left = 1; left > 0; --left) {
      const Value value = next();
      if (value.kind == Kind::string || value.kind == Kind::binary) in_.skip(value.size);
      if (value.kind == Kind::array) left += value.size;
      if (value.kind == Kind::map) left += 2 * value.size;
      require(left - 1);  // each has at least one byte
    }
  }

  double number(const char* expected) { return next(Kind::number, expected).number; }
  std::int64_t integer(const char* expected) {
    const Value value = next(Kind::number, expected);
    if (!value.integer) wrong_type(expected, "the number " + std::to_string(value.number));
    return *value.integer;
  }

  template <std::size_t N>
  void numbers(double* to, const char* expected) {
    const std::uint64_t count = next(Kind::array, expected).size;
    if (count != N) wrong_type(expected, "one of " + std::to_string(count));
    for (std::size_t i = 0; i < N; ++i) to[i] = number("a number");
  }

  /// Calls read() for each element of a list. Null is an empty list, as some programs write it.
  template <class Read>
  void each_element(const char* expected, const Read& read) {
    const Value list = next();
    if (list.kind != Kind::array && list.kind != Kind::null) wrong_type(expected, name_of(list.kind));
    if (list.size > kMaxKeypoints) {
      fail("claims " + std::to_string(list.size) + " elements, expected at most " + std::to_string(kMaxKeypoints));
    }
    for (index_ = 0; *index_ < list.size; ++*index_) read();
    index_.reset();
  }

  // ---- sections and their entries

  void read_section(Section& section) {
    if (section.is_read) pmsp::fail(map_.path, section.name, "appears twice, expected once");
    section.is_read = true;
    const Value head = next();
    if (head.kind != Kind::map && head.kind != Kind::null) wrong_type("a map", name_of(head.kind));
    for (std::uint64_t left = head.size; left > 0; --left) {
      entry_ = key();
      (this->*section.read_entry)();
    }
    entry_.clear();
  }

  std::int64_t id() const {
    const std::optional<std::int64_t> id = parse_id(entry_);
    if (!id) fail("the key is no id, expected a number >= 0 in decimal digits");
    return *id;
  }

  /// Calls read(field), which reads the value, for each of `fields` in a map. Skips others.
  template <std::size_t N, class Read>
  void each_field(const std::array<Field, N>& fields, const Read& read) {
    std::array<bool, N> seen{};
    for (std::uint64_t left = next(Kind::map, "a map").size; left > 0; --left) {
      field_ = key();
      const auto field =
          std::find_if(fields.begin(), fields.end(), [&](const Field& candidate) { return field_ == candidate.key; });
      if (field == fields.end()) {
        skip();
        continue;
      }
      bool& is_seen = seen[static_cast<std::size_t>(field - fields.begin())];
      if (is_seen) fail("appears twice, expected once");
      is_seen = true;
      read(*field);
    }
    for (std::size_t i = 0; i < N; ++i) {
      if (!fields[i].is_required || seen[i]) continue;
      field_ = fields[i].key;
      wrong_type(fields[i].expected, "no such key");
    }
    field_.clear();
  }

  void read_camera() {
    RawCamera camera;
    camera.name = entry_;
    each_field(kCameraFields, [&](const Field& field) {
      if (field_ == "model_type") {
        camera.model = text(next(Kind::string, field.expected));
      } else if (field_ == "cols") {
        camera.cols = integer(field.expected);
      } else if (field_ == "rows") {
        camera.rows = integer(field.expected);
      } else {
        camera.fps = number(field.expected);
      }
    });
    map_.cameras.push_back(std::move(camera));
  }

  void read_landmark() {
    MapLandmark landmark;
    landmark.id = id();
    each_field(kLandmarkFields, [&](const Field& field) {
      if (field_ == "pos_w") {
        numbers<3>(landmark.position_world.data(), field.expected);
      } else {
        has_color_ = true;
        skip();
      }
    });
    map_.landmarks.push_back(landmark);
  }

  void read_keyframe() {
    RawKeyframe keyframe;
    keyframe.keyframe.id = id();
    bool has_keypoints = false;
    bool has_undistorted = false;
    landmark_ids_.clear();
    keypoints_.clear();
    each_field(kKeyframeFields, [&](const Field& field) {
      if (field_ == "ts") {
        keyframe.keyframe.timestamp = number(field.expected);
      } else if (field_ == "src_frm_id") {
        keyframe.keyframe.source_frame = integer(field.expected);
        if (*keyframe.keyframe.source_frame < 0) wrong_type(field.expected, "a negative number");
      } else if (field_ == "cam") {
        keyframe.camera = text(next(Kind::string, field.expected));
      } else if (field_ == "rot_cw") {
        numbers<4>(keyframe.rotation_xyzw.data(), field.expected);
      } else if (field_ == "trans_cw") {
        numbers<3>(keyframe.translation.data(), field.expected);
      } else if (field_ == "lm_ids") {
        each_element(field.expected, [&] { landmark_ids_.push_back(integer("a whole number")); });
      } else {
        has_keypoints = true;
        // Undistorted keypoints if there are both: the SLAM estimated its poses from them.
        if (has_undistorted) return skip();
        has_undistorted = field_ == "undist_keypts";
        keypoints_.clear();
        each_element(field.expected, [&] { keypoints_.push_back(keypoint()); });
      }
    });
    has_undistorted_ |= has_undistorted;
    if (!has_keypoints) fail("has no keypoints, expected undist_keypts or keypts");
    if (landmark_ids_.size() != keypoints_.size()) {
      field_ = "lm_ids";
      fail("has " + std::to_string(landmark_ids_.size()) + " elements where there are " +
           std::to_string(keypoints_.size()) + " keypoints, expected one for each");
    }
    set_observations(keyframe.keyframe, landmark_ids_, [&](std::size_t i) { return keypoints_[i]; });
    map_.keyframes.push_back(std::move(keyframe));
  }

  /// [x, y] or {"pt": [x, y], ...}
  Eigen::Vector2f keypoint() {
    const Value head = next();
    if (head.kind == Kind::array) {
      has_keypoint_arrays_ = true;
      return point(head);
    }
    if (head.kind != Kind::map) wrong_type("[x, y] or {\"pt\": [x, y]}", name_of(head.kind));
    std::optional<Eigen::Vector2f> pixel;
    for (std::uint64_t left = head.size; left > 0; --left) {
      if (key() != "pt") {
        skip();
        continue;
      }
      if (pixel) wrong_type(kPointField, "it twice");
      pixel = point(next(Kind::array, kPointField));
    }
    if (!pixel) wrong_type(kPointField, "none");
    return *pixel;
  }

  Eigen::Vector2f point(const Value& array) {
    if (array.size != 2) wrong_type(kPoint, array.size < 2 ? "fewer numbers" : "more numbers");
    const double x = number(kPoint);
    return {static_cast<float>(x), static_cast<float>(number(kPoint))};
  }

  /// Returns the program that wrote the file, recognized by its keys.
  std::string format() const {
    if (has_dense_points_) return "stella_vslam_dense";
    if (has_undistorted_) {
      return has_keypoint_arrays_ ? "stella_vslam 0.3.2 to 0.3.3"
             : has_frame_next_id_ ? "stella_vslam 0.3.4 to 0.3.5"
                                  : "stella_vslam >= 0.3.6";
    }
    if (has_orb_params_) return "stella_vslam 0.3.0 to 0.3.1";
    if (!has_color_) return "OpenVSLAM";
    return has_next_id_ ? "PatchMatch-Stereo-Panorama" : "PatchMatch-Stereo-Panorama, dense points";
  }

  BinaryInput in_;
  RawMap map_;
  std::array<Section, 3> sections_{{{"cameras", &MapReader::read_camera},
                                    {"keyframes", &MapReader::read_keyframe},
                                    {"landmarks", &MapReader::read_landmark}}};

  // Place in the file: keyframes["12"].lm_ids[7].
  std::string section_, entry_, field_;
  std::optional<std::uint64_t> index_;

  std::vector<std::int64_t> landmark_ids_;  ///< of a keyframe
  std::vector<Eigen::Vector2f> keypoints_;

  bool has_frame_next_id_ = false, has_next_id_ = false, has_orb_params_ = false, has_dense_points_ = false;
  bool has_color_ = false, has_undistorted_ = false, has_keypoint_arrays_ = false;
};

}  // namespace

RawMap read_msgpack(const std::filesystem::path& path) { return MapReader(path).read(); }

}  // namespace pmsp::map_detail
