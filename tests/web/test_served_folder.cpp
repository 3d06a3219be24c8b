// SPDX-License-Identifier: BSD-2-Clause
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "pmsp/error.h"
#include "serve.h"
#include "support/temp_dir.h"
#include "web/client.h"

using namespace pmsp;
using namespace pmsp::tool;
using namespace pmsp::web;
using namespace pmsp_test;
using Catch::Contains;
namespace fs = std::filesystem;

namespace {

void write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path) << text;
}

/// A directory with files that may and may not be served.
struct Site {
  Site() {
    write(dir / "outside.txt", "secret");
    write(dir / "site" / "report.html", "page");
    write(dir / "site" / "potree" / "octree.bin", "0123456789");
    write(dir / "site" / ".hidden" / "key", "secret");
    write(dir / "site" / ".key", "secret");
    fs::create_symlink(dir / "outside.txt", dir / "site" / "link.txt");
    fs::create_symlink(dir.path(), dir / "site" / "up");
    fs::create_symlink("report.html", dir / "site" / "inner.html");
    mkfifo((dir / "site" / "pipe").c_str(), 0600);
  }
  TempDir dir;
};

struct Served {
  explicit Served(const fs::path& folder, const std::string& page = "")
      : files(folder, page), server({}, [this](const HttpRequest& request) { return files(request); }) {}
  Reply ask(const std::string& target, const std::string& headers = "", const std::string& method = "GET") const {
    return get(server.port(), path_of(server.url()) + target, headers, method);
  }
  FolderHandler files;
  HttpServer server;
};

}  // namespace

TEST_CASE("files of a directory are served whole and in part") {
  const Site site;
  const Served served(site.dir / "site", "report.html");
  const Reply page = served.ask("");
  CHECK(page.status == 200);
  CHECK(page.body == "page");
  CHECK_THAT(page.head, Contains("Content-Type: text/html") && Contains("no-referrer") && Contains("nosniff"));
  const Reply whole = served.ask("potree/octree.bin");
  CHECK(whole.body == "0123456789");
  CHECK_THAT(whole.head, Contains("Accept-Ranges: bytes"));
  const Reply part = served.ask("potree/octree.bin", "Range: bytes=2-4\r\n");
  CHECK(part.status == 206);
  CHECK(part.body == "234");
  CHECK_THAT(part.head, Contains("Content-Range: bytes 2-4/10"));
  CHECK(served.ask("potree/octree.bin", "Range: bytes=10-\r\n").status == 416);
  const Reply head = served.ask("potree/octree.bin", "", "HEAD");
  CHECK(head.status == 200);
  CHECK(head.body.empty());
  CHECK_THAT(head.head, Contains("Content-Length: 10"));
}

TEST_CASE("only regular files of the directory are served") {
  const Site site;
  const Served served(site.dir / "site");
  for (const char* target : {"../outside.txt",
                             "%2e%2e/outside.txt",
                             "..%2foutside.txt",
                             "potree/../../outside.txt",
                             "potree/%2e%2e/%2e%2e/outside.txt",
                             "link.txt",
                             "up/outside.txt",
                             "up/site/report.html",
                             "inner.html",
                             ".key",
                             "%2ekey",
                             ".hidden/key",
                             "pipe",
                             "potree",
                             "potree/",
                             "report.html/",
                             "report.html/x",
                             "none",
                             "//etc/passwd",
                             "/etc/passwd"}) {
    INFO(target);
    const Reply reply = served.ask(target);
    CHECK(reply.status == 404);
    CHECK_THAT(reply.body, !Contains("secret") && !Contains("root:"));
  }
}

TEST_CASE("requests without the token give 404") {
  const Site site;
  const Served served(site.dir / "site", "report.html");
  const std::string root = path_of(served.server.url());
  for (std::string wrong : {std::string("/"), std::string("/report.html"), root.substr(0, root.size() - 2) + "/",
                            root.substr(0, root.size() - 1) + "0/", "/0" + root.substr(2), "/" + root}) {
    if (wrong == root) wrong = "/1" + root.substr(2);
    INFO(wrong);
    CHECK(get(served.server.port(), wrong).status == 404);
  }
  const Served other(site.dir / "site");
  CHECK(other.server.url() != served.server.url());
  const Reply without_slash = get(served.server.port(), root.substr(0, root.size() - 1));
  CHECK(without_slash.status == 308);
  CHECK_THAT(without_slash.head, Contains("Location: " + root + "\r\n"));
}

TEST_CASE("a directory shows its page or a list of pages") {
  const Site site;
  const Reply page = Served(site.dir / "site").ask("");
  CHECK(page.body == "page");
  CHECK_THAT(page.head, Contains("Content-Security-Policy: default-src 'self'") && Contains("form-action 'none'"));
  write(site.dir / "site" / "other" / "<b>&.html", "second");
  const Served several(site.dir / "site");
  const Reply list = several.ask("");
  CHECK_THAT(list.body, Contains("./report.html") && Contains("./other/%3Cb%3E%26.html") && !Contains("<b>"));
  CHECK(several.ask("other/%3Cb%3E%26.html").body == "second");
  write(site.dir / "site" / "index.html", "index");
  CHECK(several.ask("").body == "index");
  CHECK_THROWS_AS(FolderHandler(site.dir / "none", ""), pmsp::IoError);
  CHECK_THROWS_AS(FolderHandler(site.dir / "site", "inner.html"), pmsp::IoError);
  CHECK_THROWS_AS(FolderHandler(site.dir / "site", ".key"), pmsp::IoError);
}

TEST_CASE("a directory opens no hidden names for any parsed path") {
  const Site site;
  const ServedFolder folder(site.dir / "site");
  CHECK(folder.open({"potree", "octree.bin"}).size == 10);
  for (const std::vector<std::string>& path :
       {std::vector<std::string>{".key"}, {".hidden", "key"}, {"..", "outside.txt"}, {"potree", "..", ".key"}}) {
    CHECK_FALSE(folder.open(path).descriptor.is_open());
  }
}
