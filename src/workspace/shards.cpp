// SPDX-License-Identifier: BSD-2-Clause
#include "workspace/shards.h"

#include <algorithm>
#include <set>
#include <system_error>

#include <nlohmann/json.hpp>

#include "export/files.h"
#include "pmsp/error.h"

namespace pmsp::workspace {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kJob = "pmsp shared step";
constexpr const char* kMarker = "pmsp shard";
constexpr int kShardVersion = 1;

Json to_json(const ShardJob& job) {
  return {{"format", kJob},
          {"version", kShardVersion},
          {"from", job.from},
          {"step", job.step},
          {"shards", job.count},
          {"engine", job.engine},
          {"build", job.build},
          {"map", job.map},
          {"map_bytes", job.map_bytes},
          {"images", job.images},
          {"video", job.video},
          {"mask", job.mask},
          {"mask_bytes", job.mask_bytes},
          {"mask_nadir", job.mask_nadir},
          {"mask_zenith", job.mask_zenith},
          {"no_masks", job.no_masks},
          {"prior_depth", job.prior_depth},
          {"fps", job.fps},
          {"frame_offset", job.frame_offset ? Json(*job.frame_offset) : Json()},
          {"presentation_times", job.presentation_times},
          {"points", job.points},
          {"image_list", job.image_list},
          {"camera_from_body", job.camera_from_body},
          {"component", job.component},
          {"options", Json::parse(job.options)}};
}

ShardJob job_from(const Json& json) {
  ShardJob job;
  job.from = json.at("from").get<std::string>();
  job.step = json.at("step").get<std::string>();
  job.count = json.at("shards").get<int>();
  job.engine = json.at("engine").get<std::string>();
  job.build = json.at("build").get<std::string>();
  job.map = json.at("map").get<std::string>();
  job.map_bytes = json.at("map_bytes").get<std::string>();
  job.images = json.at("images").get<std::string>();
  job.video = json.at("video").get<std::string>();
  job.mask = json.at("mask").get<std::string>();
  job.mask_bytes = json.at("mask_bytes").get<std::string>();
  job.mask_nadir = json.value("mask_nadir", 0.0);
  job.mask_zenith = json.value("mask_zenith", 0.0);
  job.no_masks = json.value("no_masks", false);
  job.prior_depth = json.value("prior_depth", "");
  job.fps = json.at("fps").get<double>();
  if (!json.at("frame_offset").is_null()) job.frame_offset = json.at("frame_offset").get<std::int64_t>();
  job.presentation_times = json.value("presentation_times", false);
  job.points = json.value("points", "");
  job.image_list = json.value("image_list", "");
  job.camera_from_body = json.value("camera_from_body", "");
  job.component = json.value("component", -1);
  job.options = json.at("options").dump();
  if (job.count < 1) throw InvalidInput(std::to_string(job.count) + " shards; expected at least 1");
  return job;
}

Json to_json(const ShardMarker& marker) {
  Json json{{"format", kMarker},
            {"version", kShardVersion},
            {"shard", marker.shard.index},
            {"of", marker.shard.count},
            {"wave", name_of(marker.wave)},
            {"state", marker.failure.empty() ? "finished" : "failed"}};
  if (!marker.failure.empty()) json["failure"] = marker.failure;
  json["step"] = marker.step;
  json["engine"] = marker.engine;
  json["build"] = marker.build;
  json["host"] = marker.host;
  json["seconds"] = marker.seconds;
  json["keyframes"] = marker.keyframes;
  json["made"] = marker.made;
  json["without"] = marker.without;
  return json;
}

ShardMarker marker_from(const Json& json) {
  ShardMarker marker;
  marker.shard = {json.at("shard").get<int>(), json.at("of").get<int>()};
  marker.wave = json.at("wave").get<std::string>() == name_of(Wave::kPlanes) ? Wave::kPlanes : Wave::kPoints;
  if (json.at("state") != "finished") marker.failure = json.at("failure").get<std::string>();
  marker.step = json.at("step").get<std::string>();
  marker.engine = json.at("engine").get<std::string>();
  marker.build = json.at("build").get<std::string>();
  marker.host = json.at("host").get<std::string>();
  marker.seconds = json.at("seconds").get<double>();
  marker.keyframes = json.at("keyframes").get<std::int64_t>();
  marker.made = json.at("made").get<std::int64_t>();
  marker.without = json.at("without").get<std::vector<std::int64_t>>();
  return marker;
}

/// Returns the result of `from` for a file of a format.
template <class From>
auto read_json(const fs::path& path, const char* format, const From& from) {
  const std::string text = read_whole_file(path);
  try {
    const Json json = Json::parse(text);
    if (json.at("format") != format || json.at("version") != kShardVersion) {
      throw InvalidInput("format and version; expected \"" + std::string(format) + "\", " +
                         std::to_string(kShardVersion));
    }
    return from(json);
  } catch (const std::exception& error) {
    throw IoError(path.string() + ": this file of the workspace is damaged or of another version (" + error.what() +
                  "); delete the directory that it lies in and run the shards again");
  }
}

void write_json(const fs::path& path, const Json& json) {
  write_file(path, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

std::string job_name(const std::string& from) { return "job-" + (from.empty() ? "new" : from) + ".json"; }

std::string marker_name(const ShardMarker& marker) {
  return std::string(name_of(marker.wave)) + "-" + std::to_string(marker.shard.index) + "-of-" +
         std::to_string(marker.shard.count) + ".json";
}

/// Returns the names of different options, the first few.
std::string other_options(const std::string& mine, const std::string& job) {
  const auto a = nlohmann::json::parse(mine).flatten();
  const auto b = nlohmann::json::parse(job).flatten();
  // Options of the machine: their effects are part of the engine.
  const std::set<std::string> no_matter{"/backend", "/device", "/pipelined", "/threads", "/simd"};
  std::string text;
  int named = 0;
  for (const auto& [key, value] : b.items()) {
    const auto found = a.find(key);
    if (no_matter.count(key) != 0 || (found != a.end() && *found == value)) continue;
    std::string name = key.substr(1);
    std::replace(name.begin(), name.end(), '/', '.');
    if (++named > 3) return text + " and more";
    text += (named > 1 ? ", " : "") + name + " " + (found == a.end() ? "none" : found->dump()) + " instead of " +
            value.dump();
  }
  return text;
}

std::string quoted(const std::string& text) { return "\"" + text + "\""; }

}  // namespace

std::string text_of(const Shard& shard) { return std::to_string(shard.index) + "/" + std::to_string(shard.count); }

IdRange id_range_of(const Shard& shard, std::size_t size) {
  const auto begin = [&](int index) {
    const auto i = static_cast<std::size_t>(index), count = static_cast<std::size_t>(shard.count);
    return i * (size / count) + std::min(i, size % count);
  };
  return {begin(shard.index), begin(shard.index + 1)};
}

const char* name_of(Wave wave) { return wave == Wave::kPlanes ? "planes" : "points"; }

void ShardFolder::make() const { make_folder(folder_); }

std::optional<ShardJob> ShardFolder::job(const std::string& from) const {
  const fs::path path = folder_ / job_name(from);
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return std::nullopt;
  return read_json(path, kJob, job_from);
}

std::optional<ShardJob> ShardFolder::ended_job(const std::string& step) const {
  for (const fs::path& path : files("job-")) {
    const ShardJob job = read_json(path, kJob, job_from);
    if (job.step == step) return job;
  }
  return std::nullopt;
}

ShardJob ShardFolder::post(const ShardJob& job) const {
  const fs::path path = folder_ / job_name(job.from);
  std::error_code ignored;
  if (!fs::exists(path, ignored)) write_new_file(path, to_json(job).dump(2) + "\n");
  return read_json(path, kJob, job_from);
}

void ShardFolder::mark(const ShardMarker& marker) const {
  const fs::path path = folder_ / marker_name(marker);
  std::error_code ignored;
  const bool may_keep = !marker.failure.empty() && fs::exists(path, ignored);
  if (may_keep && read_json(path, kMarker, marker_from).failure.empty()) return;
  write_json(path, to_json(marker));
}

std::vector<ShardMarker> ShardFolder::markers() const {
  std::vector<ShardMarker> markers;
  for (const Wave wave : {Wave::kPlanes, Wave::kPoints}) {
    for (const fs::path& path : files(std::string(name_of(wave)) + "-")) {
      markers.push_back(read_json(path, kMarker, marker_from));
    }
  }
  std::stable_sort(markers.begin(), markers.end(), [](const ShardMarker& a, const ShardMarker& b) {
    return a.wave != b.wave ? a.wave < b.wave : a.shard.index < b.shard.index;
  });
  return markers;
}

std::vector<fs::path> ShardFolder::files(const std::string& kind) const {
  std::vector<fs::path> paths;
  std::error_code error;
  for (fs::directory_iterator it(folder_, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.rfind(kind, 0) == 0 && it->path().extension() == ".json") paths.push_back(it->path());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

void ShardFolder::end(const std::string& step) const {
  std::error_code ignored;
  for (const char* kind : {"planes-", "points-"}) {
    for (const fs::path& path : files(kind)) fs::remove(path, ignored);  // remaining files are harmless
  }
  for (const fs::path& path : files("job-")) {
    try {
      if (read_json(path, kJob, job_from).step == step) continue;
    } catch (const Error&) {  // unusable
    }
    fs::remove(path, ignored);
  }
}

void ShardFolder::remove() const {
  std::error_code ignored;
  for (const char* kind : {"planes-", "points-", "job-"}) {
    for (const fs::path& path : files(kind)) fs::remove(path, ignored);
  }
  fs::remove(folder_, ignored);
}

std::string difference(const ShardJob& mine, const ShardJob& job) {
  if (mine.count != job.count) {
    return "it is one of " + std::to_string(mine.count) + " shards, not of " + std::to_string(job.count);
  }
  const std::string options = other_options(mine.options, job.options);
  if (!options.empty()) return "its options differ: " + options;
  if (mine.map_bytes != job.map_bytes) return "its map differs from " + job.map;
  if (mine.mask_bytes != job.mask_bytes) {
    return "its mask differs from " + (job.mask.empty() ? "theirs, none" : job.mask);
  }
  for (const auto& [its, others] : {std::pair(mine.engine, job.engine), std::pair(mine.build, job.build)}) {
    if (!its.empty() && its != others) return "its engine is " + quoted(its) + ", theirs is " + quoted(others);
  }
  if (mine.points != job.points || mine.image_list != job.image_list || mine.camera_from_body != job.camera_from_body ||
      mine.component != job.component) {
    return "--points, --image-list, --camera-from-body or --component differ";
  }
  if (mine.fps != job.fps || mine.frame_offset != job.frame_offset ||
      mine.presentation_times != job.presentation_times) {
    return "--fps, --frame-offset or --presentation-times differ";
  }
  if (!mine.step.empty() && mine.step != job.step) {
    return "images or contents of the workspace have changed, or not all can be read here";
  }
  return "";
}

std::string difference(const ShardMarker& marker, const ShardJob& job) {
  for (const auto& [its, others] : {std::pair(marker.engine, job.engine), std::pair(marker.build, job.build)}) {
    if (!its.empty() && its != others) return "its engine is " + quoted(its) + ", theirs is " + quoted(others);
  }
  return !marker.step.empty() && marker.step != job.step ? "it worked on other inputs, step " + marker.step : "";
}

}  // namespace pmsp::workspace
