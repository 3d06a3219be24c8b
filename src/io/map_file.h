// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "json_input.h"
#include "pmsp/io/map.h"

namespace pmsp::map_detail {

/// What was given as a map, before it is known which format it is of.
class MapFile {
 public:
  /// Throws IoError.
  explicit MapFile(const std::filesystem::path& path);

  const std::filesystem::path& path() const { return path_; }
  bool is_folder() const { return is_folder_; }
  const std::string& head() const { return head_; }  ///< its first bytes; "" of a folder
  bool is_text() const;                              ///< as far as the head tells
  /// Begins with `text` behind blanks.
  bool begins_with(const char* text) const;
  bool is_json() const { return is_text() && (begins_with("{") || begins_with("[")); }
  /// Read when first asked for. Throws InvalidInput where `is_json`, but broken.
  const nlohmann::json& json();

 private:
  std::filesystem::path path_;
  bool is_folder_ = false;
  std::string head_;
  std::optional<nlohmann::json> json_;
};

/// A format of maps. Each is defined in its file and listed in map.cpp.
struct MapFormat {
  const char* name;
  const char* what;  ///< to give as MAP, for people
  bool (*matches)(MapFile& file);
  SlamMap (*read)(MapFile& file, const ReadMapOptions& options);
};

}  // namespace pmsp::map_detail
