// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "json_input.h"
#include "pmsp/io/map.h"

namespace pmsp::map_detail {

/// Input path of a map, before its format is known.
class MapFile {
 public:
  /// Throws IoError.
  explicit MapFile(const std::filesystem::path& path);

  const std::filesystem::path& path() const { return path_; }
  bool is_folder() const { return is_folder_; }
  const std::string& head() const { return head_; }  ///< first bytes; "" for folders
  bool is_text() const;                              ///< according to head()
  /// True if the text after leading blanks begins with `text`.
  bool begins_with(const char* text) const;
  bool is_json() const { return is_text() && (begins_with("{") || begins_with("[")); }
  /// Parsed at the first call. Throws InvalidInput if `is_json` but malformed.
  const nlohmann::json& json();

 private:
  std::filesystem::path path_;
  bool is_folder_ = false;
  std::string head_;
  std::optional<nlohmann::json> json_;
};

/// Map format, defined in its own file and listed in map.cpp.
struct MapFormat {
  const char* name;
  const char* what;  ///< expected MAP argument, for messages
  bool (*matches)(MapFile& file);
  SlamMap (*read)(MapFile& file, const ReadMapOptions& options);
};

}  // namespace pmsp::map_detail
