// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include "web/web_path.h"

using namespace pmsp;
using namespace pmsp::web;
using Path = std::vector<std::string>;

TEST_CASE("a target is split and decoded once") {
  CHECK(path_segments("/") == Path{""});
  CHECK(path_segments("/a/b") == Path{"a", "b"});
  CHECK(path_segments("/a/?since=3") == Path{"a", ""});
  CHECK(path_segments("/a%20b/c%C3%A4.html") == Path{"a b", "c\xc3\xa4.html"});
  CHECK(path_segments("/%252e%252e/x") == Path{"%2e%2e", "x"});
}

TEST_CASE("a target that could leave the directory is refused") {
  for (const char* target :
       {"",           "a",      "http://x/a", "//a",      "/a//b",          "/..",           "/a/../b",
        "/a/..",      "/.",     "/./a",       "/.hidden", "/a/.git/config", "/%2e%2e/b",     "/a/%2E%2e",
        "/%2ehidden", "/a%2fb", "/a%2Fb",     "/a%5cb",   "/a\\b",          "/a%00b",        "/a%0ab",
        "/a%7f",      "/%",     "/%2",        "/%zz",     "/a/%",           "/..%2f..%2fetc"}) {
    INFO(target);
    CHECK_FALSE(path_segments(target).has_value());
  }
}

TEST_CASE("numbers are found in a query") {
  CHECK(query_of("/a?b=1&c=2") == "b=1&c=2");
  CHECK(query_of("/a").empty());
  CHECK(number_in_query("b=1&c=22", "c") == 22U);
  CHECK(number_in_query("bc=1", "c") == std::nullopt);
  CHECK(number_in_query("c=", "c") == std::nullopt);
  CHECK(number_in_query("c=-1", "c") == std::nullopt);
  CHECK(number_in_query("c=99999999999999999999", "c") == std::nullopt);
}

TEST_CASE("a range is a part of the file or the whole") {
  const auto is = [](const char* header, std::uint64_t first, std::uint64_t count) {
    const auto range = range_from(header, 100);
    return range && range->first == first && range->count == count;
  };
  CHECK(is("bytes=0-9", 0, 10));
  CHECK(is("bytes=90-", 90, 10));
  CHECK(is("bytes=90-1000", 90, 10));
  CHECK(is("bytes=-10", 90, 10));
  CHECK(is("bytes=-1000", 0, 100));
  CHECK(is("bytes=100-", 0, 0));
  CHECK(range_from("bytes=-0", 100)->count == 0);
  CHECK(range_from("bytes=0-18446744073709551615", 100)->count == 100);
  for (const char* whole : {"", "bytes", "bytes=", "bytes=-", "bytes=5", "bytes=9-5", "bytes=0-1,5-6", "lines=0-1",
                            "bytes=a-b", "bytes=0-99999999999999999999"}) {
    INFO(whole);
    CHECK_FALSE(range_from(whole, 100).has_value());
  }
}
