// SPDX-License-Identifier: BSD-2-Clause
#include "image_naming.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <locale>
#include <set>
#include <sstream>
#include <system_error>
#include <unordered_map>

#include "mask_names.h"
#include "pmsp/error.h"
#include "util/median_of.h"
#include "util/text.h"

namespace pmsp::io {
namespace {

constexpr double kUnixTime = 1e8;        ///< smallest Unix time; longer than any video [s]
constexpr double kSameTimestamp = 1e-6;  ///< [s]
constexpr double kMicroseconds = 5e3;    ///< minimum interval of keyframes with timestamps in microseconds
constexpr double kNanoseconds = 5e6;     ///< likewise in nanoseconds
constexpr double kWhole = 0.05;          ///< maximum deviation from a whole number [frames]
constexpr double kMaxIndex = 1e15;       ///< limit of consecutive integers in a double
constexpr std::size_t kMaxOffsets = 12;  ///< maximum number of frame offsets tried
constexpr std::size_t kMaxSeries = 8;    ///< maximum number of file series tried per folder
constexpr std::size_t kMaxOffsetVotes = 4'000'000;
constexpr std::size_t kMaxDigits = 18;

/// Usual frame rates of cameras and of tools that extract frames [1/s].
constexpr std::array kUsualRates{30.0,
                                 30000.0 / 1001.0,
                                 25.0,
                                 24.0,
                                 24000.0 / 1001.0,
                                 60.0,
                                 60000.0 / 1001.0,
                                 50.0,
                                 20.0,
                                 15.0,
                                 12.5,
                                 12.0,
                                 10.0,
                                 8.0,
                                 6.0,
                                 5.0,
                                 4.0,
                                 3.0,
                                 2.0,
                                 1.0,
                                 0.5,
                                 48.0,
                                 100.0,
                                 120.0};

enum Rank {
  kTimestamp = 0,
  kIndex = 1,
  kSourceFrame = 2,
  kKeyframeId = 3,
  kShiftedIndex = 4,
  kGuessedRate = 5,
  kOrder = 6,
  kEarlierNumber = 10,  ///< per number after the one that is used
  kLessLikelySeries = 100
};

/// Numbers of a name with decimals: "cam0_1763660000.25_left" has 0 and 1763660000.25.
std::optional<NumberedFile> parse_name(const std::filesystem::path& path) {
  const std::string stem = path.stem().string();
  NumberedFile file;
  file.path = path;
  const auto end_of_digits = [&stem](std::size_t at) {
    while (at < stem.size() && is_digit(stem[at])) ++at;
    return at;
  };
  std::size_t at = 0;
  while (at < stem.size()) {
    if (!is_digit(stem[at])) {
      file.around += stem[at++];
      continue;
    }
    std::size_t end = end_of_digits(at);
    bool whole = true;
    if (end + 1 < stem.size() && stem[end] == '.' && is_digit(stem[end + 1])) {
      const std::size_t decimals_end = end_of_digits(end + 1);
      const bool is_chain =
          (at > 0 && stem[at - 1] == '.') ||
          (decimals_end + 1 < stem.size() && stem[decimals_end] == '.' && is_digit(stem[decimals_end + 1]));
      if (!is_chain) {  // chains of dots are dates or versions
        whole = false;
        end = decimals_end;
      }
    }
    NameNumber number;
    number.digits = stem.substr(at, end - at);
    std::istringstream in(number.digits);
    in.imbue(std::locale::classic());
    in >> number.value;
    const bool is_number = in && std::isfinite(number.value);
    const std::size_t significant =
        number.digits.size() - std::min(number.digits.find_first_not_of('0'), number.digits.size());
    if (whole && significant <= kMaxDigits) number.integer = std::strtoll(number.digits.c_str(), nullptr, 10);
    file.around += is_number ? "*" : number.digits;
    if (is_number) file.numbers.push_back(std::move(number));
    at = end;
  }
  if (file.numbers.empty()) return std::nullopt;
  return file;
}

/// Files of a series, indexed by their numbers.
struct Series {
  const std::vector<NumberedFile>* files = nullptr;
  std::vector<std::pair<std::int64_t, int>> by_integer;
  std::vector<std::pair<double, int>> by_value;
  int penalty = 0;  ///< added to the ranks of its schemes

  std::size_t size() const { return by_value.size(); }

  int find(std::int64_t integer) const {
    const auto at = std::lower_bound(by_integer.begin(), by_integer.end(), std::make_pair(integer, 0));
    return at != by_integer.end() && at->first == integer ? at->second : -1;
  }

  /// File whose value times `unit` is nearest to `seconds`, within `tolerance`; -1 = none.
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

/// Lookup of a keyframe's file in a scheme: its index or -1; `key` is set to a description of the key.
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
  ReadingFinder(const SlamMap& map, const Series& series, const ImageFolderOptions& options,
                std::vector<NamingScheme>& out)
      : map_(map), series_(series), options_(options), out_(out) {}

  void find_all() {
    // An explicit offset implies frame indices.
    if (!options_.frame_offset) {
      if (!map_.ids_are_row_numbers) read_ids();
      read_timestamps();
    }
    const double rate = fps_of(map_.keyframes.front());
    if (rate > 0.0) read_times(1.0, rate, false);
    read_indices(source_index, false, "the SLAM's count of frames", has_unix_time(map_) ? kIndex : kSourceFrame);
    guess_rates(rate);
    if (!options_.frame_offset) read_order();
  }

 private:
  using IndexOf = std::function<std::optional<std::int64_t>(const MapKeyframe&)>;

  double fps_of(const MapKeyframe& keyframe) const {
    return options_.fps > 0.0 ? options_.fps : map_.cameras[static_cast<std::size_t>(keyframe.camera)].fps;
  }

  NamingScheme& add(const Finder& find, bool by_time, std::string meaning, int rank) {
    out_.push_back(read_names(map_, series_, find, by_time, std::move(meaning), rank + series_.penalty));
    NamingScheme& scheme = out_.back();
    scheme.is_complete =
        static_cast<std::size_t>(scheme.found) == map_.keyframes.size() && map_.keyframes.size() == series_.size();
    return scheme;
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
      NamingScheme& scheme = add(
          [this, unit_s](const MapKeyframe& k, std::string& key) {
            key = "timestamp " + format_number(k.timestamp) + " s";
            const double fps = fps_of(k);
            const double tolerance = fps > 0.0 ? std::min(0.25 / fps, 0.05) : 1e-3;
            return series_.find_nearest(k.timestamp, unit_s, tolerance);
          },
          true, std::string("timestamps in ") + name, kTimestamp);
      // Whole seconds of a short time span could be frame indices.
      scheme.is_guess = unit == 1.0 && series_.by_integer.size() == series_.size() && !has_unix_time(map_);
    }
  }

  /// Frame indices from timestamps in this unit.
  void read_times(double unit, double rate, bool is_guess) {
    const bool unix_time = has_unix_time(map_, unit);
    const double t0 = unix_time ? first_timestamp(map_) * unit : 0.0;
    const bool has_own_rates = unit == 1.0 && !is_guess;
    const auto index = [this, unit, t0, rate, has_own_rates](const MapKeyframe& k) {
      return frame_index(k.timestamp * unit, t0, has_own_rates ? fps_of(k) : rate);
    };
    const std::string timestamp = unit == 1.0 ? "timestamp" : "timestamp x " + format_number(unit);
    const std::string time = unix_time ? "(" + timestamp + " - " + format_number(t0) + ")" : timestamp;
    const std::string formula = time + " x " + format_number(rate) + " fps";
    if (!is_guess) {
      read_indices(index, true, formula, unix_time ? kSourceFrame : kIndex);
      return;
    }
    std::vector<std::int64_t> offsets{options_.frame_offset.value_or(0)};
    if (!options_.frame_offset && !series_.by_integer.empty()) {  // the first file may belong to the first keyframe
      const auto first = frame_index(first_timestamp(map_) * unit, t0, rate);
      offsets.insert(offsets.end(), {1, series_.by_integer.front().first - first.value_or(0)});
    }
    const bool are_whole = std::all_of(map_.keyframes.begin(), map_.keyframes.end(), [&](const MapKeyframe& k) {
      const double frames = (k.timestamp * unit - t0) * rate;
      return std::abs(frames - std::round(frames)) < kWhole;
    });
    for (const std::int64_t offset : offsets) {
      NamingScheme& scheme = add_offset(index, true, formula, offset, kGuessedRate);
      scheme.is_guess = true;
      scheme.is_complete = scheme.is_complete && are_whole;
    }
  }

  /// Guesses for maps without a usable frame rate or with timestamps in another unit.
  void guess_rates(double known) {
    const double unit = time_unit(map_);
    if (known > 0.0 && unit != 1.0) read_times(unit, known, true);
    if (options_.fps > 0.0 || !(last_timestamp(map_) > first_timestamp(map_))) return;
    for (const double rate : kUsualRates) read_times(unit, rate, true);
  }

  /// Same number of files and keyframes, paired in order.
  void read_order() {
    if (series_.size() != map_.keyframes.size()) return;
    std::vector<const MapKeyframe*> by_time;
    for (const MapKeyframe& keyframe : map_.keyframes) by_time.push_back(&keyframe);
    std::stable_sort(by_time.begin(), by_time.end(),
                     [](const MapKeyframe* a, const MapKeyframe* b) { return a->timestamp < b->timestamp; });
    std::unordered_map<std::int64_t, int> file_of;
    for (std::size_t i = 0; i < by_time.size(); ++i) file_of[by_time[i]->id] = series_.by_value[i].second;
    NamingScheme& scheme = add([&](const MapKeyframe& k, std::string& /*key*/) { return file_of.at(k.id); }, false,
                               "in the order of the keyframes", kOrder);
    scheme.is_guess = true;
    // Distinct timestamps are stronger evidence than the order, and did not match.
    scheme.is_complete = scheme.is_complete && !(last_timestamp(map_) > first_timestamp(map_));
  }

  void read_indices(const IndexOf& index_of, bool by_time, const std::string& formula, int rank) {
    add_offset(index_of, by_time, formula, options_.frame_offset.value_or(0), rank);
    if (options_.frame_offset) return;
    // Relative to the first keyframe, which need not be the first frame.
    out_.back().is_shifted = by_time && has_unix_time(map_);
    for (const std::int64_t offset : likely_offsets(index_of))
      if (offset != 0) add_offset(index_of, by_time, formula, offset, kShiftedIndex).is_shifted = true;
  }

  NamingScheme& add_offset(const IndexOf& index_of, bool by_time, const std::string& formula, std::int64_t offset,
                           int rank) {
    std::string meaning = "frame indices (" + formula;
    if (offset != 0) meaning += (offset > 0 ? " + " : " - ") + std::to_string(std::abs(offset));
    return add(
        [this, index_of, offset](const MapKeyframe& k, std::string& key) {
          const std::optional<std::int64_t> index = index_of(k);
          key = index ? "frame index " + std::to_string(*index + offset) : "its timestamp, which is no frame index";
          return index ? series_.find(*index + offset) : -1;
        },
        by_time, meaning + ")", rank);
  }

  /// Offsets from index to name that pair most keyframes with files; ties by size.
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
  std::vector<NamingScheme>& out_;
};

/// Removes "7.jpg.png", "7_mask.png" and "7.mask.png" beside "7.jpg".
void leave_out_masks(std::vector<std::filesystem::path>& paths) {
  std::set<std::string> names, stems;
  for (const auto& path : paths) {
    names.insert(path.filename().string());
    stems.insert(path.stem().string());
  }
  const auto is_mask = [&](const std::filesystem::path& path) {
    const std::filesystem::path stem = path.stem();
    if (is_image_name(stem) && names.count(stem.string()) != 0) return true;
    if (!is_mask_name(path)) return false;
    const std::string image = stem.string().substr(0, stem.string().size() - kMaskEnd);
    return names.count(image) + stems.count(image) != 0;
  };
  paths.erase(std::remove_if(paths.begin(), paths.end(), is_mask), paths.end());
}

int penalty_of(const std::string& around) {
  for (const char* word : {"mask", "depth", "score", "gray", "normal", "confidence"})
    if (lower_case(around).find(word) != std::string::npos) return kLessLikelySeries;
  return 0;
}

/// Finds possible series of files and their counting number. Masks and depth may be beside the images under other
/// names, images of several cameras in one folder.
class SeriesFinder {
 public:
  explicit SeriesFinder(const std::vector<NumberedFile>& files) : files_(files) {}

  std::vector<Series> find() {
    std::map<std::pair<std::string, std::size_t>, std::vector<int>> alike;
    for (std::size_t i = 0; i < files_.size(); ++i)
      alike[{files_[i].around, files_[i].numbers.size()}].push_back(static_cast<int>(i));
    for (const auto& [name, members] : alike) read(members);
    std::stable_sort(all_.begin(), all_.end(), [](const Series& a, const Series& b) { return a.size() > b.size(); });
    if (all_.size() > kMaxSeries) all_.resize(kMaxSeries);
    return std::move(all_);
  }

 private:
  const NameNumber& number(int file, std::size_t column) const {
    return files_[static_cast<std::size_t>(file)].numbers[column];
  }

  /// Number of distinct values of a column.
  std::size_t values(const std::vector<int>& members, std::size_t column) const {
    std::set<double> seen;
    for (const int file : members) seen.insert(number(file, column).value);
    return seen.size();
  }

  void read(const std::vector<int>& members) {
    const std::size_t columns = files_[static_cast<std::size_t>(members.front())].numbers.size();
    std::vector<std::size_t> differing;
    for (std::size_t column = columns; column-- > 0;)
      if (values(members, column) > 1) differing.push_back(column);
    if (differing.empty()) differing.push_back(columns - 1);
    for (std::size_t i = 0; i < differing.size(); ++i) {
      const std::size_t column = differing[i];
      const int penalty = static_cast<int>(i) * kEarlierNumber;
      if (column > 0) add_seconds(members, column - 1);
      if (values(members, column) == members.size() || differing.size() == 1) {
        add(members, column, penalty);
        continue;
      }
      std::map<std::vector<double>, std::vector<int>> apart;  // by all other columns
      for (const int file : members) {
        std::vector<double> others;
        for (const std::size_t other : differing)
          if (other != column) others.push_back(number(file, other).value);
        apart[others].push_back(file);
      }
      for (const auto& [others, part] : apart) add(part, column, penalty);
    }
  }

  Series empty_series(const std::vector<int>& members, int penalty) const {
    Series series;
    series.files = &files_;
    series.penalty = penalty + penalty_of(files_[static_cast<std::size_t>(members.front())].around);
    return series;
  }

  void add(const std::vector<int>& members, std::size_t column, int penalty) {
    Series series = empty_series(members, penalty);
    for (const int file : members) {
      series.by_value.emplace_back(number(file, column).value, file);
      if (number(file, column).integer) series.by_integer.emplace_back(*number(file, column).integer, file);
    }
    std::sort(series.by_value.begin(), series.by_value.end());
    std::sort(series.by_integer.begin(), series.by_integer.end());
    all_.push_back(std::move(series));
  }

  /// Seconds and decimals as two numbers, as in image names of ROS: "1600000000_100000000".
  void add_seconds(const std::vector<int>& members, std::size_t column) {
    Series series = empty_series(members, 0);
    for (const int file : members) {
      const NameNumber& seconds = number(file, column);
      const NameNumber& decimals = number(file, column + 1);
      const std::size_t size = decimals.digits.size();
      const bool is_time =
          seconds.integer && decimals.integer && (size == 9 || ((size == 3 || size == 6) && seconds.value > kUnixTime));
      if (!is_time) return;
      const double value = seconds.value + decimals.value * std::pow(10.0, -static_cast<double>(size));
      series.by_value.emplace_back(value, file);
    }
    std::sort(series.by_value.begin(), series.by_value.end());
    all_.push_back(std::move(series));
  }

  const std::vector<NumberedFile>& files_;
  std::vector<Series> all_;
};

}  // namespace

bool is_image_name(const std::filesystem::path& path) {
  static constexpr std::array<const char*, 8> kExtensions = {".jpg",  ".jpeg", ".png",  ".tif",
                                                             ".tiff", ".bmp",  ".webp", ".jpe"};
  const std::string name = path.filename().string();
  if (name.empty() || name.front() == '.') return false;
  const std::string extension = lower_case(path.extension().string());
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

std::vector<NumberedFile> list_numbered_images(const std::filesystem::path& folder, std::size_t& unnumbered) {
  unnumbered = 0;
  std::error_code error;
  std::filesystem::directory_iterator at(folder, error);
  if (error)
    throw IoError(folder.string() + ": cannot be listed: " + error.message() + "; expected a directory of images");
  std::vector<std::filesystem::path> paths;
  for (; !error && at != std::filesystem::directory_iterator(); at.increment(error)) {
    std::error_code ignored;
    if (is_image_name(at->path()) && at->is_regular_file(ignored)) paths.push_back(at->path());
  }
  if (error) throw IoError(folder.string() + ": cannot be listed: " + error.message());
  if (paths.empty())
    throw IoError(folder.string() +
                  ": holds no image (.jpg, .png, .tif, .bmp or .webp; subdirectories are not searched)");
  std::sort(paths.begin(), paths.end());
  leave_out_masks(paths);
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
  for (const Series& series : SeriesFinder(files).find()) ReadingFinder(map, series, options, all).find_all();
  std::stable_sort(all.begin(), all.end(), [](const NamingScheme& a, const NamingScheme& b) {
    const bool likely_a = a.rank < kLessLikelySeries;
    const bool likely_b = b.rank < kLessLikelySeries;
    if (likely_a != likely_b) return likely_a;
    if (a.is_guess != b.is_guess) return b.is_guess;
    return a.found != b.found ? a.found > b.found : a.rank < b.rank;
  });
  const int least = std::min(2, static_cast<int>(map.keyframes.size()));
  int most[] = {0, 0};  // without and with guesses
  for (const NamingScheme& scheme : all)
    for (const int guesses : {0, 1})
      if (guesses == 1 || !scheme.is_guess) most[guesses] = std::max(most[guesses], scheme.found);
  std::vector<NamingScheme> distinct;
  for (NamingScheme& scheme : all) {
    if (scheme.found < least || 2 * scheme.found < most[scheme.is_guess ? 1 : 0]) continue;
    const bool known = std::any_of(distinct.begin(), distinct.end(),
                                   [&](const NamingScheme& other) { return other.file == scheme.file; });
    if (!known) distinct.push_back(std::move(scheme));
  }
  return distinct;
}

std::map<std::int64_t, int> frames_of(const std::vector<NumberedFile>& files) {
  const std::vector<Series> all = SeriesFinder(files).find();
  const auto likely = std::find_if(all.begin(), all.end(), [](const Series& series) {
    return series.penalty < kLessLikelySeries && !series.by_integer.empty();
  });
  return likely == all.end() ? std::map<std::int64_t, int>()
                             : std::map<std::int64_t, int>(likely->by_integer.begin(), likely->by_integer.end());
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

double time_unit(const SlamMap& map) {
  std::vector<double> times;
  for (const MapKeyframe& keyframe : map.keyframes) times.push_back(keyframe.timestamp);
  std::sort(times.begin(), times.end());
  std::vector<double> steps;
  for (std::size_t i = 1; i < times.size(); ++i)
    if (times[i] > times[i - 1]) steps.push_back(times[i] - times[i - 1]);
  if (steps.empty()) return 1.0;
  const double step = median(steps);
  if (step >= kNanoseconds) return 1e-9;
  return step >= kMicroseconds ? 1e-6 : 1.0;
}

bool has_unix_time(const SlamMap& map, double unit) {
  return std::any_of(map.keyframes.begin(), map.keyframes.end(),
                     [unit](const MapKeyframe& k) { return k.timestamp * unit > kUnixTime; });
}

double first_timestamp(const SlamMap& map) {
  const auto first =
      std::min_element(map.keyframes.begin(), map.keyframes.end(),
                       [](const MapKeyframe& a, const MapKeyframe& b) { return a.timestamp < b.timestamp; });
  return first == map.keyframes.end() ? 0.0 : first->timestamp;
}

double last_timestamp(const SlamMap& map) {
  double last = first_timestamp(map);
  for (const MapKeyframe& keyframe : map.keyframes) last = std::max(last, keyframe.timestamp);
  return last;
}

std::optional<std::int64_t> frame_index(double timestamp, double t0, double fps) {
  const double index = std::round((timestamp - t0) * fps);
  if (!(fps > 0.0) || !(std::abs(index) < kMaxIndex)) return std::nullopt;
  return static_cast<std::int64_t>(index);
}

std::optional<std::int64_t> source_index(const MapKeyframe& keyframe) {
  const bool is_sensible = keyframe.source_frame && std::abs(static_cast<double>(*keyframe.source_frame)) < kMaxIndex;
  return is_sensible ? keyframe.source_frame : std::nullopt;
}

void require_half(const std::filesystem::path& images, std::size_t found, std::size_t keyframes, const std::string& how,
                  const std::string& remedy) {
  if (2 * found >= keyframes) return;
  throw InvalidInput(images.string() + ": has images for " + std::to_string(found) + " of " +
                     std::to_string(keyframes) + " keyframes (" + how + "), expected at least half; " + remedy +
                     ", or accept that with --allow-missing");
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
