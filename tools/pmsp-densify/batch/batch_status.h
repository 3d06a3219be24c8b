// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

namespace pmsp::tool {

/// The file status.json in a mission's folder: state, reason (of a failure; of a mission that is done its first
/// warning), fingerprint, command, host, version, started, finished ("2026-01-31T12:00:00Z"), and of what has ended
/// seconds, peak_memory_mib, exit_code (128 + n after signal n), points, coverage, confidence, fit.
using MissionStatus = nlohmann::ordered_json;

// States.
constexpr const char* kWaiting = "waiting";          ///< never written
constexpr const char* kRunning = "running";          ///< or the batch was killed while it ran
constexpr const char* kInterrupted = "interrupted";  ///< a signal ended the batch
constexpr const char* kDone = "done";                ///< of --dry-run: can be run
constexpr const char* kFailed = "failed";            ///< of --dry-run: refused

/// A text of it; "" where it has none.
std::string text_in(const MissionStatus& status, const char* key);

/// nullopt where the folder has none. Throws InvalidInput for one that cannot be read, IoError.
std::optional<MissionStatus> read_status(const std::filesystem::path& folder);

/// Whether a process that was killed in write_status may have left a file of this name.
bool is_unfinished_status(const std::string& name);

/// Throws OutputError.
void write_status(const std::filesystem::path& folder, const MissionStatus& status);

/// Leaves a file with these bytes as it is. Throws OutputError.
void write_if_changed(const std::filesystem::path& path, const std::string& text);

/// Now, as in `started`.
std::string time_text();

}  // namespace pmsp::tool
