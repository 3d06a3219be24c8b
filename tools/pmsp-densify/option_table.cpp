// SPDX-License-Identifier: BSD-2-Clause
#include "option_table.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <numeric>
#include <sstream>

#include "exit_code.h"
#include "pmsp/error.h"

namespace pmsp::tool {
namespace {

using Json = nlohmann::json;
using Options = DensifierOptions;

constexpr double kMaxSeed = 18446744073709551615.0;

// The shortest text that reads back as the same number.
std::string number_text(double value) {
  char text[64];
  const auto result = std::to_chars(text, text + sizeof(text), value);
  return {text, result.ptr};
}

std::string range_text(const OptionEntry& entry) {
  if (entry.is_switch()) return "true or false";
  if (entry.access.index() == 4) return "auto, scalar, avx2 or avx512";
  if (entry.access.index() == 5) return "auto, cpu or cuda";
  if (entry.access.index() == 6) return "numbers from 0 to 255 such as 0,1, or all";
  if (entry.access.index() == 3) return "a whole number from 0 to 18446744073709551615";
  if (entry.access.index() == 1) {
    return "a whole number from " + std::to_string(static_cast<int>(entry.min)) + " to " +
           std::to_string(static_cast<int>(entry.max));
  }
  return number_text(entry.min) + " to " + number_text(entry.max);
}

[[noreturn]] void refuse(const OptionEntry& entry, const std::string& where, const std::string& value) {
  const std::string unit = entry.unit[0] != '\0' ? std::string(" [") + entry.unit + "]" : "";
  throw InvalidOption(where + " is " + value + "; expected " + range_text(entry) + unit);
}

void check_range(const OptionEntry& entry, double value, const std::string& where, const std::string& text) {
  if (!(value >= entry.min && value <= entry.max)) refuse(entry, where, text);
}

void set_from_json(Options& options, const OptionEntry& entry, const Json& value, const std::string& where) {
  const std::string text = value.dump();
  if (const auto* as_switch = std::get_if<0>(&entry.access)) {
    if (!value.is_boolean()) refuse(entry, where, text);
    (*as_switch)(options) = value.get<bool>();
  } else if (entry.access.index() == 6 && value.is_array()) {
    std::string list;
    for (const Json& device : value) list += (list.empty() ? "" : ",") + device.dump();
    set_from_text(options, entry, list, where);
  } else if (entry.access.index() == 6) {
    set_from_text(options, entry, value.is_string() ? value.get<std::string>() : text, where);
  } else if (entry.access.index() >= 4) {  // names
    if (!value.is_string()) refuse(entry, where, text);
    set_from_text(options, entry, value.get<std::string>(), where);
  } else {
    const bool whole = entry.access.index() != 2;
    if (!value.is_number() || (whole && !value.is_number_integer())) refuse(entry, where, text);
    set_from_text(options, entry, text, where);
  }
}

void apply_level(Options& options, const Json& json, const std::string& prefix, const std::string& source) {
  for (const auto& [name, value] : json.items()) {
    const std::string key = prefix + name;
    const auto& table = option_table();
    const auto found = std::find_if(table.begin(), table.end(), [&](const OptionEntry& e) { return key == e.key; });
    if (found != table.end()) {
      set_from_json(options, *found, value, source + ": " + key);
      continue;
    }
    const std::string level = key + ".";
    const bool is_level = std::any_of(table.begin(), table.end(),
                                      [&](const OptionEntry& e) { return std::string(e.key).rfind(level, 0) == 0; });
    if (is_level && value.is_object()) {
      apply_level(options, value, level, source);
    } else if (is_level) {
      throw InvalidOption(source + ": " + key + " is " + value.dump().substr(0, 60) + "; expected an object");
    } else {
      std::vector<std::string> keys{"quality"};
      for (const OptionEntry& e : table) keys.emplace_back(e.key);
      throw InvalidOption(source + ": there is no option \"" + key.substr(0, 100) + "\"; did you mean \"" +
                          nearest(key, keys) + "\"?");
    }
  }
}

}  // namespace

const std::vector<OptionEntry>& option_table() {
#define PMSP_AT(type, field) [](Options& o) -> type& { return o.field; }
  static const std::vector<OptionEntry> table{
      {"width", "Size and machine", "px", 0, 16384,
       "Width of the depth maps, even, at least 32; 0 = that of the images, up to 5760", +PMSP_AT(int, width)},
      {"height", "Size and machine", "px", 0, 8192,
       "Height of the depth maps, even, at least 16; 0 = as the images' shape asks", +PMSP_AT(int, height)},
      {"seed", "Size and machine", "", 0, kMaxSeed,
       "Start of the random numbers; same input, seed, backend and simd, same bytes", +PMSP_AT(std::uint64_t, seed)},
      {"backend", "Size and machine", "", 0, 0,
       "Where the stages run; auto takes CUDA where it is built in, a device answers and its memory suffices",
       +PMSP_AT(Backend, backend)},
      {"device", "Size and machine", "", 0, 255,
       "CUDA devices that share the work, as the driver numbers them; the result is that of one",
       +PMSP_AT(std::vector<int>, devices)},
      {"pipelined", "Size and machine", "", 0, 1,
       "CUDA: overlap copies and work of successive keyframes; results come one keyframe later",
       +PMSP_AT(bool, pipelined)},
      {"threads", "Size and machine", "", 0, 1024, "Threads; 0 = one for each CPU that the process may use",
       +PMSP_AT(int, threads)},
      {"simd", "Size and machine", "", 0, 0, "Instruction set; auto takes the widest that this machine has",
       +PMSP_AT(Simd, simd)},
      {"lens_distance", "Size and machine", "map units", -1e12, 1e12,
       "Distance of the camera's two lenses along its forward axis, where panoramas are stitched as if they had one "
       "centre; 0 = one centre; estimated where it is not given",
       +PMSP_AT(double, lens_distance)},
      {"unordered", "Size and machine", "", 0, 1,
       "The images are a set, such as photo captures: their order means nothing", +PMSP_AT(bool, unordered)},
      {"view_filter.enabled", "View filter", "", 0, 1,
       "Leave out keyframes with too little or too much parallax, and those that are clearly blurred",
       +PMSP_AT(bool, view_filter.enabled)},
      {"view_filter.min_parallax_deg", "View filter", "deg", 0, 180, "Smallest useful parallax of a landmark",
       +PMSP_AT(double, view_filter.min_parallax_deg)},
      {"view_filter.max_parallax_deg", "View filter", "deg", 0, 180, "Largest useful parallax of a landmark",
       +PMSP_AT(double, view_filter.max_parallax_deg)},
      {"view_filter.min_share", "View filter", "", 0, 1,
       "Share of the common landmarks that must have useful parallax; less accepts more keyframes",
       +PMSP_AT(double, view_filter.min_share)},
      {"view_filter.min_sharpness", "View filter", "", 0, 1,
       "Sharpness, relative to that of the keyframes before, below which a keyframe is blurred; 0 = none is left out",
       +PMSP_AT(double, view_filter.min_sharpness)},
      {"init.sparse_points", "Initialisation", "", 0, 1, "Start from planes through the keyframe's landmarks",
       +PMSP_AT(bool, init.sparse_points)},
      {"init.sparse_radius_px", "Initialisation", "px of the depth map", 0, 100, "How far one landmark spreads",
       +PMSP_AT(double, init.sparse_radius_px)},
      {"init.warp_previous", "Initialisation", "", 0, 1, "Start from the previous depth map, moved into this keyframe",
       +PMSP_AT(bool, init.warp_previous)},
      {"init.chain_keyframes", "Initialisation", "ids", 0, 100000,
       "Begin that anew for each stretch of so many keyframe ids; 0 = never", +PMSP_AT(int, init.chain_keyframes)},
      {"init.range_margin", "Initialisation", "", 1, 1000, "Factor that widens the landmarks' depth range at both ends",
       +PMSP_AT(double, init.range_margin)},
      {"patchmatch.iterations", "PatchMatch", "", 1, 100, "Visits of every pixel",
       +PMSP_AT(int, patchmatch.iterations)},
      {"patchmatch.neighbours", "PatchMatch", "", 1, 8,
       "Keyframes to match with; time grows in proportion; with revisits at most 8",
       +PMSP_AT(int, patchmatch.neighbours)},
      {"patchmatch.revisits", "PatchMatch", "", 0, 4,
       "Source keyframes from earlier in the mission in addition, where the same place is passed again",
       +PMSP_AT(int, patchmatch.revisits)},
      {"patchmatch.history", "PatchMatch", "keyframes", 1, 100000, "How many keyframes' images are remembered for that",
       +PMSP_AT(int, patchmatch.history)},
      {"patchmatch.refinements", "PatchMatch", "", 0, 32, "Random draws per pixel and iteration",
       +PMSP_AT(int, patchmatch.refinements)},
      {"patchmatch.patch_spacing_px", "PatchMatch", "px of the depth map", 0.5, 8, "Distance of a patch's samples",
       +PMSP_AT(double, patchmatch.patch_spacing_px)},
      {"patchmatch.fine_patch", "PatchMatch", "share of the patch", 0.1, 1, "Size of the patch of textured pixels",
       +PMSP_AT(double, patchmatch.fine_patch)},
      {"patchmatch.fine_patch_contrast", "PatchMatch", "gray levels", 0, 255,
       "Standard deviation that makes a patch textured", +PMSP_AT(double, patchmatch.fine_patch_contrast)},
      {"patchmatch.sigma_color", "PatchMatch", "gray levels", 1, 1000, "Bilateral weight: difference in brightness",
       +PMSP_AT(double, patchmatch.sigma_color)},
      {"patchmatch.min_sigma_color", "PatchMatch", "gray levels", 1, 1000,
       "The same where the surface around a pixel is smooth; from sigma_color on: everywhere the same",
       +PMSP_AT(double, patchmatch.min_sigma_color)},
      {"patchmatch.sigma_space_px", "PatchMatch", "px of the depth map", 0.5, 100, "Bilateral weight: distance",
       +PMSP_AT(double, patchmatch.sigma_space_px)},
      {"patchmatch.fine_sigma_space_px", "PatchMatch", "px of the depth map", 0.5, 100, "The same of textured pixels",
       +PMSP_AT(double, patchmatch.fine_sigma_space_px)},
      {"patchmatch.plane_priors", "PatchMatch", "", 0, 1,
       "Prefer planes through the reliable surface around where there is no texture",
       +PMSP_AT(bool, patchmatch.plane_priors)},
      {"patchmatch.prior_weight", "PatchMatch", "", 0, 4, "Score that agreement with such a plane is worth",
       +PMSP_AT(double, patchmatch.prior_weight)},
      {"patchmatch.max_slant_deg", "PatchMatch", "deg", 10, 89, "Largest angle between a plane's normal and the ray",
       +PMSP_AT(double, patchmatch.max_slant_deg)},
      {"patchmatch.geometric_passes", "PatchMatch", "", 0, 8,
       "Further passes that prefer what neighbouring depth maps agree with",
       +PMSP_AT(int, patchmatch.geometric_passes)},
      {"patchmatch.geometric_iterations", "PatchMatch", "", 1, 100, "Iterations of each of these passes",
       +PMSP_AT(int, patchmatch.geometric_iterations)},
      {"patchmatch.geometric_weight", "PatchMatch", "", 0, 4,
       "Score that full disagreement with a neighbour's depth map costs",
       +PMSP_AT(double, patchmatch.geometric_weight)},
      {"patchmatch.geometric_tolerance", "PatchMatch", "share of the depth", 0.001, 1,
       "Difference of depths from which on disagreement is full", +PMSP_AT(double, patchmatch.geometric_tolerance)},
      {"median.enabled", "Median filter", "", 0, 1, "Remove single outliers", +PMSP_AT(bool, median.enabled)},
      {"median.max_relative_deviation", "Median filter", "share of the depth", 0, 1,
       "Deviation from the neighbourhood's median beyond which a pixel is dropped",
       +PMSP_AT(double, median.max_relative_deviation)},
      {"median.min_score", "Median filter", "NCC", -1, 1, "Photometric score below which a pixel is dropped; 0: none",
       +PMSP_AT(double, median.min_score)},
      {"consistency.enabled", "Consistency filter", "", 0, 1, "Keep only what several depth maps agree on",
       +PMSP_AT(bool, consistency.enabled)},
      {"consistency.window", "Consistency filter", "depth maps", 3, 15,
       "Depth maps compared, the filtered one in the middle; an odd number", +PMSP_AT(int, consistency.window)},
      {"consistency.min_views", "Consistency filter", "depth maps", 1, 15,
       "Depth maps that must agree, the filtered one included; at most the window",
       +PMSP_AT(int, consistency.min_views)},
      {"consistency.max_relative_depth", "Consistency filter", "share of the depth", 0, 1,
       "Deviation that still counts as agreement; a pixel's angle where that is larger",
       +PMSP_AT(double, consistency.max_relative_depth)},
      {"fusion.window", "Fusion", "depth maps", 1, 31, "Depth maps that are joined with each other; an odd number",
       +PMSP_AT(int, fusion.window)},
      {"fusion.spacing_px", "Fusion", "px of the nearer depth map", 0, 4, "Points closer than this are one point",
       +PMSP_AT(double, fusion.spacing_px)},
      {"fusion.max_relative_depth", "Fusion", "share of the depth", 0, 1,
       "Deviation up to which two depths are one surface", +PMSP_AT(double, fusion.max_relative_depth)},
      {"fusion.max_normal_deg", "Fusion", "deg", 0, 180, "Angle of normals up to which they are one surface",
       +PMSP_AT(double, fusion.max_normal_deg)},
      {"fusion.min_confidence", "Fusion", "", 0, 1, "Points with less confidence are not written",
       +PMSP_AT(double, fusion.min_confidence), "--min-confidence"},
      {"fusion.history", "Fusion", "keyframes", 1, 100000,
       "With free_space.whole_mission: keyframes that may make the point of a place in place of this one",
       +PMSP_AT(int, fusion.history)},
      {"free_space.enabled", "Free space", "", 0, 1, "Remove points that other keyframes have looked through",
       +PMSP_AT(bool, free_space.enabled)},
      {"free_space.views", "Free space", "keyframes", 1, 32, "Keyframes that are asked about each keyframe's points",
       +PMSP_AT(int, free_space.views)},
      {"free_space.max_relative_depth", "Free space", "share of the depth", 0, 1,
       "Deviation that still confirms a point", +PMSP_AT(double, free_space.max_relative_depth)},
      {"free_space.min_relative_gap", "Free space", "share of the depth", 0, 1,
       "A surface this much farther away has been seen through the point",
       +PMSP_AT(double, free_space.min_relative_gap)},
      {"free_space.max_contradiction", "Free space", "", 0, 100,
       "What may speak against a point, relative to what speaks for it; less removes more",
       +PMSP_AT(double, free_space.max_contradiction)},
      {"free_space.mirrors", "Free space", "", 0, 1, "Remove what mirrors show, such as polished floors",
       +PMSP_AT(bool, free_space.mirrors)},
      {"free_space.whole_mission", "Free space", "", 0, 1,
       "Hold points back until the end, so that later keyframes have their say too",
       +PMSP_AT(bool, free_space.whole_mission)},
      {"free_space.history", "Free space", "keyframes", 1, 100000,
       "Keyframes that may be asked, half on either side; bounds the memory of long missions",
       +PMSP_AT(int, free_space.history)},
  };
#undef PMSP_AT
  return table;
}

std::string OptionEntry::flag() const {
  std::string name = key;
  std::replace_if(
      name.begin(), name.end(), [](char c) { return c == '.' || c == '_'; }, '-');
  return "--" + name;
}

std::string OptionEntry::negative_flag() const { return "--no-" + flag().substr(2); }

std::string OptionEntry::text_of(const DensifierOptions& options) const {
  Options copy = options;
  return std::visit(
      [&copy](auto at) -> std::string {
        using T = std::decay_t<decltype(at(copy))>;
        if constexpr (std::is_same_v<T, bool>) {
          return at(copy) ? "true" : "false";
        } else if constexpr (std::is_enum_v<T>) {
          return name_of(at(copy));
        } else if constexpr (std::is_same_v<T, double>) {
          return number_text(at(copy));
        } else if constexpr (std::is_same_v<T, std::vector<int>>) {
          std::string list;
          for (const int device : at(copy)) list += (list.empty() ? "" : ",") + std::to_string(device);
          return list.empty() ? "all" : list;
        } else {
          return std::to_string(at(copy));
        }
      },
      access);
}

std::string OptionEntry::description() const {
  const std::string range = is_switch() ? negative_flag() + " for no" : range_text(*this);
  std::string text = std::string(help) + " [" + (unit[0] != '\0' ? std::string(unit) + ", " : "") + range +
                     "; default " + text_of(Options());
  for (const auto& [name, quality] : {std::pair("normal", Quality::kNormal), std::pair("high", Quality::kHigh),
                                      std::pair("paper", Quality::kPaper)}) {
    const std::string value = text_of(preset(quality));
    if (value != text_of(Options())) text += std::string(", ") + name + " " + value;
  }
  return text + "]";
}

void set_from_text(DensifierOptions& options, const OptionEntry& entry, const std::string& text,
                   const std::string& where) {
  const auto number = [&](auto parsed) {
    if (!parsed) refuse(entry, where, "\"" + text + "\"");
    return *parsed;
  };
  if (const auto* as_switch = std::get_if<0>(&entry.access)) {
    if (text != "true" && text != "false") refuse(entry, where, "\"" + text + "\"");
    (*as_switch)(options) = text == "true";
  } else if (const auto* as_int = std::get_if<1>(&entry.access)) {
    const int value = number(number_from<int>(text));
    check_range(entry, value, where, text);
    (*as_int)(options) = value;
  } else if (const auto* as_double = std::get_if<2>(&entry.access)) {
    const double value = number(number_from<double>(text));
    check_range(entry, value, where, text);
    (*as_double)(options) = value;
  } else if (const auto* as_seed = std::get_if<3>(&entry.access)) {
    (*as_seed)(options) = number(number_from<std::uint64_t>(text));
  } else if (const auto* as_list = std::get_if<6>(&entry.access)) {
    std::vector<int> devices;
    if (text != "all") devices = number(numbers_from(text));
    for (const int device : devices) check_range(entry, device, where, text);
    (*as_list)(options) = std::move(devices);
  } else {
    try {
      if (const auto* as_simd = std::get_if<4>(&entry.access)) (*as_simd)(options) = simd_from_name(text);
      if (const auto* as_backend = std::get_if<5>(&entry.access)) (*as_backend)(options) = backend_from_name(text);
    } catch (const InvalidOption&) {
      refuse(entry, where, "\"" + text + "\"");
    }
  }
}

nlohmann::ordered_json to_json(const DensifierOptions& options) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  Options copy = options;
  for (const OptionEntry& entry : option_table()) {
    const std::string key = entry.key;
    const std::size_t dot = key.find('.');
    auto& at = dot == std::string::npos ? json[key] : json[key.substr(0, dot)][key.substr(dot + 1)];
    std::visit(
        [&](auto access) {
          if constexpr (std::is_enum_v<std::remove_reference_t<decltype(access(copy))>>) {
            at = name_of(access(copy));
          } else if constexpr (std::is_same_v<std::decay_t<decltype(access(copy))>, std::vector<int>>) {
            const std::vector<int>& devices = access(copy);
            at = devices;
            if (devices.size() == 1) at = devices[0];
            if (devices.empty()) at = "all";
          } else {
            at = access(copy);
          }
        },
        entry.access);
  }
  return json;
}

nlohmann::ordered_json options_of_results(const DensifierOptions& options) {
  nlohmann::ordered_json json = to_json(options);
  for (const char* machine : {"backend", "device", "pipelined", "threads", "simd"}) json.erase(machine);
  return json;
}

void apply_json(DensifierOptions& options, const nlohmann::json& json, const std::string& source) {
  if (!json.is_object()) throw InvalidOption(source + ": holds no JSON object");
  Json rest = json;
  rest.erase("quality");  // chooses the preset below these values; whoever reads the file looks at it first
  apply_level(options, rest, "", source);
}

std::optional<std::vector<int>> numbers_from(const std::string& list) {
  std::vector<int> numbers;
  std::istringstream items(list + ",");
  for (std::string item; std::getline(items, item, ',');) {
    const auto number = number_from<int>(item);
    if (!number) return std::nullopt;
    numbers.push_back(*number);
  }
  return numbers;
}

std::string nearest(const std::string& word, const std::vector<std::string>& candidates) {
  std::string best;
  std::size_t best_distance = std::numeric_limits<std::size_t>::max();
  for (const std::string& candidate : candidates) {
    std::vector<std::size_t> row(candidate.size() + 1);  // Levenshtein distance, one row at a time
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 0; i < word.size(); ++i) {
      std::size_t diagonal = row[0];
      row[0] = i + 1;
      for (std::size_t j = 0; j < candidate.size(); ++j) {
        const std::size_t replaced = diagonal + (word[i] == candidate[j] ? 0 : 1);
        diagonal = row[j + 1];
        row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
      }
    }
    if (row.back() < best_distance) {
      best_distance = row.back();
      best = candidate;
    }
  }
  return best;
}

}  // namespace pmsp::tool
