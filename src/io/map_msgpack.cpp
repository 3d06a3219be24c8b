// SPDX-License-Identifier: BSD-2-Clause
#include <exception>
#include <string>
#include <utility>

#include "machine.h"
#include "map_msgpack_entries.h"
#include "map_msgpack_handler.h"
#include "pmsp/stages.h"

namespace pmsp::map_detail {

using nlohmann::json;

// ---- messages

const char* name_of(Section section) {
  switch (section) {
    case Section::cameras:
      return "cameras";
    case Section::keyframes:
      return "keyframes";
    case Section::landmarks:
      return "landmarks";
    case Section::other:
      break;
  }
  return "";
}

std::string MapHandler::where() const {
  switch (state_) {
    case State::start:
    case State::done:
      return "";
    case State::root:
      return root_key_.empty() ? "" : in_quotes(root_key_);
    case State::section:
      return place(Dialect::msgpack, name_of(section_), entry_key_, "");
    default:
      break;
  }
  std::string result = place(Dialect::msgpack, name_of(section_), entry_key_, field_key_);
  if (state_ == State::keypoints || state_ == State::keypoint_object || state_ == State::point) {
    result += "[" + std::to_string(keypoints_.size()) + "]";
  }
  if (state_ == State::landmark_ids) result += "[" + std::to_string(landmark_ids_.size()) + "]";
  return result;
}

const char* MapHandler::expected() const {
  switch (state_) {
    case State::start:
    case State::done:
    case State::root:
    case State::section:
      return "a map";
    case State::numbers:
      return "a number";
    case State::landmark_ids:
      return "a whole number";
    case State::keypoints:
      return "[x, y] or {\"pt\": [x, y]}";
    case State::keypoint_object:
      return "\"pt\": [x, y]";
    case State::point:
      return "[x, y], two numbers";
    case State::entry:
      break;
  }
  switch (field_) {
    case Field::model_type:
    case Field::camera:
      return "a string";
    case Field::rotation:
      return "an array of 4 numbers (x, y, z, w)";
    case Field::translation:
    case Field::position:
      return "an array of 3 numbers";
    case Field::landmark_ids:
      return "an array of landmark ids";
    case Field::keypts:
    case Field::undist_keypts:
      return "an array of keypoints";
    case Field::cols:
    case Field::rows:
      return "a whole number";
    case Field::source_frame:
      return "a whole number >= 0";
    default:
      return "a number";
  }
}

void MapHandler::wrong_type(const char* found) const {
  fail(map_.path, where(), std::string("expected ") + expected() + ", found " + found);
}

bool MapHandler::parse_error(std::size_t /*position*/, const std::string& /*last_token*/,
                             const json::exception& error) {
  const std::string inside = where().empty() ? "" : " inside " + where();
  const auto byte = [this](std::uint64_t more) { return "byte " + std::to_string(source_.offset() + more); };
  if (state_ == State::done) fail(map_.path, byte(0), "more data after the end of the map, expected none");
  constexpr int kUnexpectedEnd = 110;
  if (error.id == kUnexpectedEnd) {
    fail(map_.path, byte(1), "the file ends" + inside + " before the map is complete: it is truncated; copy it again");
  }
  fail(map_.path, byte(0), "broken MessagePack data" + inside + " (" + in_quotes(error.what()) + ")");
}

// ---- the file as a whole

void MapHandler::require_sections() const {
  for (const auto& [section, name] :
       {std::pair{Section::cameras, "cameras"}, {Section::keyframes, "keyframes"}, {Section::landmarks, "landmarks"}}) {
    if ((seen_sections_ & (1U << static_cast<unsigned>(section))) == 0) {
      fail(map_.path, "",
           std::string("has no \"") + name +
               "\": expected cameras, keyframes and landmarks, as in a map of OpenVSLAM or stella_vslam");
    }
  }
}

std::string MapHandler::format() const {
  const char* version = "OpenVSLAM";
  if (seen_.dense_points) {
    version = "stella_vslam_dense";
  } else if (seen_.undist_keypts) {
    version = seen_.keypoint_arrays ? "stella_vslam 0.3.2 to 0.3.3"
              : seen_.frame_next_id ? "stella_vslam 0.3.4 to 0.3.5"
                                    : "stella_vslam >= 0.3.6";
  } else if (seen_.orb_params) {
    version = "stella_vslam 0.3.0 to 0.3.1";
  } else if (seen_.color) {
    version = seen_.next_id ? "PatchMatch-Stereo-Panorama" : "PatchMatch-Stereo-Panorama, dense points";
  }
  return std::string(version) + ", MessagePack";
}

namespace {

/// `threads`: several read, which give up where the file is not sound.
RawMap read_file(const std::filesystem::path& path, bool threads) {
  RawMap map;
  map.path = path;
  map.dialect = Dialect::msgpack;
  ByteSource source(path);
  MapHandler handler(map, source);
  EntryReaders readers(map, handler);
  if (threads) handler.take_section = [&](Section section) { readers.read(section, source); };
  json::sax_parse(ByteIterator(&source), ByteIterator(), &handler, json::input_format_t::msgpack);
  readers.wait();
  handler.require_sections();
  map.format = handler.format();
  map.keypoint_field = handler.keypoint_field();
  map.pixels_in_another_grid = handler.is_dense_cloud();
  return map;
}

}  // namespace

RawMap read_msgpack(const std::filesystem::path& path) {
  if (usable_cpus() > 1) {
    try {
      return read_file(path, true);
    } catch (const std::exception&) {  // what is wrong with it is found out and told below
    }
  }
  return read_file(path, false);
}

}  // namespace pmsp::map_detail
