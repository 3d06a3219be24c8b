// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "batch_manifest.h"
#include "batch_status.h"
#include "child_process.h"
#include "pmsp/io/cloud.h"

namespace pmsp::tool {

/// A mission of a batch and its state.
struct BatchMission {
  Mission mission;
  std::filesystem::path folder;
  std::vector<std::string> options;  ///< in force: those of all missions, then its own
  MissionStatus status;
  bool has_run = false;  ///< in this call
};

// Contents of a mission's folder.
inline std::filesystem::path workspace_of(const std::filesystem::path& folder) { return folder / "work"; }
inline std::filesystem::path cloud_of(const std::filesystem::path& folder, const CloudFormat& format) {
  return folder / ("cloud" + std::string(format.extension));
}
inline std::filesystem::path stats_of(const std::filesystem::path& folder) { return folder / "stats.json"; }
inline std::filesystem::path log_of(const std::filesystem::path& folder) { return folder / "log.txt"; }
std::vector<std::filesystem::path> clouds_of(const BatchMission& mission);
/// nullopt without --report.
std::optional<std::filesystem::path> report_of(const BatchMission& mission);
/// Whether its clouds and its report exist.
bool has_results(const BatchMission& mission);

/// Name of the lock of such a folder in messages.
constexpr const char* kLockedFolder = "folder of a mission";

bool has_state(const MissionStatus& status, const char* state);
/// Sets the state to failed.
void refuse(BatchMission& mission, const std::string& reason);
/// Sets the status to that of the mission's folder: waiting where there is none, or no results any more; failed where
/// the mission cannot be run, or where the folder is not of a batch.
void look_at(BatchMission& mission);

/// The command line of its run, but for its share of the machine. `inputs`: the manifest's folder.
std::vector<std::string> run_words(const BatchMission& mission, const std::string& program,
                                   const std::filesystem::path& inputs);

/// Throws as `run` does before it reads anything but a configuration file.
void check_run_words(const std::vector<std::string>& words);

/// Of the mission's options, and of the names, times and sizes of its files, wherever they are.
std::string fingerprint_of(const Mission& mission, const std::vector<std::string>& options,
                           const std::filesystem::path& inputs);

/// Whether its map and images exist.
bool has_inputs(const Mission& mission, const std::filesystem::path& inputs);

/// Appends the first lines of a run to the log: time, host, version, command. Returns the size of the log then. Throws
/// OutputError.
std::size_t begin_log(const std::filesystem::path& log, const MissionStatus& status);

/// Why it has failed; its output begins at this byte of the log.
std::string reason_of(const ChildEnd& end, const std::filesystem::path& log, std::size_t begin);

/// The first line "warning: ..." of a log that is not of a keyframe; "" without one.
std::string warning_in(const std::filesystem::path& log);

/// Sets points, coverage, confidence, fit and as reason the first warning, as far as the statistics have them.
void read_stats(const std::filesystem::path& stats, MissionStatus& status);

/// The devices of one of `jobs` jobs: round-robin, so that each device has a job where there are as many.
std::vector<int> devices_of_job(std::size_t job, std::size_t jobs, const std::vector<int>& devices);

}  // namespace pmsp::tool
