// SPDX-License-Identifier: BSD-2-Clause
#include "cli/command.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>
#include <algorithm>
#include <catch2/catch.hpp>
#include <stdexcept>

#include "support/sanitized.h"

namespace pmsp_test {

namespace fs = std::filesystem;

Command::Command(const std::vector<std::string>& words) {
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  const std::string out = (dir_ / "out").string();
  const std::string err = (dir_ / "err").string();
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, out.c_str(), O_WRONLY | O_CREAT, 0600);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, err.c_str(), O_WRONLY | O_CREAT, 0600);
  const int failed = posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) throw std::runtime_error("cannot start " + words[0]);
}

std::string Command::err_so_far() const { return read_text(dir_ / "err"); }

Result Command::wait() {
  int status = 0;
  if (waitpid(pid_, &status, 0) != pid_) throw std::runtime_error("waitpid failed");
  Result result;
  result.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.out = read_text(dir_ / "out");
  result.err = read_text(dir_ / "err");
  return result;
}

std::vector<std::string> densify_words(const std::vector<std::string>& arguments) {
  std::vector<std::string> words{PMSP_DENSIFY};
  words.insert(words.end(), arguments.begin(), arguments.end());
  return words;
}

Result densify(const std::vector<std::string>& arguments) { return Command(densify_words(arguments)).wait(); }

fs::path made_mission(const TempDir& dir, const Words& options) {
  const Result made = Command(joined({PMSP_SYNTH, "--scene", "room", "-o", (dir / "room").string()}, options)).wait();
  if (made.code != 0) throw std::runtime_error("pmsp-synth: " + made.err);
  return dir / "room";
}

const std::filesystem::path& mission() {
  static const std::filesystem::path folder = PMSP_TEST_MISSION;
  return folder;
}

std::vector<std::string> quick_run(const std::filesystem::path& output, const std::vector<std::string>& more) {
  std::vector<std::string> words{"run",      (mission() / "map.msg").string(),
                                 "--images", (mission() / "images").string(),
                                 "--width",  "128",
                                 "--height", "64",
                                 "-o",       output.string()};
  if (pmsp::test::kSanitized) {
    // Sanitizers slow down PatchMatch, vector code most of all; these tests do not check depths.
    words.insert(words.end(), {"--patchmatch-iterations", "1", "--patchmatch-refinements", "1",
                               "--patchmatch-geometric-passes", "0", "--simd", "scalar"});
  }
  const auto gives = [&](const char* option) { return std::find(more.begin(), more.end(), option) != more.end(); };
  if (!gives("--quality") && !gives("--config")) words.insert(words.end(), {"--quality", "online"});
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

Result require_ok(const Result& result) {
  INFO(result.err);
  REQUIRE(result.code == 0);
  return result;
}

Words joined(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

std::string all_bytes(const fs::path& path) {
  if (!fs::is_directory(path)) return read_text(path);
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(path)) {
    if (entry.is_regular_file()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::string text;
  for (const fs::path& file : files) text += fs::relative(file, path).string() + "\n" + read_text(file);
  return text;
}

bool same_bytes(const fs::path& a, const fs::path& b) { return read_text(a) == read_text(b); }

}  // namespace pmsp_test
