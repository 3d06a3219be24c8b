// SPDX-License-Identifier: BSD-2-Clause
#include <atomic>
#include <catch2/catch.hpp>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "machine.h"
#include "pmsp/stages.h"
#include "util/thread_pool.h"

using pmsp::ThreadPool;

namespace {

std::vector<int> visits(ThreadPool& pool, int count) {
  std::vector<std::atomic<int>> seen(static_cast<std::size_t>(count));
  for (std::atomic<int>& value : seen) value = 0;
  pool.for_each(count, [&](int i) { ++seen[static_cast<std::size_t>(i)]; });
  return {seen.begin(), seen.end()};
}

}  // namespace

TEST_CASE("a pool calls every index once, with any number of threads and loops of any length") {
  for (const int threads : {1, 2, 3, 8}) {
    ThreadPool pool(threads);
    REQUIRE(pool.threads() == threads);
    for (const int count : {0, 1, 2, 7, 1000}) {
      REQUIRE(visits(pool, count) == std::vector<int>(static_cast<std::size_t>(count), 1));
    }
  }
}

TEST_CASE("thousands of short loops in a row lose no index and do not hang") {
  ThreadPool pool(4);
  for (int loop = 0; loop < 1000; ++loop) REQUIRE(visits(pool, 5) == std::vector<int>(5, 1));
}

TEST_CASE("writes of a loop are visible after it") {
  ThreadPool pool(3);
  std::vector<int> values(2000, 0);
  pool.for_each(2000, [&](int i) { values[static_cast<std::size_t>(i)] = i; });
  for (int i = 0; i < 2000; ++i) REQUIRE(values[static_cast<std::size_t>(i)] == i);
}

TEST_CASE("an exception reaches the caller, ends the loop early and leaves the pool usable") {
  for (const int threads : {1, 2, 5}) {
    ThreadPool pool(threads);
    std::atomic<int> calls{0};
    const auto body = [&](int i) {
      ++calls;
      if (i == 3) throw std::runtime_error("at three");
    };
    REQUIRE_THROWS_WITH(pool.for_each(100000, body), "at three");
    CHECK(calls < 100000);
    REQUIRE(visits(pool, 50) == std::vector<int>(50, 1));
  }
}

TEST_CASE("if all calls of a loop throw one exception arrives and the next loop starts clean") {
  ThreadPool pool(4);
  REQUIRE_THROWS_AS(pool.for_each(100, [](int i) { throw std::out_of_range(std::to_string(i)); }), std::out_of_range);
  REQUIRE_NOTHROW(pool.for_each(100, [](int) {}));
}

TEST_CASE("a pool of one thread works in the caller") {
  ThreadPool pool(1);
  const std::thread::id caller = std::this_thread::get_id();
  pool.for_each(10, [&](int) { CHECK(std::this_thread::get_id() == caller); });
}

TEST_CASE("0 threads selects one thread per usable CPU") {
  CHECK(pmsp::usable_cpus() >= 1);
  CHECK(ThreadPool(0).threads() == pmsp::usable_cpus());
}
