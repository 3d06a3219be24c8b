// SPDX-License-Identifier: BSD-2-Clause
#include "serve.h"

#include <algorithm>
#include <chrono>
#include <iostream>
#include <system_error>
#include <thread>
#include <utility>

#include <CLI/CLI.hpp>

#include "command_line.h"
#include "exit_code.h"
#include "numbers.h"
#include "page_address.h"
#include "pmsp/error.h"
#include "process.h"
#include "verbs.h"
#include "web/web_path.h"

namespace pmsp::tool {
namespace {

constexpr const char* kServeAbout =
    "Serves a report and the files of its directory, such as a Potree cloud, over HTTP to browsers of this computer,\n"
    "until Ctrl-C. The first line on stdout is the address to open. It contains a random token, without which nothing\n"
    "is served.\n";

constexpr const char* kServeMore =
    "A directory shows its index.html, its only page, or a list of its pages. Symbolic links and names with a leading\n"
    "dot are not served.\n"
    "\n"
    "Examples:\n"
    "  pmsp-densify serve mission.html\n"
    "  pmsp-densify serve results/ --port 8080";

struct ServeArguments {
  std::filesystem::path folder;
  std::string page;  ///< file of "/"; "" = that of the folder, or a list
  HttpOptions http;
  std::filesystem::path token_file;  ///< empty = new random token
};

/// Returns nullopt after printing help to stdout. Throws UsageError, InvalidOption, IoError.
std::optional<ServeArguments> parse_serve_arguments(int argc, const char* const* argv) {
  ServeArguments a;
  std::filesystem::path what;
  CLI::App app(kServeAbout, "pmsp-densify serve");
  set_up_verb(app, kServeMore);
  app.add_option("what", what, "Report or directory")->type_name("FILE|DIR");
  app.add_option_function<std::string>(
         "--port", [&a](const std::string& text) { a.http.port = port_from("--port", text); },
         "Port to listen at [1 to 65535; default 0 = any free port]")
      ->type_name("N");
  app.add_option("--address", a.http.address,
                 "Address to listen at; at an address that others can reach, anyone with the token can see the files "
                 "[default 127.0.0.1]")
      ->type_name("A");
  app.add_option("--token", a.token_file,
                 "File with the token, 16 to 128 letters, digits, - and _, for an address that stays the same; a "
                 "missing file is created, with a random token [default: a new token in each call]")
      ->type_name("FILE");
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

constexpr std::size_t kMostPages = 1000;

}  // namespace

FolderHandler::FolderHandler(const std::filesystem::path& folder, std::string page)
    : path_(folder), folder_(folder), page_(std::move(page)) {
  if (page_.empty()) return;
  if (!folder_.open({page_}).descriptor.is_open()) {
    throw IoError((folder / page_).string() +
                  ": cannot be served; expected an ordinary file, no link, whose name begins with no dot");
  }
}

std::optional<web::HttpReply> FolderHandler::operator()(const web::HttpRequest& request) const {
  if (request.path.size() == 1 && request.path.front().empty()) {
    const std::string page = !page_.empty() ? page_ : "index.html";
    web::ServedFile file = folder_.open({page});
    if (file.descriptor.is_open()) return web::file_reply(std::move(file), page, request.range);
    return front_page();
  }
  return web::file_reply(folder_.open(request.path), request.path.back(), request.range);
}

/// Of the folder and of those in it.
std::vector<std::string> FolderHandler::pages() const {
  std::vector<std::string> names;
  std::error_code error;
  const auto look = [&](const std::filesystem::path& folder, const std::string& prefix) {
    std::vector<std::string> folders;
    for (std::filesystem::directory_iterator it(folder, error), end; it != end && !error; it.increment(error)) {
      const std::string name = it->path().filename().string();
      if (name.empty() || name.front() == '.' || names.size() >= kMostPages) continue;
      const auto kind = it->symlink_status(error).type();
      if (kind == std::filesystem::file_type::directory) folders.push_back(name);
      if (kind == std::filesystem::file_type::regular && it->path().extension() == ".html")
        names.push_back(prefix + name);
    }
    return folders;
  };
  for (const std::string& folder : look(path_, "")) look(path_ / folder, folder + "/");
  std::sort(names.begin(), names.end());
  return names;
}

web::HttpReply FolderHandler::front_page() const {
  const std::vector<std::string> names = pages();
  if (names.size() == 1 && names.front().find('/') == std::string::npos) {
    return web::file_reply(folder_.open(names), names.front(), "");
  }
  std::string html = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Pages</title><h1>Pages</h1>";
  if (names.empty()) html += "<p>No page in this directory.</p>";
  html += "<ul>";
  for (const std::string& name : names)
    html += "<li><a href=\"" + web::relative_address(name) + "\">" + web::html_text(name) + "</a></li>";
  web::HttpReply reply;
  reply.type = web::media_type("list.html");
  reply.body = std::make_shared<const std::string>(html + "</ul></html>\n");
  return reply;
}

int serve(int argc, const char* const* argv) {
  const std::optional<ServeArguments> arguments = parse_serve_arguments(argc, argv);
  if (!arguments) return kExitOk;
  const FolderHandler files(arguments->folder, arguments->page);
  const InterruptGuard guard(nullptr);
  HttpOptions options = arguments->http;
  options.token = token_from_file(arguments->token_file);
  const web::HttpServer server(options, [&files](const web::HttpRequest& request) { return files(request); });
  std::cout << server.url() << std::endl;
  if (!std::cout) throw OutputError("standard output cannot be written");
  print_access(options.address, server.url());
  std::cerr << "serving " << (arguments->folder / arguments->page).string() << "; Ctrl-C ends it\n";
  try {
    for (;; std::this_thread::sleep_for(std::chrono::milliseconds(100))) guard.check();
  } catch (const Interrupted&) {
    return kExitOk;  // that is how it ends
  }
}

}  // namespace pmsp::tool
