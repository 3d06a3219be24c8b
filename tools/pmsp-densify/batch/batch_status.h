// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace pmsp::tool {

/// How far a mission of a batch is.
enum class MissionState {
  kWaiting,      ///< never written
  kRunning,      ///< or the batch was killed while it ran
  kInterrupted,  ///< a signal ended the batch
  kDone,
  kFailed
};
const char* name_of(MissionState state);

/// The file status.json in a mission's folder.
struct MissionStatus {
  MissionState state = MissionState::kWaiting;
  std::string reason;  ///< why it failed
  std::optional<int> exit_code;
  std::optional<int> signal;
  std::optional<std::int64_t> process;  ///< while it runs
  std::string started, finished;        ///< UTC, "2026-01-31T12:00:00Z"
  double seconds = 0.0;
  double peak_memory_mib = 0.0;
  std::optional<std::int64_t> points;
  std::string fingerprint;           ///< of what it was made from
  std::vector<std::string> command;  ///< that made it
  bool keeps_workspace = false;      ///< it stays when the mission is done
};

nlohmann::ordered_json to_json(const MissionStatus& status);

/// nullopt where the folder has none. Throws InvalidInput for one that cannot be read, IoError.
std::optional<MissionStatus> read_status(const std::filesystem::path& folder);

/// Whether a file of this name is what a process that was killed in write_status may leave.
bool is_unfinished_status(const std::string& name);

/// Throws OutputError.
void write_status(const std::filesystem::path& folder, const MissionStatus& status);

/// Now, as in `started`.
std::string time_text();

}  // namespace pmsp::tool
