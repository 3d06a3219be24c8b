// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <sys/types.h>

#include "support/temp_dir.h"

namespace pmsp_test {

struct Result {
  int code = -1;  ///< exit code as of a shell: 128 + n after signal n
  std::string out;
  std::string err;
};

/// A started program; its standard output and error go to files.
class Command {
 public:
  explicit Command(const std::vector<std::string>& words);
  pid_t pid() const { return pid_; }
  std::string err_so_far() const;
  Result wait();

 private:
  TempDir dir_;
  pid_t pid_ = -1;
};

using Words = std::vector<std::string>;

/// Runs pmsp-densify until it exits.
Result densify(const std::vector<std::string>& arguments);

/// The words that start pmsp-densify.
std::vector<std::string> densify_words(const std::vector<std::string>& arguments);

/// Makes a mission in a room by pmsp-synth, with these options; returns its folder.
std::filesystem::path made_mission(const TempDir& dir, const Words& options);

/// A small synthetic mission (folder with map.msg, images/), which the build made; tests do not change it.
const std::filesystem::path& mission();

/// The arguments of a quick run on it.
std::vector<std::string> quick_run(const std::filesystem::path& output, const std::vector<std::string>& more = {});

/// Fails the test unless the command succeeded. Returns its result.
Result require_ok(const Result& result);

Words joined(Words words, const Words& more);

/// Names and bytes of all files of a directory, or the bytes of a file.
std::string all_bytes(const std::filesystem::path& path);

bool same_bytes(const std::filesystem::path& a, const std::filesystem::path& b);

/// Whether the condition becomes true within ten minutes.
template <class Condition>
bool comes(const Condition& condition) {
  for (int i = 0; i < 60000; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

}  // namespace pmsp_test
