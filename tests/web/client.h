// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <string>

namespace pmsp_test {

/// A connection to a local port that may be refused or closed at any time.
class Connection {
 public:
  explicit Connection(std::uint16_t port, int receive_buffer = 0);
  ~Connection();
  Connection(Connection&& other) noexcept;
  Connection(const Connection&) = delete;

  void send(const std::string& text);
  /// Until the server closes the connection; "" also where it was reset.
  std::string read_all();
  /// Whether the server closes it within a minute without having answered.
  bool is_cut_off();

 private:
  int socket_ = -1;
};

struct Reply {
  int status = 0;  ///< 0 = none
  std::string head, body;
};

/// "GET TARGET" with header lines "A: b\r\n", on a connection of its own.
Reply get(std::uint16_t port, const std::string& target, const std::string& headers = "",
          const std::string& method = "GET");

/// The path of a URL.
std::string path_of(const std::string& url);

}  // namespace pmsp_test
