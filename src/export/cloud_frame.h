// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/map.h"

namespace pmsp {

/// Value of FrameOptions::align for alignment with the GPS positions in the images' EXIF data.
constexpr const char* kAlignExif = "exif";

/// Image files by keyframe id.
using ImageFiles = std::map<std::int64_t, std::filesystem::path>;

/// Frame of the output cloud. Order: `align` or `up` first, then `transform`, `scale` last.
struct FrameOptions {
  std::filesystem::path align;      ///< see read_anchors; kAlignExif = gps_anchors; empty = none
  double align_time_offset = 0.0;   ///< added to the keyframes' timestamps [s]
  bool up = false;                  ///< z upwards, from the cameras' orientation
  std::filesystem::path transform;  ///< see read_similarity; empty = none
  std::optional<double> scale;      ///< metres per unit after the other options, > 0
};

/// Distance of an anchor from its target position after the fit.
struct Residual {
  std::string name;       ///< of control point or keyframe
  double distance = 0.0;  ///< [unit of the file]
};

/// Frame of the output cloud, and residuals of its estimate.
struct PMSP_API CloudFrame {
  Similarity file_from_map;
  CloudUnit unit;                       ///< see unit_of_frame
  std::vector<Residual> residuals;      ///< of `align`
  std::optional<double> up_spread_deg;  ///< of `up`: median angle between the cameras' up axes and the common one
  std::string description;              ///< for messages; "" without options

  double residual_rms() const;  ///< 0 without residuals
  double residual_max() const;  ///< 0 without residuals
};

/// `images`: for kAlignExif, and for image names in a table. Throws IoError, InvalidInput.
PMSP_API CloudFrame find_cloud_frame(const FrameOptions& options, const SlamMap& map, const ImageFiles& images = {});

/// Metres if the options determine the scale, else the map's unit. Throws as read_similarity.
PMSP_API CloudUnit unit_of_frame(const FrameOptions& options);

/// Reads a 4 x 4 matrix from text, 16 numbers: scale times rotation, translation, and 0 0 0 1 (as CloudCompare writes
/// transformations). Throws IoError; InvalidInput if it is not a similarity.
PMSP_API Similarity read_similarity(const std::filesystem::path& path);

/// Point of the map with its position in the frame of the file.
struct Anchor {
  std::string name;
  Eigen::Vector3d in_map, in_file;
  std::optional<Eigen::Matrix3d> file_from_map;  ///< rotation, if known
};

/// Reads a table, one anchor per line; # begins a comment; columns are separated by blanks, commas or semicolons:
///     [NAME] x y z X Y Z          control point in the map and in the frame of the file
///     ID X Y Z                    keyframe id, and position of its camera
///     IMAGE X Y Z                 the same by image name, with or without folders and extension; images without a
///                                 keyframe are skipped
///     time tx ty tz qx qy qz qw   pose of another trajectory, camera to world (TUM, EuRoC or VINS); interpolated at
///                                 the times of keyframes between poses at most a second apart
/// All lines are of one kind; a first line may name the columns. `images`: for keyframes without an image name in the
/// map. Throws IoError, InvalidInput with the line.
PMSP_API std::vector<Anchor> read_anchors(const std::filesystem::path& path, const SlamMap& map, double time_offset,
                                          const ImageFiles& images = {});

/// Camera positions by GPS data of the images (EXIF): metres east, north and up of the first one, on the tangent plane
/// of the ellipsoid. `origin` is set to its coordinates, as text. Images without GPS data, or unreadable ones, are
/// skipped.
PMSP_API std::vector<Anchor> gps_anchors(const SlamMap& map, const ImageFiles& images, std::string& origin);

/// Returns the up direction of the map: the common direction of the cameras' up axes (-y). `spread_deg` is set to the
/// median angle to it. Throws InvalidInput if there is no common direction.
PMSP_API Eigen::Vector3d up_of_cameras(const SlamMap& map, double& spread_deg);

}  // namespace pmsp
