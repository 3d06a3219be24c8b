// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "batch_arguments.h"
#include "batch_manifest.h"
#include "batch_report.h"
#include "child_process.h"
#include "pmsp/io/cloud_writer.h"

namespace pmsp::tool {

// What the run of a mission is given, and what it leaves in the mission's folder.

inline std::filesystem::path workspace_of(const std::filesystem::path& folder) { return folder / "work"; }
inline std::filesystem::path cloud_of(const std::filesystem::path& folder, const CloudFormat& format) {
  return folder / ("cloud" + std::string(format.extension));
}
/// Those that a mission is to have.
std::vector<std::filesystem::path> clouds_of(const BatchMission& mission, const BatchArguments& batch);
/// nullopt where none is asked for.
std::optional<std::filesystem::path> report_of(const BatchMission& mission, const BatchArguments& batch);
inline std::filesystem::path stats_of(const std::filesystem::path& folder) { return folder / "stats.json"; }
inline std::filesystem::path log_of(const std::filesystem::path& folder) { return folder / "log.txt"; }

/// Its command line, but for its share of the machine. `inputs`: the folder that names in the manifest are relative to.
std::vector<std::string> run_words(const BatchMission& mission, const BatchArguments& batch,
                                   const std::filesystem::path& inputs);

/// Throws what `run` would say to them before it reads anything but a configuration file.
void check_run_words(const std::vector<std::string>& words);

/// Of what decides the result: what the manifest and the command line say, wherever they lie, and the states of the
/// files that they name.
std::string fingerprint_of(const Mission& mission, const BatchArguments& batch, const std::filesystem::path& inputs);

/// Why it has failed.
std::string reason_of(const ChildEnd& end, const std::filesystem::path& log);

/// nullopt where its stats do not say.
std::optional<std::int64_t> points_in(const std::filesystem::path& stats);

}  // namespace pmsp::tool
