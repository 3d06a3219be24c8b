// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pmsp/api.h"

namespace pmsp::workspace {

/// One of `count` parts of a step.
struct Shard {
  int index = 0;  ///< from 0
  int count = 1;
};
/// "2/7"
PMSP_API std::string text_of(const Shard& shard);

/// The shard's stretch of a list of `size`: from `first` to before `last`. Those of all shards are the whole list;
/// their sizes differ by one at most.
struct IdRange {
  std::size_t first = 0, last = 0;
};
PMSP_API IdRange id_range_of(const Shard& shard, std::size_t size);

enum class Wave { kPlanes, kPoints };
/// "planes" or "points"
PMSP_API const char* name_of(Wave wave);

/// What all shards of a step have in common. Whoever merges them makes the step again from it.
struct ShardJob {
  std::string from;  ///< step of the workspace's record; "" = none
  std::string step;
  int count = 1;       ///< of shards
  std::string engine;  ///< see StepInputs
  std::string build;   ///< the very program
  std::string options = "{}";
  std::string map, map_bytes;  ///< path, relative to the workspace where possible, and fingerprint
  std::string images, video, mask, mask_bytes;
  double mask_nadir = 0.0;   ///< [deg]
  double mask_zenith = 0.0;  ///< [deg]
  bool no_masks = false;     ///< masks that come with the images are not used
  std::string prior_depth;
  double fps = 0.0;
  std::optional<std::int64_t> frame_offset;
  bool presentation_times = false;
  std::string points, image_list, camera_from_body;  ///< paths, as that of the map
  int component = -1;                                ///< -1 = that of most keyframes
};

/// What a shard has done in a wave, or why it has not.
struct ShardMarker {
  Shard shard;
  Wave wave = Wave::kPlanes;
  std::string failure;  ///< "" = it has finished
  std::string step;     ///< "" where it failed before that was known
  std::string engine, build, host;
  double seconds = 0.0;
  std::int64_t keyframes = 0;         ///< of its stretch
  std::int64_t made = 0;              ///< by this process; others were there
  std::vector<std::int64_t> without;  ///< keyframes of its stretch for which nothing comes out
};

/// The folder in which shards tell of themselves:
///
///     job-FROM.json               what was shared out when the record was that of step FROM ("new": none)
///     planes-K-of-N.json          what became of shard K
///     points-K-of-N.json
///
/// Each file appears whole or not at all. Throws OutputError; IoError where a file is not what was written.
class PMSP_API ShardFolder {
 public:
  explicit ShardFolder(std::filesystem::path folder) : folder_(std::move(folder)) {}

  void make() const;

  /// The job of a workspace whose record is of step `from`.
  std::optional<ShardJob> job(const std::string& from) const;
  /// One that ended with this record.
  std::optional<ShardJob> ended_job(const std::string& step) const;
  /// The first one to come stays. Returns what lies there then.
  ShardJob post(const ShardJob& job) const;

  /// A failure does not take the place of a success.
  void mark(const ShardMarker& marker) const;
  /// By wave and number.
  std::vector<ShardMarker> markers() const;

  /// The step is recorded: deletes all but its job.
  void end(const std::string& step) const;
  /// Nobody will ask any more: deletes all, and the folder if that is all.
  void remove() const;

  const std::filesystem::path& path() const { return folder_; }

 private:
  std::vector<std::filesystem::path> files(const std::string& kind) const;

  std::filesystem::path folder_;
};

/// In what two jobs, or a marker's and a job's engine and build, differ: a sentence for people that names both; "" =
/// in nothing that matters. The names of files do not. A step, an engine or a build that is "" fits all.
PMSP_API std::string difference(const ShardJob& mine, const ShardJob& job);
PMSP_API std::string difference(const ShardMarker& marker, const ShardJob& job);

}  // namespace pmsp::workspace
