// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace pmsp::tool {

/// A line of a manifest.
struct Mission {
  std::size_t line = 0;  ///< from 1
  std::string name;      ///< of its folder; unique
  std::string map;       ///< this and the next three as they are written, "" = not given
  std::string images;
  std::string video;
  std::string mask;
  std::vector<std::string> options;  ///< see mission_options
  std::string error;                 ///< why it cannot be run; "" = it can
};

/// The list of missions; in a folder of results its file batch.json records the last one with the options in force,
/// which later calls need not repeat.
struct Manifest {
  std::string path;
  std::filesystem::path folder;      ///< that the paths in it are relative to, absolute
  std::vector<std::string> options;  ///< of all missions, see mission_options
  std::vector<Mission> missions;
};

/// "-": standard input. A line that makes no sense is a mission with an error. Throws IoError, and InvalidInput where
/// two missions have one name, there is none, or the columns of a table are not known.
Manifest read_manifest(const std::string& path);

/// nullopt where the folder of results has none. Throws InvalidInput for one that cannot be read, IoError.
std::optional<Manifest> read_record(const std::filesystem::path& folder);
/// Throws OutputError.
void write_record(const std::filesystem::path& folder, const Manifest& manifest);

/// In what the line of a mission differs from the recorded one, as `difference` has it; "" = in nothing.
std::string line_difference(const Mission& recorded, const Mission& given);

/// Without the extension and the last parts that most maps share: "a/hall" of a/hall/map.msg, a/hall/sparse/0 and
/// a/hall/reconstruction.json.
std::filesystem::path title_of_map(const std::filesystem::path& map);

}  // namespace pmsp::tool
