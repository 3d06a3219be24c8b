// SPDX-License-Identifier: BSD-2-Clause
#include <exception>
#include <iostream>

#include "exit_code.h"
#include "verbs.h"

namespace {

int guarded_main(int argc, char** argv) {
  using namespace pmsp::tool;
  const std::optional<Arguments> arguments = parse_arguments(argc, argv);
  if (!arguments) return kExitOk;
  if (arguments->verb == Verb::kInfo) {
    info(*arguments);
  } else if (arguments->verb == Verb::kConfig || arguments->print_config) {
    config(*arguments);
  } else {
    run(*arguments);
  }
  std::cout.flush();
  if (!std::cout) throw pmsp::OutputError("standard output cannot be written");
  return kExitOk;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return guarded_main(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "pmsp-densify: " << error.what() << "\n";
    return pmsp::tool::exit_code_of(error);
  } catch (...) {
    std::cerr << "pmsp-densify: unexpected error\n";
    return pmsp::tool::kExitUnexpected;
  }
}
