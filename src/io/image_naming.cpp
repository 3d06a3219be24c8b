// SPDX-License-Identifier: BSD-2-Clause
#include "image_naming.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <locale>
#include <map>
#include <sstream>
#include <system_error>
#include <unordered_map>

#include "pmsp/error.h"

namespace pmsp::io {
namespace {

constexpr double kUnixTime = 1e8;        ///< [s] no video is that long (3 years)
constexpr double kSameTimestamp = 1e-6;  ///< [s]
constexpr double kMaxIndex = 1e15;       ///< beyond which a double skips whole numbers
constexpr std::size_t kMaxOffsets = 12;  ///< frame offsets that are tried
constexpr std::size_t kMaxSeries = 8;    ///< series of files in one folder that are tried
constexpr std::size_t kMaxOffsetVotes = 4'000'000;
constexpr std::size_t kMaxDigits = 18;

enum Rank { kTimestamp = 0, kIndex = 1, kSourceFrame = 2, kKeyframeId = 3, kShiftedIndex = 4, kLessLikelySeries = 100 };

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// The last number in the name, with its decimals: "cam0_1763660000.25_left" has 1763660000.25.
std::optional<NumberedFile> parse_name(const std::filesystem::path& path) {
  const std::string stem = path.stem().string();
  std::size_t end = stem.size();
  while (end > 0 && !is_digit(stem[end - 1])) --end;
  std::size_t begin = end;
  while (begin > 0 && is_digit(stem[begin - 1])) --begin;
  if (begin == end) return std::nullopt;
  bool whole = true;
  if (begin >= 2 && stem[begin - 1] == '.' && is_digit(stem[begin - 2])) {
    whole = false;
    --begin;
    while (begin > 0 && is_digit(stem[begin - 1])) --begin;
  }
  NumberedFile file;
  file.path = path;
  file.around = stem.substr(0, begin) + "*" + stem.substr(end);
  const std::string digits = stem.substr(begin, end - begin);
  std::istringstream in(digits);
  in.imbue(std::locale::classic());
  in >> file.value;
  if (!in || !std::isfinite(file.value)) return std::nullopt;
  const std::size_t significant = digits.size() - std::min(digits.find_first_not_of('0'), digits.size());
  if (whole && significant <= kMaxDigits) file.integer = std::strtoll(digits.c_str(), nullptr, 10);
  return file;
}

/// The files of one series with their keys, to be looked up by keyframe.
struct Series {
  const std::vector<NumberedFile>* files = nullptr;
  std::vector<std::pair<std::int64_t, int>> by_integer;
  std::vector<std::pair<double, int>> by_value;

  int find(std::int64_t integer) const {
    const auto at = std::lower_bound(by_integer.begin(), by_integer.end(), std::make_pair(integer, 0));
    return at != by_integer.end() && at->first == integer ? at->second : -1;
  }

  /// The file whose value times `unit` is nearest to `seconds` and not farther than `tolerance`.
  int find_nearest(double seconds, double unit, double tolerance) const {
    auto at = std::lower_bound(by_value.begin(), by_value.end(), std::make_pair(seconds / unit, 0));
    int best = -1;
    double best_distance = tolerance;
    if (at != by_value.begin()) --at;
    for (int i = 0; i < 2 && at != by_value.end(); ++i, ++at) {
      const double distance = std::abs(at->first * unit - seconds);
      if (distance <= best_distance) {
        best = at->second;
        best_distance = distance;
      }
    }
    return best;
  }
};

Series make_series(const std::vector<NumberedFile>& files, const std::vector<int>& members) {
  Series series;
  series.files = &files;
  for (const int i : members) {
    const NumberedFile& file = files[static_cast<std::size_t>(i)];
    series.by_value.emplace_back(file.value, i);
    if (file.integer) series.by_integer.emplace_back(*file.integer, i);
  }
  std::sort(series.by_value.begin(), series.by_value.end());
  std::sort(series.by_integer.begin(), series.by_integer.end());
  return series;
}

/// Where a scheme looks for a keyframe's file: its index or -1, and in `key` what was looked for.
using Finder = std::function<int(const MapKeyframe&, std::string& key)>;

NamingScheme read_names(const SlamMap& map, const Series& series, const Finder& find, bool by_time, std::string meaning,
                        int rank) {
  NamingScheme scheme;
  scheme.meaning = std::move(meaning);
  scheme.rank = rank;
  scheme.file.assign(map.keyframes.size(), -1);
  scheme.reason.resize(map.keyframes.size());
  const std::vector<int> repeated = by_time ? earlier_with_same_timestamp(map) : std::vector<int>();
  std::unordered_map<int, std::int64_t> taken;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
    if (by_time && repeated[k] >= 0) {
      scheme.reason[k] = same_timestamp_reason(map.keyframes[static_cast<std::size_t>(repeated[k])]);
      continue;
    }
    std::string key;
    const int file = find(map.keyframes[k], key);
    if (file < 0) {
      scheme.reason[k] = "no image for " + key;
      continue;
    }
    const auto [other, is_free] = taken.emplace(file, map.keyframes[k].id);
    if (!is_free) {
      scheme.reason[k] = (*series.files)[static_cast<std::size_t>(file)].path.filename().string() +
                         " is already the image of keyframe " + std::to_string(other->second);
      continue;
    }
    scheme.file[k] = file;
    ++scheme.found;
  }
  return scheme;
}

class ReadingFinder {
 public:
  ReadingFinder(const SlamMap& map, const Series& series, const ImageFolderOptions& options, int penalty,
                std::vector<NamingScheme>& out)
      : map_(map), series_(series), options_(options), penalty_(penalty), out_(out) {}

  void find_all() {
    // An explicit offset says that the names are frame indices.
    if (options_.frame_offset == 0) {
      if (!map_.ids_are_row_numbers) read_ids();
      read_timestamps();
    }
    const bool unix_time = has_unix_time(map_);
    const double t0 = unix_time ? first_timestamp(map_) : 0.0;
    const auto index = [this, t0](const MapKeyframe& k) { return frame_index(k.timestamp, t0, fps_of(k)); };
    const auto source = [](const MapKeyframe& k) { return k.source_frame; };
    const double fps = fps_of(map_.keyframes.front());
    if (fps > 0.0) {
      const std::string time = unix_time ? "(timestamp - " + format_number(t0) + ")" : "timestamp";
      read_indices(index, true, time + " x " + format_number(fps) + " fps", unix_time ? kSourceFrame : kIndex);
    }
    read_indices(source, false, "the SLAM's count of frames", unix_time ? kIndex : kSourceFrame);
  }

 private:
  using IndexOf = std::function<std::optional<std::int64_t>(const MapKeyframe&)>;

  double fps_of(const MapKeyframe& keyframe) const {
    return options_.fps > 0.0 ? options_.fps : map_.cameras[static_cast<std::size_t>(keyframe.camera)].fps;
  }

  void add(const Finder& find, bool by_time, std::string meaning, int rank) {
    out_.push_back(read_names(map_, series_, find, by_time, std::move(meaning), rank + penalty_));
  }

  void read_ids() {
    add(
        [this](const MapKeyframe& k, std::string& key) {
          key = "keyframe id " + std::to_string(k.id);
          return series_.find(k.id);
        },
        false, "keyframe ids", kKeyframeId);
  }

  void read_timestamps() {
    static constexpr std::array<std::pair<const char*, double>, 4> kUnits = {
        {{"seconds", 1.0}, {"milliseconds", 1e-3}, {"microseconds", 1e-6}, {"nanoseconds", 1e-9}}};
    for (const auto& [name, unit] : kUnits) {
      const double unit_s = unit;
      add(
          [this, unit_s](const MapKeyframe& k, std::string& key) {
            key = "timestamp " + format_number(k.timestamp) + " s";
            const double fps = fps_of(k);
            const double tolerance = fps > 0.0 ? std::min(0.25 / fps, 0.05) : 1e-3;
            return series_.find_nearest(k.timestamp, unit_s, tolerance);
          },
          true, std::string("timestamps in ") + name, kTimestamp);
    }
  }

  void read_indices(const IndexOf& index_of, bool by_time, const std::string& formula, int rank) {
    add_offset(index_of, by_time, formula, options_.frame_offset, rank);
    if (options_.frame_offset != 0) return;
    for (const std::int64_t offset : likely_offsets(index_of))
      if (offset != 0) add_offset(index_of, by_time, formula, offset, kShiftedIndex);
  }

  void add_offset(const IndexOf& index_of, bool by_time, const std::string& formula, std::int64_t offset, int rank) {
    std::string meaning = "frame indices (" + formula;
    if (offset != 0) meaning += (offset > 0 ? " + " : " - ") + std::to_string(std::abs(offset));
    add(
        [this, index_of, offset](const MapKeyframe& k, std::string& key) {
          const std::optional<std::int64_t> index = index_of(k);
          key = index ? "frame index " + std::to_string(*index + offset) : "its timestamp, which is no frame index";
          return index ? series_.find(*index + offset) : -1;
        },
        by_time, meaning + ")", rank);
  }

  /// Offsets from index to name that pair the most keyframes with files; among equal ones the smallest first.
  std::vector<std::int64_t> likely_offsets(const IndexOf& index_of) const {
    const std::size_t n_files = std::max<std::size_t>(series_.by_integer.size(), 1);
    const std::size_t n_used = std::min(map_.keyframes.size(), std::max<std::size_t>(kMaxOffsetVotes / n_files, 4));
    const std::size_t step = std::max<std::size_t>(map_.keyframes.size() / n_used, 1);
    std::unordered_map<std::int64_t, int> votes;
    for (std::size_t k = 0; k < map_.keyframes.size(); k += step) {
      const std::optional<std::int64_t> index = index_of(map_.keyframes[k]);
      if (!index) continue;
      for (const auto& file : series_.by_integer) ++votes[file.first - *index];
    }
    std::vector<std::pair<std::int64_t, int>> sorted;
    for (const auto& vote : votes)
      if (vote.second > 1) sorted.push_back(vote);
    const auto better = [](const auto& a, const auto& b) {
      if (a.second != b.second) return a.second > b.second;
      return std::abs(a.first) != std::abs(b.first) ? std::abs(a.first) < std::abs(b.first) : a.first > b.first;
    };
    const std::size_t n = std::min(sorted.size(), kMaxOffsets);
    std::partial_sort(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(n), sorted.end(), better);
    std::vector<std::int64_t> offsets;
    for (std::size_t i = 0; i < n; ++i) offsets.push_back(sorted[i].first);
    return offsets;
  }

  const SlamMap& map_;
  const Series& series_;
  const ImageFolderOptions& options_;
  int penalty_;
  std::vector<NamingScheme>& out_;
};

/// Files of one series each, the largest first; programs put masks and depth beside the images under names of their
/// own.
std::vector<std::pair<std::string, std::vector<int>>> group_by_series(const std::vector<NumberedFile>& files) {
  std::map<std::string, std::vector<int>> groups;
  for (std::size_t i = 0; i < files.size(); ++i) groups[files[i].around].push_back(static_cast<int>(i));
  std::vector<std::pair<std::string, std::vector<int>>> sorted(groups.begin(), groups.end());
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const auto& a, const auto& b) { return a.second.size() > b.second.size(); });
  if (sorted.size() > kMaxSeries) sorted.resize(kMaxSeries);
  return sorted;
}

int series_penalty(const std::string& around) {
  for (const char* word : {"mask", "depth", "score", "gray", "normal", "confidence"})
    if (lower(around).find(word) != std::string::npos) return kLessLikelySeries;
  return 0;
}

}  // namespace

bool is_image_name(const std::filesystem::path& path) {
  static constexpr std::array<const char*, 8> kExtensions = {".jpg",  ".jpeg", ".png",  ".tif",
                                                             ".tiff", ".bmp",  ".webp", ".jpe"};
  if (path.filename().string().front() == '.') return false;
  const std::string extension = lower(path.extension().string());
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

std::vector<NumberedFile> list_numbered_images(const std::filesystem::path& folder, std::size_t& unnumbered) {
  unnumbered = 0;
  std::error_code error;
  std::filesystem::directory_iterator at(folder, error);
  if (error)
    throw IoError(folder.string() + ": cannot be listed: " + error.message() + "; expected a folder of images");
  std::vector<std::filesystem::path> paths;
  for (; !error && at != std::filesystem::directory_iterator(); at.increment(error)) {
    std::error_code ignored;
    if (is_image_name(at->path()) && at->is_regular_file(ignored)) paths.push_back(at->path());
  }
  if (error) throw IoError(folder.string() + ": cannot be listed: " + error.message());
  if (paths.empty())
    throw IoError(folder.string() + ": holds no image (.jpg, .png, .tif, .bmp or .webp; subfolders are not searched)");
  std::sort(paths.begin(), paths.end());
  std::vector<NumberedFile> files;
  for (const auto& path : paths) {
    if (auto file = parse_name(path)) {
      files.push_back(std::move(*file));
    } else {
      ++unnumbered;
    }
  }
  return files;
}

std::vector<NamingScheme> find_naming_schemes(const SlamMap& map, const std::vector<NumberedFile>& files,
                                              const ImageFolderOptions& options) {
  std::vector<NamingScheme> all;
  if (map.keyframes.empty()) return all;
  for (const auto& [around, members] : group_by_series(files)) {
    const Series series = make_series(files, members);
    ReadingFinder(map, series, options, series_penalty(around), all).find_all();
  }
  std::stable_sort(all.begin(), all.end(), [](const NamingScheme& a, const NamingScheme& b) {
    const bool likely_a = a.rank < kLessLikelySeries;
    const bool likely_b = b.rank < kLessLikelySeries;
    if (likely_a != likely_b) return likely_a;
    return a.found != b.found ? a.found > b.found : a.rank < b.rank;
  });
  const int least = std::min(2, static_cast<int>(map.keyframes.size()));
  int most = 0;
  for (const NamingScheme& scheme : all) most = std::max(most, scheme.found);
  std::vector<NamingScheme> distinct;
  for (NamingScheme& scheme : all) {
    if (scheme.found < least || 2 * scheme.found < most) continue;
    const bool known = std::any_of(distinct.begin(), distinct.end(),
                                   [&](const NamingScheme& other) { return other.file == scheme.file; });
    if (!known) distinct.push_back(std::move(scheme));
  }
  return distinct;
}

std::vector<int> earlier_with_same_timestamp(const SlamMap& map) {
  std::vector<std::size_t> order(map.keyframes.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return map.keyframes[a].timestamp < map.keyframes[b].timestamp;
  });
  std::vector<int> earlier(map.keyframes.size(), -1);
  std::size_t begin = 0;
  while (begin < order.size()) {
    std::size_t end = begin + 1;
    while (end < order.size() &&
           map.keyframes[order[end]].timestamp - map.keyframes[order[end - 1]].timestamp < kSameTimestamp)
      ++end;
    const std::size_t first = *std::min_element(order.begin() + static_cast<std::ptrdiff_t>(begin),
                                                order.begin() + static_cast<std::ptrdiff_t>(end));
    for (std::size_t i = begin; i < end; ++i)
      if (order[i] != first) earlier[order[i]] = static_cast<int>(first);
    begin = end;
  }
  return earlier;
}

bool has_unix_time(const SlamMap& map) {
  return std::any_of(map.keyframes.begin(), map.keyframes.end(),
                     [](const MapKeyframe& k) { return k.timestamp > kUnixTime; });
}

double first_timestamp(const SlamMap& map) {
  const auto first =
      std::min_element(map.keyframes.begin(), map.keyframes.end(),
                       [](const MapKeyframe& a, const MapKeyframe& b) { return a.timestamp < b.timestamp; });
  return first == map.keyframes.end() ? 0.0 : first->timestamp;
}

std::optional<std::int64_t> frame_index(double timestamp, double t0, double fps) {
  const double index = std::round((timestamp - t0) * fps);
  if (!(fps > 0.0) || !(std::abs(index) < kMaxIndex)) return std::nullopt;
  return static_cast<std::int64_t>(index);
}

std::string same_timestamp_reason(const MapKeyframe& earlier) {
  return "has the timestamp of keyframe " + std::to_string(earlier.id) + " (" + format_number(earlier.timestamp) +
         " s), so its own image is unknown";
}

std::string format_number(double value) {
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out.precision(16);
  out << value;
  return out.str();
}

}  // namespace pmsp::io
