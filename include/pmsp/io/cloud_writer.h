// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/image.h"
#include "pmsp/io/similarity.h"
#include "pmsp/point_cloud.h"
#include "pmsp/transform.h"

namespace pmsp {

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

}  // namespace pmsp
