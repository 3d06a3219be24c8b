// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <filesystem>
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
  std::vector<std::string> options;  ///< see MissionOptions
  std::string error;                 ///< why it cannot be run; "" = it can
  bool is_named = true;              ///< false: the line does not even say which mission it is
};

struct Manifest {
  std::filesystem::path folder;  ///< that its paths are relative to; "" = where the program is called
  std::vector<Mission> missions;
};

/// "-": standard input. A line that makes no sense is a mission with an error. Throws IoError, and InvalidInput where
/// two missions have one name, there is none, or the columns of a table are not known.
Manifest read_manifest(const std::string& path);

}  // namespace pmsp::tool
