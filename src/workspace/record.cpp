// SPDX-License-Identifier: BSD-2-Clause
#include "workspace/record.h"

#include <cmath>

#include <nlohmann/json.hpp>

#include "densifier_checks.h"
#include "io/plan_io.h"
#include "pmsp/error.h"
#include "util/number_from.h"

namespace pmsp::workspace {
namespace {

using Json = nlohmann::ordered_json;
constexpr const char* kRecordFormat = "pmsp workspace";
constexpr int kRecordVersion = 1;
constexpr int kDeepest = 16;

/// Rotation row by row, translation, scale.
Json to_json(const KeyframePose& pose) {
  Json json = Json::array();
  for (int i = 0; i < 9; ++i) json.push_back(pose.cam_from_world.rotation(i / 3, i % 3));
  for (int i = 0; i < 3; ++i) json.push_back(pose.cam_from_world.translation[i]);
  json.push_back(pose.scale);
  return json;
}

KeyframePose pose_from(const Json& json) {
  const std::vector<double> numbers = json.get<std::vector<double>>();
  if (numbers.size() != 13)
    throw InvalidInput("a pose has " + std::to_string(numbers.size()) + " numbers; expected 13");
  KeyframePose pose;
  for (std::size_t i = 0; i < 9; ++i) {
    pose.cam_from_world.rotation(static_cast<int>(i / 3), static_cast<int>(i % 3)) = numbers[i];
  }
  for (std::size_t i = 0; i < 3; ++i) pose.cam_from_world.translation[static_cast<int>(i)] = numbers[9 + i];
  pose.scale = numbers[12];
  check_pose("a pose", pose.cam_from_world);
  check_scale("a pose", pose.scale);
  return pose;
}

std::int64_t id_from(const std::string& text) {
  if (const auto id = plain_number_from<std::int64_t>(text)) return *id;
  throw InvalidInput("\"" + text + "\" is no keyframe's id");
}

/// Returns an integer from `low` to `high`.
int count_from(const Json& json, int low, int high) {
  const std::int64_t count = json.get<std::int64_t>();
  if (count >= low && count <= high) return static_cast<int>(count);
  throw InvalidInput(std::to_string(count) + "; expected " + std::to_string(low) + " to " + std::to_string(high));
}

Json to_json(const RecordedPlanes& planes) {
  Json sources = Json::array();
  for (const RecordedSource& source : planes.sources) {
    sources.push_back({{"id", source.id}, {"image", source.image}, {"pose", to_json(source.pose)}});
  }
  return {{"file", planes.file},
          {"own", planes.own},
          {"passes", planes.passes},
          {"pose", to_json(planes.pose)},
          {"sources", sources}};
}

Json to_json(const RecordedKeyframe& keyframe) {
  Json sharpness = Json::array();
  for (const LandmarkSharpness& at : keyframe.sharpness.landmarks) {
    sharpness.push_back({at.id, at.horizontal, at.vertical});
  }
  Json json{{"image", keyframe.image},
            {"size", {keyframe.width, keyframe.height}},
            {"pose", to_json(keyframe.pose)},
            {"looked_for", keyframe.looked_for},
            {"sharpness", sharpness}};
  Json ranges = Json::array();
  for (const RecordedRange& it : keyframe.ranges) ranges.push_back({it.landmark, it.range});
  if (!ranges.empty()) json["ranges"] = ranges;
  if (keyframe.planes) json["planes"] = to_json(*keyframe.planes);
  if (keyframe.points) {
    json["points"] = {
        {"file", keyframe.points->file}, {"inputs", keyframe.points->inputs}, {"step", keyframe.points->step}};
  }
  return json;
}

/// Returns a file name in one of the workspace's folders, never a path.
std::string file_from(const Json& json) {
  std::string name = json.get<std::string>();
  if (name.empty() || name[0] == '.' || name.find('/') != std::string::npos)
    throw InvalidInput("\"" + name + "\" is no file of a workspace");
  return name;
}

RecordedPlanes planes_from(const Json& json) {
  RecordedPlanes planes{file_from(json.at("file")),
                        json.at("own").get<std::string>(),
                        count_from(json.at("passes"), 1, 1000000),
                        pose_from(json.at("pose")),
                        {}};
  for (const Json& source : json.at("sources")) {
    planes.sources.push_back(
        {source.at("id").get<std::int64_t>(), source.at("image").get<std::string>(), pose_from(source.at("pose"))});
  }
  return planes;
}

RecordedKeyframe keyframe_from(const Json& json) {
  RecordedKeyframe keyframe;
  keyframe.image = json.at("image").get<std::string>();
  keyframe.width = count_from(json.at("size").at(0), 16, 65536);
  keyframe.height = count_from(json.at("size").at(1), 8, 65536);
  keyframe.pose = pose_from(json.at("pose"));
  keyframe.looked_for = json.at("looked_for").get<std::string>();
  for (const Json& at : json.at("sharpness")) {
    keyframe.sharpness.landmarks.push_back(
        {at.at(0).get<std::int64_t>(), at.at(1).get<float>(), at.at(2).get<float>()});
  }
  if (const auto ranges = json.find("ranges"); ranges != json.end()) {  // older records have none
    for (const Json& it : *ranges) keyframe.ranges.push_back({it.at(0).get<std::int64_t>(), it.at(1).get<double>()});
  }
  if (const auto planes = json.find("planes"); planes != json.end()) keyframe.planes = planes_from(*planes);
  if (const auto points = json.find("points"); points != json.end()) {
    keyframe.points = RecordedPoints{file_from(points->at("file")), points->at("inputs").get<std::string>(),
                                     points->at("step").get<std::string>()};
  }
  return keyframe;
}

Record record_from(const Json& json, const std::string& where) {
  Record record;
  record.step = json.at("step").get<std::string>();
  record.engine = json.at("engine").get<std::string>();
  record.options = json.at("options").dump();
  record.lenses_looked_at = json.value("lenses_looked_at", std::size_t{0});
  record.map = json.at("map").get<std::string>();
  record.images = json.at("images").get<std::string>();
  record.outputs = json.at("outputs").get<std::vector<std::string>>();
  if (const auto cloud = json.find("cloud"); cloud != json.end()) {  // older records have none
    for (int i = 0; i < 3; ++i)
      record.cloud.center[i] = cloud->at("center").at(static_cast<std::size_t>(i)).get<double>();
    record.cloud.reach = cloud->at("reach").get<double>();
    record.cloud.comments = cloud->at("comments").get<std::vector<std::string>>();
    if (!record.cloud.center.allFinite() || !(record.cloud.reach >= 0.0) || !std::isfinite(record.cloud.reach)) {
      throw InvalidInput("the size of the cloud is no number");
    }
  }
  record.plan = plan_from_json(json.at("plan").dump(), where + ": plan");
  for (const auto& [id, keyframe] : json.at("keyframes").items()) {
    try {
      record.keyframes.emplace(id_from(id), keyframe_from(keyframe));
    } catch (const std::exception& error) {
      throw InvalidInput("keyframe " + id + ": " + error.what());
    }
  }
  for (const auto& [step, poses] : json.at("poses").items()) {
    for (const auto& [id, pose] : poses.items()) record.poses[step].emplace(id_from(id), pose_from(pose));
  }
  return record;
}

}  // namespace

/// One line per keyframe.
std::string record_json(const Record& record) {
  const auto line = [](const std::string& key, const Json& value) {
    return Json(key).dump() + ": " + value.dump(-1, ' ', false, Json::error_handler_t::replace);
  };
  std::string text = "{\n" + line("format", kRecordFormat) + ",\n" + line("version", kRecordVersion) + ",\n" +
                     line("step", record.step) + ",\n" + line("engine", record.engine) + ",\n" +
                     line("map", record.map) + ",\n" + line("images", record.images) + ",\n" +
                     line("options", Json::parse(record.options)) + ",\n" +
                     line("lenses_looked_at", record.lenses_looked_at) + ",\n" + line("outputs", record.outputs);
  if (record.cloud.reach > 0.0) {
    const Eigen::Vector3d& center = record.cloud.center;
    text += ",\n" + line("cloud", {{"center", {center.x(), center.y(), center.z()}},
                                   {"reach", record.cloud.reach},
                                   {"comments", record.cloud.comments}});
  }
  text += ",\n\"keyframes\": {";
  const char* before = "\n";
  for (const auto& [id, keyframe] : record.keyframes) {
    text += before + line(std::to_string(id), to_json(keyframe));
    before = ",\n";
  }
  text += "\n},\n\"poses\": {";
  before = "\n";
  for (const auto& [step, poses] : record.poses) {
    Json table = Json::object();
    for (const auto& [id, pose] : poses) table[std::to_string(id)] = to_json(pose);
    text += before + line(step, table);
    before = ",\n";
  }
  return text + "\n},\n\"plan\": " + plan_json(record.plan) + "}\n";
}

Record record_from_json(const std::string& text, const std::string& where) {
  try {
    const Json json = Json::parse(text, [](int depth, Json::parse_event_t /*event*/, Json& /*parsed*/) {
      if (depth > kDeepest) throw InvalidInput("nested more than " + std::to_string(kDeepest) + " deep");
      return true;
    });
    if (!json.is_object() || json.value("format", Json()) != Json(kRecordFormat)) {
      throw InvalidInput("the format; expected \"" + std::string(kRecordFormat) + "\"");
    }
    if (json.value("version", Json()) != Json(kRecordVersion)) {
      throw InvalidInput("the version; expected " + std::to_string(kRecordVersion));
    }
    return record_from(json, where);
  } catch (const std::exception& error) {
    throw InvalidInput(where + ": is no record of a workspace that this version can read (" + error.what() +
                       "); give another directory, or delete this one");
  }
}

}  // namespace pmsp::workspace
