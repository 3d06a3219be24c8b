// SPDX-License-Identifier: BSD-2-Clause
#include <cstdlib>
#include <exception>
#include <iostream>
#include <string>

#include "exit_code.h"
#include "mission_input.h"
#include "verbs.h"

#if defined(__GLIBC__)
#include <malloc.h>
#endif

namespace {

int guarded_main(int argc, char** argv) {
  using namespace pmsp::tool;
  const std::string verb = argc > 1 ? argv[1] : "";
  if (verb == "batch") return batch(argc, argv);
  if (verb == "convert") return convert(argc, argv);
  if (verb == "report") return report(argc, argv);
  if (verb == "serve") return serve(argc, argv);
  const std::optional<Arguments> arguments = parse_arguments(argc, argv);
  if (!arguments) return kExitOk;
  if (arguments->verb == Verb::kInfo) {
    info(*arguments);
  } else if (arguments->verb == Verb::kMerge) {
    merge(*arguments);
  } else if (arguments->verb == Verb::kConfig || arguments->print_config) {
    config(*arguments);
  } else if (arguments->verb == Verb::kFuse) {
    fuse(with_needed_images(*arguments));
  } else if (arguments->print_memory) {
    print_memory(with_needed_images(*arguments));
  } else if (arguments->shard) {
    run_shard(with_needed_images(*arguments));
  } else {
    run(with_needed_images(*arguments));
  }
  std::cout.flush();
  if (!std::cout) throw pmsp::OutputError("standard output cannot be written");
  return kExitOk;
}

}  // namespace

int main(int argc, char** argv) {
#if defined(__GLIBC__)
  // Arrays of all sizes are allocated and freed by different threads: few arenas need less memory than one per thread,
  // and less time than mmap for each array.
  mallopt(M_ARENA_MAX, 4);
#endif
  // Loads all kernels at the start: lazy loading at the first launch would synchronise the device, and starve others.
  setenv("CUDA_MODULE_LOADING", "EAGER", 0);
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
