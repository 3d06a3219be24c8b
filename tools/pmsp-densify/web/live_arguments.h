// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace CLI {
class App;
}

namespace pmsp::tool {

struct LiveArguments {
  std::optional<std::uint16_t> port;  ///< nullopt = no live page
  std::string address = "127.0.0.1";
};

/// --live-view and --live-address.
void add_live_options(CLI::App& run, LiveArguments& arguments);
/// Throws UsageError, InvalidOption.
void check_live(const LiveArguments& arguments, bool is_shard);

}  // namespace pmsp::tool
