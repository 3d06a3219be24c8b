// SPDX-License-Identifier: BSD-2-Clause
// The address of a page: its token, and the QR code that a telephone reads.
#include <sys/stat.h>

#include <fstream>
#include <vector>

#include <zbar.h>
#include <catch2/catch.hpp>

#include "page_address.h"
#include "pmsp/error.h"
#include "support/temp_dir.h"
#include "web/http_server.h"

using namespace pmsp;
using namespace pmsp::tool;
using namespace pmsp_test;
using Catch::Contains;

namespace {

unsigned mode_of(const std::filesystem::path& file) {
  struct stat about = {};
  return stat(file.c_str(), &about) == 0 ? about.st_mode & 0777U : 0;
}

void put(const std::filesystem::path& file, const std::string& text) { std::ofstream(file) << text; }

/// Lines of half blocks as dark and light modules; `dark_blocks`: whether blocks are dark.
std::vector<std::vector<bool>> modules_of(const std::string& text, bool dark_blocks) {
  std::vector<std::vector<bool>> rows;
  std::vector<bool> upper, lower;
  for (std::size_t at = 0; at < text.size();) {
    const auto take = [&](const std::string& block, bool is_upper, bool is_lower) {
      if (text.compare(at, block.size(), block) != 0) return false;
      upper.push_back(is_upper == dark_blocks);
      lower.push_back(is_lower == dark_blocks);
      at += block.size();
      return true;
    };
    if (text[at] == '\033') {
      at = text.find('m', at) + 1;
    } else if (text[at] == '\n') {
      rows.push_back(std::move(upper));
      rows.push_back(std::move(lower));
      upper.clear();
      lower.clear();
      ++at;
    } else if (!take("█", true, true) && !take("▀", true, false) && !take("▄", false, true) &&
               !take(" ", false, false)) {
      FAIL("unknown letter at " << at);
    }
  }
  return rows;
}

/// The text that a reader finds in a picture of the modules, each some pixels wide.
std::string decoded(const std::vector<std::vector<bool>>& rows) {
  constexpr std::size_t kPixels = 6;
  const std::size_t width = kPixels * rows.front().size(), height = kPixels * rows.size();
  std::vector<unsigned char> gray(width * height);
  for (std::size_t i = 0; i < gray.size(); ++i) gray[i] = rows[i / width / kPixels][i % width / kPixels] ? 0 : 255;
  zbar::ImageScanner scanner;
  zbar::Image image(static_cast<unsigned>(width), static_cast<unsigned>(height), "Y800", gray.data(), gray.size());
  if (scanner.scan(image) != 1) return "";
  return image.symbol_begin()->get_data();
}

}  // namespace

TEST_CASE("a token file is created for its owner and read again") {
  const TempDir dir;
  const std::filesystem::path file = dir / "token";
  CHECK(token_from_file("").empty());
  const std::string token = token_from_file(file);
  CHECK(token.size() == 32);
  CHECK(mode_of(file) == 0600);
  CHECK(dir.entries() == 1);
  CHECK(token_from_file(file) == token);
  CHECK(token_from_file(dir / "other") != token);
  put(file, "my-Token_0123456789\r\n");
  CHECK(token_from_file(file) == "my-Token_0123456789");
}

TEST_CASE("an unusable token file is refused without its content") {
  const TempDir dir;
  const std::filesystem::path file = dir / "token";
  for (const std::string& text :
       {std::string(), std::string("fifteen-letters"), std::string(129, 'a'), std::string("0123456789abcde/"),
        std::string("0123456789 abcdef"), std::string("0123456789abcdef\nsecond-line"), std::string(10'000, 'a')}) {
    put(file, text);
    CHECK_THROWS_AS(token_from_file(file), InvalidOption);
    CHECK_THROWS_WITH(token_from_file(file), Contains(file.string()) && !Contains("0123456789"));
  }
  CHECK_THROWS_AS(token_from_file(dir.path()), Error);
  CHECK_THROWS_AS(token_from_file(dir / "none" / "token"), OutputError);
}

TEST_CASE("a reader finds the address in its QR code") {
  if (!has_qr_codes()) return;
  const std::string url = "http://192.168.178.201:65535/" + web::new_token() + "/";
  for (const bool colors : {true, false}) {
    const std::string text = qr_text(url, 80, colors);
    REQUIRE_FALSE(text.empty());
    CHECK((text.find('\033') != std::string::npos) == colors);
    CHECK(decoded(modules_of(text, colors)) == url);
  }
}

TEST_CASE("a QR code that is wider than the terminal is left out") {
  if (!has_qr_codes()) return;
  const std::string text = qr_text("http://192.168.1.2:8080/", 80, false);
  const std::size_t columns = modules_of(text, false).front().size();
  CHECK(qr_text("http://192.168.1.2:8080/", columns, false) == text);
  CHECK(qr_text("http://192.168.1.2:8080/", columns - 1, false).empty());
  CHECK(qr_text(std::string(5000, 'a'), 1000, false).empty());
}

TEST_CASE("only an unspecified host is replaced for other computers") {
  CHECK(url_for_others("http://192.0.2.7:8080/token/") == "http://192.0.2.7:8080/token/");
  CHECK(url_for_others("http://[2001:db8::1]:8080/token/") == "http://[2001:db8::1]:8080/token/");
  for (const std::string url : {"http://0.0.0.0:8080/token/", "http://[::]:8080/token/"}) {
    const std::string others = url_for_others(url);
    CHECK_THAT(others, Catch::EndsWith(":8080/token/") && Catch::StartsWith("http://"));
    CHECK_THAT(others, !Contains("127.0.0.1"));
  }
}
