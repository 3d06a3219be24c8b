// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <memory>

#include "export/files.h"
#include "plan/plan.h"
#include "pmsp/api.h"
#include "pmsp/stages.h"
#include "pmsp/types.h"

// Artefacts of a keyframe as files of a workspace: 16 bytes for the type, numbers in the format of the machine
// (little-endian), and a checksum. Files are written atomically. Writing throws OutputError; reading throws IoError,
// naming the file, if it is damaged.
namespace pmsp::workspace {

/// Properties of an image, recorded so that it need not be read again.
struct ImageRecord {
  int width = 0, height = 0;  ///< [px]
  SharpnessRecord sharpness;
};

/// Returns a complete file that is not in its place: `commit` moves it there and waits for the disk.
PMSP_API std::unique_ptr<AtomicFile> planes_file(const std::filesystem::path& path, const PlaneMap& planes);
PMSP_API PlaneMap read_planes(const std::filesystem::path& path);

PMSP_API std::unique_ptr<AtomicFile> points_file(const std::filesystem::path& path, const KeyframeCloud& cloud);
PMSP_API KeyframeCloud read_points(const std::filesystem::path& path);

PMSP_API void write_image_record(const std::filesystem::path& path, const ImageRecord& record);
PMSP_API ImageRecord read_image_record(const std::filesystem::path& path);

}  // namespace pmsp::workspace
