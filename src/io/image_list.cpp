// SPDX-License-Identifier: BSD-2-Clause
#include "image_list.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <string>
#include <system_error>
#include <vector>

#include "image_naming.h"
#include "map_scene.h"
#include "text_input.h"
#include "util/median_of.h"

namespace pmsp::map_detail {
namespace {

constexpr double kSingleTolerance = 0.02;  ///< if the list has a single image [s]

struct Line {
  std::string text;   ///< whole line
  std::string where;  ///< line number, for messages
  bool has_time = false;
  double time = 0.0;
  std::string name;  ///< after the time
};

std::string without_quotes(const std::string& text) {
  const bool is_quoted = text.size() > 2 && text.front() == '"' && text.back() == '"';
  return is_quoted ? text.substr(1, text.size() - 2) : text;
}

std::vector<Line> read_lines(const std::filesystem::path& path) {
  TextInput in(path);
  std::vector<Line> lines;
  while (in.next()) {
    Line line;
    line.text = in.rest("the timestamp or name");
    line.where = in.here();
    const auto [end, error] = std::from_chars(line.text.data(), line.text.data() + line.text.size(), line.time);
    const auto at = static_cast<std::size_t>(end - line.text.data());
    const std::size_t name = line.text.find_first_not_of(" \t,;", at);
    line.has_time = error == std::errc() && std::isfinite(line.time) && name != std::string::npos && name > at;
    if (line.has_time) line.name = without_quotes(line.text.substr(name));
    lines.push_back(std::move(line));
  }
  if (lines.empty()) fail(path, "", "names no image, expected lines \"timestamp name\" or \"name\"");
  return lines;
}

/// True if lines have timestamps; removes a header.
bool take_times(std::vector<Line>& lines, std::size_t keyframes, const std::filesystem::path& path) {
  const auto begins_names = lines.begin() + 1;
  const auto has_time = [](const Line& line) { return line.has_time; };
  const bool rest_has_times = lines.size() > 1 && std::all_of(begins_names, lines.end(), has_time);
  const bool rest_are_images = lines.size() > 1 && std::all_of(begins_names, lines.end(), [](const Line& line) {
                                 return io::is_image_name(line.text);
                               });
  const bool is_header = !lines.front().has_time && !io::is_image_name(lines.front().text) &&
                         (rest_has_times || (rest_are_images && lines.size() == keyframes + 1));
  if (is_header) lines.erase(lines.begin());
  const auto timed = static_cast<std::size_t>(std::count_if(lines.begin(), lines.end(), has_time));
  const bool is_constant = lines.size() > 1 && std::all_of(lines.begin(), lines.end(), [&](const Line& line) {
                             return line.has_time && line.time == lines.front().time;
                           });
  if (timed == 0 || is_constant) return false;  // common numeric prefix of all names
  if (timed < lines.size()) {
    const auto other = std::find_if(lines.begin(), lines.end(),
                                    [&](const Line& line) { return line.has_time != lines.front().has_time; });
    fail(path, other->where, "expected all lines alike, \"timestamp name\" or \"name\"");
  }
  return true;
}

/// Nearest keyframe in time per image; nullptr = none within the tolerance.
struct Match {
  std::vector<MapKeyframe*> of_image;
  std::size_t count = 0;
  double tolerance = 0.0;  ///< half the median interval between images [s]
};

/// `lines`: ascending in time.
Match match_times(SlamMap& map, const std::vector<Line>& lines, double unit) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < lines.size(); ++i) steps.push_back((lines[i].time - lines[i - 1].time) * unit);
  Match match;
  match.tolerance = steps.empty() ? kSingleTolerance : 0.5 * median(steps);
  match.of_image.resize(lines.size(), nullptr);
  const auto away = [&](const MapKeyframe& keyframe, std::size_t i) {
    return std::abs(lines[i].time * unit - keyframe.timestamp);
  };
  for (MapKeyframe& keyframe : map.keyframes) {
    const auto next = std::lower_bound(lines.begin(), lines.end(), keyframe.timestamp,
                                       [unit](const Line& line, double t) { return line.time * unit < t; });
    auto i = static_cast<std::size_t>(next - lines.begin());
    if (i == lines.size() || (i > 0 && away(keyframe, i - 1) < away(keyframe, i))) --i;
    MapKeyframe*& taken_by = match.of_image[i];
    if (away(keyframe, i) > match.tolerance || (taken_by != nullptr && away(keyframe, i) >= away(*taken_by, i)))
      continue;
    match.count += taken_by == nullptr ? 1 : 0;
    taken_by = &keyframe;
  }
  return match;
}

void name_by_time(SlamMap& map, std::vector<Line>& lines, const std::filesystem::path& path) {
  std::stable_sort(lines.begin(), lines.end(), [](const Line& a, const Line& b) { return a.time < b.time; });
  Match match;
  for (const double unit : {1.0, 1e-9, 1e-6, 1e-3}) {  // the unit is not part of the list
    Match other = match_times(map, lines, unit);
    if (other.count > match.count) match = std::move(other);
  }
  if (match.count == 0) {
    fail(path, "",
         "has times from " + io::format_number(lines.front().time) + " to " + io::format_number(lines.back().time) +
             ", keyframes from " + io::format_number(io::first_timestamp(map)) + " to " +
             io::format_number(io::last_timestamp(map)) + " s; expected times of the same clock");
  }
  for (MapKeyframe& keyframe : map.keyframes) keyframe.image.clear();
  for (std::size_t i = 0; i < lines.size(); ++i)
    if (match.of_image[i] != nullptr) match.of_image[i]->image = image_name(lines[i].name, path, lines[i].where);
  const std::size_t without = map.keyframes.size() - match.count;
  if (without == 0) return;
  // A trajectory may have a pose per video frame, but only some images.
  const bool leaves_out = map.ids_are_row_numbers && 2 * match.count >= lines.size();
  map.notes.push_back((leaves_out ? "poses left out, without an image in " : "keyframes without an image in ") +
                      path.string() + " within " + to_message(match.tolerance) + " s: " + std::to_string(without));
  if (!leaves_out) return;
  map.keyframes.erase(std::remove_if(map.keyframes.begin(), map.keyframes.end(),
                                     [](const MapKeyframe& keyframe) { return keyframe.image.empty(); }),
                      map.keyframes.end());
  if (map.component_keyframes.size() == 1) map.component_keyframes = {map.keyframes.size()};
}

}  // namespace

void name_images(SlamMap& map, const std::filesystem::path& list) {
  std::vector<Line> lines = read_lines(list);
  if (take_times(lines, map.keyframes.size(), list)) {
    name_by_time(map, lines, list);
    return;
  }
  // Lost poses have left gaps in the row numbers.
  const auto rows = map.keyframes.empty() ? 0 : static_cast<std::size_t>(map.keyframes.back().id) + 1;
  if (map.ids_are_row_numbers && lines.size() == rows) {
    for (MapKeyframe& keyframe : map.keyframes) {
      const Line& line = lines[static_cast<std::size_t>(keyframe.id)];
      keyframe.image = image_name(without_quotes(line.text), list, line.where);
    }
    return;
  }
  if (lines.size() != map.keyframes.size()) {
    fail(list, "",
         "names " + std::to_string(lines.size()) + " images without timestamps, the map has " +
             std::to_string(map.keyframes.size()) + " keyframes; expected as many");
  }
  for (std::size_t i = 0; i < lines.size(); ++i)
    map.keyframes[i].image = image_name(without_quotes(lines[i].text), list, lines[i].where);
}

}  // namespace pmsp::map_detail
