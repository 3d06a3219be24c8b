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

/// Range of a shard in a list of `size`: [first, last). The ranges of all shards cover the list; their sizes differ by
/// at most one.
struct IdRange {
  std::size_t first = 0, last = 0;
};
PMSP_API IdRange id_range_of(const Shard& shard, std::size_t size);

enum class Wave { kPlanes, kPoints };
/// "planes" or "points"
PMSP_API const char* name_of(Wave wave);

/// Common inputs of all shards of a step, from which a merge makes the step again.
struct ShardJob {
  std::string from;  ///< step of the workspace's record; "" = none
  std::string step;
  int count = 1;       ///< of shards
  std::string engine;  ///< see StepInputs
  std::string build;   ///< exact version of the program
  std::string options = "{}";
  std::string map, map_bytes;  ///< path, relative to the workspace where possible, and fingerprint
  std::string images, video, mask, mask_bytes;
  double mask_nadir = 0.0;   ///< [deg]
  double mask_zenith = 0.0;  ///< [deg]
  bool no_masks = false;     ///< masks that come with the images are ignored
  std::string prior_depth;
  double fps = 0.0;
  std::optional<std::int64_t> frame_offset;
  bool presentation_times = false;
  std::string points, image_list, camera_from_body;  ///< paths, as of the map
  int component = -1;                                ///< -1 = the one with most keyframes
};

/// Result of a shard in a wave, or reason of its failure.
struct ShardMarker {
  Shard shard;
  Wave wave = Wave::kPlanes;
  std::string failure;  ///< "" = success
  std::string step;     ///< "" if it failed before the step was known
  std::string engine, build, host;
  double seconds = 0.0;
  std::int64_t keyframes = 0;         ///< in its range
  std::int64_t made = 0;              ///< by this process; others existed
  std::vector<std::int64_t> without;  ///< keyframes in its range without result
};

/// Folder for the coordination of shards:
///
///     job-FROM.json               the job while the record is of step FROM ("new": none)
///     planes-K-of-N.json          result of shard K
///     points-K-of-N.json
///
/// Files are written atomically. Throws OutputError; IoError if a file is damaged.
class PMSP_API ShardFolder {
 public:
  explicit ShardFolder(std::filesystem::path folder) : folder_(std::move(folder)) {}

  void make() const;

  /// Returns the job of a workspace whose record is of step `from`.
  std::optional<ShardJob> job(const std::string& from) const;
  /// Returns the job that ended with this record.
  std::optional<ShardJob> ended_job(const std::string& step) const;
  /// Adds the job unless there is one. Returns the one in the folder.
  ShardJob post(const ShardJob& job) const;

  /// A failure does not replace a success.
  void mark(const ShardMarker& marker) const;
  /// Returns markers by wave and index.
  std::vector<ShardMarker> markers() const;

  /// Deletes all but the job of the recorded step.
  void end(const std::string& step) const;
  /// Deletes all files, and the folder if it is then empty.
  void remove() const;

  const std::filesystem::path& path() const { return folder_; }

 private:
  std::vector<std::filesystem::path> files(const std::string& kind) const;

  std::filesystem::path folder_;
};

/// Returns a sentence for users on the relevant differences of two jobs, or of the engine and build of a marker and a
/// job; "" = none. File names are ignored; empty steps, engines and builds match all.
PMSP_API std::string difference(const ShardJob& mine, const ShardJob& job);
PMSP_API std::string difference(const ShardMarker& marker, const ShardJob& job);

}  // namespace pmsp::workspace
