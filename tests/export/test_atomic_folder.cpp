// SPDX-License-Identifier: BSD-2-Clause
#include <sys/wait.h>
#include <unistd.h>
#include <csignal>
#include <filesystem>
#include <string>

#include <catch2/catch.hpp>

#include "export/atomic_folder.h"
#include "export/files.h"
#include "pmsp/error.h"
#include "support/temp_dir.h"

using namespace pmsp;
using namespace pmsp_test;
using Catch::Contains;

namespace fs = std::filesystem;

namespace {

bool is_own(const std::string& name) { return name == "a" || name == "b" || name == "index.json" || name == "images"; }

void write_all(const AtomicFolder& folder, const std::string& text) {
  write_file(folder / "a", text);
  write_file(folder / "index.json", text);
  make_folder(folder / "images");
  write_file(folder.path() / "images" / "1.png", text);
}

void check_all(const fs::path& folder, const std::string& text) {
  for (const char* name : {"a", "index.json", "images/1.png"}) CHECK(read_text(folder / name) == text);
  CHECK_FALSE(fs::exists(folder / "lock"));
  CHECK_FALSE(fs::exists(folder / ".part"));
  CHECK_FALSE(fs::exists(folder / ".whole"));
}

/// Calls `work` in a process that is killed then.
template <class Work>
void killed_after(const Work& work) {
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    try {
      work();
    } catch (...) {
      _exit(1);
    }
    raise(SIGKILL);
  }
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  REQUIRE(WIFSIGNALED(status));
}

}  // namespace

TEST_CASE("a directory appears with all its files or not at all") {
  const TempDir dir;
  { write_all(AtomicFolder(dir / "sub/out", is_own), "given up"); }
  CHECK_FALSE(fs::exists(dir / "sub/out"));
  AtomicFolder folder(dir / "sub/out/", is_own);
  write_all(folder, "new");
  CHECK_FALSE(fs::exists(dir / "sub/out"));
  CHECK_THROWS_WITH(AtomicFolder(dir / "sub/out", is_own), Contains("another process works in this output"));
  folder.commit();
  check_all(dir / "sub/out", "new");
  CHECK(std::distance(fs::directory_iterator(dir / "sub"), fs::directory_iterator()) == 1);
}

TEST_CASE("in an existing directory own files are replaced and others kept") {
  const TempDir dir;
  fs::create_directories(dir / "out/images");
  for (const char* name : {"a", "b", "notes", "images/1.png", "images/notes"}) write_text(dir / "out" / name, "old");
  { write_all(AtomicFolder(dir / "out", is_own), "given up"); }
  for (const char* name : {"a", "b", "notes", "images/1.png", "images/notes"}) {
    CHECK(read_text(dir / "out" / name) == "old");
  }
  CHECK(std::distance(fs::directory_iterator(dir / "out"), fs::directory_iterator()) == 4);
  AtomicFolder folder(dir / "out", is_own);
  write_all(folder, "new");
  folder.commit();
  check_all(dir / "out", "new");
  CHECK_FALSE(fs::exists(dir / "out/b"));
  CHECK(read_text(dir / "out/notes") == "old");
  CHECK(read_text(dir / "out/images/notes") == "old");
}

TEST_CASE("the remains of a killed process are recovered under the same name only") {
  const TempDir dir;
  killed_after([&] { write_all(AtomicFolder(dir / "out", is_own), "killed"); });
  killed_after([&] {
    AtomicFolder folder(dir / "out", is_own);
    write_all(folder, "killed");
    raise(SIGKILL);
  });
  CHECK(fs::exists(dir / "out.part/a"));
  CHECK_FALSE(fs::exists(dir / "out"));
  for (const bool exists : {false, true}) {
    if (exists) {
      fs::create_directory(dir / "out");
      killed_after([&] {
        AtomicFolder folder(dir / "out", is_own);
        write_all(folder, "killed");
        raise(SIGKILL);
      });
      CHECK(fs::exists(dir / "out/.part/a"));
    }
    CHECK(AtomicFolder::is_free(dir / "out"));
    AtomicFolder folder(dir / "out", is_own);
    write_all(folder, "new");
    folder.commit();
    check_all(dir / "out", "new");
    CHECK(dir.entries() == 1);
    CHECK_FALSE(AtomicFolder::is_free(dir / "out"));
    fs::remove_all(dir / "out");
  }
}

TEST_CASE("a process killed while renaming files leaves a recoverable directory") {
  const TempDir dir;
  fs::create_directories(dir / "out/.whole");
  for (const char* name : {"out/a", "out/notes", "out/.whole/index.json", "out/.whole/lock"}) {
    write_text(dir / name, "killed");
  }
  CHECK(AtomicFolder::is_free(dir / "out"));
  AtomicFolder folder(dir / "out", is_own);
  write_all(folder, "new");
  folder.commit();
  check_all(dir / "out", "new");
  CHECK(read_text(dir / "out/notes") == "killed");
}

TEST_CASE("foreign directories named like an unfinished one are refused and kept") {
  const TempDir dir;
  for (const char* name : {"mine", "a"}) {
    fs::create_directories(dir / "out.part");
    write_text(dir / "out.part" / name, "mine");
    CHECK_THROWS_AS(AtomicFolder(dir / "out", is_own), OutputError);
    CHECK(read_text(dir / "out.part" / name) == "mine");
    fs::remove_all(dir / "out.part");
  }
  fs::create_directory(dir / "elsewhere");
  fs::create_directory_symlink("elsewhere", dir / "out.part");
  CHECK_THROWS_AS(AtomicFolder(dir / "out", is_own), OutputError);
  write_text(dir / "file", "mine");
  CHECK_THROWS_AS(AtomicFolder(dir / "file", is_own), OutputError);
}

TEST_CASE("a symbolic link is kept and its target is written") {
  const TempDir dir;
  fs::create_directory(dir / "there");
  for (const char* name : {"file", "there/none"}) {
    fs::create_symlink(name, dir / "link.1");
    fs::create_symlink("link.1", dir / "link");
    for (const char* text : {"first", "second"}) write_file(dir / "link", std::string(text));
    CHECK(fs::is_symlink(dir / "link"));
    CHECK(fs::is_symlink(dir / "link.1"));
    CHECK(read_text(dir / name) == "second");
    for (const char* link : {"link", "link.1"}) fs::remove(dir / link);
  }
  fs::create_directory_symlink("there/folder", dir / "link");
  for (const char* text : {"first", "second"}) {
    AtomicFolder folder(dir / "link", is_own);
    write_all(folder, text);
    folder.commit();
    check_all(dir / "there/folder", text);
  }
  CHECK(fs::is_symlink(dir / "link"));
  fs::create_symlink("round", dir / "round");
  CHECK_THROWS_AS(write_file(dir / "round", std::string("x")), OutputError);
}
