// SPDX-License-Identifier: BSD-2-Clause
#include "batch_status.h"

#include <ctime>
#include <system_error>

#include "depth_output.h"
#include "export/files.h"
#include "pmsp/error.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFile = "status.json";

}  // namespace

std::string text_in(const MissionStatus& status, const char* key) {
  return status.contains(key) && status[key].is_string() ? status[key].get<std::string>() : "";
}

std::optional<MissionStatus> read_status(const fs::path& folder) {
  const fs::path path = folder / kFile;
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return std::nullopt;
  MissionStatus status = MissionStatus::parse(read_whole_file(path), nullptr, false);
  const std::string state = text_in(status, "state");
  if (!text_in(status, "fingerprint").empty() &&
      (state == kRunning || state == kInterrupted || state == kDone || state == kFailed)) {
    return status;
  }
  throw InvalidInput(path.string() + ": is no status of a mission; delete the directory, or give another one with -o");
}

bool is_unfinished_status(const std::string& name) { return target_of_temporary(name) == kFile; }

void write_status(const fs::path& folder, const MissionStatus& status) {
  write_file(folder / kFile, json_text(status));
}

void write_if_changed(const fs::path& path, const std::string& text) {
  try {
    if (read_whole_file(path) == text) return;
  } catch (const IoError&) {  // no status
  }
  write_file(path, text);
}

std::string time_text() {
  const std::time_t now = std::time(nullptr);
  std::tm utc = {};
  gmtime_r(&now, &utc);
  char text[32];
  std::strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

}  // namespace pmsp::tool
