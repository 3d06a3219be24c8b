// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <string>

#include "plan/missions.h"
#include "pmsp/error.h"
#include "workspace/record.h"

using namespace pmsp;
using namespace pmsp::workspace;
using Catch::Contains;

namespace {

Record some_record() {
  Record record;
  record.step = "0123456789abcdef";
  record.engine = "a machine";
  record.options = R"({"seed":1})";
  record.lenses_looked_at = 11;
  record.map = "../map.msg";
  record.images = "../images";
  record.outputs = {"../cloud.ply"};
  PlanEntry entry;
  entry.id = -3;
  entry.use = KeyframeUse::kDepthMap;
  entry.near = {4};
  entry.range = {0.1, 1.0 / 3.0};
  record.plan.entries = {entry};
  RecordedKeyframe keyframe;
  keyframe.image = "abc";
  keyframe.width = 640;
  keyframe.height = 320;
  keyframe.sharpness.landmarks = {{5, 0.1F, 1.0F / 3.0F}};
  keyframe.pose.cam_from_world.translation = {1.0 / 3.0, 2e-300, -1e12};
  keyframe.pose.scale = 1.1;
  keyframe.ranges = {{-7, 2.0 / 3.0}, {9, 1e-9}};
  record.keyframes[4] = keyframe;
  keyframe.looked_for = "blur";
  keyframe.planes = RecordedPlanes{"-3-s", "own", 7, keyframe.pose, {{4, "abc", keyframe.pose}}};
  keyframe.points = RecordedPoints{"-3-s", "inputs", "s"};
  record.keyframes[-3] = keyframe;
  record.poses["s"][4] = keyframe.pose;
  return record;
}

}  // namespace

TEST_CASE("a record is parsed back from its text unchanged") {
  for (const Record& record : {some_record(), Record()}) {
    const std::string text = record_json(record);
    const Record back = record_from_json(text, "it");
    CHECK(record_json(back) == text);
    CHECK(back.plan == record.plan);
    CHECK(back.keyframes.size() == record.keyframes.size());
  }
  const Record back = record_from_json(record_json(some_record()), "it");
  CHECK(back.keyframes.at(-3).pose == some_record().keyframes.at(-3).pose);
  CHECK(back.lenses_looked_at == 11);
  CHECK(back.keyframes.at(-3).planes->passes == 7);
  CHECK(back.keyframes.at(-3).planes->sources[0].pose == some_record().keyframes.at(4).pose);
  CHECK(back.keyframes.at(4).ranges.size() == 2);
  CHECK(back.keyframes.at(4).ranges[0].landmark == -7);
  CHECK(back.keyframes.at(4).ranges[0].range == 2.0 / 3.0);
  CHECK(back.keyframes.at(-3).sharpness.landmarks[0].vertical == 1.0F / 3.0F);
}

TEST_CASE("an invalid record is refused by name and cannot refer to files outside the workspace") {
  const std::string text = record_json(some_record());
  for (std::size_t at = 0; at <= text.rfind('}'); at += 17) {
    CHECK_THROWS_WITH(record_from_json(text.substr(0, at), "work/workspace.json"), Contains("work/workspace.json"));
  }
  const auto with = [&](const std::string& what, const std::string& instead) {
    std::string changed = text;
    const std::size_t at = changed.find(what);
    REQUIRE(at != std::string::npos);
    return changed.replace(at, what.size(), instead);
  };
  CHECK_THROWS_AS(record_from_json(with("\"version\": 1", "\"version\": 99"), "it"), InvalidInput);
  CHECK_THROWS_AS(record_from_json(with("\"-3-s\"", "\"../../home/me\""), "it"), InvalidInput);
  CHECK_THROWS_AS(record_from_json(with("\"-3-s\"", "\"planes/../../home/me\""), "it"), InvalidInput);
  CHECK_THROWS_AS(record_from_json(with("\"-3-s\"", "\"..\""), "it"), InvalidInput);
  CHECK_THROWS_AS(record_from_json(with("\"4\": {", "\"x\": {"), "it"), InvalidInput);
  CHECK_THROWS_AS(record_from_json(with("[1.0,", "[\"1\","), "it"), InvalidInput);
  CHECK_THROWS_AS(record_from_json(with("\"4\": {", "\"4x\": {"), "it"), InvalidInput);
  CHECK_THROWS_AS(record_from_json(with("[640,320]", "[0,0]"), "it"), InvalidInput);
  CHECK_THROWS_AS(record_from_json(with("-1000000000000.0,1.1]", "1e308,1.1]"), "it"), InvalidInput);
  CHECK_THROWS_AS(record_from_json(with("-1000000000000.0,1.1]", "0.0,-1.1]"), "it"), InvalidInput);
  CHECK_THROWS_WITH(record_from_json(with("\"passes\":7", "\"passes\":-7"), "it"), Contains("keyframe -3"));
  CHECK_THROWS_AS(record_from_json(with("{\"seed\":1}", std::string(100000, '[')), "it"), InvalidInput);
  CHECK_THROWS_AS(record_from_json(with("{\"seed\":1}", std::string(100000, '[') + std::string(100000, ']')), "it"),
                  InvalidInput);
}
