// SPDX-License-Identifier: BSD-2-Clause
#include "report_page.h"

#include <algorithm>
#include <utility>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "elementary.h"
#include "io/image_decode.h"
#include "mission_input.h"
#include "numbers.h"
#include "page_depth.h"
#include "pictures.h"
#include "progress.h"
#include "web/page.h"
#include "web/web_path.h"

namespace pmsp::tool {
namespace {

using Json = nlohmann::ordered_json;

/// Number at a path of keys; 0 = missing.
double number_at(const Json& json, const std::vector<const char*>& path) {
  const Json* at = &json;
  for (const char* key : path) {
    if (!at->is_object() || !at->contains(key)) return 0.0;
    at = &at->at(key);
  }
  return at->is_number() ? at->get<double>() : 0.0;
}

std::string text_at(const Json& json, const char* key) {
  return json.is_object() && json.contains(key) && json.at(key).is_string() ? json.at(key).get<std::string>() : "";
}

std::string count_at(const Json& json, const std::vector<const char*>& path) {
  return count_text(static_cast<std::int64_t>(std::clamp(number_at(json, path), 0.0, 1e15)));
}

std::string percent(double part, double whole) {
  return number_text(whole > 0.0 ? 100.0 * part / whole : 0.0, "%.0f %%");
}

}  // namespace

Json report_facts(const Json& stats) {
  Json facts = Json::array();
  const auto add = [&facts](const char* name, const std::string& value) {
    if (!value.empty()) facts.push_back({name, value});
  };
  add("Map", text_at(stats, "map"));
  add("Images", text_at(stats, "images"));
  if (stats.contains("outputs") && stats.at("outputs").is_array()) {
    std::string outputs;
    for (const Json& it : stats.at("outputs")) {
      if (it.is_string()) outputs += (outputs.empty() ? "" : ", ") + it.get<std::string>();
    }
    add("Written to", outputs);
  }
  if (number_at(stats, {"keyframes", "in_map"}) > 0.0) {
    add("Keyframes", count_at(stats, {"keyframes", "in_map"}) + " in the map, " +
                         count_at(stats, {"keyframes", "with_image"}) + " with an image, " +
                         count_at(stats, {"keyframes", "depth_maps"}) + " with a depth map");
  }
  add("Points", count_at(stats, {"points_written"}));
  if (stats.contains("cloud")) add("Lengths", text_at(stats.at("cloud"), "lengths"));
  if (number_at(stats, {"options", "width"}) > 0.0) {
    add("Depth maps",
        count_at(stats, {"options", "width"}) + " × " + count_at(stats, {"options", "height"}) + " pixels");
  }
  if (const double pixels = number_at(stats, {"pixels", "unmasked"}); pixels > 0.0) {
    add("Pixels kept", "PatchMatch " + percent(number_at(stats, {"pixels", "matched"}), pixels) + ", median filter " +
                           percent(number_at(stats, {"pixels", "after_median"}), pixels) + ", consistency filter " +
                           percent(number_at(stats, {"pixels", "after_consistency"}), pixels));
  }
  std::string backend = text_at(stats, "backend");
  if (!backend.empty()) {
    backend += ", " + text_at(stats, "simd") + ", " + count_at(stats, {"threads"}) + " threads on the CPU";
  }
  add("Backend", backend);
  if (stats.contains("seed") && stats.at("seed").is_number()) add("Seed", stats.at("seed").dump());
  if (const double seconds = number_at(stats, {"seconds", "total"}); seconds > 0.0) add("Time", duration_text(seconds));
  if (number_at(stats, {"peak_memory_mib"}) > 0.0) add("Memory", count_at(stats, {"peak_memory_mib"}) + " MiB");
  add("Program", text_at(stats, "generator"));
  return facts;
}

Json report_times(const Json& stats) {
  Json times = Json::array();
  const auto add = [&](const char* name, const char* group, const char* key) {
    const double seconds = number_at(stats, {group, key});
    if (seconds > 0.0) times.push_back({name, seconds});
  };
  add("Reading the map", "critical_path", "map");
  add("Finding images", "critical_path", "images");
  add("Waiting for images", "critical_path", "wait_for_images");
  add("Preparing images", "seconds", "prepare");
  add("Initialising", "seconds", "init");
  add("PatchMatch", "seconds", "patchmatch");
  add("Median filter", "seconds", "median");
  add("Consistency filter", "seconds", "consistency");
  add("Fusion", "seconds", "fusion");
  add("Free space", "seconds", "free_space");
  add("Duplicate removal", "seconds", "duplicates");
  add("Writing points", "critical_path", "points");
  add("Writing depth maps", "critical_path", "depth_maps");
  add("Writing and reading the workspace", "critical_path", "workspace");
  add("Drawing", "critical_path", "preview");
  add("Waiting for the disk", "critical_path", "finish");
  return times;
}

std::vector<std::string> report_problems(const Json& stats) {
  std::vector<std::string> problems;
  const double unmasked = number_at(stats, {"pixels", "unmasked"});
  const double all = number_at(stats, {"options", "width"}) * number_at(stats, {"options", "height"}) *
                     number_at(stats, {"keyframes", "depth_maps"});
  const bool is_whole = !stats.contains("workspace");  // otherwise pixel counts are those of the last run only
  if (is_whole && all > 0.0 && unmasked > 0.0 && unmasked < 0.995 * all) {
    problems.push_back(percent(all - unmasked, all) + " of the views lie in the mask.");
  }
  if (is_whole && unmasked > 0.0 && number_at(stats, {"pixels", "after_consistency"}) < 0.4 * unmasked) {
    problems.push_back("Only " + percent(number_at(stats, {"pixels", "after_consistency"}), unmasked) +
                       " of the pixels have a depth that other keyframes agree with.");
  }
  if (stats.contains("warnings") && stats.at("warnings").is_array()) {
    for (const Json& warning : stats.at("warnings")) {
      if (warning.is_string()) problems.push_back(warning.get<std::string>());
    }
  }
  return problems;
}

std::string list_of_keyframes(const std::vector<std::int64_t>& ids, const std::vector<std::int64_t>& order) {
  std::vector<std::string> runs;
  for (std::size_t i = 0; i < order.size();) {
    std::size_t end = i;
    while (end < order.size() && std::find(ids.begin(), ids.end(), order[end]) != ids.end()) ++end;
    if (end == i) {
      ++i;
      continue;
    }
    const std::string first = std::to_string(order[i]);
    const std::string last = std::to_string(order[end - 1]);
    if (end == i + 1) {
      runs.push_back(first);
    } else {
      runs.push_back(first + (end == i + 2 ? " and " : " to ") + last);
    }
    i = end;
  }
  std::string text;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (i == 8 && runs.size() > 9) return text + " and " + std::to_string(runs.size() - 8) + " more groups";
    text += (i == 0 ? "" : i + 1 == runs.size() ? " and " : ", ") + runs[i];
  }
  return text;
}

namespace {

constexpr int kStripWidth = 320;
constexpr std::size_t kMostStrips = 200;
constexpr int kStripQuality = 80;
constexpr int kCoverageWidth = 128, kCoverageHeight = 64;

std::string jpeg(const cv::Mat& picture, int quality) {
  const std::vector<unsigned char> bytes = io::encoded(
      ".jpg", picture, "a picture for the report cannot be encoded as JPEG", {cv::IMWRITE_JPEG_QUALITY, quality});
  return {bytes.begin(), bytes.end()};
}

/// True if item `index` of `count` belongs to an even sample of size `share`.
bool is_in_share(std::size_t index, std::size_t count, std::size_t share) {
  if (count <= share) return true;
  return index == 0 || index * share / count != (index - 1) * share / count;
}

double share_used(ImageView<const std::uint8_t> mask) {
  if (mask.width == 0 || mask.height == 0) return 1.0;
  std::size_t used = 0;
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) used += mask(x, y) != 0 ? 1 : 0;
  }
  return static_cast<double>(used) / (static_cast<double>(mask.width) * mask.height);
}

std::vector<std::int64_t> ids_in_order(const SlamMap& map) {
  std::vector<std::int64_t> ids;
  for (const MapKeyframe* keyframe : in_time_order(map)) ids.push_back(keyframe->id);
  return ids;
}

Json vector_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

/// Returns the first output that `convert` reads, with colours; "" = none.
std::string readable_output(const Json& stats) {
  for (const Json& it : stats.value("outputs", Json::array())) {
    const CloudFormat* format = it.is_string() ? cloud_format_of(it.get<std::string>()) : nullptr;
    if (it.is_string() && (format == nullptr || (!format->is_map && format->name != std::string("splat")))) return it;
  }
  return "";
}

/// Reason for an unused keyframe, for messages.
const char* words_for(const std::string& use) {
  if (use == "no neighbour") return "no other used keyframe nearby sees the same surfaces with enough parallax";
  if (use == "no range") return "too few landmarks for a depth range";
  if (use == "too little parallax") return "too little parallax to the previous keyframe";
  if (use == "too much parallax") return "too far from the previous keyframe for matching";
  if (use == "no landmarks") return "the map contains no landmarks of it";
  if (use == "blurred") return "its image is blurrier than those of the keyframes around";
  return "";
}

}  // namespace

ReportPage::ReportPage(const ReportArguments& arguments, const CloudHeader& header, const SlamMap& map,
                       std::size_t keyframes)
    : arguments_(arguments),
      map_(map),
      file_from_map_(header.file_from_map),
      unit_(header.unit),
      keyframes_(keyframes),
      file_(arguments.path),
      cloud_(header, arguments.points, ids_in_order(map)),
      covered_(static_cast<std::size_t>(kCoverageWidth) * kCoverageHeight, 0) {
  if (!arguments.photos.empty()) photos_.emplace(arguments.photos);
}

void ReportPage::add_image(std::size_t index, const Keyframe& keyframe) {
  Jpegs& it = pictures_[keyframe.id];
  it.unmasked = share_used(keyframe.mask);
  if (is_in_share(index, keyframes_, kMostStrips)) {
    it.image = jpeg(picture_of(keyframe.image, kStripWidth), kStripQuality);
  }
  // The next used keyframe after each equal part of the mission.
  const std::size_t due =
      1 + index * static_cast<std::size_t>(arguments_.panoramas) / std::max<std::size_t>(keyframes_, 1);
  if (panoramas_ < arguments_.panoramas && static_cast<std::size_t>(panoramas_) < due) {
    it.panorama = photo_of(keyframe.image);
    ++panoramas_;
  }
  if (photos_) photos_->add(keyframe.id, keyframe.image);
}

void ReportPage::set_used(std::int64_t id, bool used) {
  if (used) return;
  const auto found = pictures_.find(id);
  if (found == pictures_.end()) return;
  if (!found->second.panorama.empty()) --panoramas_;
  pictures_.erase(found);
}

void ReportPage::add_depth(const DepthMap& map) {
  Jpegs& it = pictures_[map.keyframe_id];
  const DepthPicture picture = draw_depth(map, cv::COLORMAP_INFERNO);
  const double scale = map.scale * file_from_map_.scale;
  it.has_depth = true;
  it.near = picture.near * scale;
  it.far = picture.far * scale;
  it.coverage = std::min(1.0, picture.coverage / std::max(it.unmasked, 1e-9));
  it.mean_confidence = picture.mean_confidence;
  depth_width_ = map.depth.width();
  if (!it.panorama.empty()) it.depths = page_depth(map.depth.view(), map.confidence.view(), scale);
  if (photos_) photos_->add_depth(map, scale);
  if (!it.image.empty()) {
    const cv::Size size(kStripWidth, kStripWidth / 2);
    cv::Mat small;
    cv::resize(picture.depth, small, size, 0, 0, cv::INTER_AREA);
    it.depth = jpeg(small, kStripQuality);
    cv::resize(picture.confidence, small, size, 0, 0, cv::INTER_AREA);
    it.confidence = jpeg(small, kStripQuality);
  }
  ++depth_maps_;
  for (int y = 0; y < kCoverageHeight; ++y) {
    for (int x = 0; x < kCoverageWidth; ++x) {
      const int column = (2 * x + 1) * map.depth.width() / (2 * kCoverageWidth);
      const int row = (2 * y + 1) * map.depth.height() / (2 * kCoverageHeight);
      if (map.depth(column, row) > 0.0F) ++covered_[static_cast<std::size_t>(y * kCoverageWidth + x)];
    }
  }
}

void ReportPage::set_potree(const std::filesystem::path& folder) { potree_ = path_beside(arguments_.path, folder); }

std::vector<std::string> ReportPage::beside() const {
  std::vector<std::string> names;
  for (const std::filesystem::path& path : {potree_, path_beside(arguments_.path, arguments_.photos)}) {
    if (!path.empty()) names.push_back(path.begin()->string());
  }
  return names;
}

void ReportPage::set_use(const PlanEntry& entry) { uses_[entry.id] = name_of(entry.use); }

Json ReportPage::keyframes_json(const Json& stats) const {
  std::map<std::int64_t, std::string> skipped;
  if (stats.contains("skipped")) {
    for (const Json& it : stats.at("skipped")) skipped[it.at("keyframe_id")] = it.at("reason");
  }
  Json keyframes = Json::array();
  for (const MapKeyframe* keyframe : in_time_order(map_)) {
    const RigidTransform world_from_cam = file_from_map_ * keyframe->cam_from_world.inverse();
    Json json{{"id", keyframe->id}, {"center", vector_json(world_from_cam.translation)}};
    json["rotation"] = Json::array();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) json["rotation"].push_back(world_from_cam.rotation(c, r));
    }
    const auto use = uses_.find(keyframe->id);
    const auto skip = skipped.find(keyframe->id);
    if (skip != skipped.end()) {
      json["use"] = "no image";
      json["reason"] = skip->second;
    } else {
      json["use"] = use != uses_.end() ? use->second : "no image";
      json["reason"] = words_for(json["use"]);
    }
    if (photos_ && photos_->contains(keyframe->id)) {
      const std::filesystem::path folder = path_beside(arguments_.path, arguments_.photos);
      const auto address = [&](const std::string& name) {
        return web::relative_address((folder / name).generic_string());
      };
      json["photo"] = address(photo_name(keyframe->id));
      if (photos_->has_depth(keyframe->id)) json["photo_depths"] = address(depth_name(keyframe->id));
    }
    const auto found = pictures_.find(keyframe->id);
    if (found != pictures_.end()) {
      const Jpegs& it = found->second;
      const std::string name = "-" + std::to_string(keyframe->id);
      if (it.has_depth) {
        json["coverage"] = it.coverage;
        json["confidence"] = it.mean_confidence;
        if (!it.image.empty()) {
          json["strip"] = {{"image", "image" + name}, {"depth", "depth" + name}, {"confidence", "confidence" + name}};
          json["strip"]["near"] = it.near;
          json["strip"]["far"] = it.far;
        }
      }
      if (!it.panorama.empty()) json["panorama"] = "panorama" + name;
      if (!it.depths.empty()) json["depths"] = "depths" + name;
    }
    keyframes.push_back(std::move(json));
  }
  return keyframes;
}

Json ReportPage::coverage_json() const {
  std::string shares;
  for (const std::uint32_t count : covered_) {
    shares +=
        static_cast<char>(static_cast<unsigned char>(255 * std::size_t{count} / std::max<std::size_t>(depth_maps_, 1)));
  }
  std::string text;
  append_base64(text, shares);
  return {{"width", kCoverageWidth}, {"height", kCoverageHeight}, {"depth_maps", depth_maps_}, {"shares", text}};
}

std::vector<std::string> ReportPage::problems(const Json& stats, const Json& keyframes) const {
  std::vector<std::string> all;
  if (unit_of_lengths(arguments_.unit, unit_).empty()) {
    all.emplace_back(
        "The map's scale is arbitrary: lengths are in map units, not in metres (see --scale, --align, and convert "
        "--length).");
  }
  const std::vector<std::int64_t> order = ids_in_order(map_);
  const auto tell = [&](const std::string& use, const std::string& one, const std::string& many) {
    std::vector<std::int64_t> ids;
    for (const Json& keyframe : keyframes) {
      if (keyframe.at("use") == use) ids.push_back(keyframe.at("id"));
    }
    if (ids.empty()) return;
    all.push_back((ids.size() == 1 ? "Keyframe " : "Keyframes ") + list_of_keyframes(ids, order) + " " +
                  (ids.size() == 1 ? one : many) + ".");
  };
  tell("no image", "has no usable image", "have no usable image");
  tell("blurred", "is blurred and left out", "are blurred and left out");
  tell("too much parallax", "is too far from its neighbours for matching",
       "are too far from their neighbours for matching");
  tell("no landmarks", "sees no landmark of the map", "see no landmark of the map");
  tell("no neighbour", "has no neighbour that sees the same surfaces with enough parallax",
       "have no neighbour that sees the same surfaces with enough parallax");
  tell("no range", "sees too few landmarks for a depth map", "see too few landmarks for a depth map");
  for (const std::string& problem : report_problems(stats)) all.push_back(problem);
  std::int64_t uncertain = 0;
  for (std::size_t i = 0; i < 3; ++i) uncertain += cloud_.confidences()[i];
  if (2 * uncertain > cloud_.points_in()) {
    all.push_back("Half of the points have a confidence below 0.3: half of their depths have an error above 1.2 %.");
  }
  return all;
}

Json ReportPage::page_json(const Json& stats) const {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const MapKeyframe& keyframe : map_.keyframes) {
    up -= file_from_map_.rotation * keyframe.cam_from_world.rotation.row(1).transpose();
  }
  const std::string unit = unit_of_lengths(arguments_.unit, unit_);
  const std::string map_name = map_.path.filename().string();
  Json json{{"format", "pmsp-report"},
            {"version", 1},
            {"title", map_name + ": report"},
            {"generator", stats.value("generator", "pmsp-densify")},
            {"unit", unit.empty() ? "map units" : unit},
            {"up", vector_json(up.norm() > 1e-9 ? Eigen::Vector3d(up.normalized()) : up_)},
            {"origin", vector_json(cloud_.origin())},
            {"points_in", cloud_.points_in()},
            {"points", cloud_.points()},
            {"nodes", Json::array()}};
  for (const PageNode& node : cloud_.nodes()) {
    json["nodes"].push_back(
        {{"level", node.level}, {"corner", node.corner}, {"side", node.side}, {"points", node.points}});
  }
  if (has_north_) json["north"] = {0.0, 1.0, 0.0};
  json["keyframes"] = keyframes_json(stats);
  json["confidences"] = cloud_.confidences();
  json["pixel"] = depth_width_ > 0 ? 2.0 * kernels::kPi / depth_width_ : 0.01;
  json["lens_distance"] = number_at(stats, {"options", "lens_distance"}) * file_from_map_.scale;
  if (depth_maps_ > 0) json["coverage_map"] = coverage_json();
  const std::string source = source_.empty() ? readable_output(stats) : source_;
  if (!source.empty()) json["convert"] = source;
  json["facts"] = report_facts(stats);
  json["times"] = report_times(stats);
  json["problems"] = problems(stats, json["keyframes"]);
  json["normals"] = has_normals_;
  json["notes"] = notes_;
  const bool is_part = cloud_.points() < cloud_.points_in();
  if (is_part) {
    json["notes"].push_back("The page contains the most confident points of each place, fewer than the cloud.");
  }
  if (is_part && !potree_.empty()) {
    json["potree"] = web::relative_address(potree_.generic_string());
    json["notes"].push_back("Over HTTP (pmsp-densify serve), it loads the others on demand from the Potree directory " +
                            potree_.generic_string() + ".");
  }
  if (!json.contains("potree") && !photos_) {
    json["notes"].push_back("The page contains all of its data and uses no network.");
  }
  return json;
}

void ReportPage::put(AtomicFile& file, const std::string& name, const std::string& bytes) const {
  std::string text = "<script type=\"application/octet-stream\" id=\"pmsp-" + name + "\">";
  append_base64(text, bytes);
  text += "</script>\n";
  file.write(text);
}

void ReportPage::write(const Json& stats) {
  if (photos_ && keeps_photos_) photos_->keep_previous(ids_in_order(map_));
  if (photos_) photos_->commit();
  cloud_.finish();
  const Json data = page_json(stats);
  const auto [before, after] = web::page_around_data(data.contains("potree") || photos_);
  file_.write(before);
  file_.write("<script type=\"application/json\" id=\"pmsp-data\">" + web::script_json(data) + "</script>\n");
  for (std::size_t i = 0; i < cloud_.nodes().size(); ++i)
    put(file_, "node-" + std::to_string(i), cloud_.nodes()[i].bytes);
  for (const auto& [id, it] : pictures_) {
    const std::string name = "-" + std::to_string(id);
    if (!it.panorama.empty()) put(file_, "panorama" + name, it.panorama);
    if (!it.depths.empty()) put(file_, "depths" + name, it.depths);
    if (!it.has_depth || it.image.empty()) continue;
    put(file_, "image" + name, it.image);
    put(file_, "depth" + name, it.depth);
    put(file_, "confidence" + name, it.confidence);
  }
  file_.write(after);
  file_.commit();
}

}  // namespace pmsp::tool
