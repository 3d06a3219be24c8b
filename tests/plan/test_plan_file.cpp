// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include "io/plan_io.h"
#include "plan/missions.h"
#include "pmsp/error.h"
#include "support/temp_dir.h"

using namespace pmsp;
using namespace pmsp::test;
using namespace pmsp_test;
using Catch::Contains;

TEST_CASE("a plan read from its file is the same", "[plan][io]") {
  const TempDir dir;
  MissionRecipe recipe;
  recipe.keyframes = 60;
  recipe.first_id = -30;
  for (recipe.seed = 0; recipe.seed < 4; ++recipe.seed) {
    DensifierOptions options = preset(Quality::kNormal);
    Plan plan = make_plan(walk(recipe), options);
    plan.entries[3].range = {0.1, 1.0 / 3.0 * 1e6};
    plan.entries[4].id = INT64_MAX;
    plan.entries[5].near = {INT64_MIN};
    write_plan(dir / "plan.json", plan);
    CHECK(plan_from_json(read_text(dir / "plan.json")) == plan);
  }
  CHECK(plan_from_json(plan_json({})) == Plan{});
  CHECK(dir.entries() == 1);
}

TEST_CASE("a broken plan is refused with what is wrong", "[plan][io]") {
  const std::string entry =
      R"({"id":1,"use":"depth map","near":[2],"first_planes":null,"range":[1,2],"consistency":[],)"
      R"("fusion":[],"viewers":[],"owners":[]})";
  const auto text = [](const std::string& entries) {
    return R"({"format":"pmsp plan","version":1,"entries":[)" + entries + "]}";
  };
  const auto replaced = [&](const std::string& what, const std::string& by) {
    std::string changed = entry;
    const std::size_t at = changed.find(what);
    REQUIRE(at != std::string::npos);
    return text(changed.replace(at, what.size(), by));
  };
  REQUIRE(plan_from_json(text(entry)).entries.size() == 1);
  const std::pair<std::string, const char*> broken[] = {
      {"{", "truncated"},
      {"[]", "no plan"},
      {R"({"format":"pmsp plan","version":2,"entries":[]})", "version: is 2"},
      {R"({"format":"pmsp plan","version":1})", "entries"},
      {text("7"), "entries[0]"},
      {text(entry + "," + entry.substr(0, 7) + "}"), "entries[1]: lacks \"use\""},
      {replaced("\"depth map\"", "\"best\""), "'best'"},
      {replaced("\"depth map\"", "5"), "use: is 5"},
      {replaced("[2]", "[2.5]"), "near[0]: is 2.5"},
      {replaced("[2]", "[18446744073709551615]"), "near[0]"},
      {replaced("[2]", "2"), "near: is 2"},
      {replaced("null", "\"x\""), "first_planes"},
      {replaced("[1,2]", "[1]"), "range: is an array of 1"},
      {replaced("[1,2]", "[1,\"\xff\"]"), "JSON"},
  };
  for (const auto& [json, expected] : broken) {
    INFO(json);
    CHECK_THROWS_WITH(plan_from_json(json, "p.json"), Contains("p.json") && Contains(expected));
    CHECK_THROWS_AS(plan_from_json(json), InvalidInput);
  }
  const TempDir dir;
  CHECK_THROWS_AS(write_plan(dir / "no" / "plan.json", {}), OutputError);
}
