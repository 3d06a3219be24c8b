// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pmsp/io/image_source.h"
#include "pmsp/io/map.h"

namespace pmsp::io {

/// An image file whose name holds a number.
struct NumberedFile {
  std::filesystem::path path;
  std::string around;                   ///< the name without the number: files of one series share it
  double value = 0.0;                   ///< the number
  std::optional<std::int64_t> integer;  ///< the number where it is whole and fits
};

/// Whether a file's name has the ending of an image and it is not hidden.
bool is_image_name(const std::filesystem::path& path);

/// Image files of a folder by name, not recursive, hidden ones left out. Throws IoError when there is no such folder or
/// no image in it. `unnumbered` receives how many have no number in their names; those are left out.
std::vector<NumberedFile> list_numbered_images(const std::filesystem::path& folder, std::size_t& unnumbered);

/// One way to read the names, and the pairing that it gives.
struct NamingScheme {
  std::string meaning;              ///< of the names, for people: "frame indices (timestamp x 10 fps)"
  std::vector<int> file;            ///< for each keyframe of the map: index of the file, -1 = none
  std::vector<std::string> reason;  ///< for each keyframe: why it has none
  int found = 0;                    ///< keyframes with a file
  int rank = 0;                     ///< the lower, the more plausible among schemes that find equally many
};

/// Naming schemes that pair at least two keyframes (one, where the map has no more), the one that finds most first.
/// Readings with equal pairings are given once, those that find less than half as many as the best are left out.
std::vector<NamingScheme> find_naming_schemes(const SlamMap& map, const std::vector<NumberedFile>& files,
                                              const ImageFolderOptions& options);

/// For each keyframe the index of an earlier one (smaller id) with the same timestamp, or -1.
std::vector<int> earlier_with_same_timestamp(const SlamMap& map);

/// True where timestamps are Unix times rather than seconds of a video.
bool has_unix_time(const SlamMap& map);

/// The lowest timestamp of the map's keyframes [s].
double first_timestamp(const SlamMap& map);

/// round((timestamp - t0) * fps), or nullopt when that is no sensible frame index.
std::optional<std::int64_t> frame_index(double timestamp, double t0, double fps);

/// "keyframe 7 has the same timestamp (1.5 s)": why a keyframe is skipped.
std::string same_timestamp_reason(const MapKeyframe& earlier);

/// A number as people write it: up to 16 digits, no trailing zeros.
std::string format_number(double value);

}  // namespace pmsp::io
