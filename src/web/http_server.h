// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/web.h"
#include "web/served_file.h"

namespace pmsp::web {

/// Request with the valid token.
struct HttpRequest {
  std::vector<std::string> path;  ///< path_segments after the token
  std::string query;
  std::string range;         ///< Range header; "" = the complete file
  bool must_answer = false;  ///< the timeout has elapsed: nullopt is no longer an answer
};

struct HttpReply {
  int status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::shared_ptr<const std::string> body;
  ServedFile file;                 ///< replaces `body` if open
  std::optional<ByteRange> range;  ///< part of the file, with status 206
};

/// Returns the reply; nullopt = none yet: called again every 50 ms, until `HttpOptions::long_poll_timeout` has elapsed.
using HttpHandler = std::function<std::optional<HttpReply>(const HttpRequest&)>;

/// HTTP server for GET and HEAD, with one thread. The first segment of each path must be its token; other requests get
/// 404. Memory and number of connections are bounded for any client.
class PMSP_API HttpServer {
 public:
  /// `handler`: called on the server's thread, must not block. Throws InvalidOption if the address or the
  /// token is invalid, OutputError if the address is not available.
  HttpServer(const HttpOptions& options, HttpHandler handler);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  std::uint16_t port() const;
  std::string url() const;  ///< with the token

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Returns 128 random bits of the system as a token. Throws OutputError.
PMSP_API std::string new_token();

/// Throws InvalidOption unless it is valid, see HttpOptions::token; the message does not contain it.
PMSP_API void require_token(const std::string& token);

/// Whether the address is reachable from this computer only. Throws InvalidOption if it is invalid.
PMSP_API bool is_loopback(const std::string& address);

/// Returns the warning for an address that others can reach.
PMSP_API std::string address_warning(const std::string& address);

PMSP_API HttpReply not_found();

/// Returns the file, or the part of it that a Range header selects; not_found if it is not open. `name`: for its type.
PMSP_API HttpReply file_reply(ServedFile file, const std::string& name, const std::string& range_header);

}  // namespace pmsp::web
