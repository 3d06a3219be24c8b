// SPDX-License-Identifier: BSD-2-Clause
#include "io/plan_io.h"

#include <nlohmann/json.hpp>

#include "binary_input.h"
#include "export/files.h"
#include "json_input.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

using Json = nlohmann::ordered_json;
constexpr const char* kPlanFormat = "pmsp plan";
constexpr int kPlanVersion = 1;

Json to_json(const PlanEntry& entry) {
  Json json{{"id", entry.id},
            {"use", name_of(entry.use)},
            {"near", entry.near},
            {"first_planes", nullptr},
            {"range", {entry.range.min, entry.range.max}},
            {"consistency", entry.consistency},
            {"fusion", entry.fusion},
            {"viewers", entry.viewers},
            {"duplicate_views", entry.duplicate_views}};
  if (entry.first_planes) json["first_planes"] = *entry.first_planes;
  return json;
}

PlanEntry entry_from(const JsonValue& json) {
  const auto ids = [&](const char* key) {
    std::vector<std::int64_t> result;
    json.at(key).each_element([&](const JsonValue& id) { result.push_back(id.integer()); });
    return result;
  };
  PlanEntry entry;
  entry.id = json.at("id").integer();
  const JsonValue use = json.at("use"), first_planes = json.at("first_planes"), range = json.at("range");
  try {
    entry.use = keyframe_use_from_name(use.text());
  } catch (const InvalidInput& error) {
    fail(use.path(), use.where(), error.what());
  }
  entry.near = ids("near");
  if (!first_planes.is_null()) entry.first_planes = first_planes.integer();
  if (range.size() != 2) range.refuse("two depths");
  entry.range = {range.element(0).number(), range.element(1).number()};
  entry.consistency = ids("consistency");
  entry.fusion = ids("fusion");
  entry.viewers = ids("viewers");
  entry.duplicate_views = ids(json.has("duplicate_views") ? "duplicate_views" : "owners");  // former name
  return entry;
}

}  // namespace

std::string plan_json(const Plan& plan) {
  std::string text = "{\n\"format\": \"" + std::string(kPlanFormat) +
                     "\",\n\"version\": " + std::to_string(kPlanVersion) + ",\n\"entries\": [";
  for (std::size_t i = 0; i < plan.entries.size(); ++i) {
    text += (i == 0 ? "\n" : ",\n") + to_json(plan.entries[i]).dump();
  }
  return text + "\n]\n}\n";
}

Plan plan_from_json(const std::string& text, const std::string& where) {
  const std::filesystem::path path(where);
  const nlohmann::json json = parse_json(text, path);
  const JsonValue root(json, path);
  if (!root.has("format") || root.at("format").text() != kPlanFormat) {
    fail(path, "", std::string("is no plan; expected \"format\": \"") + kPlanFormat + "\"");
  }
  if (root.at("version").integer() != kPlanVersion) root.at("version").refuse(std::to_string(kPlanVersion));
  Plan plan;
  root.at("entries").each_element([&](const JsonValue& entry) { plan.entries.push_back(entry_from(entry)); });
  return plan;
}

void write_plan(const std::filesystem::path& path, const Plan& plan) { write_file(path, plan_json(plan)); }

}  // namespace pmsp
