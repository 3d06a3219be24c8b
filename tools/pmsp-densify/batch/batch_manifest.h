// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace pmsp::tool {

/// Line of a manifest.
struct Mission {
  std::size_t line = 0;  ///< from 1
  std::string name;      ///< unique folder name
  std::string map;       ///< this and the next three as written, "" = not set
  std::string images;
  std::string video;
  std::string mask;
  std::vector<std::string> options;  ///< see mission_options
  std::string error;                 ///< why it is invalid; "" = valid
};

/// List of missions. batch.json in the output folder records the last one with its options, which later calls may omit.
struct Manifest {
  std::string path;
  std::filesystem::path folder;      ///< absolute folder to which its paths are relative
  std::vector<std::string> options;  ///< of all missions, see mission_options
  std::vector<Mission> missions;
};

/// Reads a manifest; "-" = standard input. Invalid lines become missions with an error. Throws IoError; InvalidInput
/// for duplicate names, no missions, or unknown columns of a table.
Manifest read_manifest(const std::string& path);

/// Returns the recorded manifest of an output folder, nullopt = none. Throws InvalidInput if malformed, IoError.
std::optional<Manifest> read_record(const std::filesystem::path& folder);
/// Throws OutputError.
void write_record(const std::filesystem::path& folder, const Manifest& manifest);

/// Returns how a mission's line differs from the recorded one (see difference); "" = equal.
std::string line_difference(const Mission& recorded, const Mission& given);

/// Missions found in a folder tree, as manifest lines; rules: see `batch --help`.
struct Scan {
  std::vector<nlohmann::ordered_json> missions;
  std::vector<std::filesystem::path> without_images;  ///< maps without images
};

/// Throws IoError.
Scan scan_for_missions(const std::filesystem::path& folder);

}  // namespace pmsp::tool
