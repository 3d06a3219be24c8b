// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/io/map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <system_error>

#include "image_list.h"
#include "map_file.h"
#include "map_raw.h"
#include "pmsp/error.h"
#include "util/text.h"

namespace pmsp {
namespace map_detail {

// To add a format: define it in its own file, declare it here, add it to kFormats and to CMakeLists.txt.
extern const MapFormat kColmap;
extern const MapFormat kOpenSfm;
extern const MapFormat kOpenMvg;
extern const MapFormat kNerfstudio;
extern const MapFormat kMetashape;
extern const MapFormat kAliceVision;
extern const MapFormat kOb3d;
extern const MapFormat kTartanAir;
extern const MapFormat kVipe;
extern const MapFormat kTum;

}  // namespace map_detail

namespace {

using namespace map_detail;

/// Interpolation and galloping search, since ids usually are evenly spread.
template <class T>
const T* find_by_id(const std::vector<T>& sorted, std::int64_t id) {
  if (sorted.empty() || id < sorted.front().id || id > sorted.back().id) return nullptr;
  const auto size = static_cast<std::ptrdiff_t>(sorted.size());
  const double first = static_cast<double>(sorted.front().id);
  const double share = (static_cast<double>(id) - first) / (static_cast<double>(sorted.back().id) - first + 1.0);
  const std::ptrdiff_t guess = std::clamp<std::ptrdiff_t>(std::lround(share * static_cast<double>(size)), 0, size - 1);
  std::ptrdiff_t low = guess, high = guess + 1;  // if present, the id is in [low, high)
  for (std::ptrdiff_t step = 4; low > 0 && sorted[static_cast<std::size_t>(low)].id > id; step *= 2) {
    high = low;
    low = std::max<std::ptrdiff_t>(low - step, 0);
  }
  for (std::ptrdiff_t step = 4; high < size && sorted[static_cast<std::size_t>(high - 1)].id < id; step *= 2) {
    low = high;
    high = std::min(high + step, size);
  }
  const auto it = std::lower_bound(sorted.begin() + low, sorted.begin() + high, id,
                                   [](const T& item, std::int64_t key) { return item.id < key; });
  return it != sorted.begin() + high && it->id == id ? &*it : nullptr;
}

bool starts_with(const std::string& text, const char* prefix) { return text.rfind(prefix, 0) == 0; }

bool is_msgpack_map(MapFile& file) {
  const std::string& head = file.head();
  if (head.empty() || starts_with(head, "\x89PNG")) return false;  // a PNG's first byte is valid MessagePack
  const auto first = static_cast<unsigned char>(head[0]);
  return (first & 0xF0U) == 0x80U || first == 0xDEU || first == 0xDFU;
}

/// Description of a file that is not a map, for the message.
std::string describe(const MapFile& file) {
  const std::string& head = file.head();
  if (head.empty()) return "the file is empty";
  if (starts_with(head, "ply\n") || starts_with(head, "ply\r")) return "this looks like a PLY point cloud";
  if (starts_with(head, "\x89PNG") || starts_with(head, "\xFF\xD8\xFF") || starts_with(head, "GIF8")) {
    return "this looks like an image";
  }
  if (head.compare(0, 4, "RIFF") == 0 || head.find("ftyp") == 4) return "this looks like an image or a video";
  if (starts_with(head, "PK\x03\x04") || starts_with(head, "\x1F\x8B")) {
    return "this looks like a compressed archive; unpack it first";
  }
  const std::size_t version = starts_with(head, "\x01") ? 1 : 0;  // cereal may begin with it
  if (head.compare(version, 10,
                   std::string("\x03\0\0\0\0\0\0\0"
                               "0.",
                               10)) == 0) {
    return "this looks like sfm_data.bin of openMVG; convert it: openMVG_main_ConvertSfM_DataFormat -i " +
           file.path().string() + " -o sfm_data.json";
  }
  if (starts_with(head, "Ogawa")) {
    return "this looks like a scene of Alembic, as Meshroom writes it; give the cameras.sfm beside it, or convert it: "
           "aliceVision_convertSfMFormat --input " +
           file.path().string() + " --output cameras.sfm";
  }
  if (starts_with(head, "SQLite format 3")) return "this looks like a SQLite database whose first bytes are damaged";
  if (starts_with(head, "7\x7F\x06")) return "this looks like the -wal file of a SQLite database; give the .db itself";
  if (starts_with(head, "\xD9\xD5\x05\xF9")) {
    return "this looks like the -journal file of a SQLite database; give the .db itself";
  }
  if (file.is_json()) return "this is JSON of another kind";
  if (file.begins_with("<")) return "this is XML of another kind";
  if (file.is_text()) return "this looks like a text file";
  return format("the first byte is 0x%02x", static_cast<unsigned>(static_cast<unsigned char>(head[0])));
}

bool is_sqlite_map(MapFile& file) { return file.head().compare(0, 16, std::string("SQLite format 3\0", 16)) == 0; }
SlamMap sqlite_map(MapFile& file, const ReadMapOptions& /*options*/) { return map_from_raw(read_sqlite(file.path())); }
SlamMap msgpack_map(MapFile& file, const ReadMapOptions& /*options*/) {
  return map_from_raw(read_msgpack(file.path()));
}

constexpr MapFormat kSqlite{"SQLite", "a map of OpenVSLAM or stella_vslam (*.msg, *.db)", is_sqlite_map, sqlite_map};
constexpr MapFormat kMsgpack{"MessagePack", nullptr, is_msgpack_map, msgpack_map};

constexpr std::array kFormats{&kSqlite,
                              &kMsgpack,
                              &map_detail::kColmap,
                              &map_detail::kOb3d,
                              &map_detail::kVipe,
                              &map_detail::kOpenSfm,
                              &map_detail::kOpenMvg,
                              &map_detail::kTartanAir,
                              &map_detail::kNerfstudio,
                              &map_detail::kMetashape,
                              &map_detail::kAliceVision,
                              &map_detail::kTum};

}  // namespace

const MapLandmark* SlamMap::find_landmark(std::int64_t id) const { return find_by_id(landmarks, id); }

const MapKeyframe* SlamMap::find_keyframe(std::int64_t id) const { return find_by_id(keyframes, id); }

std::vector<std::string> map_formats() {
  std::vector<std::string> all;
  for (const MapFormat* format : kFormats) {
    if (format->what != nullptr) all.emplace_back(format->what);
  }
  return all;
}

SlamMap read_map(const std::filesystem::path& path, const ReadMapOptions& options) {
  MapFile file(path);
  for (const MapFormat* format : kFormats) {
    if (!format->matches(file)) continue;
    if (!options.camera_from_body.empty() && format != &map_detail::kTum) {
      throw InvalidOption("camera_from_body is " + options.camera_from_body.string() + ": " + path.string() +
                          " holds poses of its cameras; expected a trajectory (TUM, EuRoC, VINS, KITTI)");
    }
    SlamMap map = format->read(file, options);
    if (options.component && *options.component != map.component) {
      throw InvalidOption("component is " + std::to_string(*options.component) + ": " + path.string() +
                          " has one, component 0");
    }
    if (!options.image_list.empty()) {
      name_images(map, options.image_list);
      check_images_once(map, options.image_list);
    }
    if (map.landmarks.empty() && !options.points.empty()) {
      map.landmarks = landmarks_from_ply(options.points);
      map.notes.push_back("landmarks: " + std::to_string(map.landmarks.size()) + " points of " +
                          options.points.string());
    }
    const bool has_observations = std::any_of(map.keyframes.begin(), map.keyframes.end(),
                                              [](const MapKeyframe& k) { return !k.observations.empty(); });
    if (!has_observations && !map.landmarks.empty()) observe_landmarks(map);
    return map;
  }
  std::string expected;
  for (const std::string& what : map_formats()) expected += (expected.empty() ? "" : ", ") + what;
  throw InvalidInput(
      path.string() + ": is no map that can be read: " +
      (file.is_folder()
           ? "the directory holds no model of COLMAP (cameras, images, points3D as .bin or "
             ".txt), nor directories 0, 1, ... that do, nor cameras/*_cam.json (OB3D), nor pose/*.npz (ViPE)"
           : "expected " + expected + "; but " + describe(file)));
}

namespace map_detail {

MapFile::MapFile(const std::filesystem::path& path) : path_(path) {
  constexpr std::uint64_t kHeadBytes = 4096;
  std::error_code ignored;
  const std::filesystem::file_type type = std::filesystem::status(path, ignored).type();
  if (type == std::filesystem::file_type::not_found) throw IoError(path.string() + ": there is no such file");
  is_folder_ = type == std::filesystem::file_type::directory;
  if (is_folder_) return;
  BinaryInput in(path);
  const auto size = static_cast<std::size_t>(std::min<std::uint64_t>(in.size(), kHeadBytes));
  head_.assign(in.take(size), size);
  if (starts_with(head_, "\xEF\xBB\xBF")) head_.erase(0, 3);
}

bool MapFile::is_text() const {
  return !is_folder_ && std::all_of(head_.begin(), head_.end(), [](char c) {
    return static_cast<unsigned char>(c) >= 0x20U || c == '\n' || c == '\r' || c == '\t';
  });
}

bool MapFile::begins_with(const char* text) const {
  const std::size_t first = head_.find_first_not_of(" \t\r\n");
  return first != std::string::npos && head_.compare(first, std::strlen(text), text) == 0;
}

const nlohmann::json& MapFile::json() {
  if (!json_) json_ = read_json(path_);
  return *json_;
}

std::string place(Dialect dialect, const std::string& section, const std::string& id, const std::string& field) {
  if (dialect == Dialect::msgpack) {
    return section + (id.empty() ? "" : "[" + in_quotes(id) + "]") + (field.empty() ? "" : "." + field);
  }
  return "table " + section + (id.empty() ? "" : ", id " + id) + (field.empty() ? "" : ", column " + field);
}

}  // namespace map_detail
}  // namespace pmsp
