// SPDX-License-Identifier: BSD-2-Clause
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "batch_jobs.h"
#include "devices.h"

TEST_CASE("host memory is shared among missions and a single one gets all it needs", "[batch]") {
  pmsp::tool::MemoryNeed need;
  need.host = 60.0;
  pmsp::tool::MemoryShares shares(100.0);
  const auto first = shares.take(need);
  REQUIRE(first);
  CHECK_FALSE(shares.take(need));
  CHECK(shares.take({}));  // unknown need
  need.host = 40.0;
  CHECK(shares.take(need));
  shares.give_back(*first);
  CHECK(shares.take(need));
  need.host = 1000.0;
  CHECK_FALSE(shares.take(need));
  CHECK(pmsp::tool::MemoryShares(100.0).take(need));
}

TEST_CASE("GPU memory is shared among the missions of each GPU", "[batch]") {
  constexpr double kGiB = 1024.0 * 1024.0 * 1024.0;
  pmsp::tool::MemoryNeed need;
  need.host = 50.0 * kGiB;
  need.gpu_host = 1.0 * kGiB;
  need.device = 5.0 * kGiB;
  need.device_least = 2.0 * kGiB;
  need.device_free = 8.0 * kGiB;
  need.devices = {0};
  pmsp::tool::MemoryShares shares(4.0 * kGiB);
  const auto first = shares.take(need);
  REQUIRE(first);
  CHECK(first->host == need.gpu_host);  // its need on the CPU has no effect
  CHECK(first->devices == need.devices);
  need.device_free = 3.0 * kGiB;  // while the first one runs there
  CHECK_FALSE(shares.take(need));
  pmsp::tool::MemoryNeed other = need;
  other.devices = {1};
  other.device_free = 8.0 * kGiB;
  CHECK(shares.take(other));
  pmsp::tool::MemoryNeed both = other;
  both.devices = {0, 1};
  CHECK_FALSE(shares.take(both));
  shares.give_back(*first);
  CHECK(shares.take(need));

  // Missions that exceed the free device memory get less, and run on the CPU below their minimum.
  need.device = 20.0 * kGiB;
  pmsp::tool::MemoryShares least(100.0 * kGiB);
  const auto with_scratch = least.take(need);
  REQUIRE(with_scratch);
  CHECK(with_scratch->device < 3.0 * kGiB);
  need.device_least = 10.0 * kGiB;
  const auto on_cpu = least.take(need);
  REQUIRE(on_cpu);
  CHECK(on_cpu->host == need.host);
  CHECK(on_cpu->devices.empty());
}

TEST_CASE("an unreadable memory estimate counts as zero and host memory is known", "[batch]") {
  for (const char* text : {"", "{", "[]", "{\"cpu\": 3}", "pmsp-densify: map.msg: there is no such file"}) {
    const pmsp::tool::MemoryNeed need = pmsp::tool::memory_need_from(text);
    CHECK(need.host == 0.0);
    CHECK(need.device_free == 0.0);
  }
  const std::string answer =
      R"({
  "cpu": {"memory_bytes": 7},
  "gpu": {"memory_bytes": 1, "device_bytes": 2, "least_device_bytes": 3, "free_device_bytes": 4, "devices": [1, 0]}
}
)";
  for (const std::string& log : {answer, "[h264] no frame {\n" + answer}) {
    const pmsp::tool::MemoryNeed need = pmsp::tool::memory_need_from(log);
    CHECK(need.host == 7.0);
    CHECK(need.device_free == 4.0);
    CHECK(need.devices == std::vector<int>{1, 0});
  }
  CHECK(pmsp::tool::free_host_memory() > 1e6);
  CHECK(pmsp::free_device_memory(255) == 0);  // there is none
}
