// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <sys/types.h>

#include "support/temp_dir.h"

namespace pmsp_test {

struct Result {
  int code = -1;  ///< as a shell shows it: 128 + n after signal n
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

/// Runs pmsp-densify to its end.
Result densify(const std::vector<std::string>& arguments);

/// The words that start pmsp-densify.
std::vector<std::string> densify_words(const std::vector<std::string>& arguments);

/// A small synthetic mission (folder with map.msg, images/), made once for all tests.
const std::filesystem::path& mission();

/// The arguments of a quick run on it.
std::vector<std::string> quick_run(const std::filesystem::path& output, const std::vector<std::string>& more = {});

}  // namespace pmsp_test
