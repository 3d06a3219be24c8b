// SPDX-License-Identifier: BSD-2-Clause
#include "io/plan_io.h"

#include <cmath>

#include <nlohmann/json.hpp>

#include "export/files.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

using Json = nlohmann::ordered_json;
constexpr const char* kFormat = "pmsp plan";
constexpr int kVersion = 1;

Json to_json(const PlanEntry& entry) {
  Json json{{"id", entry.id},
            {"use", name_of(entry.use)},
            {"near", entry.near},
            {"first_planes", nullptr},
            {"range", {entry.range.min, entry.range.max}},
            {"consistency", entry.consistency},
            {"fusion", entry.fusion},
            {"viewers", entry.viewers},
            {"owners", entry.duplicate_views}};
  if (entry.first_planes) json["first_planes"] = *entry.first_planes;
  return json;
}

/// Reads an entry; errors contain its name.
class EntryReader {
 public:
  EntryReader(const Json& json, std::string where) : json_(json), where_(std::move(where)) {
    if (!json.is_object()) throw InvalidInput(where_ + " is " + shown(json) + "; expected an object");
  }

  PlanEntry read() const {
    PlanEntry entry;
    entry.id = id_of(at("id"), "id");
    const Json& use = at("use");
    if (!use.is_string()) refuse("use", use, "a string");
    try {
      entry.use = keyframe_use_from_name(use.get<std::string>());
    } catch (const InvalidInput& error) {
      throw InvalidInput(where_ + ": " + error.what());
    }
    entry.near = ids("near");
    if (!at("first_planes").is_null()) entry.first_planes = id_of(at("first_planes"), "first_planes");
    entry.range = range();
    entry.consistency = ids("consistency");
    entry.fusion = ids("fusion");
    entry.viewers = ids("viewers");
    entry.duplicate_views = ids("owners");
    return entry;
  }

 private:
  static std::string shown(const Json& json) {
    return json.dump(-1, ' ', true, Json::error_handler_t::replace).substr(0, 60);
  }

  [[noreturn]] void refuse(const char* key, const Json& value, const char* expected) const {
    throw InvalidInput(where_ + ": " + key + " is " + shown(value) + "; expected " + expected);
  }

  const Json& at(const char* key) const {
    const auto found = json_.find(key);
    if (found == json_.end()) throw InvalidInput(where_ + " lacks " + key);
    return *found;
  }

  std::int64_t id_of(const Json& value, const char* key) const {
    const bool fits =
        value.is_number_integer() &&
        !(value.is_number_unsigned() && value.get<std::uint64_t>() > static_cast<std::uint64_t>(INT64_MAX));
    if (!fits) refuse(key, value, "a keyframe id");
    return value.get<std::int64_t>();
  }

  std::vector<std::int64_t> ids(const char* key) const {
    const Json& list = at(key);
    if (!list.is_array()) refuse(key, list, "a list of keyframe ids");
    std::vector<std::int64_t> result;
    for (const Json& value : list) result.push_back(id_of(value, key));
    return result;
  }

  DepthRange range() const {
    const Json& list = at("range");
    if (!list.is_array() || list.size() != 2 || !list[0].is_number() || !list[1].is_number()) {
      refuse("range", list, "two depths");
    }
    return {list[0].get<double>(), list[1].get<double>()};
  }

  const Json& json_;
  std::string where_;
};

Json parsed(const std::string& text, const std::string& where) {
  try {
    return Json::parse(text);
  } catch (const Json::parse_error& error) {
    throw InvalidInput(where + ": is no JSON, byte " + std::to_string(error.byte));
  }
}

}  // namespace

std::string plan_json(const Plan& plan) {
  std::string text = "{\n\"format\": \"" + std::string(kFormat) + "\",\n\"version\": " + std::to_string(kVersion) +
                     ",\n\"entries\": [";
  for (std::size_t i = 0; i < plan.entries.size(); ++i) {
    text += (i == 0 ? "\n" : ",\n") + to_json(plan.entries[i]).dump();
  }
  return text + "\n]\n}\n";
}

Plan plan_from_json(const std::string& text, const std::string& where) {
  const Json json = parsed(text, where);
  if (!json.is_object() || json.value("format", Json()) != Json(kFormat)) {
    throw InvalidInput(where + ": is no plan; expected \"format\": \"" + kFormat + "\"");
  }
  if (json.value("version", Json()) != Json(kVersion)) {
    throw InvalidInput(where + ": version is " + json.value("version", Json()).dump().substr(0, 60) + "; expected " +
                       std::to_string(kVersion));
  }
  const auto entries = json.find("entries");
  if (entries == json.end() || !entries->is_array()) throw InvalidInput(where + ": lacks the list \"entries\"");
  Plan plan;
  plan.entries.reserve(entries->size());
  for (const Json& entry : *entries) {
    plan.entries.push_back(EntryReader(entry, where + ": entry " + std::to_string(plan.entries.size())).read());
  }
  return plan;
}

void write_plan(const std::filesystem::path& path, const Plan& plan) { write_file(path, plan_json(plan)); }

Plan read_plan(const std::filesystem::path& path) { return plan_from_json(read_whole_file(path), path.string()); }

}  // namespace pmsp
