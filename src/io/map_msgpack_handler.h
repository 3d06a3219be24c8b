// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "map_byte_source.h"
#include "map_raw.h"

namespace pmsp::map_detail {

/// The sections of a map that are read.
enum class Section { other, cameras, keyframes, landmarks };
const char* name_of(Section section);  ///< its key; "" for others

/// The fields of a section's entries that are read; `other` ones are skipped, whatever they hold.
enum class Field {
  other,
  model_type,
  cols,
  rows,
  fps,
  timestamp,
  source_frame,
  camera,
  rotation,
  translation,
  landmark_ids,
  keypts,
  undist_keypts,
  position,
  color,
};

/// Where the parser stands. Each state but `start` lies inside the one that it returns to.
enum class State {
  start,
  root,             ///< inside the file's one map
  section,          ///< inside cameras, keyframes or landmarks
  entry,            ///< inside one camera, keyframe or landmark
  numbers,          ///< inside rot_cw, trans_cw or pos_w
  landmark_ids,     ///< inside lm_ids
  keypoints,        ///< inside the list of keypoints
  keypoint_object,  ///< inside one keypoint, {"pt": [x, y], ...}
  point,            ///< inside [x, y], of either kind of keypoint
  done,
};

/// Whether a field of a section's entries is read.
bool is_read(Section section, const std::string& key);

/// Keys and values that were there: they tell which program has written a file.
struct MapFlags {
  bool frame_next_id = false;
  bool next_id = false;
  bool orb_params = false;
  bool dense_points = false;
  bool color = false;
  bool undist_keypts = false;
  bool keypoint_arrays = false;
};

struct Number {
  double value = 0.0;
  std::optional<std::int64_t> integer;  ///< if it is one
};

/// Takes the parser's events and keeps what a RawMap needs. Everything else (descriptors, images, the spanning tree) is
/// counted in and out of `skip_depth_` and forgotten.
class MapHandler {
 public:
  MapHandler(RawMap& map, ByteSource& source) : map_(map), source_(source) {}

  /// Called where the source stands at the keyframes or landmarks, to take them and leave a nil. Not set: the handler
  /// takes them itself.
  std::function<void(Section)> take_section;

  bool null();
  bool boolean(bool /*value*/) { return other_value("a boolean"); }
  bool number_integer(nlohmann::json::number_integer_t value) {
    source_.token_seen();
    return skip_depth_ > 0 || number({static_cast<double>(value), value});
  }
  bool number_unsigned(nlohmann::json::number_unsigned_t value) {
    source_.token_seen();
    return skip_depth_ > 0 || number(from_unsigned(value));
  }
  bool number_float(nlohmann::json::number_float_t value, const std::string& /*text*/) {
    source_.token_seen();
    return skip_depth_ > 0 || number(from_double(value));
  }
  bool string(std::string& value);
  bool binary(nlohmann::json::binary_t& /*value*/) { return other_value("binary data"); }
  bool start_object(std::size_t size);
  bool key(std::string& value);
  bool end_object();
  bool start_array(std::size_t size);
  bool end_array();
  bool parse_error(std::size_t position, const std::string& last_token, const nlohmann::json::exception& error);

  /// The version, told by which keys there were.
  std::string format() const;
  std::string keypoint_field() const { return seen_.undist_keypts ? "undist_keypts" : "keypts"; }
  bool is_dense_cloud() const { return seen_.color && !seen_.next_id; }
  const MapFlags& flags() const { return seen_; }
  void add(const MapFlags& flags);
  /// Throws InvalidInput if one of the sections was missing.
  void require_sections() const;

 private:
  static Number from_double(double value);
  static Number from_unsigned(nlohmann::json::number_unsigned_t value) {
    if (value > static_cast<std::uint64_t>(INT64_MAX)) return {static_cast<double>(value), std::nullopt};
    return {static_cast<double>(value), static_cast<std::int64_t>(value)};
  }

  bool number(const Number& value);
  void field_number(const Number& value);
  bool other_value(const char* found);
  bool skip();
  void key_in_root(const std::string& value);
  void key_in_section(const std::string& value);
  void key_in_entry(const std::string& value);
  void start_field_array(std::size_t size);
  void start_numbers(std::size_t size, std::size_t expected);
  void end_numbers();
  void end_point();
  void end_entry();
  void end_keyframe();
  std::int64_t integer(const Number& value) const;
  std::size_t keypoint_count(std::size_t size) const;

  std::string where() const;
  const char* expected() const;
  [[noreturn]] void wrong_type(const char* found) const;

  RawMap& map_;
  ByteSource& source_;

  State state_ = State::start;
  State after_point_ = State::keypoints;
  int skip_depth_ = 0;
  Section section_ = Section::other;
  Field field_ = Field::other;
  bool at_pt_ = false;        // in keypoint_object: the key was "pt"
  bool pt_seen_ = false;      // in keypoint_object
  unsigned seen_fields_ = 0;  // of the entry
  unsigned seen_sections_ = 0;

  std::string root_key_;
  std::string entry_key_;
  std::string field_key_;
  std::array<double, 4> numbers_{};
  std::size_t numbers_count_ = 0;
  std::size_t numbers_expected_ = 0;

  RawCamera camera_;
  RawKeyframe keyframe_;
  MapLandmark landmark_;
  std::vector<std::int64_t> landmark_ids_;
  std::vector<Eigen::Vector2f> keypoints_;

  MapFlags seen_;
};

}  // namespace pmsp::map_detail
