// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pmsp/io/images.h"
#include "pmsp/io/map.h"

namespace pmsp::io {

/// A number in a file's name.
struct NameNumber {
  double value = 0.0;
  std::optional<std::int64_t> integer;  ///< where it is whole and fits
  std::string digits;
};

/// An image file whose name holds numbers.
struct NumberedFile {
  std::filesystem::path path;
  std::string around;               ///< the name without its numbers: files of one series share it
  std::vector<NameNumber> numbers;  ///< from left to right, at least one
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
  bool is_shifted = false;          ///< by a constant offset, which is found
  bool is_guess = false;            ///< to be proved: by images, or by `is_complete`
  bool is_complete = false;         ///< each keyframe has a file, and each file of the series a keyframe
};

/// Naming schemes that pair at least two keyframes (one, where the map has no more): guesses last, else the one that
/// finds most first. Readings with equal pairings are given once, those that find less than half as many as the best
/// are left out.
std::vector<NamingScheme> find_naming_schemes(const SlamMap& map, const std::vector<NumberedFile>& files,
                                              const ImageFolderOptions& options);

/// Files of the largest series by the whole numbers in their names.
std::map<std::int64_t, int> frames_of(const std::vector<NumberedFile>& files);

/// For each keyframe the index of an earlier one (smaller id) with the same timestamp, or -1.
std::vector<int> earlier_with_same_timestamp(const SlamMap& map);

/// Unit of timestamps [s]: 1, unless keyframes would then be hours apart, as where a file has nanoseconds.
double time_unit(const SlamMap& map);

/// True where timestamps in this unit are Unix times rather than seconds of a video.
bool has_unix_time(const SlamMap& map, double unit = 1.0);

/// The lowest and the highest timestamp of the map's keyframes, as the map has them.
double first_timestamp(const SlamMap& map);
double last_timestamp(const SlamMap& map);

/// round((timestamp - t0) * fps), or nullopt when that is no sensible frame index.
std::optional<std::int64_t> frame_index(double timestamp, double t0, double fps);

/// The source frame, or nullopt when that is no sensible frame index.
std::optional<std::int64_t> source_index(const MapKeyframe& keyframe);

/// Throws InvalidInput unless at least half of the keyframes have an image. `how` they are paired and the `remedy` are
/// for people.
void require_half(const std::filesystem::path& images, std::size_t found, std::size_t keyframes, const std::string& how,
                  const std::string& remedy);

/// "keyframe 7 has the same timestamp (1.5 s)": why a keyframe is skipped.
std::string same_timestamp_reason(const MapKeyframe& earlier);

/// A number as people write it: up to 16 digits, no trailing zeros.
std::string format_number(double value);

}  // namespace pmsp::io
