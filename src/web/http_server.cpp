// SPDX-License-Identifier: BSD-2-Clause
#include "web/http_server.h"
#include "machine.h"

#include <sys/random.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <list>
#include <thread>
#include <utility>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>

#include "pmsp/error.h"
#include "pmsp/stages.h"

namespace pmsp::web {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using tcp = asio::ip::tcp;
using ErrorCode = boost::system::error_code;

constexpr std::size_t kChunk = 65536;
constexpr std::size_t kMinToken = 16, kMaxToken = 128;
constexpr auto kPollInterval = std::chrono::milliseconds(50);

asio::ip::address address_from(const std::string& text) {
  ErrorCode error;
  const asio::ip::address address = asio::ip::make_address(text, error);
  if (!error) return address;
  throw InvalidOption("address \"" + text + "\" is invalid; expected an IP address such as 127.0.0.1 or ::1");
}

/// Compares in constant time.
bool are_equal(const std::string& given, const std::string& token) {
  unsigned difference = given.size() == token.size() ? 0U : 1U;
  for (std::size_t i = 0; i < token.size(); ++i) {
    const char other = i < given.size() ? given[i] : '\0';
    difference |= static_cast<unsigned>(static_cast<unsigned char>(token[i]) ^ static_cast<unsigned char>(other));
  }
  return difference == 0;
}

HttpReply plain_reply(int status, const std::string& text) {
  HttpReply reply;
  reply.status = status;
  reply.body = std::make_shared<const std::string>(text + "\n");
  return reply;
}

class Session;

/// State shared by all sessions.
struct Common {
  HttpOptions options;
  HttpHandler handler;
  std::string token;
  std::list<Session*> sessions;  ///< from the oldest to the youngest
};

/// Connection. Each operation has a timeout: `expires_after` applies to all operations until the next call.
class Session : public std::enable_shared_from_this<Session> {
 public:
  Session(tcp::socket socket, Common& common)
      : common_(common), stream_(std::move(socket)), poll_timer_(stream_.get_executor()) {
    place_ = common_.sessions.insert(common_.sessions.end(), this);
  }
  ~Session() {
    if (!is_closed_) common_.sessions.erase(place_);
  }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  bool is_trusted() const { return is_trusted_; }

  /// Cancels all operations and closes the connection.
  void close() {
    if (std::exchange(is_closed_, true)) return;
    common_.sessions.erase(place_);
    ErrorCode ignored;
    stream_.socket().close(ignored);
    poll_timer_.cancel();
  }

  void read() {
    parser_.emplace();
    parser_->header_limit(static_cast<std::uint32_t>(common_.options.header_bytes));
    parser_->body_limit(0);
    stream_.expires_after(common_.options.for_headers);
    http::async_read(stream_, buffer_, *parser_, [self = shared_from_this()](ErrorCode error, std::size_t) {
      if (!error) return self->take();
      if (error == http::error::header_limit || error == http::error::buffer_overflow) {
        return self->refuse(431, "the headers are too long");
      }
      if (error == http::error::body_limit || error == http::error::unexpected_body) {
        return self->refuse(413, "requests must not have a body");
      }
      self->close();
    });
  }

 private:
  void take() {
    const auto& request = parser_->get();
    keep_alive_ = request.keep_alive();
    is_head_ = request.method() == http::verb::head;
    const std::string target(request.target());
    const auto segments = path_segments(target);
    if (!segments || !are_equal(segments->front(), common_.token)) return refuse(404, "not found");
    is_trusted_ = true;
    if (request.method() != http::verb::get && !is_head_) return refuse(405, "expected GET or HEAD");
    request_ = {};
    request_.path.assign(segments->begin() + 1, segments->end());
    request_.query = std::string(query_of(target));
    if (request.count(http::field::if_range) == 0) request_.range = std::string(request[http::field::range]);
    if (request_.path.empty()) {
      location_ = "/" + common_.token + "/";
      return answer(plain_reply(308, "see " + location_));
    }
    give_up_ = std::chrono::steady_clock::now() + common_.options.long_poll_timeout;
    poll_handler();
  }

  void poll_handler() {
    if (is_closed_) return;
    request_.must_answer = std::chrono::steady_clock::now() >= give_up_;
    std::optional<HttpReply> reply;
    try {
      reply = common_.handler(request_);
    } catch (const std::exception&) {
      reply = plain_reply(500, "this cannot be served");
    }
    if (!reply && request_.must_answer) reply = plain_reply(503, "there is no answer");
    if (reply) return answer(std::move(*reply));
    poll_timer_.expires_after(kPollInterval);
    poll_timer_.async_wait([self = shared_from_this()](ErrorCode error) {
      if (!error) self->poll_handler();
    });
  }

  void refuse(unsigned status, const std::string& why) {
    keep_alive_ = false;
    answer(plain_reply(static_cast<int>(status), why));
  }

  void answer(HttpReply reply) {
    reply_ = std::move(reply);
    const bool is_file = reply_.file.descriptor.is_open();
    const std::uint64_t size = is_file ? reply_.file.size : reply_.body ? reply_.body->size() : 0;
    const ByteRange part = reply_.range.value_or(ByteRange{0, size});
    next_ = part.first;
    end_ = is_head_ ? next_ : part.first + part.count;
    serializer_.reset();
    header_ = {};
    header_.version(parser_ ? parser_->get().version() : 11);
    header_.result(static_cast<unsigned>(reply_.status));
    header_.keep_alive(keep_alive_);
    header_.set(http::field::content_type, reply_.type);
    if (reply_.status != 204) header_.set(http::field::content_length, std::to_string(part.count));
    if (is_file) header_.set(http::field::accept_ranges, "bytes");
    if (reply_.status == 206) {
      header_.set(http::field::content_range, "bytes " + std::to_string(part.first) + "-" +
                                                  std::to_string(part.first + part.count - 1) + "/" +
                                                  std::to_string(size));
    } else if (reply_.status == 416) {
      header_.set(http::field::content_range, "bytes */" + std::to_string(size));
    } else if (reply_.status == 308) {
      header_.set(http::field::location, location_);
    } else if (reply_.status == 405) {
      header_.set(http::field::allow, "GET, HEAD");
    }
    // The token and the contents must not reach third parties.
    header_.set(http::field::cache_control, "no-store");
    header_.set("Referrer-Policy", "no-referrer");
    header_.set("X-Content-Type-Options", "nosniff");
    header_.set("Cross-Origin-Resource-Policy", "same-origin");
    header_.set("X-Frame-Options", "DENY");
    // Foreign pages of a served directory must not send it elsewhere. Own pages contain a stricter policy.
    header_.set("Content-Security-Policy",
                "default-src 'self' 'unsafe-inline' data: blob:; base-uri 'none'; form-action 'none'");
    serializer_.emplace(header_);
    stream_.expires_after(common_.options.for_chunk);
    http::async_write_header(stream_, *serializer_, [self = shared_from_this()](ErrorCode error, std::size_t) {
      if (error) return self->close();
      self->send();
    });
  }

  /// Sends the next chunk. Slow clients are disconnected by the timeout.
  void send() {
    if (next_ == end_) return finish();
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(kChunk, end_ - next_));
    const char* from = nullptr;
    if (reply_.file.descriptor.is_open()) {
      chunk_.resize(kChunk);
      const ssize_t got = pread(reply_.file.descriptor.get(), chunk_.data(), count, static_cast<off_t>(next_));
      if (got != static_cast<ssize_t>(count)) return close();  // truncated meanwhile
      from = chunk_.data();
    } else {
      from = reply_.body->data() + next_;
    }
    next_ += count;
    stream_.expires_after(common_.options.for_chunk);
    asio::async_write(stream_, asio::buffer(from, count), [self = shared_from_this()](ErrorCode error, std::size_t) {
      if (error) return self->close();
      self->send();
    });
  }

  void finish() {
    reply_ = {};
    if (keep_alive_) return read();
    ErrorCode ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    close();
  }

  Common& common_;
  std::list<Session*>::iterator place_;
  beast::tcp_stream stream_;
  asio::steady_timer poll_timer_;
  beast::flat_static_buffer<16384> buffer_;
  std::optional<http::request_parser<http::empty_body>> parser_;
  HttpRequest request_;
  std::chrono::steady_clock::time_point give_up_;
  HttpReply reply_;
  http::response<http::empty_body> header_;
  std::optional<http::response_serializer<http::empty_body>> serializer_;
  std::string location_;
  std::vector<char> chunk_;
  std::uint64_t next_ = 0, end_ = 0;  ///< of the body
  bool keep_alive_ = false, is_head_ = false, is_trusted_ = false, is_closed_ = false;
};

}  // namespace

struct HttpServer::Impl {
  Impl(const HttpOptions& options, HttpHandler handler) {
    common.options = options;
    common.handler = std::move(handler);
    common.token = options.token.empty() ? new_token() : options.token;
    require_token(common.token);
    const tcp::endpoint endpoint(address_from(options.address), options.port);
    try {
      acceptor.open(endpoint.protocol());
      acceptor.set_option(asio::socket_base::reuse_address(true));
      acceptor.bind(endpoint);
      acceptor.listen();
    } catch (const boost::system::system_error& error) {
      throw OutputError("port " + std::to_string(options.port) + " of " + options.address +
                        " cannot be served: " + error.code().message() + "; expected a free port, or 0 to select one");
    }
    port = acceptor.local_endpoint().port();
    accept();
    thread = std::thread([this] {
      run_at_low_priority(common.options.nice);
      context.run();
    });
  }

  ~Impl() {
    context.stop();
    thread.join();
  }

  void accept() {
    acceptor.async_accept([this](ErrorCode error, tcp::socket socket) {
      if (!error) {
        if (has_room()) std::make_shared<Session>(std::move(socket), common)->read();
        return accept();
      }
      if (error == asio::error::operation_aborted) return;
      wait.expires_after(std::chrono::milliseconds(100));  // no descriptors are left, for example
      wait.async_wait([this](ErrorCode) { accept(); });
    });
  }

  /// Whether one more connection is allowed; closes one without token if necessary.
  bool has_room() {
    if (common.sessions.size() < common.options.connections) return true;
    const auto unauthenticated = std::find_if(common.sessions.begin(), common.sessions.end(),
                                              [](const Session* session) { return !session->is_trusted(); });
    if (unauthenticated == common.sessions.end()) return false;
    (*unauthenticated)->close();
    return true;
  }

  std::uint16_t port = 0;
  Common common;  ///< declared before the context, which destroys the sessions
  asio::io_context context{1};
  tcp::acceptor acceptor{context};
  asio::steady_timer wait{context};
  std::thread thread;
};

HttpServer::HttpServer(const HttpOptions& options, HttpHandler handler)
    : impl_(std::make_unique<Impl>(options, std::move(handler))) {}
HttpServer::~HttpServer() = default;

std::uint16_t HttpServer::port() const { return impl_->port; }

std::string HttpServer::url() const {
  const asio::ip::address address = address_from(impl_->common.options.address);
  const std::string host = address.is_v6() ? "[" + address.to_string() + "]" : address.to_string();
  return "http://" + host + ":" + std::to_string(port()) + "/" + impl_->common.token + "/";
}

std::string new_token() {
  std::array<unsigned char, 16> bytes{};
  if (getentropy(bytes.data(), bytes.size()) != 0) {
    throw OutputError(std::string("random numbers of the system are not available: ") + std::strerror(errno));
  }
  std::string token;
  for (const unsigned char byte : bytes) {
    for (const int digit : {byte >> 4, byte & 15}) token += "0123456789abcdef"[digit];
  }
  return token;
}

void require_token(const std::string& token) {
  const bool is_plain = std::all_of(token.begin(), token.end(), [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-' || c == '_';
  });
  if (is_plain && token.size() >= kMinToken && token.size() <= kMaxToken) return;
  throw InvalidOption("the token has " + std::to_string(token.size()) + " characters" +
                      (is_plain ? "" : ", some invalid ones") + "; expected 16 to 128 letters, digits, '-' and '_'");
}

bool is_loopback(const std::string& address) { return address_from(address).is_loopback(); }

std::string address_warning(const std::string& address) {
  return "others can reach " + address +
         ": anyone with the address of the page can see its contents; the connection is not encrypted";
}

HttpReply not_found() { return plain_reply(404, "not found"); }

HttpReply file_reply(ServedFile file, const std::string& name, const std::string& range_header) {
  if (!file.descriptor.is_open()) return not_found();
  HttpReply reply;
  reply.type = media_type(name);
  reply.range = range_from(range_header, file.size);
  if (reply.range) reply.status = reply.range->count > 0 ? 206 : 416;
  reply.file = std::move(file);
  return reply;
}

}  // namespace pmsp::web
