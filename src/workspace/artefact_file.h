// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <memory>

#include "export/files.h"
#include "plan/plan.h"
#include "pmsp/api.h"
#include "pmsp/stages.h"
#include "pmsp/types.h"

// What a keyframe leaves, as a file of a workspace: 16 bytes that say what it is, the numbers as this machine has them
// (little-endian), a checksum of all that. Each is written whole or not at all. Writing throws OutputError; reading
// IoError, naming the file, where it is not what was written.
namespace pmsp::workspace {

/// What was seen of an image, so that nobody has to look at it again.
struct Look {
  int width = 0, height = 0;  ///< [px]
  SharpnessRecord sharpness;
};

/// All is in the file, but it is not in its place: that `commit` does, which waits for the disk.
PMSP_API std::unique_ptr<AtomicFile> planes_file(const std::filesystem::path& path, const PlaneMap& planes);
PMSP_API PlaneMap read_planes(const std::filesystem::path& path);

PMSP_API std::unique_ptr<AtomicFile> points_file(const std::filesystem::path& path, const KeyframeCloud& cloud);
PMSP_API KeyframeCloud read_points(const std::filesystem::path& path);

PMSP_API void write_look(const std::filesystem::path& path, const Look& look);
PMSP_API Look read_look(const std::filesystem::path& path);

}  // namespace pmsp::workspace
