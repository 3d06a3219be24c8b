// SPDX-License-Identifier: BSD-2-Clause
#include "serve_arguments.h"

#include <CLI/CLI.hpp>

#include "command_line.h"
#include "exit_code.h"
#include "numbers.h"
#include "pmsp/error.h"

namespace pmsp::tool {
namespace {

constexpr const char* kAbout =
    "Serves a report and the files of its directory, such as a Potree cloud, over HTTP to browsers of this computer,\n"
    "until Ctrl-C. The first line on stdout is the address to open. It contains a random token, without which nothing\n"
    "is served.\n";

constexpr const char* kMore =
    "A directory shows its index.html, its only page, or a list of its pages. Symbolic links and names with a leading\n"
    "dot are not served.\n"
    "\n"
    "Examples:\n"
    "  pmsp-densify serve mission.html\n"
    "  pmsp-densify serve results/ --port 8080";

}  // namespace

std::uint16_t port_from(const char* option, const std::string& text) {
  return static_cast<std::uint16_t>(number_in(option, text, 0, 65535, "a port, 1 to 65535, or 0 for one that is free"));
}

std::optional<ServeArguments> parse_serve_arguments(int argc, const char* const* argv) {
  ServeArguments a;
  std::filesystem::path what;
  CLI::App app(kAbout, "pmsp-densify serve");
  set_up_verb(app, kMore);
  app.add_option("what", what, "Report or directory")->type_name("FILE|DIR");
  app.add_option_function<std::string>(
         "--port", [&a](const std::string& text) { a.http.port = port_from("--port", text); },
         "Port to listen at [1 to 65535; default 0 = any free port]")
      ->type_name("N");
  app.add_option("--address", a.http.address,
                 "Address to listen at; at an address that others can reach, anyone with the token can see the files "
                 "[default 127.0.0.1]")
      ->type_name("A");
  if (!parse_words(app, {argv + 2, argv + argc})) return std::nullopt;
  refuse_extra_words(app);
  if (what.empty()) throw UsageError("file or directory is missing; expected pmsp-densify serve FILE|DIR");
  std::error_code error;
  const std::filesystem::path place = std::filesystem::absolute(what);
  if (std::filesystem::is_directory(place, error)) {
    a.folder = place;
    return a;
  }
  if (!std::filesystem::exists(place, error)) throw IoError(what.string() + ": no such file or directory");
  a.folder = place.parent_path();
  a.page = place.filename().string();
  return a;
}

}  // namespace pmsp::tool
