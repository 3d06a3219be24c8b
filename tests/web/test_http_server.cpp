// SPDX-License-Identifier: BSD-2-Clause
// Malicious clients: each is disconnected, and others are served meanwhile.
#include <dirent.h>

#include <atomic>
#include <fstream>
#include <stdexcept>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>

#include "pmsp/error.h"
#include "support/temp_dir.h"
#include "web/client.h"
#include "web/http_server.h"

using namespace pmsp;
using namespace pmsp::web;
using namespace pmsp_test;
using std::chrono::milliseconds;

namespace {

HttpReply text_reply(const std::string& text) {
  HttpReply reply;
  reply.body = std::make_shared<const std::string>(text);
  return reply;
}

HttpOptions impatient() {
  HttpOptions options;
  options.for_headers = options.for_chunk = milliseconds(1500);  // a loaded machine may leave a good client waiting
  options.long_poll_timeout = milliseconds(200);
  return options;
}

std::size_t open_descriptors() {
  std::size_t count = 0;
  DIR* const folder = opendir("/proc/self/fd");
  if (folder == nullptr) return 0;
  while (readdir(folder) != nullptr) ++count;
  closedir(folder);
  return count;
}

}  // namespace

TEST_CASE("clients that send no request or one letter at a time are disconnected") {
  const HttpServer server(impatient(), [](const HttpRequest&) { return text_reply("here"); });
  Connection silent(server.port()), slow(server.port());
  slow.send("GET ");
  CHECK(silent.is_cut_off());
  CHECK(slow.is_cut_off());
  CHECK(get(server.port(), path_of(server.url())).body == "here");
}

TEST_CASE("clients that do not read are disconnected and delay no other client") {
  const std::string large(16U << 20U, 'x');  // more than the sockets' buffers hold
  const HttpServer server(impatient(), [&](const HttpRequest& request) {
    return text_reply(request.path.front() == "large" ? large : "small");
  });
  const std::string root = path_of(server.url());
  Connection slow(server.port(), 4096);
  slow.send("GET " + root + "large HTTP/1.1\r\nHost: x\r\n\r\n");
  for (int i = 0; i < 30; ++i) {  // longer than the server waits
    CHECK(get(server.port(), root + "small").body == "small");
    std::this_thread::sleep_for(milliseconds(100));
  }
  CHECK(slow.read_all().size() < large.size());
  CHECK(get(server.port(), root + "large").body.size() == large.size());
}

TEST_CASE("long headers and bodies and other methods are refused") {
  const HttpServer server(impatient(), [](const HttpRequest&) { return text_reply("here"); });
  const std::string root = path_of(server.url());
  CHECK(get(server.port(), root, "X: " + std::string(9000, 'a') + "\r\n").status == 431);
  std::string many;
  for (int i = 0; i < 5000; ++i) many += "X" + std::to_string(i) + ": y\r\n";
  CHECK(get(server.port(), root, many).status != 200);
  CHECK(get(server.port(), root + std::string(20000, 'a')).status != 200);
  CHECK(get(server.port(), root, "Content-Length: 5\r\n", "POST").status != 200);
  CHECK(get(server.port(), root, "", "DELETE").status == 405);
  CHECK(get(server.port(), root, "Content-Length: 99999999999999999999\r\n").status != 200);
  Connection noise(server.port());
  noise.send(std::string(100000, '\0'));
  noise.read_all();
  Connection endless(server.port());
  endless.send("GET " + root + " HTTP/1.1\r\n" + std::string(1U << 20U, 'a'));
  endless.read_all();
  CHECK(get(server.port(), root).body == "here");
}

TEST_CASE("a thousand connections do not prevent other clients from being served") {
  HttpOptions options;
  options.connections = 16;
  std::atomic<int> asked{0};
  const HttpServer server(options, [&](const HttpRequest&) {
    ++asked;
    return text_reply("here");
  });
  const std::string root = path_of(server.url());
  Connection known(server.port());
  known.send("GET " + root + " HTTP/1.1\r\nHost: x\r\n\r\n");
  while (asked == 0) std::this_thread::sleep_for(milliseconds(1));
  const std::size_t before = open_descriptors();
  std::vector<Connection> crowd;
  for (int i = 0; i < 1000; ++i) {
    crowd.emplace_back(server.port());
    if (i % 3 == 0) crowd.back().send("GET /wrong");
    if (i % 100 == 0) CHECK(get(server.port(), root).body == "here");
  }
  CHECK(get(server.port(), root).body == "here");
  CHECK(open_descriptors() <= before + 1000 + options.connections);
  known.send("GET " + root + " HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  CHECK(known.read_all().find("here", 200) != std::string::npos);  // the one with the token is still connected
}

TEST_CASE("a response may be deferred until a timeout") {
  std::atomic<int> calls{0};
  const HttpServer server(impatient(), [&](const HttpRequest& request) -> std::optional<HttpReply> {
    ++calls;
    if (request.path.front() == "later" && calls >= 3) return text_reply("now");
    if (request.path.front() == "never" && request.must_answer) return text_reply("nothing");
    if (request.path.front() == "wrong") throw std::runtime_error("a secret");
    return std::nullopt;
  });
  const std::string root = path_of(server.url());
  CHECK(get(server.port(), root + "later").body == "now");
  CHECK(get(server.port(), root + "never").body == "nothing");
  CHECK(get(server.port(), root + "silent").status == 503);
  const Reply wrong = get(server.port(), root + "wrong");
  CHECK(wrong.status == 500);
  CHECK(wrong.body.find("secret") == std::string::npos);
}

TEST_CASE("a given token is that of each server, and invalid ones are refused") {
  HttpOptions options;
  options.token = "my-Token_0123456";
  for (int i = 0; i < 2; ++i) {
    const HttpServer server(options, [](const HttpRequest&) { return text_reply("here"); });
    CHECK(path_of(server.url()) == "/my-Token_0123456/");
    CHECK(get(server.port(), "/my-Token_0123456/").body == "here");
    CHECK(get(server.port(), "/my-Token_0123455/").status == 404);
    CHECK(get(server.port(), "/my-Token_01234567/").status == 404);
    CHECK(get(server.port(), "/my-token_0123456/").status == 404);
  }
  for (const std::string& token : {std::string("short"), std::string(129, 'a'), std::string("0123456789abcde/"),
                                   std::string("0123456789abcde.")}) {
    options.token = token;
    CHECK_THROWS_AS(HttpServer(options, [](const HttpRequest&) { return not_found(); }), pmsp::InvalidOption);
  }
}

TEST_CASE("addresses are checked") {
  CHECK(is_loopback("127.0.0.1"));
  CHECK(is_loopback("::1"));
  CHECK_FALSE(is_loopback("0.0.0.0"));
  CHECK_THROWS_AS(is_loopback("localhost"), pmsp::InvalidOption);
  HttpOptions taken;
  const auto nothing = [](const HttpRequest&) { return not_found(); };
  const HttpServer first({}, nothing);
  taken.port = first.port();
  CHECK_THROWS_AS(HttpServer(taken, nothing), pmsp::OutputError);
}
