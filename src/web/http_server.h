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

/// A request that has shown the token.
struct HttpRequest {
  std::vector<std::string> path;  ///< behind the token, as path_segments
  std::string query;
  std::string range;       ///< header; "" = the whole
  bool last_call = false;  ///< the answer can be put off no longer
};

struct HttpReply {
  int status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::shared_ptr<const std::string> body;  ///< or
  ServedFile file;
  std::optional<ByteRange> range;  ///< of the file; needs status 206
};

/// nullopt: not yet. It is asked again every 50 ms, until `HttpOptions::patience` is over.
using HttpHandler = std::function<std::optional<HttpReply>(const HttpRequest&)>;

/// Answers GET and HEAD by one thread of its own, and only those who know the token that is the first part of each
/// path; whatever else is asked is not there. Memory and connections are bounded whatever clients do.
class PMSP_API HttpServer {
 public:
  /// `handler` is called by the server's thread alone, and should return soon. Throws InvalidOption where the address
  /// is none, OutputError where it cannot be had.
  HttpServer(const HttpOptions& options, HttpHandler handler);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  std::uint16_t port() const;
  /// With the token.
  std::string url() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Whether only this computer can reach the address. Throws InvalidOption where it is none.
PMSP_API bool is_loopback(const std::string& address);

/// What to tell who serves to others.
PMSP_API std::string address_warning(const std::string& address);

PMSP_API HttpReply not_found();

}  // namespace pmsp::web
