// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>
#include <vector>

#include "pmsp-synth/mission_files.h"
#include "synth/mission.h"

namespace pmsp::synth_tool {

/// Names of the layouts of published benchmarks, see docs/results.md.
std::vector<std::string> layout_names();

/// Writes the mission into a new or empty folder as a benchmark would be laid out; metres. Throws OutputError.
void write_layout(const std::string& layout, synth::Mission& mission, const MissionFilesOptions& options);

}  // namespace pmsp::synth_tool
