// SPDX-License-Identifier: BSD-2-Clause
#include "cli/batch_missions.h"

#include <algorithm>
#include <csignal>
#include <sstream>

#include <catch2/catch.hpp>

namespace pmsp_test {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells(1);
  bool is_quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (c == '"' && is_quoted && line.compare(i, 2, "\"\"") == 0) {
      cells.back() += line[i++];
    } else if (c == '"') {
      is_quoted = !is_quoted;
    } else if (c == ',' && !is_quoted) {
      cells.emplace_back();
    } else {
      cells.back() += c;
    }
  }
  return cells;
}

}  // namespace

std::vector<std::string> quick_options() {
  const std::vector<std::string> words = quick_run("");
  std::vector<std::string> options;
  for (std::size_t i = 4; i < words.size(); ++i) {
    if (words[i] == "-o") {
      ++i;
    } else {
      options.push_back(words[i]);
    }
  }
  return options;
}

Missions::Missions() {
  fs::create_directory_symlink(mission() / "images", dir_ / "images");
  fs::copy_file(mission() / "map.msg", dir_ / "map.msg");
}

Missions::Json Missions::line(const std::string& name, const Json& more) {
  Json line{{"name", name}, {"map", "map.msg"}, {"images", "images"}};
  line.update(more);
  return line;
}

void Missions::write(const std::vector<Json>& lines) const {
  std::string text;
  for (const Json& line : lines) text += line.dump() + "\n";
  write_text(dir_ / "m.jsonl", text);
}

std::vector<std::string> Missions::words(const std::vector<std::string>& more, const char* manifest) const {
  std::vector<std::string> words{"batch", (dir_ / manifest).string(), "-o", (dir_ / "out").string()};
  const std::vector<std::string> quick = quick_options();
  for (const auto* options : {&quick, &more}) words.insert(words.end(), options->begin(), options->end());
  return words;
}

Result Missions::batch(const std::vector<std::string>& more, const char* manifest) const {
  return densify(words(more, manifest));
}

Result Missions::bare(const std::vector<std::string>& more) const {
  std::vector<std::string> words{"batch", "-o", (dir_ / "out").string()};
  words.insert(words.end(), more.begin(), more.end());
  return densify(words);
}

Missions::Json Missions::status(const std::string& name) const {
  const std::string text = read_text(result(name) / "status.json");
  return text.empty() ? Json{{"state", "waiting"}} : Json::parse(text);
}

std::map<std::string, std::string> Missions::row(const std::string& name) const {
  std::istringstream lines(read_text(dir_ / "out/missions.csv"));
  std::string line;
  std::getline(lines, line);
  const std::vector<std::string> names = cells_of(line);
  std::map<std::string, std::string> row;
  while (std::getline(lines, line)) {
    const std::vector<std::string> cells = cells_of(line);
    for (std::size_t i = 0; cells[0] == name && i < std::min(names.size(), cells.size()); ++i) row[names[i]] = cells[i];
  }
  return row;
}

std::string Missions::files() const {
  std::vector<std::string> files;
  std::error_code ignored;
  for (const auto& entry : fs::recursive_directory_iterator(dir_ / "out", ignored)) {
    const auto time = entry.last_write_time().time_since_epoch().count();
    const std::string content = entry.is_regular_file() ? read_text(entry.path()) : "";
    files.push_back(entry.path().string() + " " + std::to_string(time) + "\n" + content);
  }
  std::sort(files.begin(), files.end());
  std::string all;
  for (const std::string& file : files) all += file;
  return all;
}

bool is_alive(pid_t process) {
  if (kill(process, 0) != 0) return false;
  const std::string stat = read_text("/proc/" + std::to_string(process) + "/stat");  // a zombie has ended
  const std::size_t name_end = stat.rfind(')');
  return name_end == std::string::npos || stat.substr(name_end + 2, 1) != "Z";
}

pid_t stop_run_of(const Missions& missions, const std::string& name) {
  const bool is_running = comes([&] {
    return missions.status(name).contains("process") && fs::exists(missions.result(name) / "work/workspace.json");
  });
  REQUIRE(is_running);
  const pid_t process = missions.status(name)["process"].get<pid_t>();
  kill(process, SIGSTOP);
  return process;
}

}  // namespace pmsp_test
