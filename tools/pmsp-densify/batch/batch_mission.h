// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "batch_jobs.h"
#include "batch_manifest.h"

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

/// Throws OutputError.
void write_status(const std::filesystem::path& folder, const MissionStatus& status);

/// Returns the current time, formatted as `started`.
std::string time_text();

/// Mission of a batch with its state.
struct BatchMission {
  Mission mission;
  std::filesystem::path folder;
  std::vector<std::string> options;  ///< effective: those of all missions, then its own
  MissionStatus status;
  bool has_run = false;  ///< in this call
};

// Contents of a mission's folder.
inline std::filesystem::path workspace_of(const std::filesystem::path& folder) { return folder / "work"; }
inline std::filesystem::path stats_of(const std::filesystem::path& folder) { return folder / "stats.json"; }
inline std::filesystem::path log_of(const std::filesystem::path& folder) { return folder / "log.txt"; }
std::vector<std::filesystem::path> clouds_of(const BatchMission& mission);
/// Path of the report; nullopt without --report.
std::optional<std::filesystem::path> report_of(const BatchMission& mission);
/// True if clouds and report exist.
bool has_results(const BatchMission& mission);

/// Description of such a folder in lock messages.
constexpr const char* kLockedFolder = "directory of a mission";

bool has_state(const MissionStatus& status, const char* state);
/// Sets the state to failed.
void refuse(BatchMission& mission, const std::string& reason);
/// Sets the status from the mission's folder: waiting without results; failed if the mission is invalid or the folder
/// does not belong to a batch.
void look_at(BatchMission& mission);

/// Returns the command line of its run, without CPU and GPU share. `inputs`: folder of the manifest.
std::vector<std::string> run_words(const BatchMission& mission, const std::string& program,
                                   const std::filesystem::path& inputs);

/// Throws as `run` does before it reads files other than the configuration.
void check_run_words(const std::vector<std::string>& words);

/// Returns a fingerprint of the options, and of names, times and sizes of the files, independent of their location.
std::string fingerprint_of(const Mission& mission, const std::vector<std::string>& options,
                           const std::filesystem::path& inputs);

/// True if map and images exist.
bool has_inputs(const Mission& mission, const std::filesystem::path& inputs);

/// Appends the header of a run to the log: time, host, version, command. Returns the size of the log after it. Throws
/// OutputError.
std::size_t begin_log(const std::filesystem::path& log, const MissionStatus& status);

/// Returns the reason of a failure; `begin`: offset of the run's output in the log.
std::string reason_of(const ChildEnd& end, const std::filesystem::path& log, std::size_t begin);

/// Returns the first "warning: ..." of a log that does not concern a keyframe; "" = none.
std::string warning_in(const std::filesystem::path& log);

/// Sets points, coverage, confidence, fit, and the first warning as reason, as available in the statistics.
void read_stats(const std::filesystem::path& stats, MissionStatus& status);

using BatchMissions = std::vector<BatchMission>;

/// Number of missions in a state.
std::size_t count(const BatchMissions& missions, const char* state);

/// Returns "95 of 100 missions done, 5 failed".
std::string summary(const BatchMissions& missions);

/// Table for a terminal.
std::string table_text(const BatchMissions& missions);

/// Result of --dry-run: a line per mission, "hall: ok", "cellar: refused: ...", and totals.
std::string checks_text(const BatchMissions& missions);

/// Content of missions.csv: header and a row per mission.
std::string csv_text(const BatchMissions& missions);

/// Content of index.html in `folder`: table with links to the files of the missions. Self-contained, without scripts.
std::string page_text(const BatchMissions& missions, const std::string& manifest, const std::filesystem::path& folder);

}  // namespace pmsp::tool
