// SPDX-License-Identifier: BSD-2-Clause
#include <limits>

#include <sqlite3.h>
#include <catch2/catch.hpp>

#include "map_files.h"
#include "pmsp/error.h"
#include "pmsp/io/map.h"

namespace pmsp::test {
namespace {

using Catch::Contains;
using Catch::StartsWith;

/// The error of reading a valid map after `sql` was run on it.
std::string error_after(const std::string& sql, const SampleMap& map = sample_map(),
                        SqliteVersion version = SqliteVersion::stella_0_6_0) {
  const TempDir folder;
  write_sqlite(folder / "map.db", map, version, sql);
  return error_of(folder / "map.db");
}

}  // namespace

TEST_CASE("missing tables and columns and rows are named") {
  CHECK_THAT(error_after("DROP TABLE keyframes"), StartsWith("InvalidInput: ") && Contains("table keyframes"));
  CHECK_THAT(error_after("DROP TABLE cameras"), Contains("table cameras"));
  CHECK_THAT(error_after("DROP TABLE landmarks"), Contains("table landmarks"));
  CHECK_THAT(error_after("DROP TABLE associations"), Contains("table associations"));
  CHECK_THAT(error_after("ALTER TABLE keyframes DROP COLUMN pose_cw"), Contains("has no column pose_cw"));
  CHECK_THAT(error_after("ALTER TABLE landmarks RENAME COLUMN pos_w TO x"), Contains("has no column pos_w"));
  CHECK_THAT(error_after("DELETE FROM keyframes"), Contains("holds no keyframe"));
  CHECK_THAT(error_after("DELETE FROM associations WHERE id = 9"), Contains("table associations, id 9"));
  CHECK(error_after("DROP TABLE stats").empty());
  CHECK(error_after("DELETE FROM landmarks").empty());
}

TEST_CASE("views and generated columns are not executed") {
  const std::string endless = "(WITH RECURSIVE r(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM r) SELECT i FROM r)";
  CHECK_THAT(error_after("DROP TABLE landmarks; CREATE VIEW landmarks AS SELECT i AS id, zeroblob(24) AS pos_w FROM " +
                         endless),
             Contains("table landmarks: is missing"));
  CHECK_THAT(
      error_after("ALTER TABLE landmarks DROP COLUMN pos_w; ALTER TABLE landmarks ADD COLUMN pos_w GENERATED ALWAYS "
                  "AS (zeroblob(900000000)) VIRTUAL"),
      Contains("has no column pos_w"));
}

TEST_CASE("invalid cells are named by table and row and column") {
  const auto check = [](const std::string& sql, const std::string& where, const std::string& what) {
    INFO(sql);
    CHECK_THAT(error_after(sql), StartsWith("InvalidInput: ") && Contains(where) && Contains(what));
  };
  check("UPDATE keyframes SET ts = NULL WHERE id = 9", "table keyframes, id 9, column ts",
        "expected a number, found NULL");
  check("UPDATE keyframes SET ts = 'x' WHERE id = 9", "table keyframes, id 9, column ts", "found text");
  check("UPDATE keyframes SET ts = 9e999 WHERE id = 9", "table keyframes, id 9, column ts", "finite");
  check("UPDATE keyframes SET cam = 5 WHERE id = 9", "table keyframes, id 9, column cam", "expected a string");
  check("UPDATE keyframes SET cam = X'41' WHERE id = 9", "table keyframes, id 9, column cam", "no camera \"A\"");
  check("UPDATE keyframes SET pose_cw = NULL WHERE id = 9", "table keyframes, id 9, column pose_cw", "16 doubles");
  check("UPDATE keyframes SET pose_cw = zeroblob(96) WHERE id = 9", "column pose_cw", "16 doubles");
  check("UPDATE keyframes SET undist_keypts = zeroblob(85) WHERE id = 9", "column undist_keypts",
        "a multiple of 28 bytes");
  check("UPDATE keyframes SET undist_keypts = NULL WHERE id = 9", "associations, id 9, column lm_ids",
        "there are 0 keypoints");
  check("UPDATE associations SET lm_ids = NULL WHERE id = 9", "associations, id 9, column lm_ids", "has 0 elements");
  check("UPDATE associations SET lm_ids = zeroblob(13) WHERE id = 9", "lm_ids", "a multiple of 4 bytes");
  check("UPDATE keyframes SET src_frm_id = -4 WHERE id = 9", "column src_frm_id", "is -4, expected a number >= 0");
  check("UPDATE keyframes SET id = -4 WHERE id = 9", "table keyframes, id -4", "expected an id >= 0");
  check("UPDATE landmarks SET pos_w = zeroblob(23) WHERE id = 5", "table landmarks, id 5, column pos_w", "3 doubles");
  check("UPDATE cameras SET model_type = X'466973686579650a'", "column model_type", "Fisheye");
  check("UPDATE cameras SET cols = 1930 WHERE id = 0", "name \"theta\", column cols", "cols = 2 x rows");
  check("UPDATE cameras SET rows = NULL WHERE id = 0", "table cameras, id 0, column rows", "expected a number");
  check("UPDATE cameras SET name = X'7468657461'", "cameras", "two cameras");
}

TEST_CASE("a matrix that is no rotation is refused including row-major ones") {
  SampleMap map = sample_map();
  SECTION("scaled") { map.keyframes[0].rotation_cw *= 1.01; }
  SECTION("mirrored") { map.keyframes[0].rotation_cw *= -1.0; }
  CHECK_THAT(error_after("", map), StartsWith("InvalidInput: ") && Contains("table keyframes, id 10, column pose_cw"));
}

TEST_CASE("a lost pose or landmark in a database is skipped and counted") {
  const TempDir folder;
  const auto read = [&](const std::string& sql) {
    write_sqlite(folder / "map.db", sample_map(), SqliteVersion::stella_0_6_0, sql);
    return read_map(folder / "map.db");
  };
  for (const char* sql :
       {"UPDATE keyframes SET pose_cw = zeroblob(128) WHERE id = 9",
        "UPDATE landmarks SET pos_w = X'000000000000f87f000000000000f87f000000000000f87f' WHERE id = 5",
        "UPDATE cameras SET model_type = X'466973686579650a' WHERE id = 0"}) {
    CAPTURE(sql);
    const SlamMap map = read(sql);
    REQUIRE(map.notes.size() == 1);
    CHECK_THAT(map.notes[0], Contains("left out") && Contains(": "));
  }
}

TEST_CASE("a database truncated anywhere is refused") {
  const TempDir folder;
  const auto path = folder / "map.db";
  write_sqlite(path, sample_map(), SqliteVersion::stella_0_6_0);
  const std::string bytes = read_file(path);
  std::size_t accepted = 0;
  for (std::size_t size = 16; size < bytes.size(); size += size < 200 ? 1 : 97) {
    write_file(path, bytes.substr(0, size));
    accepted += error_of(path).find("InvalidInput: ") == 0 ? 0 : 1;
  }
  CHECK(accepted == 0);
}

TEST_CASE("a database with an active writer is refused") {
  const TempDir folder;
  const auto path = folder / "map.db";
  write_sqlite(path, sample_map(), SqliteVersion::stella_0_6_0, "PRAGMA journal_mode = WAL");
  CHECK(error_of(path).empty());
  sqlite3* writer = nullptr;
  REQUIRE(sqlite3_open(path.string().c_str(), &writer) == SQLITE_OK);
  REQUIRE(sqlite3_exec(writer, "UPDATE keyframes SET ts = 5", nullptr, nullptr, nullptr) == SQLITE_OK);
  CHECK_THAT(error_of(path), StartsWith("InvalidInput: ") && Contains("map.db-wal") && Contains("unfinished"));
  sqlite3_close(writer);
  CHECK(error_of(path).empty());
}

}  // namespace pmsp::test
