// SPDX-License-Identifier: BSD-2-Clause
#include "map_msgpack_handler.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace pmsp::map_detail {
namespace {

struct FieldName {
  Section section;
  const char* key;
  Field field;
  bool required;
};

constexpr std::array<FieldName, 14> kFields{{
    {Section::cameras, "model_type", Field::model_type, true},
    {Section::cameras, "cols", Field::cols, true},
    {Section::cameras, "rows", Field::rows, true},
    {Section::cameras, "fps", Field::fps, true},
    {Section::keyframes, "ts", Field::timestamp, true},
    {Section::keyframes, "src_frm_id", Field::source_frame, false},
    {Section::keyframes, "cam", Field::camera, true},
    {Section::keyframes, "rot_cw", Field::rotation, true},
    {Section::keyframes, "trans_cw", Field::translation, true},
    {Section::keyframes, "lm_ids", Field::landmark_ids, true},
    {Section::keyframes, "keypts", Field::keypts, false},
    {Section::keyframes, "undist_keypts", Field::undist_keypts, false},
    {Section::landmarks, "pos_w", Field::position, true},
    {Section::landmarks, "color", Field::color, false},
}};

std::optional<std::int64_t> parse_id(const std::string& text) {
  if (text.empty() || text.size() > 18 || text.find_first_not_of("0123456789") != std::string::npos) return {};
  return std::stoll(text);
}

constexpr unsigned bit(Field field) { return 1U << static_cast<unsigned>(field); }

}  // namespace

bool is_read(Section section, const std::string& key) {
  return std::any_of(kFields.begin(), kFields.end(),
                     [&](const FieldName& name) { return name.section == section && key == name.key; });
}

void MapHandler::add(const MapFlags& flags) {
  seen_.frame_next_id |= flags.frame_next_id;
  seen_.next_id |= flags.next_id;
  seen_.orb_params |= flags.orb_params;
  seen_.dense_points |= flags.dense_points;
  seen_.color |= flags.color;
  seen_.undist_keypts |= flags.undist_keypts;
  seen_.keypoint_arrays |= flags.keypoint_arrays;
}

// ---- values

Number MapHandler::from_double(double value) {
  constexpr double kExact = 9007199254740992.0;  // 2^53: all integers up to here are doubles
  const bool whole = std::abs(value) <= kExact && std::floor(value) == value;
  return {value, whole ? std::optional<std::int64_t>(static_cast<std::int64_t>(value)) : std::nullopt};
}

/// Begins to ignore an array or a map.
bool MapHandler::skip() {
  constexpr int kDeepest = 64;  // the parser recurses; a hostile file must not exhaust the stack
  if (++skip_depth_ > kDeepest)
    fail(map_.path, where(), "arrays or maps nested more than 64 deep, expected a flat map file");
  return true;
}

bool MapHandler::null() {
  source_.token_seen();
  if (skip_depth_ > 0) return true;
  // Writers leave null where a list that is built element by element got none.
  const bool list = field_ == Field::landmark_ids || field_ == Field::keypts || field_ == Field::undist_keypts;
  if (state_ == State::entry && list) return true;
  if (state_ == State::root) return true;
  return other_value("null");
}

bool MapHandler::other_value(const char* found) {
  source_.token_seen();
  if (skip_depth_ > 0) return true;
  const bool ignored = (state_ == State::root && section_ == Section::other) ||
                       (state_ == State::entry && (field_ == Field::other || field_ == Field::color)) ||
                       (state_ == State::keypoint_object && !at_pt_);
  if (!ignored) wrong_type(found);
  return true;
}

bool MapHandler::string(std::string& value) {
  if (skip_depth_ == 0 && state_ == State::entry && field_ == Field::model_type) {
    camera_.model = value;
  } else if (skip_depth_ == 0 && state_ == State::entry && field_ == Field::camera) {
    keyframe_.camera = value;
  } else {
    return other_value("a string");
  }
  source_.token_seen();
  return true;
}

std::int64_t MapHandler::integer(const Number& value) const {
  if (!value.integer) wrong_type(("the number " + std::to_string(value.value)).c_str());
  return *value.integer;
}

bool MapHandler::number(const Number& value) {
  switch (state_) {
    case State::entry:
      field_number(value);
      return true;
    case State::numbers:
    case State::point:
      if (numbers_count_ == numbers_expected_) wrong_type("more numbers");
      numbers_[numbers_count_++] = value.value;
      return true;
    case State::landmark_ids:
      landmark_ids_.push_back(integer(value));
      return true;
    default:
      return other_value("a number");
  }
}

void MapHandler::field_number(const Number& value) {
  switch (field_) {
    case Field::cols:
      camera_.cols = integer(value);
      return;
    case Field::rows:
      camera_.rows = integer(value);
      return;
    case Field::fps:
      camera_.fps = value.value;
      return;
    case Field::timestamp:
      keyframe_.keyframe.timestamp = value.value;
      return;
    case Field::source_frame:
      keyframe_.keyframe.source_frame = integer(value);
      if (*keyframe_.keyframe.source_frame < 0) wrong_type("a negative number");
      return;
    default:
      other_value("a number");
  }
}

// ---- maps

bool MapHandler::start_object(std::size_t /*size*/) {
  source_.token_seen();
  if (skip_depth_ > 0) return skip();
  switch (state_) {
    case State::start:
      state_ = State::root;
      return true;
    case State::root:
      if (section_ == Section::other) return skip();
      entry_key_.clear();
      state_ = State::section;
      return true;
    case State::section:
      seen_fields_ = 0;
      field_key_.clear();
      camera_ = {};
      keyframe_ = {};
      landmark_ = {};
      landmark_ids_.clear();
      keypoints_.clear();
      state_ = State::entry;
      return true;
    case State::keypoints:
      at_pt_ = pt_seen_ = false;
      state_ = State::keypoint_object;
      return true;
    default:
      other_value("a map");
      return skip();
  }
}

bool MapHandler::key(std::string& value) {
  source_.token_seen();
  if (skip_depth_ > 0) return true;
  switch (state_) {
    case State::root:
      key_in_root(value);
      if (section_ == Section::other) {
        source_.replace_value_by_nil();
      } else if (section_ != Section::cameras && take_section) {
        take_section(section_);
      }
      break;
    case State::section:
      key_in_section(value);
      break;
    case State::entry:
      key_in_entry(value);
      if (field_ == Field::other) source_.replace_value_by_nil();
      break;
    default:
      at_pt_ = value == "pt";
      if (at_pt_ && pt_seen_) wrong_type("it twice");
      break;
  }
  return true;
}

void MapHandler::key_in_root(const std::string& value) {
  root_key_ = value;
  section_ = value == "cameras"     ? Section::cameras
             : value == "keyframes" ? Section::keyframes
             : value == "landmarks" ? Section::landmarks
                                    : Section::other;
  seen_.frame_next_id |= value == "frame_next_id";
  seen_.next_id |= value == "keyframe_next_id" || value == "landmark_next_id";
  seen_.orb_params |= value == "orb_params";
  seen_.dense_points |= value == "dense_points";
  if (section_ == Section::other) return;
  const unsigned mask = 1U << static_cast<unsigned>(section_);
  if ((seen_sections_ & mask) != 0) fail(map_.path, name_of(section_), "appears twice, expected once");
  seen_sections_ |= mask;
}

void MapHandler::key_in_section(const std::string& value) {
  entry_key_ = value;
  if (section_ != Section::cameras && !parse_id(value)) {
    fail(map_.path, where(), "the key is no id, expected a number >= 0 in decimal digits");
  }
}

void MapHandler::key_in_entry(const std::string& value) {
  field_key_ = value;
  field_ = Field::other;
  for (const FieldName& name : kFields) {
    if (name.section == section_ && value == name.key) field_ = name.field;
  }
  if (field_ == Field::other) return;
  if ((seen_fields_ & bit(field_)) != 0) fail(map_.path, where(), "appears twice, expected once");
  seen_fields_ |= bit(field_);
  seen_.color |= field_ == Field::color;
  // Undistorted keypoints, where there are both: they are what the SLAM's poses were made from.
  if (field_ == Field::keypts && (seen_fields_ & bit(Field::undist_keypts)) != 0) field_ = Field::other;
  if (field_ == Field::undist_keypts) {
    seen_.undist_keypts = true;
    keypoints_.clear();
  }
}

bool MapHandler::end_object() {
  source_.token_seen();
  if (skip_depth_ > 0) {
    --skip_depth_;
    return true;
  }
  switch (state_) {
    case State::root:
      state_ = State::done;
      break;
    case State::section:
      state_ = State::root;
      break;
    case State::entry:
      end_entry();
      state_ = State::section;
      break;
    default:  // keypoint_object
      if (!pt_seen_) wrong_type("none");
      state_ = State::keypoints;
      keypoints_.emplace_back(static_cast<float>(numbers_[0]), static_cast<float>(numbers_[1]));
      break;
  }
  return true;
}

void MapHandler::end_entry() {
  for (const FieldName& name : kFields) {
    if (name.section != section_ || !name.required || (seen_fields_ & bit(name.field)) != 0) continue;
    field_key_ = name.key;
    field_ = name.field;
    wrong_type("no such key");
  }
  field_key_.clear();
  switch (section_) {
    case Section::cameras:
      camera_.name = entry_key_;
      map_.cameras.push_back(std::move(camera_));
      return;
    case Section::keyframes:
      end_keyframe();
      return;
    default:
      landmark_.id = *parse_id(entry_key_);
      map_.landmarks.push_back(landmark_);
      return;
  }
}

void MapHandler::end_keyframe() {
  if ((seen_fields_ & (bit(Field::keypts) | bit(Field::undist_keypts))) == 0) {
    fail(map_.path, where(), "has no keypoints, expected undist_keypts or keypts");
  }
  if (landmark_ids_.size() != keypoints_.size()) {
    field_key_ = "lm_ids";
    fail(map_.path, where(),
         "has " + std::to_string(landmark_ids_.size()) + " elements where there are " +
             std::to_string(keypoints_.size()) + " keypoints, expected one for each");
  }
  keyframe_.keyframe.id = *parse_id(entry_key_);
  set_observations(keyframe_.keyframe, landmark_ids_, [&](std::size_t i) { return keypoints_[i]; });
  map_.keyframes.push_back(std::move(keyframe_));
}

// ---- arrays

bool MapHandler::start_array(std::size_t size) {
  source_.token_seen();
  if (skip_depth_ > 0) return skip();
  const bool pt = state_ == State::keypoint_object && at_pt_;
  if (state_ == State::keypoints || pt) {
    seen_.keypoint_arrays |= !pt;
    after_point_ = state_;
    numbers_count_ = 0;
    numbers_expected_ = 2;
    state_ = State::point;
  } else if (state_ == State::entry && field_ != Field::other && field_ != Field::color) {
    start_field_array(size);
  } else {
    other_value("an array");
    return skip();
  }
  return true;
}

std::size_t MapHandler::keypoint_count(std::size_t size) const {
  if (size > kMaxKeypoints) {
    fail(map_.path, where(),
         "claims " + std::to_string(size) + " elements, expected at most " + std::to_string(kMaxKeypoints));
  }
  return size;
}

void MapHandler::start_field_array(std::size_t size) {
  switch (field_) {
    case Field::rotation:
      start_numbers(size, 4);
      break;
    case Field::translation:
    case Field::position:
      start_numbers(size, 3);
      break;
    case Field::landmark_ids:
      keypoint_count(size);
      state_ = State::landmark_ids;
      break;
    case Field::keypts:
    case Field::undist_keypts:
      keypoint_count(size);
      state_ = State::keypoints;
      break;
    default:
      wrong_type("an array");
  }
}

void MapHandler::start_numbers(std::size_t size, std::size_t expected_size) {
  if (size != expected_size) wrong_type(("one of " + std::to_string(size)).c_str());
  numbers_count_ = 0;
  numbers_expected_ = expected_size;
  state_ = State::numbers;
}

bool MapHandler::end_array() {
  source_.token_seen();
  if (skip_depth_ > 0) {
    --skip_depth_;
    return true;
  }
  if (state_ == State::point) {
    end_point();
  } else {
    if (state_ == State::numbers) end_numbers();
    state_ = State::entry;
  }
  return true;
}

void MapHandler::end_numbers() {
  const Eigen::Vector3d vector(numbers_[0], numbers_[1], numbers_[2]);
  if (field_ == Field::rotation) keyframe_.rotation_xyzw = numbers_;
  if (field_ == Field::translation) keyframe_.translation = vector;
  if (field_ == Field::position) landmark_.position_world = vector;
}

void MapHandler::end_point() {
  if (numbers_count_ != 2) wrong_type("fewer numbers");
  state_ = after_point_;
  if (state_ == State::keypoint_object) {
    pt_seen_ = true;
  } else {
    keypoints_.emplace_back(static_cast<float>(numbers_[0]), static_cast<float>(numbers_[1]));
  }
}

}  // namespace pmsp::map_detail
