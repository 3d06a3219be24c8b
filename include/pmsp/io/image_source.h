// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/image.h"
#include "pmsp/io/map.h"

namespace pmsp {

/// Why a keyframe of the map cannot be used.
struct SkippedKeyframe {
  std::int64_t keyframe_id = 0;
  std::string reason;
};

/// Gives the images of a map's keyframes, one after the other, in the order of `keyframe_ids()`.
class PMSP_API ImageSource {
 public:
  virtual ~ImageSource() = default;

  /// Keyframes that have an image, in the order in which `next` gives them (ascending timestamp). For a video it is
  /// what is planned: a keyframe that the video turns out not to reach joins `skipped` while `next` runs.
  virtual const std::vector<std::int64_t>& keyframe_ids() const = 0;

  /// Keyframes without an image of their own, with the reason. Complete once `next` has returned nullopt.
  virtual const std::vector<SkippedKeyframe>& skipped() const = 0;

  /// How images were matched with keyframes, one sentence for people.
  virtual const std::string& description() const = 0;

  /// An image, and whose it is.
  struct Item {
    std::int64_t keyframe_id = 0;
    Image<Rgb> image;
  };
  /// The next image, or nullopt after the last one. Throws IoError when it cannot be decoded, InvalidInput when its
  /// size is not that of the map's camera up to a common factor (2:1 stays 2:1). After an error, the next call goes on
  /// with the next image.
  virtual std::optional<Item> next() = 0;

  /// A file, and which of its frames.
  struct Origin {
    std::filesystem::path file;
    std::string frame;
  };
  /// Where a keyframe's image lies: a file, and which of its frames, "" where there is only one. Equal bytes and equal
  /// frames give equal images, unless another keyframe has come that takes the frame of a video before. Throws
  /// InvalidInput when the keyframe is not among `keyframe_ids`.
  virtual Origin origin(std::int64_t keyframe_id) const = 0;

  /// `next` finds up to so many images decoded already, each by a thread of its own where they are files of their own.
  /// 0, as at the start: it decodes itself. Before the first `next`.
  virtual void read_ahead(int images) = 0;

  /// `keyframe_ids` and `next` name these keyframes only, and others are not decoded where that can be helped. Before
  /// the first `next`.
  virtual void restrict_to(const std::set<std::int64_t>& keyframe_ids) = 0;

  /// Another source of the same images, which takes no search for what belongs together. Before the first `next`.
  /// Throws IoError when a video can no longer be opened.
  virtual std::unique_ptr<ImageSource> again() const = 0;
};

/// Whether EXIF data of an image file turn it: ImageSource gives such images upright. Throws IoError.
PMSP_API bool is_turned_by_exif(const std::filesystem::path& image);

/// How images of a folder are matched with keyframes.
struct ImageFolderOptions {
  double fps = 0.0;  ///< of the frame indices [1/s]; 0 = the map's camera's
  /// Added to the frame index that a keyframe's timestamp gives. A value says that names are frame indices; nullopt:
  /// the naming and the offset are found.
  std::optional<std::int64_t> frame_offset = std::nullopt;
  bool allow_missing = false;  ///< images for fewer than half of the keyframes are accepted
};

/// Images in a folder (JPEG, PNG, TIFF, BMP, WebP). Where the map names them (`MapKeyframe::image`), these and no
/// others are taken: the file in the folder that has the longest tail of the name; where none is found, files with
/// another ending. Else the folder itself is searched, and a number in the names of its
/// images is a keyframe id (unless ids are row numbers), a timestamp (seconds, milli-, micro- or nanoseconds,
/// "SECONDS_NANOSECONDS") or a frame index: the last number that differs between files. Frame indices are timestamp x
/// fps, for Unix times counted from the first keyframe, with a constant offset. Where names leave more than one
/// reading, what a few images show of landmarks decides. Readings that guess the frame rate, the unit of timestamps, or
/// that images come in the order of keyframes are taken only where images prove them, or, without landmarks, where a
/// rate gives each keyframe an image and each image a keyframe. Of keyframes with one timestamp the first (smallest id)
/// keeps the image.
///
/// Throws IoError when there is no such folder or no image in it, InvalidInput when no reading fits, or images are
/// there for fewer than half of the keyframes without `allow_missing`.
PMSP_API std::unique_ptr<ImageSource> open_image_folder(const SlamMap& map, const std::filesystem::path& folder,
                                                        const ImageFolderOptions& options = {});

/// How frames of a video are matched with keyframes.
struct VideoOptions {
  double fps = 0.0;  ///< to turn timestamps into frame indices [1/s]; 0 = the map's camera's
  /// Added to the frame index. A value says that timestamps are counts of frames, or with `presentation_times` which
  /// frame is at time 0, of Unix times that of the first keyframe. nullopt: it is found.
  std::optional<std::int64_t> frame_offset = std::nullopt;
  bool presentation_times = false;  ///< timestamps are presentation times; excludes `fps`
  bool allow_missing = false;       ///< a video that reaches fewer than half of the keyframes is accepted
};

/// Frames of a video, decoded once, in order. A keyframe takes the frame whose presentation time is nearest to its
/// timestamp (not farther than half a frame), or the frame whose index is round(timestamp x fps). Both readings are
/// tried on a few frames (3000 at most), by the landmarks that they show, and where neither fits, with each constant
/// offset; of Unix times only differences count. Maps whose timestamps are all equal count by their source frames.
/// Without landmarks, the reading that the video's length allows is taken.
///
/// Throws IoError when the video cannot be opened or not one frame decoded; InvalidInput when nothing fits, readings
/// fit alike, a frame rate is needed and neither map nor options have one, or the video reaches fewer than half of the
/// keyframes without `allow_missing`.
PMSP_API std::unique_ptr<ImageSource> open_video(const SlamMap& map, const std::filesystem::path& video,
                                                 const VideoOptions& options = {});

}  // namespace pmsp
