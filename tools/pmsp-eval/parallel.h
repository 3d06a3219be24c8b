// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "machine.h"
#include "pmsp/stages.h"

namespace pmsp::eval {

constexpr std::size_t kPointsPerTask = 4096;

/// Returns `threads`, or for 0 the number of CPUs available to the process.
inline int resolve_threads(int threads) { return threads > 0 ? threads : usable_cpus(); }

/// Calls `work(begin, end)` for chunks of [0, count) of at most `chunk` on several threads (0 = one per available CPU).
/// The first exception ends the work and is rethrown.
template <class Work>
void parallel_chunks(std::size_t count, std::size_t chunk, int threads, const Work& work) {
  std::atomic<std::size_t> next{0};
  std::exception_ptr error;
  std::mutex error_mutex;
  const auto run = [&] {
    try {
      for (std::size_t begin = next.fetch_add(chunk); begin < count; begin = next.fetch_add(chunk)) {
        work(begin, std::min(begin + chunk, count));
      }
    } catch (...) {
      const std::lock_guard<std::mutex> lock(error_mutex);
      if (!error) error = std::current_exception();
      next = count;
    }
  };
  std::vector<std::thread> pool;
  const std::size_t pieces = (count + chunk - 1) / chunk;
  const std::size_t workers = std::min(pieces, static_cast<std::size_t>(resolve_threads(threads)));
  for (std::size_t i = 1; i < workers; ++i) pool.emplace_back(run);
  run();
  for (std::thread& thread : pool) thread.join();
  if (error) std::rethrow_exception(error);
}

}  // namespace pmsp::eval
