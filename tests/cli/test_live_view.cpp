// SPDX-License-Identifier: BSD-2-Clause
#include <signal.h>

#include <chrono>
#include <thread>

#include <catch2/catch.hpp>

#include "cli/command.h"
#include "report_page.h"
#include "web/client.h"
#include "web/page.h"

using namespace pmsp_test;
using Catch::Contains;

namespace {

/// The address of the page that a run has printed.
std::string url_of(const Command& command) {
  for (int i = 0; i < 6000; ++i) {
    const std::string err = command.err_so_far();
    const std::size_t begin = err.find("http://");
    const std::size_t end = err.find('\n', begin);
    if (begin != std::string::npos && end != std::string::npos) return err.substr(begin, end - begin);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return "";
}

}  // namespace

TEST_CASE("malicious clients change nothing in a run with --live-view") {
  if (!pmsp::web::has_report_page()) return;
  const TempDir dir;
  REQUIRE(densify(quick_run(dir / "alone.ply")).code == 0);
  Command run(densify_words(quick_run(dir / "looked.ply", {"--live-view", "0"})));
  const std::string url = url_of(run);
  REQUIRE_THAT(url, Contains("http://127.0.0.1:"));
  const auto port = static_cast<std::uint16_t>(std::stoi(url.substr(url.rfind(':') + 1)));
  std::vector<Connection> crowd;
  for (int i = 0; i < 200; ++i) {
    crowd.emplace_back(port);
    if (i % 2 == 0) crowd.back().send("GET " + path_of(url) + " HTTP/1.1\r\nX: ");  // never ends
    if (i % 5 == 0) crowd.back().send(std::string(10000, 'x'));
  }
  crowd.emplace_back(port, 4096);  // has the token, and does not read
  crowd.back().send("GET " + path_of(url) + " HTTP/1.1\r\nHost: x\r\n\r\n");
  CHECK(get(port, "/").status != 200);
  CHECK(get(port, path_of(url) + "../../etc/passwd").status != 200);
  const Result result = run.wait();
  INFO(result.err);
  CHECK(result.code == 0);
  CHECK(read_text(dir / "looked.ply") == read_text(dir / "alone.ply"));
}

TEST_CASE("a run with a token file has the same address again, and stays until a signal with --live-keep") {
  if (!pmsp::web::has_report_page()) return;
  const TempDir dir;
  const std::string token = (dir / "token").string(), report = (dir / "r.html").string();
  std::string port = "0", first;
  for (int i = 0; i < 2; ++i) {
    Command run(densify_words(quick_run(
        dir / "c.ply", {"--force", "--report", report, "--live-view", port, "--live-token", token, "--live-keep"})));
    const std::string url = url_of(run);
    if (i == 1) CHECK(url == first);
    first = url;
    port = url.substr(url.rfind(':') + 1);
    port.resize(port.find('/'));
    const auto ask = [&](const std::string& target) {
      return get(static_cast<std::uint16_t>(std::stoi(port)), path_of(url) + target);
    };
    REQUIRE(comes([&] { return run.err_so_far().find("Ctrl-C ends it") != std::string::npos; }));
    CHECK(ask("report/r.html").body == read_text(report));
    CHECK(ask("report/c.ply").status == 404);
    CHECK(ask("report/token").status == 404);
    CHECK(kill(run.pid(), SIGINT) == 0);
    CHECK(run.wait().code == 0);
  }
  CHECK_THAT(first, Contains("/" + read_text(token).substr(0, 32) + "/"));
}

TEST_CASE("invalid ports and addresses and directories are refused by run and serve") {
  const TempDir dir;
  const auto code = [&](const std::vector<std::string>& more) { return densify(quick_run(dir / "c.ply", more)).code; };
  CHECK(code({"--live-view", "x"}) == 2);
  CHECK(code({"--live-view", "65536"}) == 2);
  CHECK(code({"--live-view", "0", "--live-address", "localhost"}) == 2);
  CHECK(code({"--live-view", "0", "--live-address", "192.0.2.1"}) == 6);  // unassigned address
  CHECK(code({"--live-token", (dir / "token").string()}) == 2);
  CHECK(code({"--live-keep"}) == 2);
  CHECK(code({"--live-view", "0", "--live-token", (dir / "none" / "token").string()}) == 6);
  CHECK(densify({"serve"}).code == 2);
  CHECK(densify({"serve", (dir / "none").string()}).code == 3);
  CHECK(densify({"serve", dir.path().string(), "--port", "-1"}).code == 2);
  CHECK(densify({"serve", dir.path().string(), "--adress", "::1"}).code == 2);
  CHECK(dir.entries() == 0);
}
