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
using Error = boost::system::error_code;

constexpr std::size_t kChunk = 65536;
constexpr auto kAskAgain = std::chrono::milliseconds(50);

asio::ip::address address_from(const std::string& text) {
  Error error;
  const asio::ip::address address = asio::ip::make_address(text, error);
  if (!error) return address;
  throw InvalidOption("\"" + text + "\" is no address; expected numbers such as 127.0.0.1 or ::1");
}

/// 128 bits from the system.
std::string new_token() {
  std::array<unsigned char, 16> bytes{};
  if (getentropy(bytes.data(), bytes.size()) != 0) {
    throw OutputError(std::string("the system gives no random numbers: ") + std::strerror(errno));
  }
  std::string token;
  for (const unsigned char byte : bytes) {
    for (const int digit : {byte >> 4, byte & 15}) token += "0123456789abcdef"[digit];
  }
  return token;
}

/// Takes as long wherever they differ.
bool are_equal(const std::string& told, const std::string& token) {
  unsigned difference = told.size() == token.size() ? 0U : 1U;
  for (std::size_t i = 0; i < token.size(); ++i) {
    const char other = i < told.size() ? told[i] : '\0';
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

/// What sessions have in common.
struct Common {
  HttpOptions options;
  HttpHandler handler;
  std::string token;
  std::list<Session*> sessions;  ///< from the oldest to the youngest
};

/// A connection. Whatever it waits for has an end: `expires_after` holds for all that follows until it is set anew.
class Session : public std::enable_shared_from_this<Session> {
 public:
  Session(tcp::socket socket, Common& common)
      : common_(common), stream_(std::move(socket)), ask_again_(stream_.get_executor()) {
    place_ = common_.sessions.insert(common_.sessions.end(), this);
  }
  ~Session() {
    if (!is_closed_) common_.sessions.erase(place_);
  }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  bool is_trusted() const { return is_trusted_; }

  /// Whatever it waits for ends at once, and it with that.
  void close() {
    if (std::exchange(is_closed_, true)) return;
    common_.sessions.erase(place_);
    Error ignored;
    stream_.socket().close(ignored);
    ask_again_.cancel();
  }

  void read() {
    parser_.emplace();
    parser_->header_limit(static_cast<std::uint32_t>(common_.options.header_bytes));
    parser_->body_limit(0);
    stream_.expires_after(common_.options.for_headers);
    http::async_read(stream_, buffer_, *parser_, [self = shared_from_this()](Error error, std::size_t) {
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
    give_up_ = std::chrono::steady_clock::now() + common_.options.patience;
    ask();
  }

  void ask() {
    if (is_closed_) return;
    request_.last_call = std::chrono::steady_clock::now() >= give_up_;
    std::optional<HttpReply> reply;
    try {
      reply = common_.handler(request_);
    } catch (const std::exception&) {
      reply = plain_reply(500, "this cannot be served");
    }
    if (!reply && request_.last_call) reply = plain_reply(503, "there is no answer");
    if (reply) return answer(std::move(*reply));
    ask_again_.expires_after(kAskAgain);
    ask_again_.async_wait([self = shared_from_this()](Error error) {
      if (!error) self->ask();
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
    head_ = {};
    head_.version(parser_ ? parser_->get().version() : 11);
    head_.result(static_cast<unsigned>(reply_.status));
    head_.keep_alive(keep_alive_);
    head_.set(http::field::content_type, reply_.type);
    if (reply_.status != 204) head_.set(http::field::content_length, std::to_string(part.count));
    if (is_file) head_.set(http::field::accept_ranges, "bytes");
    if (reply_.status == 206) {
      head_.set(http::field::content_range, "bytes " + std::to_string(part.first) + "-" +
                                                std::to_string(part.first + part.count - 1) + "/" +
                                                std::to_string(size));
    } else if (reply_.status == 416) {
      head_.set(http::field::content_range, "bytes */" + std::to_string(size));
    } else if (reply_.status == 308) {
      head_.set(http::field::location, location_);
    } else if (reply_.status == 405) {
      head_.set(http::field::allow, "GET, HEAD");
    }
    // Neither the token nor what it opens goes to anybody else.
    head_.set(http::field::cache_control, "no-store");
    head_.set("Referrer-Policy", "no-referrer");
    head_.set("X-Content-Type-Options", "nosniff");
    head_.set("Cross-Origin-Resource-Policy", "same-origin");
    head_.set("X-Frame-Options", "DENY");
    serializer_.emplace(head_);
    stream_.expires_after(common_.options.for_chunk);
    http::async_write_header(stream_, *serializer_, [self = shared_from_this()](Error error, std::size_t) {
      if (error) return self->close();
      self->send();
    });
  }

  /// The next piece. A client that takes none in time is cut off.
  void send() {
    if (next_ == end_) return finish();
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(kChunk, end_ - next_));
    const char* from = nullptr;
    if (reply_.file.descriptor.is_open()) {
      chunk_.resize(kChunk);
      const ssize_t got = pread(reply_.file.descriptor.get(), chunk_.data(), count, static_cast<off_t>(next_));
      if (got != static_cast<ssize_t>(count)) return close();  // it has become shorter
      from = chunk_.data();
    } else {
      from = reply_.body->data() + next_;
    }
    next_ += count;
    stream_.expires_after(common_.options.for_chunk);
    asio::async_write(stream_, asio::buffer(from, count), [self = shared_from_this()](Error error, std::size_t) {
      if (error) return self->close();
      self->send();
    });
  }

  void finish() {
    reply_ = {};
    if (keep_alive_) return read();
    Error ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    close();
  }

  Common& common_;
  std::list<Session*>::iterator place_;
  beast::tcp_stream stream_;
  asio::steady_timer ask_again_;
  beast::flat_static_buffer<16384> buffer_;
  std::optional<http::request_parser<http::empty_body>> parser_;
  HttpRequest request_;
  std::chrono::steady_clock::time_point give_up_;
  HttpReply reply_;
  http::response<http::empty_body> head_;
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
    common.token = new_token();
    const tcp::endpoint endpoint(address_from(options.address), options.port);
    try {
      acceptor.open(endpoint.protocol());
      acceptor.set_option(asio::socket_base::reuse_address(true));
      acceptor.bind(endpoint);
      acceptor.listen();
    } catch (const boost::system::system_error& error) {
      throw OutputError("port " + std::to_string(options.port) + " of " + options.address + " cannot be served: " +
                        error.code().message() + "; give another one, or 0 for one that is free");
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
    acceptor.async_accept([this](Error error, tcp::socket socket) {
      if (!error) {
        if (has_room()) std::make_shared<Session>(std::move(socket), common)->read();
        return accept();
      }
      if (error == asio::error::operation_aborted) return;
      wait.expires_after(std::chrono::milliseconds(100));  // no descriptors are left, for example
      wait.async_wait([this](Error) { accept(); });
    });
  }

  /// Makes some where that can be.
  bool has_room() {
    if (common.sessions.size() < common.options.connections) return true;
    const auto stranger = std::find_if(common.sessions.begin(), common.sessions.end(),
                                       [](const Session* session) { return !session->is_trusted(); });
    if (stranger == common.sessions.end()) return false;
    (*stranger)->close();
    return true;
  }

  std::uint16_t port = 0;
  Common common;  ///< before the context, whose end ends the sessions
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

bool is_loopback(const std::string& address) { return address_from(address).is_loopback(); }

std::string address_warning(const std::string& address) {
  return "others can reach " + address +
         ": who learns the address of the page sees all that it shows, and nothing is encrypted on its way";
}

HttpReply not_found() { return plain_reply(404, "not found"); }

}  // namespace pmsp::web
