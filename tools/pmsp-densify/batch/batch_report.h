// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "batch_manifest.h"
#include "batch_status.h"

namespace pmsp::tool {

/// A mission of a batch, and how far it is.
struct BatchMission {
  Mission mission;
  std::filesystem::path folder;
  MissionStatus status;
  bool has_run = false;     ///< in this batch; else the status is an earlier one's, or it cannot be run
  bool has_folder = false;  ///< of its own; else nothing is written there
};

struct BatchReport {
  std::string manifest;
  std::vector<BatchMission> missions;
  double seconds = 0.0;

  std::size_t count(MissionState state) const;
};

/// A row for each mission: name, state, points, seconds, memory, reason.
std::string table_text(const BatchReport& report);

/// "95 of 100 missions done, 5 failed"
std::string summary(const BatchReport& report);

nlohmann::ordered_json to_json(const BatchReport& report);

/// One mission as in there.
nlohmann::ordered_json to_json(const BatchMission& mission);

}  // namespace pmsp::tool
