// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <deque>
#include <future>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <utility>
#include <vector>

#include "image_decode.h"
#include "image_naming.h"
#include "pairing_series.h"
#include "pmsp/error.h"
#include "pmsp/io/image_source.h"

namespace pmsp {
namespace {

constexpr std::size_t kTrialRuns = 3;  ///< pairs of neighbouring keyframes that a scheme is tried on
constexpr std::size_t kTrialLandmarks = 300;
constexpr int kTrialComparisons = 30;  ///< fewer say nothing
constexpr double kTrialClear = 0.8;    ///< likeness that no shifted pairing reaches
constexpr double kTrialBetter = 0.03;  ///< of the likeness, by which a less plausible scheme must be better
constexpr int kTrialWidth = 960;       ///< [px] to which larger JPEGs are reduced while they are decoded

/// Keyframes of a scheme that have a file, in order of time.
std::vector<std::size_t> paired_keyframes(const SlamMap& map, const io::NamingScheme& scheme) {
  std::vector<std::size_t> paired;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    if (scheme.file[k] >= 0) paired.push_back(k);
  std::stable_sort(paired.begin(), paired.end(), [&](std::size_t a, std::size_t b) {
    return map.keyframes[a].timestamp < map.keyframes[b].timestamp;
  });
  return paired;
}

/// Pairs of neighbours, evenly spread.
std::vector<std::size_t> trial_keyframes(const std::vector<std::size_t>& paired) {
  if (paired.size() <= 2 * kTrialRuns) return paired;
  std::vector<std::size_t> trial;
  for (std::size_t run = 0; run < kTrialRuns; ++run) {
    const std::size_t at = (paired.size() - 2) * (2 * run + 1) / (2 * kTrialRuns);
    trial.push_back(paired[at]);
    trial.push_back(paired[at + 1]);
  }
  return trial;
}

int trial_flags(const MapCamera& camera) {
  if (camera.width >= 8 * kTrialWidth) return cv::IMREAD_REDUCED_COLOR_8;
  if (camera.width >= 4 * kTrialWidth) return cv::IMREAD_REDUCED_COLOR_4;
  return camera.width >= 2 * kTrialWidth ? cv::IMREAD_REDUCED_COLOR_2 : cv::IMREAD_COLOR;
}

/// How well the images of a scheme fit their keyframes, tried on a few.
io::PairingSeries try_scheme(const SlamMap& map, const io::NamingScheme& scheme,
                             const std::vector<io::NumberedFile>& files) {
  io::PairingSeries series(map, kTrialLandmarks);
  std::vector<std::pair<const MapKeyframe*, std::future<Image<Rgb>>>> images;  // all at the same time
  for (const std::size_t k : trial_keyframes(paired_keyframes(map, scheme))) {
    const MapCamera& camera = map.cameras[static_cast<std::size_t>(map.keyframes[k].camera)];
    const auto& path = files[static_cast<std::size_t>(scheme.file[k])].path;
    images.emplace_back(&map.keyframes[k], std::async(std::launch::async, [&path, &camera] {
      return io::rgb_from_bgr(io::decode_image_file(path, trial_flags(camera)));
    }));
  }
  for (auto& [keyframe, image] : images) {
    try {
      series.add(*keyframe, image.get().view());
    } catch (const Error&) {
      continue;  // reported when the image's turn comes, if this scheme is chosen
    }
  }
  return series;
}

/// Names alone cannot always tell (ids and frame indices of a short map look the same); the images can. Readings are
/// tried in order of plausibility until one clearly fits.
std::size_t choose_scheme(const SlamMap& map, const std::vector<io::NamingScheme>& schemes,
                          const std::vector<io::NumberedFile>& files) {
  std::size_t best = 0;
  std::optional<double> best_likeness;
  for (std::size_t i = 0; i < schemes.size() && schemes.size() > 1; ++i) {
    const io::PairingSeries series = try_scheme(map, schemes[i], files);
    if (series.found().tries() < kTrialComparisons) continue;
    if (series.likeness() >= kTrialClear) return i;
    if (best_likeness && series.likeness() <= *best_likeness + kTrialBetter) continue;
    best_likeness = series.likeness();
    best = i;
  }
  return best;
}

bool is_file(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored);
}

/// The file that the map names, or where the name has no ending ("IMG_0001"), the one with that name and the ending of
/// an image. "" where there is none.
std::filesystem::path named_file(const std::filesystem::path& folder, const std::string& image) {
  const std::filesystem::path path = folder / image;
  if (is_file(path)) return path;
  if (io::is_image_name(path)) return {};
  for (const char* ending : {".jpg", ".JPG", ".jpeg", ".JPEG", ".png", ".PNG", ".tif", ".TIF", ".tiff", ".TIFF"}) {
    if (is_file(path.string() + ending)) return path.string() + ending;
  }
  return {};
}

/// Keyframes whose images the map names take exactly these.
io::NamingScheme read_map_names(const SlamMap& map, const std::filesystem::path& folder,
                                std::vector<io::NumberedFile>& files) {
  io::NamingScheme scheme;
  scheme.meaning = "those that " + map.path.filename().string() + " gives";
  for (const MapKeyframe& keyframe : map.keyframes) {
    const std::filesystem::path path = keyframe.image.empty() ? "" : named_file(folder, keyframe.image);
    scheme.file.push_back(path.empty() ? -1 : static_cast<int>(files.size()));
    scheme.reason.push_back(keyframe.image.empty() ? "the map names no image for it"
                            : path.empty()         ? "there is no " + (folder / keyframe.image).string()
                                                   : "");
    if (path.empty()) continue;
    io::NumberedFile file;
    file.path = path;
    files.push_back(std::move(file));
    ++scheme.found;
  }
  return scheme;
}

class ImageFolder final : public ImageSource {
 public:
  ImageFolder(const SlamMap& map, const std::filesystem::path& folder, const io::NamingScheme& scheme,
              const std::vector<io::NumberedFile>& files, bool told_by_images) {
    for (const std::size_t k : paired_keyframes(map, scheme)) {
      const MapKeyframe& keyframe = map.keyframes[k];
      ids_.push_back(keyframe.id);
      plan_.push_back({files[static_cast<std::size_t>(scheme.file[k])].path,
                       map.cameras[static_cast<std::size_t>(keyframe.camera)]});
    }
    for (std::size_t k = 0; k < map.keyframes.size(); ++k)
      if (scheme.file[k] < 0) skipped_.push_back({map.keyframes[k].id, scheme.reason[k]});
    description_ = std::to_string(ids_.size()) + " of " + std::to_string(map.keyframes.size()) +
                   " keyframes found in " + folder.string() + ": file names are " + scheme.meaning;
    if (told_by_images) description_ += "; names alone would allow another scheme, whose images do not fit";
  }

  const std::vector<std::int64_t>& keyframe_ids() const override { return ids_; }
  const std::vector<SkippedKeyframe>& skipped() const override { return skipped_; }
  const std::string& description() const override { return description_; }

  std::optional<Item> next() override {
    while (begun_ < plan_.size() && begun_ - next_ < std::max<std::size_t>(1, ahead_)) {
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
    return {plan_[static_cast<std::size_t>(found - ids_.begin())].path, ""};
  }

  void restrict_to(const std::set<std::int64_t>& keyframe_ids) override {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      if (keyframe_ids.count(ids_[i]) == 0) continue;
      ids_[kept] = ids_[i];
      plan_[kept++] = plan_[i];
    }
    ids_.resize(kept);
    plan_.resize(kept);
  }

  std::unique_ptr<ImageSource> again() const override {
    return std::unique_ptr<ImageSource>(new ImageFolder(ids_, plan_, skipped_, description_));
  }

 private:
  struct Entry {
    std::filesystem::path path;
    MapCamera camera;
  };

  ImageFolder(std::vector<std::int64_t> ids, std::vector<Entry> plan, std::vector<SkippedKeyframe> skipped,
              std::string description)
      : ids_(std::move(ids)),
        plan_(std::move(plan)),
        skipped_(std::move(skipped)),
        description_(std::move(description)) {}

  Item decode(std::size_t i) const {
    const Entry& entry = plan_[i];
    const cv::Mat bgr = io::decode_image_file(entry.path, cv::IMREAD_COLOR);
    io::check_image_size(entry.path.string(), bgr.cols, bgr.rows, entry.camera);
    return Item{ids_[i], io::rgb_from_bgr(bgr)};
  }

  std::vector<std::int64_t> ids_;
  std::vector<Entry> plan_;
  std::vector<SkippedKeyframe> skipped_;
  std::string description_;
  std::size_t ahead_ = 0;
  std::size_t next_ = 0;
  std::size_t begun_ = 0;                   ///< images that are being decoded, or have been
  std::deque<std::future<Item>> decoding_;  ///< from the next one on; after all that it uses
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
      throw IoError(folder.string() + ": there is no such folder; expected the images that " + map.path.string() +
                    " names");
    }
    std::vector<io::NumberedFile> named;
    const io::NamingScheme scheme = read_map_names(map, folder, named);
    if (scheme.found == 0) {
      throw InvalidInput(folder.string() + ": none of the " + std::to_string(map.keyframes.size()) +
                         " images that the map names is there: " + scheme.reason.front() +
                         "; names count from the folder that is given");
    }
    return std::make_unique<ImageFolder>(map, folder, scheme, named, false);
  }
  std::size_t unnumbered = 0;
  const std::vector<io::NumberedFile> files = io::list_numbered_images(folder, unnumbered);
  if (files.empty())
    throw InvalidInput(folder.string() + ": no image in it (" + std::to_string(unnumbered) +
                       " found) has a number in its name; expected keyframe ids, timestamps or frame indices");
  const std::vector<io::NamingScheme> schemes = io::find_naming_schemes(map, files, options);
  if (schemes.empty())
    throw InvalidInput(
        folder.string() + ": the " + std::to_string(files.size()) + " images (such as " +
        files.front().path.filename().string() + ") fit none of the " + std::to_string(map.keyframes.size()) +
        " keyframes of " + map.path.string() +
        ", neither as keyframe ids nor as timestamps nor as frame indices; rename them, or set --fps and "
        "--frame-offset");
  const std::size_t chosen = choose_scheme(map, schemes, files);
  return std::make_unique<ImageFolder>(map, folder, schemes[chosen], files, chosen > 0);
}

}  // namespace pmsp
