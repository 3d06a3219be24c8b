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

/// Name of an alignment with the places in the images' EXIF data.
constexpr const char* kAlignExif = "exif";

/// Files of images by keyframe id.
using ImageFiles = std::map<std::int64_t, std::filesystem::path>;

/// In which frame a cloud is written. Where more than one is given: `align` or `up` first, then `transform`, `scale`
/// last.
struct FrameOptions {
  std::filesystem::path align;      ///< see read_anchors; kAlignExif = gps_anchors; empty = none
  double align_time_offset = 0.0;   ///< added to the keyframes' timestamps [s]
  bool up = false;                  ///< z upwards, as the cameras stood
  std::filesystem::path transform;  ///< see read_similarity; empty = none
  std::optional<double> scale;      ///< metres a unit of what the other options lead to, > 0
};

/// How far a point of the map is from where it should be, after the best fit.
struct Residual {
  std::string name;       ///< of the control point, or the keyframe
  double distance = 0.0;  ///< in the unit of the file
};

/// The frame that a cloud is written in, and how well what it was found from fits.
struct PMSP_API CloudFrame {
  Similarity file_from_map;
  CloudUnit unit;                       ///< see unit_of_frame
  std::vector<Residual> residuals;      ///< of `align`
  std::optional<double> up_spread_deg;  ///< of `up`: the median angle between a camera's up and that of all
  std::string description;              ///< for people; "" where nothing was asked for

  double residual_rms() const;  ///< 0 without residuals
  double residual_max() const;  ///< 0 without residuals
};

/// `images`: those that kAlignExif looks at, and that a table may name. Throws IoError, InvalidInput.
PMSP_API CloudFrame find_cloud_frame(const FrameOptions& options, const SlamMap& map, const ImageFiles& images = {});

/// Metres where the options give the cloud a scale, else that of the map. Throws as read_similarity.
PMSP_API CloudUnit unit_of_frame(const FrameOptions& options);

/// A 4 x 4 matrix as text, 16 numbers: scale times a rotation, a translation, and 0 0 0 1 (as CloudCompare writes its
/// transformations). Throws IoError, InvalidInput where it is no such thing.
PMSP_API Similarity read_similarity(const std::filesystem::path& path);

/// A point of the map, and where it lies in the frame of the file.
struct Anchor {
  std::string name;
  Eigen::Vector3d in_map, in_file;
  std::optional<Eigen::Matrix3d> file_from_map;  ///< rotation, where it is known
};

/// A table, one anchor a line; # begins a comment; blanks, commas or semicolons between the columns:
///     [NAME] x y z X Y Z               a control point in the map and in the frame of the file
///     ID X Y Z                         a keyframe, and where its camera was
///     IMAGE X Y Z                      the same by the name of its image, with or without folders and ending; images
///                                      that are no keyframes are ignored
///     time tx ty tz qx qy qz qw        a pose of another trajectory, camera to world (TUM, EuRoC or VINS); the
///     camera's
///                                      place at the time of a keyframe is interpolated between poses not more than a
///                                      second apart
/// All lines are of one kind; a first line may name the columns. `images`: those of keyframes that the map names no
/// image for. Throws IoError, InvalidInput with the line.
PMSP_API std::vector<Anchor> read_anchors(const std::filesystem::path& path, const SlamMap& map, double time_offset,
                                          const ImageFiles& images = {});

/// Where the cameras were by the GPS data of their images (EXIF): metres east, north and up of the first of them, on
/// the plane that touches the ellipsoid there. `origin` becomes that place, for people. Images without a place are
/// passed over, those that cannot be read, too.
PMSP_API std::vector<Anchor> gps_anchors(const SlamMap& map, const ImageFiles& images, std::string& origin);

/// Which way is up in the map, as the cameras stood: the direction that their up axes (-y) have in common. `spread_deg`
/// becomes the median angle to it. Throws InvalidInput where they have none in common.
PMSP_API Eigen::Vector3d up_of_cameras(const SlamMap& map, double& spread_deg);

}  // namespace pmsp
