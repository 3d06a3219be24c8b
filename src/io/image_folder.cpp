// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <deque>
#include <future>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <utility>
#include <vector>

#include "image_decode.h"
#include "image_naming.h"
#include "map_scene.h"
#include "pairing_trial.h"
#include "pmsp/error.h"
#include "pmsp/io/images.h"

namespace pmsp {
namespace {

constexpr std::size_t kTrialPairs = 3;      ///< pairs of adjacent keyframes per trial
constexpr std::size_t kMostTrials = 32;     ///< maximum number of schemes
constexpr double kSearchedFit = 1.5;        ///< required fit of readings with a searched offset [least fit]
constexpr double kTrialClear = 0.8;         ///< likeness above that of any shifted pairing
constexpr double kTrialBetter = 0.03;       ///< required lead in likeness of a less plausible scheme
constexpr std::size_t kRecentFrames = 8;    ///< decoded frames cached during the offset search
constexpr std::int64_t kMostFrames = 3000;  ///< maximum length of the offset search [frames]
constexpr int kTrialWidth = 960;            ///< size to which larger JPEGs are reduced by the decoder [px]

/// Keyframes of a scheme that have a file, by time.
std::vector<std::size_t> paired_keyframes(const SlamMap& map, const io::NamingScheme& scheme) {
  std::vector<std::size_t> paired;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    if (scheme.file[k] >= 0) paired.push_back(k);
  std::stable_sort(paired.begin(), paired.end(), [&](std::size_t a, std::size_t b) {
    return map.keyframes[a].timestamp < map.keyframes[b].timestamp;
  });
  return paired;
}

int trial_flags(const MapCamera& camera) {
  if (camera.width >= 8 * kTrialWidth) return cv::IMREAD_REDUCED_COLOR_8;
  if (camera.width >= 4 * kTrialWidth) return cv::IMREAD_REDUCED_COLOR_4;
  return camera.width >= 2 * kTrialWidth ? cv::IMREAD_REDUCED_COLOR_2 : cv::IMREAD_COLOR;
}

/// Some keyframes of a scheme with their images.
struct Trial {
  io::Keyframes keyframes;
  std::map<const MapKeyframe*, Image<Rgb>> images;

  const Image<Rgb>* image_of(const MapKeyframe& keyframe) const {
    const auto found = images.find(&keyframe);
    return found == images.end() ? nullptr : &found->second;
  }
};

Trial make_trial(const SlamMap& map, const io::NamingScheme& scheme, const std::vector<io::NumberedFile>& files) {
  io::Keyframes paired;
  for (const std::size_t k : paired_keyframes(map, scheme)) paired.push_back(&map.keyframes[k]);
  Trial trial;
  trial.keyframes = io::spread_pairs(paired, kTrialPairs);
  std::vector<std::pair<const MapKeyframe*, std::future<Image<Rgb>>>> images;  // decoded concurrently
  for (const MapKeyframe* keyframe : trial.keyframes) {
    const MapCamera& camera = map.cameras[static_cast<std::size_t>(keyframe->camera)];
    const auto k = static_cast<std::size_t>(keyframe - map.keyframes.data());
    const auto& path = files[static_cast<std::size_t>(scheme.file[k])].path;
    images.emplace_back(keyframe, std::async(std::launch::async, [&path, &camera] {
                          return io::rgb_from_bgr(io::decode_image_file(path, trial_flags(camera)));
                        }));
  }
  for (auto& [keyframe, image] : images) {
    try {
      trial.images.emplace(keyframe, image.get());
    } catch (const Error&) {
      continue;  // reported when the image is read, if this scheme is chosen
    }
  }
  return trial;
}

/// Choice if images are not conclusive: the most plausible reading, or the only guess that pairs all keyframes with all
/// files.
std::optional<std::size_t> choose_by_names(const std::vector<io::NamingScheme>& schemes) {
  if (!schemes.front().is_guess) {
    const bool is_alone = !schemes.front().is_shifted || schemes.size() == 1 || schemes[1].is_guess ||
                          schemes[1].found < schemes[0].found;
    return is_alone ? std::optional<std::size_t>(0) : std::nullopt;
  }
  std::optional<std::size_t> complete;
  for (std::size_t i = 0; i < schemes.size(); ++i) {
    if (!schemes[i].is_complete) continue;
    if (complete) return std::nullopt;
    complete = i;
  }
  return complete;
}

/// Chosen scheme, nullopt = none; and whether images contradict it.
struct Choice {
  std::optional<std::size_t> scheme;
  bool is_disproved = false;
};

/// Chooses a scheme by comparing images with the map, since names can be ambiguous (ids and frame indices of a short
/// map are alike). Tries schemes by plausibility until one clearly fits, also with mirrored or turned images, which the
/// pairing check reports. A guess is accepted only if proved.
Choice choose_scheme(const SlamMap& map, const std::vector<io::NamingScheme>& schemes,
                     const std::vector<io::NumberedFile>& files) {
  if (schemes.size() == 1 && !schemes.front().is_guess) return {0};
  bool is_conclusive = false;
  std::optional<std::size_t> best;
  double best_likeness = 0.0;
  std::optional<std::size_t> poor;  ///< not a guess, and may fit
  for (std::size_t i = 0; i < std::min(schemes.size(), kMostTrials) && !map.landmarks.empty(); ++i) {
    const bool may_be_right = best || poor || (!schemes.front().is_guess && !is_conclusive);
    if (schemes[i].is_guess && may_be_right) break;
    const Trial trial = make_trial(map, schemes[i], files);
    const auto image_of = [&trial](const MapKeyframe& keyframe) { return trial.image_of(keyframe); };
    const io::Evidence evidence = io::try_images(map, trial.keyframes, image_of);
    if (!evidence.conclusive()) continue;
    is_conclusive = true;
    const bool is_searched = schemes[i].is_shifted || schemes[i].is_guess;
    const double least = (is_searched ? kSearchedFit : 1.0) * evidence.least_fit;
    if (!evidence.fits() || evidence.fit < least) {
      if (!best && !is_searched && io::fit_presented(map, trial.keyframes, image_of)) return {i};
      if (!is_searched && !poor && evidence.may_fit()) poor = i;
      continue;
    }
    if (evidence.likeness >= kTrialClear) return {i};
    if (best && evidence.likeness <= best_likeness + kTrialBetter) continue;
    best_likeness = evidence.likeness;
    best = i;
  }
  if (best) return {best};
  if (poor) return {poor};  // left to the pairing check
  if (!is_conclusive) return {choose_by_names(schemes)};
  return {schemes.front().is_guess ? std::nullopt : std::optional<std::size_t>(0), true};
}

/// Returns the offset of frame indices that fits all frames of a recording, trying each image as that of the same
/// keyframe; nullopt = none.
std::optional<std::int64_t> find_frame_offset(const SlamMap& map, const std::vector<io::NumberedFile>& files,
                                              double rate) {
  const std::map<std::int64_t, int> frames = io::frames_of(files);
  if (!(rate > 0.0) || map.landmarks.empty() || frames.size() <= map.keyframes.size()) return std::nullopt;
  const double unit = io::time_unit(map);
  const double t0 = io::has_unix_time(map, unit) ? io::first_timestamp(map) * unit : 0.0;
  const auto index_of = [&](const MapKeyframe& keyframe) {
    return io::frame_index(keyframe.timestamp * unit, t0, rate).value_or(0);
  };
  const io::Keyframes by_time = io::keyframes_by_time(map);
  const io::Keyframes run = io::first_run(map, by_time);
  const int flags = trial_flags(map.cameras[static_cast<std::size_t>(run.front()->camera)]);
  std::deque<std::pair<std::int64_t, Image<Rgb>>> recent;
  io::FrameReading reading;
  reading.image = [&](std::int64_t frame) -> const Image<Rgb>* {
    const auto known =
        std::find_if(recent.begin(), recent.end(), [&](const auto& entry) { return entry.first == frame; });
    if (known != recent.end()) return &known->second;
    const auto file = frames.find(frame);
    if (file == frames.end()) return nullptr;
    try {
      const cv::Mat bgr = io::decode_image_file(files[static_cast<std::size_t>(file->second)].path, flags);
      if (recent.size() == kRecentFrames) recent.pop_front();
      recent.emplace_back(frame, io::rgb_from_bgr(bgr));
    } catch (const Error&) {
      return nullptr;  // reported when the image is read
    }
    return &recent.back().second;
  };
  reading.frame_of = [&](const MapKeyframe& keyframe, std::int64_t anchor) {
    return std::optional(anchor + index_of(keyframe) - index_of(*run.front()));
  };
  const std::int64_t first = frames.begin()->first;
  const std::int64_t last = std::min(frames.rbegin()->first, first + kMostFrames);
  const auto found = io::find_anchor(map, run, io::spread_pairs(by_time, kTrialPairs), reading, first, last);
  return found ? std::optional(found->anchor - index_of(*run.front())) : std::nullopt;
}

/// Returns the file of each keyframe, by the longest tail of its name in the map; "" = none. `other_endings`: also
/// converted files, "IMG_0001.jpg" for "IMG_0001.png". Names without an image extension ("IMG_0001") are always
/// completed.
std::vector<std::filesystem::path> named_files(const SlamMap& map, const std::filesystem::path& folder,
                                               bool other_endings) {
  std::vector<std::filesystem::path> files;
  for (const MapKeyframe& keyframe : map.keyframes) {
    const bool is_whole = io::is_image_name(keyframe.image) && !other_endings;
    files.push_back(keyframe.image.empty() ? "" : map_detail::longest_tail(folder, keyframe.image, !is_whole));
  }
  return files;
}

/// Pairs keyframes with the images named in the map. If several match the same file, because the folder is missing in
/// the path, it belongs to the one whose whole name matches, or to none.
io::NamingScheme read_map_names(const SlamMap& map, const std::filesystem::path& folder,
                                std::vector<io::NumberedFile>& files) {
  io::NamingScheme scheme;
  scheme.meaning = "those in " + map.path.filename().string();
  std::vector<std::filesystem::path> found = named_files(map, folder, false);
  const auto is_empty = [](const std::filesystem::path& path) { return path.empty(); };
  if (std::all_of(found.begin(), found.end(), is_empty)) found = named_files(map, folder, true);
  std::map<std::filesystem::path, int> keyframes_of;
  for (const std::filesystem::path& path : found) ++keyframes_of[path];
  for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
    const std::string& image = map.keyframes[k].image;
    std::filesystem::path path = found[k];
    std::string reason;
    if (image.empty()) {
      reason = "the map names no image for it";
    } else if (path.empty()) {
      reason = (folder / image).string() + " does not exist";
    } else if (keyframes_of[path] > 1 && path != folder / image) {
      reason = path.string() + " could be the image of " + std::to_string(keyframes_of[path]) +
               " keyframes; give the directory that their names (" + image + ") are relative to";
      path.clear();
    }
    scheme.file.push_back(path.empty() ? -1 : static_cast<int>(files.size()));
    scheme.reason.push_back(reason);
    if (path.empty()) continue;
    io::NumberedFile file;
    file.path = path;
    files.push_back(std::move(file));
    ++scheme.found;
  }
  return scheme;
}

/// First missing files of those named in the map, for messages; "" = none.
std::string missing_names(const SlamMap& map, const io::NamingScheme& scheme) {
  constexpr std::size_t kNames = 3;
  std::string names;
  std::size_t missing = 0;
  for (std::size_t k = 0; k < scheme.file.size(); ++k) {
    if (scheme.file[k] >= 0 || map.keyframes[k].image.empty()) continue;
    if (missing++ < kNames) names += (names.empty() ? "" : ", ") + map.keyframes[k].image;
  }
  return names + (missing > kNames ? " and " + std::to_string(missing - kNames) + " more" : "");
}

class ImageFolder final : public ImageSource {
 public:
  ImageFolder(const SlamMap& map, const std::filesystem::path& folder, const io::NamingScheme& scheme,
              const std::vector<io::NumberedFile>& files, bool chosen_by_images) {
    for (const std::size_t k : paired_keyframes(map, scheme)) {
      const MapKeyframe& keyframe = map.keyframes[k];
      ids_.push_back(keyframe.id);
      entries_.push_back({files[static_cast<std::size_t>(scheme.file[k])].path,
                          map.cameras[static_cast<std::size_t>(keyframe.camera)]});
    }
    for (std::size_t k = 0; k < map.keyframes.size(); ++k)
      if (scheme.file[k] < 0) skipped_.push_back({map.keyframes[k].id, scheme.reason[k]});
    description_ = std::to_string(ids_.size()) + " of " + std::to_string(map.keyframes.size()) +
                   " keyframes found in " + folder.string() + ": file names are " + scheme.meaning;
    if (chosen_by_images) description_ += "; names alone also fit another scheme, but its images do not";
  }

  const std::vector<std::int64_t>& keyframe_ids() const override { return ids_; }
  const std::vector<SkippedKeyframe>& skipped() const override { return skipped_; }
  const std::string& description() const override { return description_; }

  std::optional<Item> next() override {
    while (begun_ < entries_.size() && begun_ - next_ < std::max<std::size_t>(1, ahead_)) {
      const auto policy = ahead_ > 0 ? std::launch::async : std::launch::deferred;
      decoding_.push_back(std::async(policy, [this, i = begun_] { return decode(i); }));
      ++begun_;
    }
    if (next_ == begun_) return std::nullopt;
    ++next_;
    std::future<Item> decoded = std::move(decoding_.front());
    decoding_.pop_front();
    return decoded.get();
  }

  void read_ahead(int images) override { ahead_ = static_cast<std::size_t>(std::max(0, images)); }

  Origin origin(std::int64_t keyframe_id) const override {
    const auto found = std::find(ids_.begin(), ids_.end(), keyframe_id);
    if (found == ids_.end()) throw InvalidInput("keyframe " + std::to_string(keyframe_id) + " has no image");
    return {entries_[static_cast<std::size_t>(found - ids_.begin())].path, ""};
  }

  void restrict_to(const std::set<std::int64_t>& keyframe_ids) override {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      if (keyframe_ids.count(ids_[i]) == 0) continue;
      ids_[kept] = ids_[i];
      entries_[kept++] = entries_[i];
    }
    ids_.resize(kept);
    entries_.resize(kept);
  }

  std::unique_ptr<ImageSource> reopen() const override {
    return std::unique_ptr<ImageSource>(new ImageFolder(ids_, entries_, skipped_, description_));
  }

 private:
  struct Entry {
    std::filesystem::path path;
    MapCamera camera;
  };

  ImageFolder(std::vector<std::int64_t> ids, std::vector<Entry> plan, std::vector<SkippedKeyframe> skipped,
              std::string description)
      : ids_(std::move(ids)),
        entries_(std::move(plan)),
        skipped_(std::move(skipped)),
        description_(std::move(description)) {}

  Item decode(std::size_t i) const {
    const Entry& entry = entries_[i];
    const cv::Mat bgr = io::decode_image_file(entry.path, cv::IMREAD_COLOR);
    io::check_image_size(entry.path.string(), bgr.cols, bgr.rows, entry.camera);
    return Item{ids_[i], io::rgb_from_bgr(bgr)};
  }

  std::vector<std::int64_t> ids_;
  std::vector<Entry> entries_;
  std::vector<SkippedKeyframe> skipped_;
  std::string description_;
  std::size_t ahead_ = 0;
  std::size_t next_ = 0;
  std::size_t begun_ = 0;                   ///< number of images whose decoding has started
  std::deque<std::future<Item>> decoding_;  ///< from the next one on; last member, since it uses the others
};

}  // namespace

std::unique_ptr<ImageSource> open_image_folder(const SlamMap& map, const std::filesystem::path& folder,
                                               const ImageFolderOptions& options) {
  if (!(options.fps >= 0.0) || !std::isfinite(options.fps))
    throw InvalidOption("fps = " + io::format_number(options.fps) + ": expected a number > 0, or 0 for the map's own");
  const bool is_named =
      std::any_of(map.keyframes.begin(), map.keyframes.end(), [](const MapKeyframe& k) { return !k.image.empty(); });
  if (is_named) {
    std::error_code ignored;
    if (!std::filesystem::is_directory(folder, ignored)) {
      throw IoError(folder.string() + ": there is no such directory; expected that of the images named in " +
                    map.path.string());
    }
    std::vector<io::NumberedFile> named;
    const io::NamingScheme scheme = read_map_names(map, folder, named);
    if (scheme.found == 0) {
      throw InvalidInput(
          folder.string() + ": none of the " + std::to_string(map.keyframes.size()) +
          " images that the map names exists: " + scheme.reason.front() +
          ", nor does a file whose path ends with it; give the directory that the names are relative to");
    }
    if (!options.allow_missing) {
      const std::string missing = missing_names(map, scheme);
      io::require_half(
          folder, static_cast<std::size_t>(scheme.found), map.keyframes.size(),
          missing.empty() ? "the map names no more" : "missing: " + missing,
          missing.empty() ? "name them with --image-list" : "give the directory that the names are relative to");
    }
    return std::make_unique<ImageFolder>(map, folder, scheme, named, false);
  }
  std::size_t unnumbered = 0;
  const std::vector<io::NumberedFile> files = io::list_numbered_images(folder, unnumbered);
  if (files.empty())
    throw InvalidInput(folder.string() + ": none of its " + std::to_string(unnumbered) +
                       " images has a number in its name; expected keyframe ids, timestamps or frame indices");
  std::vector<io::NamingScheme> schemes = io::find_naming_schemes(map, files, options);
  const std::string remedy = "set --fps or --frame-offset, or name the images with --image-list";
  if (schemes.empty())
    throw InvalidInput(folder.string() + ": the " + std::to_string(files.size()) + " images (such as " +
                       files.front().path.filename().string() + ") fit none of the " +
                       std::to_string(map.keyframes.size()) + " keyframes of " + map.path.string() + ", neither as " +
                       (map.ids_are_row_numbers ? "" : "keyframe ids nor as ") +
                       "timestamps nor as frame indices; rename them, or " + remedy);
  if (!options.allow_missing) {
    const io::NamingScheme first = schemes.front();
    const auto has_few = [&map](const io::NamingScheme& scheme) {
      return 2 * static_cast<std::size_t>(scheme.found) < map.keyframes.size();
    };
    schemes.erase(std::remove_if(schemes.begin(), schemes.end(), has_few), schemes.end());
    if (schemes.empty()) {
      io::require_half(folder, static_cast<std::size_t>(first.found), map.keyframes.size(),
                       "file names read as " + first.meaning, remedy);
    }
  }
  const Choice choice = choose_scheme(map, schemes, files);
  if (choice.is_disproved && !options.frame_offset) {
    const double rate = options.fps > 0.0 ? options.fps : map.cameras.front().fps;
    ImageFolderOptions shifted = options;
    shifted.frame_offset = find_frame_offset(map, files, rate);
    if (shifted.frame_offset) {
      const std::vector<io::NamingScheme> found = io::find_naming_schemes(map, files, shifted);
      if (!found.empty() && !found.front().is_guess)
        return std::make_unique<ImageFolder>(map, folder, found.front(), files, true);
    }
  }
  if (!choice.scheme) {
    throw InvalidInput(folder.string() + ": the names of the images (such as " +
                       files.front().path.filename().string() + ") do not determine their keyframes of " +
                       map.path.string() + ": " + schemes.front().meaning + " would be a guess; " + remedy);
  }
  return std::make_unique<ImageFolder>(map, folder, schemes[*choice.scheme], files,
                                       *choice.scheme > 0 && !map.landmarks.empty());
}

}  // namespace pmsp
