// SPDX-License-Identifier: BSD-2-Clause
#include "io/prior_depths.h"

#include <cmath>
#include <cstdlib>
#include <utility>

#include "pmsp/error.h"

namespace pmsp::io {

PriorDepths::PriorDepths(const std::filesystem::path& folder, const std::filesystem::path& images, const SlamMap& map) {
  if (!folder.empty()) {
    folder_.emplace(folder, images);
    return;
  }
  for (const MapKeyframe& keyframe : map.keyframes) {
    if (!keyframe.prior_depth.empty()) of_map_[keyframe.id] = keyframe.prior_depth;
  }
}

std::filesystem::path PriorDepths::file_for(std::int64_t keyframe_id, const std::filesystem::path& image) const {
  if (folder_) return folder_->file_for(keyframe_id, image);
  const auto found = of_map_.find(keyframe_id);
  return found == of_map_.end() ? std::filesystem::path() : found->second;
}

std::string PriorDepths::unit_text() const { return folder_ ? nlohmann::json(folder_->png_scale()).dump() : ""; }

void PriorDepths::attach(Keyframe& keyframe, const std::filesystem::path& image) {
  if (!wanted()) return;
  Outcome outcome;
  outcome.file = file_for(keyframe.id, image);
  if (!outcome.file.empty()) {
    try {
      const Image<float> values = folder_ ? folder_->read(outcome.file) : read_exr_depth(outcome.file);
      require_shape(values, outcome.file, keyframe.image.width, keyframe.image.height);
      outcome.alignment = align_prior_depth(values.view(), keyframe);
      if (outcome.alignment.why_not.empty()) {
        depth_ = aligned_depth(values.view(), outcome.alignment);
        keyframe.prior_depth = static_cast<const Image<float>&>(depth_).view();
      }
    } catch (const Error& error) {  // unreadable ones count as missing
      outcome.alignment.why_not = error.what();
    }
  }
  outcomes_[keyframe.id] = std::move(outcome);
}

void require_shape(const Image<float>& depth, const std::filesystem::path& file, int width, int height) {
  const std::int64_t across = std::int64_t{depth.width()} * height;
  const std::int64_t down = std::int64_t{depth.height()} * width;
  if (depth.width() >= 16 && depth.height() >= 8 && std::abs(across - down) * 100 <= down) return;
  throw InvalidInput(file.string() + ": is " + std::to_string(depth.width()) + " x " + std::to_string(depth.height()) +
                     ", expected the shape of its image, " + std::to_string(width) + " : " + std::to_string(height) +
                     ", and at least 16 x 8; make it again from the whole image");
}

std::string PriorDepths::summary() const {
  std::size_t used = 0, missing = 0, refused = 0;
  std::string why;
  double share = 0.0;
  for (const auto& [id, outcome] : outcomes_) {
    const bool fits = !outcome.file.empty() && outcome.alignment.why_not.empty();
    used += fits;
    missing += outcome.file.empty();
    if (fits) share += outcome.alignment.share;
    if (fits || outcome.file.empty()) continue;
    if (refused++ == 0) why = "keyframe " + std::to_string(id) + ": " + outcome.alignment.why_not;
  }
  std::string text = "prior depth: " + std::to_string(used) + " of " + std::to_string(outcomes_.size()) +
                     " keyframes have one that fits";
  if (used > 0) {
    text +=
        " (" + std::to_string(std::lround(100.0 * share / static_cast<double>(used))) + " % of the landmarks, to 15 %)";
  }
  if (missing > 0) text += ", " + std::to_string(missing) + " have none";
  if (refused > 0) text += ", " + std::to_string(refused) + " are left out; " + why;
  return text;
}

nlohmann::ordered_json to_json(const DepthAlignment& alignment) {
  return {{"model", name_of(alignment.model)}, {"scale", alignment.scale}, {"shift", alignment.shift},
          {"landmarks", alignment.landmarks},  {"share", alignment.share}, {"error", alignment.error}};
}

nlohmann::ordered_json PriorDepths::report() const {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const auto& [id, outcome] : outcomes_) {
    const DepthAlignment& it = outcome.alignment;
    nlohmann::ordered_json entry{{"keyframe_id", id}};
    if (outcome.file.empty()) {
      entry["left_out"] = "there is no file for it";
    } else if (!it.why_not.empty()) {
      entry["left_out"] = it.why_not;
    } else {
      entry.update(to_json(it));
    }
    json.push_back(entry);
  }
  return json;
}

}  // namespace pmsp::io
