// SPDX-License-Identifier: BSD-2-Clause
#include "mission_input.h"

#include <filesystem>
#include <memory>
#include <utility>

#include "decoder.h"
#include "map_input.h"
#include "pmsp/error.h"

namespace pmsp::tool {
namespace {

using Spent = TimeAccount::Scope;

constexpr std::size_t kClearImages = 8;  ///< decoded before a clear verdict ends the check

}  // namespace

void MissionInput::read_map() {
  progress_.stage("reading " + arguments_.map.string());
  const Spent spent(time_, Busy::kMap);
  map = tool::read_map(arguments_, &convention);
  remarks = tool::remarks(map);
}

void MissionInput::open_images() {
  const Spent spent(time_, Busy::kImages);
  images = tool::open_images(arguments_, map);
  masks.reset(new MaskSource(mask_options(arguments_, map, *images)));
  mask_report = look_at_masks(arguments_, map, *images, *masks);
  for (const std::string& warning : mask_report.warnings) progress_.warning(warning);
}

void MissionInput::check_poses(int threads) {
  const auto warn = [this](const std::string& text) {
    if (!text.empty()) progress_.warning(text);
  };
  warn(undecided(convention, map, arguments_));
  if (needs_check_by_images(map, arguments_)) {
    progress_.stage("comparing the poses with the images");
    const Spent spent(time_, Busy::kImages);
    const PosesByImages poses = check_by_images(map, arguments_, threads);
    if (!poses.about.empty()) remarks.push_back(poses.about);
    warn(poses.warning);
  }
  if (!map.landmarks.empty()) return;
  progress_.warning(
      "neither the map nor the images give landmarks; without them no keyframe gets a depth range, nor a depth map; "
      "--points takes a PLY file with points of the same frame");
}

CloudFrame MissionInput::find_frame() const {
  ImageFiles files;
  if (!arguments_.cloud.frame.align.empty()) {
    for (const std::int64_t id : images->keyframe_ids()) files[id] = images->origin(id).file;
  }
  return find_cloud_frame(arguments_.cloud.frame, map, files);
}

void MissionInput::announce() const {
  progress_.message(map.path.string() + " (" + map.format + "): " + std::to_string(map.keyframes.size()) +
                    " keyframes, " + std::to_string(map.landmarks.size()) + " landmarks");
  for (const std::string& remark : remarks) progress_.message(remark);
  progress_.message("images: " + images->description());
  if (!mask_report.text.empty()) progress_.message("masks: " + mask_report.text);
  for (const SkippedKeyframe& skipped : images->skipped()) progress_.skipped(skipped);
}

MissionInput::ImageCheck MissionInput::check_images(int threads) const {
  ImageCheck check;
  std::optional<PairingVerifier> verifier;
  if (!arguments_.no_verify) verifier.emplace(map);
  const std::unique_ptr<ImageSource> source = images->again();
  ImageReader reader(*source, map, threads, verifier ? &*verifier : nullptr);
  check.skipped = images->skipped();
  for (std::size_t count = 1;; ++count) {
    ImageReader::Read read = reader.next();
    check.skipped.insert(check.skipped.end(), read.skipped.begin(), read.skipped.end());
    if (read.pairing) check.pairing = read.pairing;
    if (!read.item) break;
    if (check.size.width == 0) check.size = {read.keyframe.image.width, read.keyframe.image.height};
    const bool is_clear = !check.pairing || (check.pairing->conclusive && !check.pairing->doubtful);
    reader.let_go(*std::move(read.item));
    if (is_clear && count >= kClearImages) return check;
  }
  if (check.size.width == 0 && !reader.first_error().empty()) {
    throw IoError("no image can be read; the first one: " + reader.first_error());
  }
  return check;
}

std::string warning_of(const PairingVerifier::Verdict& pairing, bool saw_all) {
  return pairing.doubtful || (saw_all && !pairing.conclusive) ? pairing.message : "";
}

}  // namespace pmsp::tool
