// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/options.h"
#include "pmsp/types.h"

namespace pmsp {

/// x_target = scale * rotation * x_source + translation, named `target_from_source` like a RigidTransform.
struct Similarity {
  double scale = 1.0;                                      ///< > 0
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< orthonormal, determinant +1
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();   ///< in the unit of the target

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return scale * (rotation * x) + translation; }

  /// target_from_middle * middle_from_source = target_from_source.
  Similarity operator*(const Similarity& other) const {
    return {scale * other.scale, rotation * other.rotation, *this * other.translation};
  }

  /// A camera pose moved along: its centre by the similarity, its axes by the rotation.
  RigidTransform operator*(const RigidTransform& world_from_cam) const {
    return {rotation * world_from_cam.rotation, *this * world_from_cam.translation};
  }

  bool is_identity() const {
    return scale == 1.0 && rotation == Eigen::Matrix3d::Identity() && translation == Eigen::Vector3d::Zero();
  }
};

/// A point on its way into a file. Keyframe and pixel are its key: they stay the same whatever happens to other points.
struct OutputPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< in the frame and unit of the file
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();    ///< unit, in the frame of the file
  float confidence = 0.0F;                             ///< 0 to 1
  std::int64_t keyframe_id = 0;
  std::uint32_t pixel = 0;  ///< of the keyframe's depth map, see KeyframeCloud::pixels
  std::uint32_t agree = 0;  ///< see KeyframeCloud::agree
  Rgb color;
  std::uint8_t views = 0;  ///< keyframes whose depth maps agree on the point
};

/// A keyframe's image, for formats that hold cameras and images too.
struct OutputView {
  std::int64_t keyframe_id = 0;
  double timestamp = 0.0;        ///< [s]
  RigidTransform cam_from_file;  ///< from the frame of the file; in its unit
  std::string name;              ///< of its equirectangular image, unique; "000012.jpg"
  int width = 0, height = 0;     ///< of the image [px]
  bool has_mask = false;         ///< a grey PNG of that size, 0 = ignore, 255 = use: "000012.jpg.png"
};

/// Unit of a cloud's lengths.
struct CloudUnit {
  enum class Kind {
    kUnknown,  ///< the file does not say
    kMap,      ///< that of the SLAM map, which has no scale
    kMetres,
  };
  Kind kind = Kind::kUnknown;
  std::string by;  ///< what metres follow from: an option, such as "--scale"; "" else
};

/// What a writer is told of a cloud before its first point. All of it follows from inputs and options, nothing from the
/// clock or the machine, so that equal runs give equal bytes.
struct CloudHeader {
  std::string generator;              ///< "pmsp-densify 0.1.0"
  std::vector<std::string> comments;  ///< a line each; other line breaks become spaces
  Similarity file_from_map;           ///< how the frame of the file follows from that of the SLAM map
  CloudUnit unit;                     ///< of the file; `comments` say so to readers
  /// Nearly all points lie within `reach` of `center`, in the frame of the file. Formats with integer coordinates take
  /// their offset and, where `resolution` is 0, their scale from it.
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double reach = 1.0;
  double resolution = 0.0;              ///< of integer coordinates; 0 = about a ten-millionth of `reach`
  bool double_positions = false;        ///< PLY: positions as double even where float would do
  std::string wkt;                      ///< coordinate reference system of the file's frame, as WKT; "" = none
  int year = 0, day_of_year = 0;        ///< of the data; 0 = not told
  std::filesystem::path scratch = ".";  ///< folder for what memory should not hold
  int threads = 0;                      ///< that place points and make a file's bytes; 0 = one for each CPU
  /// For datasets: puts the mission's images into `images` in a folder that is there, and masks, all or none, into
  /// `masks`; says which cameras saw them, by ascending keyframe id. Called when all points have come.
  std::function<std::vector<OutputView>(const std::filesystem::path& folder)> export_views;
  std::int64_t dataset_points = 1'000'000;  ///< of a dataset, at most: its points are thinned to that
};

/// Makes some points, those from `first` to before `last`, at `to`. Several threads may call it at a time.
using PlacePoints = std::function<void(std::size_t first, std::size_t last, OutputPoint* to)>;

/// Writes a cloud into a file or folder, point by point, in memory that does not grow with it. What it writes appears
/// under its name when `finish` is called; a writer that is destroyed before leaves what was there before.
class PMSP_API CloudWriter {
 public:
  virtual ~CloudWriter() = default;

  /// Which keyframes the bits of `agree` stand for, in points of this keyframe that come later.
  virtual void set_window(std::int64_t keyframe_id, const std::vector<std::int64_t>& window_ids);
  /// Throws OutputError (disk full; a position that the format cannot hold).
  virtual void add(const OutputPoint* points, std::size_t count) = 0;
  /// As `add` with the `count` points that `place` makes, for writers that place and encode them in one go, by several
  /// threads. False where the writer has taken none of them and expects them by `add`.
  virtual bool take(std::size_t count, const PlacePoints& place);
  /// Puts what was written under its name. Throws OutputError.
  virtual void finish() = 0;
};

/// A format of clouds.
struct CloudFormat {
  const char* name;       ///< "las"
  const char* extension;  ///< of its files or folders, ".las"
  const char* what;       ///< a few words for people
  /// Whether a folder's writer makes files or folders of that name in it; nullptr for formats of one file.
  bool (*writes)(const std::string& name);
  /// Throws OutputError when the target cannot be made.
  std::unique_ptr<CloudWriter> (*open)(const std::filesystem::path& path, const CloudHeader& header);

  bool is_folder() const { return writes != nullptr; }
};

/// All formats; the first one is the default.
PMSP_API const std::vector<CloudFormat>& cloud_formats();

/// nullptr when there is none of that name.
PMSP_API const CloudFormat* find_cloud_format(const std::string& name);

/// By the extension, in small or capital letters; nullptr when no format has it.
PMSP_API const CloudFormat* cloud_format_of(const std::filesystem::path& path);

/// The keyframe's points from `first` to before `last`, in the frame of a file, with the keyframe at `pose`.
PMSP_API void place_points(const KeyframeCloud& cloud, const KeyframePose& pose, const Similarity& file_from_map,
                           std::size_t first, std::size_t last, OutputPoint* to);

struct SlamMap;  // pmsp/io/map.h

/// A box, its faces included.
struct Box {
  Eigen::Vector3d low, high;
  bool contains(const Eigen::Vector3d& x) const {
    return (x.array() >= low.array()).all() && (x.array() <= high.array()).all();
  }
};

/// Which points stay where there are more than are wanted.
struct ThinningOptions {
  double voxel = 0.0;           ///< side of the cubes of which each keeps one point; 0 = all points stay
  std::int64_t max_points = 0;  ///< at most so many stay; 0 = all

  bool is_needed() const { return voxel > 0.0 || max_points > 0; }
};

/// How much of a cloud is written.
struct CloudAmount {
  std::optional<Box> crop;  ///< in the frame of the file
  ThinningOptions thinning;
};

/// What can be told of a mission's cloud beforehand: `center` and `reach`, from its cameras and landmarks, and the
/// frame of the file. `range_margin`: InitOptions::range_margin of the run.
PMSP_API CloudHeader cloud_header_of(const SlamMap& map, const Similarity& file_from_map = {},
                                     double range_margin = InitOptions().range_margin);

/// A mission's points on their way into files: placed in the frame of the files, cropped, thinned, written in each of
/// the formats. Memory does not grow with the cloud. Files appear when `commit` is called, whole, or not at all.
class PMSP_API CloudOutput {
 public:
  /// A file or folder to write.
  struct Target {
    const CloudFormat* format;
    std::filesystem::path path;
  };

  /// Throws OutputError when a target cannot be made.
  CloudOutput(const CloudHeader& header, const CloudAmount& amount, const std::vector<Target>& targets);
  /// All points in one file or folder. Its format follows from the extension, see cloud_formats; without one it is a
  /// PLY. Throws InvalidOption where no format has it; OutputError.
  explicit CloudOutput(const std::filesystem::path& path);
  CloudOutput(const std::filesystem::path& path, const CloudHeader& header);
  ~CloudOutput();

  /// Gives it, too, all points that are written; finishing it is left to whom it belongs. Before the first point.
  void also_to(CloudWriter& writer);

  /// With the keyframe at the cloud's own pose, or at a newer one, from a loop closure or a bundle adjustment. Throws
  /// OutputError (disk full; points that come after `commit`).
  void add(const KeyframeCloud& cloud);
  void add(const KeyframeCloud& cloud, const KeyframePose& pose);
  /// Points that already lie in a frame, which `file_from_points` turns into that of the files.
  void add(const OutputPoint* points, std::size_t count, const Similarity& file_from_points);
  /// Points that have come.
  std::int64_t points_in() const;

  /// After the last point: what was held back for thinning goes to the writers.
  void complete();
  /// Points written; with thinning, once it is complete.
  std::int64_t points() const;

  /// Completes, and puts the files in their places. Throws OutputError.
  void commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// What a cloud says of itself before its points.
struct CloudInfo {
  std::string format;       ///< "PLY", "LAS", "Potree", "COLMAP", "workspace"
  std::int64_t points = 0;  ///< announced
  bool has_normals = false, has_colors = false, has_confidence = false, has_views = false;
  bool double_positions = false;            ///< PLY
  std::vector<std::string> comments;        ///< how it was made, a line each
  std::optional<Similarity> file_from_map;  ///< nullopt where the cloud does not say so: another program made it
  CloudUnit unit;
  std::string wkt;                ///< coordinate reference system; "" = none
  int year = 0, day_of_year = 0;  ///< of the data; 0 = not known
};

/// The points of a cloud, in memory that does not grow with it.
class PMSP_API CloudReader {
 public:
  /// Points in the frame and unit of the cloud. What the cloud lacks is 0, a missing colour grey (200). Confidences lie
  /// between 0 and 1. Keyframe and pixel are those of a workspace; elsewhere they number the points.
  using Take = std::function<void(const OutputPoint* points, std::size_t count)>;

  virtual ~CloudReader() = default;
  const CloudInfo& info() const { return info_; }

  /// Delivers all points, some at a time, in their order in the file. May be called several times. Throws IoError,
  /// InvalidInput where the data are cut off or a position is not finite.
  virtual void read(const Take& take) = 0;

 protected:
  CloudInfo info_;
};

/// A PLY (ascii, or binary of either byte order), a LAS 1.0 to 1.4 or a Potree 2 folder that is not compressed, the
/// points of a dataset (COLMAP, nerfstudio), or a workspace, by its content. Throws IoError, InvalidInput: none of
/// these, or broken.
PMSP_API std::unique_ptr<CloudReader> open_cloud(const std::filesystem::path& path);

/// Box around all points; nullopt = there are none. Reads them all.
PMSP_API std::optional<std::pair<Eigen::Vector3d, Eigen::Vector3d>> bounds_of(CloudReader& cloud);

/// `file_from_map` and `unit` from the comments that pmsp-densify writes, and what these say that the cloud lacks.
PMSP_API void read_origin(CloudInfo& info);

/// What a PLY holds, as columns. Missing columns are empty. Colours given as numbers from 0 to 1 are scaled to 255;
/// comment lines without words are left out. Confidence and views are taken with or without "scalar_" before the name.
struct PlyCloud {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Vector3f> normals;
  std::vector<Rgb> colors;
  std::vector<float> confidence;
  std::vector<std::uint8_t> views;
  std::vector<std::string> comments;
};

/// Reads the vertices of a PLY, ascii or binary of either byte order; other elements are passed over. Throws IoError,
/// or InvalidInput with the line or byte: broken or cut off, no x y z, a position that is not finite.
PMSP_API PlyCloud read_ply(const std::filesystem::path& path);

}  // namespace pmsp
