// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"

namespace pmsp::io {

/// Number in a file name.
struct NameNumber {
  double value = 0.0;
  std::optional<std::int64_t> integer;  ///< if integral and in range
  std::string digits;
};

/// Image file with numbers in its name.
struct NumberedFile {
  std::filesystem::path path;
  std::string around;               ///< name without its numbers, common to the files of a series
  std::vector<NameNumber> numbers;  ///< from left to right, at least one
};

/// True for names with an image extension, except hidden files.
PMSP_API bool is_image_name(const std::filesystem::path& path);

/// Returns the image files of a folder by name, without subfolders and hidden files. `unnumbered` is set to the number
/// of files without a number in their names, which are skipped. Throws IoError if the folder is missing or contains no
/// image.
std::vector<NumberedFile> list_numbered_images(const std::filesystem::path& folder, std::size_t& unnumbered);

/// Interpretation of the file names, with its pairing.
struct NamingScheme {
  std::string meaning;              ///< description for messages: "frame indices (timestamp x 10 fps)"
  std::vector<int> file;            ///< per keyframe of the map: index of its file, -1 = none
  std::vector<std::string> reason;  ///< per keyframe: why it has no file
  int found = 0;                    ///< number of keyframes with a file
  int rank = 0;                     ///< plausibility among schemes with the same `found`; lower is better
  bool is_shifted = false;          ///< by a constant offset, to be searched
  bool is_guess = false;            ///< needs confirmation by images or by `is_complete`
  bool is_complete = false;         ///< one-to-one pairing of keyframes and files of the series
};

/// Returns naming schemes that pair at least two keyframes (one if the map has only one), by decreasing `found`,
/// guesses last. Duplicates, and schemes with less than half the best `found`, are omitted.
std::vector<NamingScheme> find_naming_schemes(const SlamMap& map, const std::vector<NumberedFile>& files,
                                              const ImageFolderOptions& options);

/// Files of the largest series by their integer numbers.
std::map<std::int64_t, int> frames_of(const std::vector<NumberedFile>& files);

/// Per keyframe: index of an earlier one (smaller id) with the same timestamp, or -1.
std::vector<int> earlier_with_same_timestamp(const SlamMap& map);

/// Unit of the timestamps [s]: 1, unless keyframes would be hours apart (nanoseconds).
double time_unit(const SlamMap& map);

/// True if timestamps in this unit are Unix times instead of seconds of a video.
bool has_unix_time(const SlamMap& map, double unit = 1.0);

/// Lowest and highest timestamp of the map's keyframes [map's unit].
double first_timestamp(const SlamMap& map);
double last_timestamp(const SlamMap& map);

/// Returns round((timestamp - t0) * fps); nullopt if out of range.
std::optional<std::int64_t> frame_index(double timestamp, double t0, double fps);

/// Returns the source frame; nullopt if missing or out of range.
std::optional<std::int64_t> source_index(const MapKeyframe& keyframe);

/// Throws InvalidInput unless at least half of the keyframes have an image. `how`, `remedy`: for the message.
void require_half(const std::filesystem::path& images, std::size_t found, std::size_t keyframes, const std::string& how,
                  const std::string& remedy);

/// Returns "keyframe 7 has the same timestamp (1.5 s)", the reason for skipping a keyframe.
std::string same_timestamp_reason(const MapKeyframe& earlier);

/// Formats a number with up to 16 digits, without trailing zeros.
std::string format_number(double value);

}  // namespace pmsp::io
