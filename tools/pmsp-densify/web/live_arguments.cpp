// SPDX-License-Identifier: BSD-2-Clause
#include "live_arguments.h"

#include <CLI/CLI.hpp>

#include "exit_code.h"
#include "report_arguments.h"
#include "serve_arguments.h"
#include "web/http_server.h"

namespace pmsp::tool {

void add_live_options(CLI::App& run, LiveArguments& a) {
  const char* group = "Output";
  run.add_option_function<std::string>(
         "--live-view", [&a](const std::string& text) { a.port = port_from("--live-view", text); },
         "Port of a live page with the points computed so far, moved with a newer map (--follow); its address is "
         "printed on stderr [1 to 65535; 0 = any free port]")
      ->type_name("PORT")
      ->group(group);
  run.add_option(
         "--live-address", a.address,
         "Address of the page of --live-view; at an address that others can reach, anyone with its token can see it "
         "[default 127.0.0.1]")
      ->type_name("A")
      ->group(group);
}

void check_live(const LiveArguments& a, bool is_shard) {
  web::is_loopback(a.address);  // or it is none
  if (!a.port) return;
  require_report_page("--live-view");
  if (is_shard) throw UsageError("a shard makes no cloud; leave --live-view out");
}

}  // namespace pmsp::tool
