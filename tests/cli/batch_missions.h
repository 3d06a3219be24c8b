// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include <sys/types.h>

#include <nlohmann/json.hpp>

#include "cli/command.h"

namespace pmsp_test {

/// Batches in a folder of their own, beside a copy of the mission's map and a link to its images.
class Missions {
 public:
  using Json = nlohmann::ordered_json;

  Missions();

  std::filesystem::path operator/(const std::string& name) const { return dir_ / name; }
  std::filesystem::path result(const std::string& name) const { return dir_ / "out" / name; }

  /// A line of a manifest; `more` takes precedence.
  static Json line(const std::string& name, const Json& more = Json::object());
  /// The manifest m.jsonl.
  void write(const std::vector<Json>& lines) const;

  std::vector<std::string> words(const std::vector<std::string>& more = {}, const char* manifest = "m.jsonl") const;
  /// With m.jsonl and options of a quick run.
  Result batch(const std::vector<std::string>& more = {}, const char* manifest = "m.jsonl") const;
  /// With the folder of results alone.
  Result bare(const std::vector<std::string>& more) const;

  /// status.json of a mission.
  Json status(const std::string& name) const;
  /// Cells of a mission in missions.csv by column name.
  std::map<std::string, std::string> row(const std::string& name) const;
  /// Names, times and contents of all files below the folder of results.
  std::string files() const;

 private:
  TempDir dir_;
};

/// Options of a quick run, without inputs and outputs.
std::vector<std::string> quick_options();

bool is_alive(pid_t process);

/// Waits until a mission is in the middle of its run, and stops that; returns its process.
pid_t stop_run_of(const Missions& missions, const std::string& name);

}  // namespace pmsp_test
