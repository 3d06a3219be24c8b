// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
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

/// Similarity, named `target_from_source`: x_target = scale * rotation * x_source + translation.
struct Similarity {
  double scale = 1.0;                                      ///< > 0
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< orthonormal, determinant +1
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();   ///< [target units]

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return scale * (rotation * x) + translation; }

  Similarity operator*(const Similarity& other) const {
    return {scale * other.scale, rotation * other.rotation, *this * other.translation};
  }

  /// Transforms a camera pose: its centre by the similarity, its axes by the rotation.
  RigidTransform operator*(const RigidTransform& world_from_cam) const {
    return {rotation * world_from_cam.rotation, *this * world_from_cam.translation};
  }

  bool is_identity() const {
    return scale == 1.0 && rotation == Eigen::Matrix3d::Identity() && translation == Eigen::Vector3d::Zero();
  }
};

/// Point of an output file. Keyframe and pixel are its key, independent of other points.
struct OutputPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< in frame and unit of the file
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();    ///< unit, in the frame of the file
  float confidence = 0.0F;                             ///< 0 to 1
  std::int64_t keyframe_id = 0;
  std::uint32_t pixel = 0;  ///< see KeyframeCloud::pixels
  std::uint32_t agree = 0;  ///< see KeyframeCloud::agree
  Rgb color;
  std::uint8_t views = 0;  ///< see CloudPoint::views
};

/// Image of a keyframe, for formats with cameras and images.
struct OutputView {
  std::int64_t keyframe_id = 0;
  double timestamp = 0.0;        ///< [s]
  RigidTransform cam_from_file;  ///< pose in frame and unit of the file
  std::string name;              ///< file name of the equirectangular image, unique: "000012.jpg"
  int width = 0, height = 0;     ///< of the image [px]
  bool has_mask = false;         ///< with a gray PNG of the same size, 0 = ignored, 255 = used: "000012.jpg.png"
};

/// Unit of lengths of a cloud.
struct CloudUnit {
  enum class Kind {
    kUnknown,  ///< not stored in the file
    kMap,      ///< of the SLAM map, without known scale
    kMetres,
  };
  Kind kind = Kind::kUnknown;
  std::string by;  ///< source of the scale in metres: an option, such as "--scale"; else ""
};

/// Depth images of a dataset: distance from the camera centre, normals and confidence of each image.
struct DatasetDepth {
  bool png = false;            ///< as 16-bit PNG
  bool exr = false;            ///< as EXR
  double png_scale = 1e-3;     ///< depth of a gray level [unit of the file]
  double lens_distance = 0.0;  ///< of the depth maps, see DensifierOptions

  bool is_wanted() const { return png || exr; }
};

/// Cloud metadata, passed to the writer before any point. Must follow from inputs and options only, not from clock or
/// machine, so that equal runs give equal bytes.
struct CloudHeader {
  std::string generator;              ///< "pmsp-densify 0.1.0"
  std::vector<std::string> comments;  ///< one line each; line breaks become spaces
  Similarity file_from_map;           ///< transform to the frame of the file
  CloudUnit unit;                     ///< unit of the file; stored in `comments`
  /// Sphere with nearly all points, in the frame of the file: offset and (`resolution` 0) scale of integer coordinates.
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double reach = 1.0;
  double resolution = 0.0;              ///< of integer coordinates; 0 = about 1e-7 of `reach`
  bool double_positions = false;        ///< PLY: positions always as double
  std::string wkt;                      ///< coordinate reference system of the file; "" = none
  int year = 0, day_of_year = 0;        ///< of the data; 0 = unknown
  std::filesystem::path scratch = ".";  ///< directory of temporary files
  int threads = 0;                      ///< number of threads that place and encode points; 0 = one per CPU
  /// For datasets: writes the images of the mission into the existing directory `images` of `folder`, and masks (all or
  /// none) into `masks`; returns their cameras by ascending keyframe id. Called after the last point.
  std::function<std::vector<OutputView>(const std::filesystem::path& folder)> export_views;
  std::int64_t dataset_points = 1'000'000;  ///< maximum number of points of a dataset, by thinning
  DatasetDepth dataset_depth;
  // For maps of free and occupied space (CloudFormat::is_map); lengths in the unit of the file:
  std::map<std::int64_t, RigidTransform> cameras;  ///< file from camera, by keyframe id
  double cell_size = 0.0;                          ///< side of the cells, > 0
  int least_rays = 3;                              ///< rays that make a cell free, at least, 1 to 255
  double robot_height = 1.0;                       ///< free height above the floor, > 0
  double robot_step = 0.1;                         ///< highest step of the floor, >= `cell_size`
  double robot_slope_deg = 20.0;                   ///< steepest slope of the floor [deg], 1 to 60
  bool map_units = false;                          ///< accept lengths in map units, which no robot may take for metres
};

/// Writes points [first, last) to `to`. May be called by several threads at once.
using PointProducer = std::function<void(std::size_t first, std::size_t last, OutputPoint* to)>;

/// Streaming writer of a cloud, in bounded memory. The target is replaced by `finish`, else unchanged.
class PMSP_API CloudWriter {
 public:
  virtual ~CloudWriter() = default;

  /// Sets the keyframe ids of the bits of OutputPoint::agree for the following points.
  virtual void set_window(std::int64_t keyframe_id, const std::vector<std::int64_t>& window_ids);
  /// Throws OutputError (disk full; a position that the format cannot hold).
  virtual void add(const OutputPoint* points, std::size_t count) = 0;
  /// Adds the depth map of a keyframe; only datasets use it, see CloudHeader::dataset_depth. Throws OutputError.
  virtual void add_depth(const DepthMap& map);
  virtual bool wants_depth() const;  ///< whether `add_depth` has an effect
  /// Adds `count` points computed by `producer`, with several threads. Returns false, without effect, if unsupported.
  virtual bool add_parallel(std::size_t count, const PointProducer& producer);
  virtual void finish() = 0;  ///< completes the target; throws OutputError
};

/// Format of an output: a cloud, or what is made from it.
struct CloudFormat {
  const char* name;       ///< "las"
  const char* extension;  ///< of files or directories, ".las"
  const char* what;       ///< short description
  /// Returns whether the format writes entries of that name in its directory; nullptr for single files.
  bool (*writes)(const std::string& name);
  /// Throws OutputError if the target cannot be created.
  std::unique_ptr<CloudWriter> (*open)(const std::filesystem::path& path, const CloudHeader& header);

  /// Map of free and occupied space: requires `cameras` and `cell_size` of the header, takes points before crop and
  /// thinning, is bounded by the crop. `finish` throws InvalidInput if it is too large, or a grid has no floor.
  bool is_map = false;
  /// Returns the files that are written besides; nullptr = none.
  std::vector<std::filesystem::path> (*beside)(const std::filesystem::path& path) = nullptr;

  bool is_folder() const { return writes != nullptr; }
};

/// Returns all formats, the default first.
PMSP_API const std::vector<CloudFormat>& cloud_formats();

/// Returns nullptr if the name is unknown.
PMSP_API const CloudFormat* find_cloud_format(const std::string& name);

/// Returns the format of an extension in lower or upper case, nullptr if unknown.
PMSP_API const CloudFormat* cloud_format_of(const std::filesystem::path& path);

/// Writes points [first, last) of a keyframe at `pose` to `to`, in the frame of a file.
PMSP_API void place_points(const KeyframeCloud& cloud, const KeyframePose& pose, const Similarity& file_from_map,
                           std::size_t first, std::size_t last, OutputPoint* to);

struct SlamMap;  // pmsp/io/map.h

/// Axis-aligned box, including its faces.
struct Box {
  Eigen::Vector3d low, high;
  bool contains(const Eigen::Vector3d& x) const {
    return (x.array() >= low.array()).all() && (x.array() <= high.array()).all();
  }
};

/// Thinning of a cloud.
struct ThinningOptions {
  double voxel = 0.0;           ///< size of voxels with at most one point; 0 = no voxels
  std::int64_t max_points = 0;  ///< maximum number of points; 0 = unlimited

  bool is_needed() const { return voxel > 0.0 || max_points > 0; }
};

/// Part of a cloud that is written.
struct CloudSelection {
  std::optional<Box> crop;  ///< in the frame of the file
  ThinningOptions thinning;
};

/// Returns a header with `file_from_map`, `center`, `reach` and `cameras`. `range_margin`: see InitOptions.
PMSP_API CloudHeader cloud_header_of(const SlamMap& map, const Similarity& file_from_map = {},
                                     double range_margin = InitOptions().range_margin);

/// Returns the header of pmsp-densify for a cloud in map units: also generator, unit, and as comments seed and options.
/// `options`: of densify(); with a lens distance that it estimates, the tool stores that one.
PMSP_API CloudHeader cloud_header_of(const SlamMap& map, const DensifierOptions& options);

/// Output of a mission's points in several formats, in bounded memory: transforms them into the frame of the files,
/// crops and thins them; maps (CloudFormat::is_map) share one set of cells. Targets are replaced by `commit`, else
/// unchanged.
class PMSP_API CloudOutput {
 public:
  struct Target {
    const CloudFormat* format;
    std::filesystem::path path;
  };

  /// Throws OutputError if a target cannot be created; InvalidInput if the header is not sufficient for a map.
  CloudOutput(const CloudHeader& header, const CloudSelection& amount, const std::vector<Target>& targets);
  /// Single file or directory with the format of its extension, see cloud_formats, or without one PLY. Throws
  /// InvalidOption if the extension is unknown; OutputError.
  explicit CloudOutput(const std::filesystem::path& path);
  CloudOutput(const std::filesystem::path& path, const CloudHeader& header);
  ~CloudOutput();

  void add_writer(
      CloudWriter& writer);  ///< second writer of all points, finished by the caller; before the first point

  /// Add points, at the pose of the cloud or a newer one. Throw OutputError (disk full; after `commit`); InvalidInput
  /// if a target is a map and the camera is not at that place in CloudHeader::cameras.
  void add(const KeyframeCloud& cloud);
  void add(const KeyframeCloud& cloud, const KeyframePose& pose);
  /// Adds points of another frame. Throws InvalidInput if a target is a map, which needs the keyframes of the points.
  void add(const OutputPoint* points, std::size_t count, const Similarity& file_from_points);
  std::int64_t points_in() const;  ///< number of added points

  /// Adds the depth map of a keyframe to datasets, see CloudHeader::dataset_depth.
  void add_depth(const DepthMap& map);
  bool wants_depth() const;  ///< whether `add_depth` has an effect

  void complete();              ///< writes the points that remain after thinning; after the last `add`
  std::int64_t points() const;  ///< number of written points; with thinning after `complete`

  /// Calls `complete`, then replaces the targets, maps last. Throws OutputError; InvalidInput if maps, but only they,
  /// cannot be made.
  void commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Metadata of a cloud.
struct CloudInfo {
  std::string format;       ///< "PLY", "LAS", "Potree", "COLMAP", "workspace"
  std::int64_t points = 0;  ///< according to the header
  bool has_normals = false, has_colors = false, has_confidence = false, has_views = false;
  bool double_positions = false;            ///< PLY
  std::vector<std::string> comments;        ///< one line each
  std::optional<Similarity> file_from_map;  ///< nullopt = not stored, as by other programs
  CloudUnit unit;
  std::string wkt;                ///< coordinate reference system; "" = none
  int year = 0, day_of_year = 0;  ///< of the data; 0 = unknown
};

/// Streaming reader of a cloud, in bounded memory.
class PMSP_API CloudReader {
 public:
  /// Receives points in frame and unit of the cloud. Missing values are 0, missing colours gray (200). Confidences are
  /// 0 to 1. Keyframe and pixel are those of a workspace, else a running number.
  using Take = std::function<void(const OutputPoint* points, std::size_t count)>;

  virtual ~CloudReader() = default;
  const CloudInfo& info() const { return info_; }

  /// Delivers all points in blocks, in the order of the file. May be called again. Throws IoError; InvalidInput if the
  /// file is truncated or a position not finite.
  virtual void read(const Take& take) = 0;

 protected:
  CloudInfo info_;
};

/// Opens a cloud, detected by content: PLY (ascii, binary of either byte order), uncompressed LAS 1.0 to 1.4 or Potree
/// 2, dataset (COLMAP, nerfstudio), workspace. Throws IoError; InvalidInput if unknown or damaged.
PMSP_API std::unique_ptr<CloudReader> open_cloud(const std::filesystem::path& path);

/// Reads all points and returns minimum and maximum of their coordinates; nullopt = no points.
PMSP_API std::optional<std::pair<Eigen::Vector3d, Eigen::Vector3d>> bounds_of(CloudReader& cloud);

/// Sets `file_from_map`, `unit` and the has_ flags from comments of pmsp-densify.
PMSP_API void read_origin(CloudInfo& info);

/// Columns of a PLY; empty = missing. Colours of 0 to 1 are scaled to 255; empty comments are ignored; confidence and
/// views may have the prefix "scalar_".
struct PlyCloud {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Vector3f> normals;
  std::vector<Rgb> colors;
  std::vector<float> confidence;
  std::vector<std::uint8_t> views;
  std::vector<std::string> comments;
};

/// Reads the vertices of a PLY, ascii or binary of either byte order; ignores other elements. Throws IoError;
/// InvalidInput, with line or byte, if it is damaged, truncated, without x y z, or a position is not finite.
PMSP_API PlyCloud read_ply(const std::filesystem::path& path);

}  // namespace pmsp
