// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "pmsp/api.h"
#include "pmsp/io/map.h"
#include "pmsp/types.h"

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

/// Reads a mask: black (0 in every channel; in a JPEG, less than half) = ignore, any other colour = use. Where the
/// colours ignore nothing or everything, or are those of a photo, an alpha channel decides: transparent (less than
/// half) = ignore. It is scaled to `width` x `height` without growing what may be used: a pixel is used (255, else 0)
/// only if all that it covers is. Throws IoError, or InvalidInput when the shape is not that of the images, the mask
/// leaves no pixel, or the file looks like a photo or a depth map: a tenth of its pixels lie outside its eight
/// commonest colours.
PMSP_API Image<std::uint8_t> read_mask(const std::filesystem::path& path, int width, int height);

/// Whether an image's format and header allow for an alpha channel; false where it cannot be read.
PMSP_API bool may_have_alpha(const std::filesystem::path& image);

/// What is to be ignored in the images of a mission.
struct MaskOptions {
  /// Empty: what `found` says. An image as read_mask takes it, for all images. A folder with one for each: image
  /// "a/7.jpg" has "a/7.jpg.png" (COLMAP, OpenSfM), "a/7.png", "a/7_mask.png" (Metashape, ODM), "a/7.mask.png"
  /// (OpenMVS), or one of these names in another image format, or without "a/"; an image without one is used as a
  /// whole. A YAML configuration of stella_vslam or OpenVSLAM (.yaml, .yml): its `mask_rectangles`, each [x_min, x_max,
  /// y_min, y_max] as shares of width and height.
  std::filesystem::path path;
  std::filesystem::path images;  ///< the folder that images lie in; names in a folder of masks are relative to it
  double nadir_deg = 0.0;        ///< radius of a cap around the lowest row that is ignored, too, 0 to 90 [deg]
  double zenith_deg = 0.0;       ///< of one around the highest row, 0 to 90 [deg]
  /// Whether masks that come with the images count: the alpha channel of an image always; without a `path` also what
  /// the map names for it, else a mask in the folder `masks` beside that of the images, else "7_mask.png" or
  /// "7.mask.png" beside it.
  bool found = true;
  std::map<std::filesystem::path, std::filesystem::path> named{};  ///< the mask that the map names, by image
};

/// Where masks of images were found, and how much they hide.
struct MaskSummary {
  std::size_t images = 0;                        ///< all
  std::size_t in_folder = 0;                     ///< with a mask in the folder of MaskOptions::path
  std::size_t named = 0;                         ///< with one that the map names
  std::size_t named_missing = 0;                 ///< whose mask, as the map names it, is not there
  std::filesystem::path first_missing;           ///< the first of these masks
  std::size_t in_masks = 0;                      ///< with one in the folder `masks` beside that of the images
  std::size_t beside = 0;                        ///< with one beside the image
  std::filesystem::path first;                   ///< the first file of a mask
  std::vector<std::filesystem::path> unmatched;  ///< in the folder of MaskOptions::path, but of no image
  std::size_t looked_at = 0;                     ///< images with a mask that what follows is of
  std::size_t with_alpha = 0;                    ///< of these, images whose alpha channel hides something
  bool by_alpha = false;                         ///< the first file of a mask is read from its alpha channel
  double hidden = 0.0;                           ///< share of the sphere that is ignored, mean, 0 to 1
  double least = 0.0, most = 0.0;                ///< the same of one image
  double hidden_by_files = 0.0;                  ///< the same of the files alone, without alpha and caps, mean
  std::string colours;                           ///< of `first`, for people: "90 % #ffffff, 10 % #ff0000"
};

/// Gives each image its mask, in the image's size.
class PMSP_API MaskSource {
 public:
  /// Throws InvalidOption, IoError where there is no such file or folder, InvalidInput where it is no such YAML.
  explicit MaskSource(const MaskOptions& options);
  ~MaskSource();

  /// Hides these pixels in all images, too (0 = ignore), scaled to their size; empty = none.
  void set_rig(Image<std::uint8_t> mask);

  bool is_folder() const;  ///< MaskOptions::path is one

  /// What the mask of an image is read from, its alpha channel apart; empty where nothing is.
  std::filesystem::path file_for(const std::filesystem::path& image) const;

  /// Whether file_for, and thereby the mask, may differ from image to image.
  bool is_per_image(const std::filesystem::path& image) const;

  /// Whether anything of the image may be ignored, by what is known without decoding.
  bool has_mask(const std::filesystem::path& image) const;

  /// Looks at all masks of the images, or at 16 of them, evenly spread, as they are in images of that size. Throws as
  /// read_mask; InvalidInput where a folder of masks has none for any of them.
  MaskSummary look(const std::vector<std::filesystem::path>& images, int width, int height);

  /// Empty where nothing is to be ignored; stays until the next call. Throws as read_mask.
  ImageView<const std::uint8_t> mask_for(const std::filesystem::path& image, int width, int height);

 private:
  void look_at(const std::vector<std::filesystem::path>& images, int width, int height, MaskSummary& summary);

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
