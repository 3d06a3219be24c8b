// SPDX-License-Identifier: BSD-2-Clause
#pragma once

namespace pmsp::bench {

/// `pmsp-bench write`: times of the cloud writers. Returns the exit code; throws as main.
int write_bench(int argc, char** argv);

}  // namespace pmsp::bench
