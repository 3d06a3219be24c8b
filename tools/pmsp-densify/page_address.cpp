// SPDX-License-Identifier: BSD-2-Clause
#include "page_address.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <memory>
#include <system_error>

#ifdef PMSP_HAS_QRENCODE
#include <qrencode.h>
#endif

#include "export/files.h"
#include "pmsp/error.h"
#include "progress.h"
#include "web/http_server.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

/// Creates a file that only its owner can read; an existing one stays.
void write_secret(const fs::path& file, const std::string& text) {
  std::string temporary = file.string() + ".XXXXXX";
  const auto fail = [&](const char* what) {
    throw OutputError(file.string() + ": cannot " + what + ": " + std::strerror(errno));
  };
  const int descriptor = mkstemp(temporary.data());
  if (descriptor < 0) fail("create");
  const bool is_written =
      write(descriptor, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && fsync(descriptor) == 0;
  const bool is_named = is_written && (link(temporary.c_str(), file.c_str()) == 0 || errno == EEXIST ||
                                       rename(temporary.c_str(), file.c_str()) == 0);  // no hard links
  const int error = errno;
  close(descriptor);
  unlink(temporary.c_str());
  errno = error;
  if (!is_named) fail("write");
}

#ifdef PMSP_HAS_QRENCODE
constexpr int kQuietZone = 4;  ///< modules around a QR code, as its standard requires

/// Dark modules, row by row.
struct QrCode {
  explicit QrCode(const std::string& text)
      : code_(QRcode_encodeString8bit(text.c_str(), 0, QR_ECLEVEL_L), QRcode_free) {}

  int size() const { return code_ ? code_->width : 0; }
  bool is_dark(int x, int y) const {
    return x >= 0 && y >= 0 && x < size() && y < size() && (code_->data[y * size() + x] & 1) != 0;
  }

 private:
  std::unique_ptr<QRcode, decltype(&QRcode_free)> code_;
};
#endif

/// "" if there is none.
std::string first_own_address() {
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return "";
  const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> owner(all, freeifaddrs);
  for (const ifaddrs* it = all; it != nullptr; it = it->ifa_next) {
    const bool is_used = (it->ifa_flags & IFF_RUNNING) != 0 && (it->ifa_flags & IFF_LOOPBACK) == 0;
    if (!is_used || it->ifa_addr == nullptr || it->ifa_addr->sa_family != AF_INET) continue;
    sockaddr_in address{};
    std::memcpy(&address, it->ifa_addr, sizeof(address));
    char text[INET_ADDRSTRLEN] = {};
    if (inet_ntop(AF_INET, &address.sin_addr, text, sizeof(text)) != nullptr) return text;
  }
  return "";
}

}  // namespace

std::string token_from_file(const fs::path& file) {
  if (file.empty()) return "";
  struct stat about = {};
  if (stat(file.c_str(), &about) != 0 && errno == ENOENT) {
    write_secret(file, web::new_token() + "\n");
    if (stat(file.c_str(), &about) != 0) throw IoError(file.string() + ": cannot be read: " + std::strerror(errno));
  }
  constexpr off_t kMaxSize = 4096;
  if (about.st_size > kMaxSize) throw InvalidOption(file.string() + ": is larger than a file with a token");
  std::string token = read_whole_file(file);
  token.erase(token.find_last_not_of(" \t\r\n") + 1);
  try {
    web::require_token(token);
  } catch (const InvalidOption& error) {
    throw InvalidOption(file.string() + ": " + error.what() + "; delete the file for a new one");
  }
  if ((about.st_mode & (S_IRGRP | S_IROTH)) != 0) {
    std::cerr << "pmsp-densify: warning: " << file.string() << ": others can read the token; expected mode 600\n";
  }
  return token;
}

#ifdef PMSP_HAS_QRENCODE
bool has_qr_codes() { return true; }

std::string qr_text(const std::string& text, std::size_t columns, bool colors) {
  const QrCode code(text);
  const int end = code.size() + kQuietZone;
  if (code.size() == 0 || static_cast<std::size_t>(end + kQuietZone) > columns) return "";
  std::string lines;
  for (int y = -kQuietZone; y < end; y += 2) {
    if (colors) lines += "\033[38;5;16;48;5;231m";  // black on white
    for (int x = -kQuietZone; x < end; ++x) {
      const bool upper = code.is_dark(x, y) == colors, lower = code.is_dark(x, y + 1) == colors;
      lines += upper && lower ? "█" : upper ? "▀" : lower ? "▄" : " ";
    }
    lines += colors ? "\033[0m\n" : "\n";
  }
  return lines;
}
#else
bool has_qr_codes() { return false; }

std::string qr_text(const std::string& /*text*/, std::size_t /*columns*/, bool /*colors*/) { return ""; }
#endif

std::string url_for_others(const std::string& url) {
  for (const std::string unspecified : {"//0.0.0.0:", "//[::]:"}) {
    const std::size_t at = url.find(unspecified);
    const std::string own = at == std::string::npos ? "" : first_own_address();
    if (!own.empty()) return std::string(url).replace(at, unspecified.size(), "//" + own + ":");
  }
  return url;
}

void print_access(const std::string& address, const std::string& url) {
  if (web::is_loopback(address)) return;
  std::cerr << "pmsp-densify: warning: " << web::address_warning(address) << "\n";
  const std::string others = url_for_others(url);
  if (others != url) std::cerr << "from other computers: " << others << "\n";
  if (isatty(STDERR_FILENO) == 0) return;
  const char* const no_color = std::getenv("NO_COLOR");
  const bool colors = no_color == nullptr || *no_color == '\0';
  std::cerr << qr_text(others, terminal_columns(STDERR_FILENO, 80), colors) << std::flush;
}

}  // namespace pmsp::tool
