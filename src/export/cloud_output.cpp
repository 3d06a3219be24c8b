// SPDX-License-Identifier: BSD-2-Clause
#include "export/cloud_output.h"

#include <algorithm>

namespace pmsp {

CloudOutput::CloudOutput(const CloudHeader& header, const CloudAmount& amount, const std::vector<Target>& targets,
                         int threads)
    : file_from_map_(header.file_from_map), crop_(amount.crop), placed_(threads) {
  for (const Target& target : targets) writers_.push_back(target.format->open(target.path, header));
  if (amount.thinning.is_needed()) thinning_ = std::make_unique<Thinning>(amount.thinning, header.scratch.string());
}

CloudOutput::~CloudOutput() = default;

void CloudOutput::add(const KeyframeCloud& cloud) {
  for (const auto& writer : writers_) writer->set_window(cloud.keyframe_id, cloud.window_ids);
  placed_.for_each_piece(cloud, cloud.pose(), file_from_map_, [this](OutputPoint* points, std::size_t count) {
    OutputPoint* end = points + count;
    if (crop_) end = std::remove_if(points, end, [this](const OutputPoint& p) { return !crop_->contains(p.position); });
    const auto left = static_cast<std::size_t>(end - points);
    points_in_ += static_cast<std::int64_t>(count);
    if (thinning_) {
      thinning_->add(points, left);
    } else {
      write(points, left);
    }
  });
}

void CloudOutput::complete() {
  if (!thinning_) return;
  thinning_->finish([this](const OutputPoint* points, std::size_t count) { write(points, count); });
  thinning_.reset();
}

void CloudOutput::commit() {
  for (const auto& writer : writers_) writer->finish();
}

void CloudOutput::write(const OutputPoint* points, std::size_t count) {
  for (const auto& writer : writers_) writer->add(points, count);
  for (CloudWriter* writer : others_) writer->add(points, count);
  points_ += static_cast<std::int64_t>(count);
}

}  // namespace pmsp
