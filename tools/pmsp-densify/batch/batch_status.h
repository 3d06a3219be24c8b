// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

namespace pmsp::tool {

/// status.json of a mission's folder: state, reason (of a failure; first warning if done), fingerprint, command, host,
/// version, started, finished ("2026-01-31T12:00:00Z"); after the end also seconds, peak_memory_mib, exit_code (128 + n
/// for signal n), points, coverage, confidence, fit.
using MissionStatus = nlohmann::ordered_json;

// States.
constexpr const char* kWaiting = "waiting";          ///< never written
constexpr const char* kRunning = "running";          ///< also if the batch was killed meanwhile
constexpr const char* kInterrupted = "interrupted";  ///< batch ended by a signal
constexpr const char* kDone = "done";                ///< with --dry-run: valid
constexpr const char* kFailed = "failed";            ///< with --dry-run: rejected

/// Returns a text field; "" = missing.
std::string text_in(const MissionStatus& status, const char* key);

/// Returns nullopt without status. Throws InvalidInput if malformed, IoError.
std::optional<MissionStatus> read_status(const std::filesystem::path& folder);

/// True for names of temporary files of write_status, which a killed process may leave.
bool is_unfinished_status(const std::string& name);

/// Throws OutputError.
void write_status(const std::filesystem::path& folder, const MissionStatus& status);

/// Writes a file unless it has this content. Throws OutputError.
void write_if_changed(const std::filesystem::path& path, const std::string& text);

/// Returns the current time, formatted as `started`.
std::string time_text();

}  // namespace pmsp::tool
