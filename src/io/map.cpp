// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/io/map.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <system_error>

#include "map_raw.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

template <class T>
const T* find_by_id(const std::vector<T>& sorted, std::int64_t id) {
  const auto it =
      std::lower_bound(sorted.begin(), sorted.end(), id, [](const T& item, std::int64_t key) { return item.id < key; });
  return it != sorted.end() && it->id == id ? &*it : nullptr;
}

/// The first bytes of a file, enough to tell what it is.
std::string read_head(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (status.type() == std::filesystem::file_type::not_found) throw IoError(path.string() + ": there is no such file");
  if (status.type() == std::filesystem::file_type::directory) {
    throw IoError(path.string() + ": is a folder; give the map file itself (*.msg or *.db)");
  }
  // Opening a named pipe would wait for ever, and readers need the file's length.
  if (error || status.type() != std::filesystem::file_type::regular) {
    throw IoError(path.string() + ": is not a regular file" + (error ? " (" + error.message() + ")" : ""));
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) throw IoError(path.string() + ": cannot be opened: " + std::strerror(errno));
  std::string head(16, '\0');
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  if (file.bad()) throw IoError(path.string() + ": cannot be read: " + std::strerror(errno));
  head.resize(static_cast<std::size_t>(file.gcount()));
  return head;
}

bool starts_with(const std::string& text, const char* prefix) { return text.rfind(prefix, 0) == 0; }

bool is_msgpack_map(const std::string& head) {
  if (head.empty() || starts_with(head, "\x89PNG")) return false;  // a PNG's first byte would do, too
  const auto first = static_cast<unsigned char>(head[0]);
  return (first & 0xF0U) == 0x80U || first == 0xDEU || first == 0xDFU;
}

bool is_text(const std::string& head) {
  return std::all_of(head.begin(), head.end(), [](char c) { return c >= ' ' || c == '\n' || c == '\r' || c == '\t'; });
}

/// What a file that is no map looks like, for the message.
std::string describe(const std::string& head) {
  if (head.empty()) return "the file is empty";
  if (starts_with(head, "ply\n") || starts_with(head, "ply\r")) return "this looks like a PLY point cloud";
  if (starts_with(head, "\x89PNG") || starts_with(head, "\xFF\xD8\xFF") || starts_with(head, "GIF8")) {
    return "this looks like an image";
  }
  if (head.compare(0, 4, "RIFF") == 0 || head.find("ftyp") == 4) return "this looks like an image or a video";
  if (starts_with(head, "PK\x03\x04") || starts_with(head, "\x1F\x8B")) {
    return "this looks like a compressed archive; unpack it first";
  }
  if (starts_with(head, "SQLite format 3")) return "this looks like a SQLite database whose first bytes are damaged";
  if (starts_with(head, "7\x7F\x06")) return "this looks like the -wal file of a SQLite database; give the .db itself";
  if (starts_with(head, "\xD9\xD5\x05\xF9")) {
    return "this looks like the -journal file of a SQLite database; give the .db itself";
  }
  if (is_text(head)) {
    const std::size_t first = head.find_first_not_of(" \t\r\n");
    const bool json = first != std::string::npos && (head[first] == '{' || head[first] == '[');
    return json ? "this looks like JSON text; give the map as the SLAM wrote it" : "this looks like a text file";
  }
  char byte[8];
  std::snprintf(byte, sizeof byte, "0x%02x", static_cast<unsigned>(static_cast<unsigned char>(head[0])));
  return std::string("the first byte is ") + byte;
}

}  // namespace

const MapLandmark* SlamMap::find_landmark(std::int64_t id) const { return find_by_id(landmarks, id); }

const MapKeyframe* SlamMap::find_keyframe(std::int64_t id) const { return find_by_id(keyframes, id); }

SlamMap read_map(const std::filesystem::path& path) {
  static const std::string kSqliteMagic("SQLite format 3\0", 16);
  const std::string head = read_head(path);
  if (head == kSqliteMagic) return map_detail::finish_map(map_detail::read_sqlite(path));
  if (is_msgpack_map(head)) return map_detail::finish_map(map_detail::read_msgpack(path));
  throw InvalidInput(path.string() +
                     ": is no map of OpenVSLAM or stella_vslam: expected MessagePack (*.msg) or SQLite " +
                     "(*.db), but " + describe(head));
}

namespace map_detail {

void fail(const std::filesystem::path& path, const std::string& where, const std::string& what) {
  throw InvalidInput(path.string() + ": " + (where.empty() ? "" : where + ": ") + what);
}

std::string place(Dialect dialect, const std::string& section, const std::string& id, const std::string& field) {
  if (dialect == Dialect::msgpack) {
    return section + (id.empty() ? "" : "[" + in_quotes(id) + "]") + (field.empty() ? "" : "." + field);
  }
  return "table " + section + (id.empty() ? "" : ", id " + id) + (field.empty() ? "" : ", column " + field);
}

std::string in_quotes(const std::string& text) {
  constexpr std::size_t kLongest = 60;
  std::string result = "\"";
  for (std::size_t i = 0; i < text.size() && i < kLongest; ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const bool control = byte < 0x20U || byte == 0x7FU;
    result += control ? '?' : text[i];
  }
  return result + (text.size() > kLongest ? "...\"" : "\"");
}

}  // namespace map_detail
}  // namespace pmsp
