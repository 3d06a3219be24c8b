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

/// Keyframe without a usable image.
struct SkippedKeyframe {
  std::int64_t keyframe_id = 0;
  std::string reason;
};

/// Sequential reader of the images of a map's keyframes.
class PMSP_API ImageSource {
 public:
  virtual ~ImageSource() = default;

  /// Returns the keyframes with an image, in the order of `next` (ascending timestamp). Keyframes beyond the end of a
  /// video are moved to `skipped` by `next`.
  virtual const std::vector<std::int64_t>& keyframe_ids() const = 0;

  /// Returns the keyframes without an image; complete when `next` has returned nullopt.
  virtual const std::vector<SkippedKeyframe>& skipped() const = 0;

  virtual const std::string& description() const = 0;  ///< message on the pairing of images and keyframes

  /// Image of a keyframe.
  struct Item {
    std::int64_t keyframe_id = 0;
    Image<Rgb> image;
  };
  /// Returns the next image, nullopt after the last one. Throws IoError if it cannot be decoded, InvalidInput if its
  /// size is not that of the map's camera up to a factor; further calls then continue with the following image.
  virtual std::optional<Item> next() = 0;

  /// File of an image, and the frame in it; "" = single image.
  struct Origin {
    std::filesystem::path file;
    std::string frame;
    /// Returns the file, for a frame VIDEO/FRAME.jpg: a name for masks and prior depth.
    std::filesystem::path name() const { return frame.empty() ? file : file / (frame + ".jpg"); }
  };
  /// Returns the origin of a keyframe's image. Equal file contents and frames give equal images, unless another
  /// keyframe takes the frame of a video first. Throws InvalidInput if the id is not in `keyframe_ids`.
  virtual Origin origin(std::int64_t keyframe_id) const = 0;

  /// Sets the number of images decoded in advance, by one thread per file; 0 (default) = none. Must precede `next`.
  virtual void read_ahead(int images) = 0;

  /// Restricts `keyframe_ids` and `next` to these keyframes, if possible without decoding others. Must precede `next`.
  virtual void restrict_to(const std::set<std::int64_t>& keyframe_ids) = 0;

  /// Returns another source with the same pairing. Must precede `next`. Throws IoError if a video cannot be opened
  /// again.
  virtual std::unique_ptr<ImageSource> reopen() const = 0;
};

/// Returns whether EXIF data rotate or mirror the image, as ImageSource applies. Throws IoError.
PMSP_API bool is_turned_by_exif(const std::filesystem::path& image);

/// Pairing of images in a directory and keyframes.
struct ImageFolderOptions {
  double fps = 0.0;  ///< rate of frame indices [1/s]; 0 = MapCamera::fps
  /// Offset of the frame index in a name to that of the timestamp; nullopt = meaning of names and offset are estimated.
  std::optional<std::int64_t> frame_offset = std::nullopt;
  bool allow_missing = false;  ///< accept images for fewer than half of the keyframes
};

/// Opens a directory of images (JPEG, PNG, TIFF, BMP, WebP).
///
/// Names from the map (`MapKeyframe::image`) are searched by their longest existing suffix; if none is found, with
/// other extensions. Without names in the map, the last number that differs between file names is a keyframe id (unless
/// ids are row numbers), a timestamp (seconds, milli-, micro- or nanoseconds, "SECONDS_NANOSECONDS") or a frame index:
/// timestamp x fps plus a constant, Unix times counted from the first keyframe. If several readings are possible,
/// landmarks in some images decide. Guesses of frame rate, unit of timestamps or equal order must be confirmed by
/// images or, without landmarks, pair all keyframes with all images. Of keyframes with the same timestamp the one with
/// the smallest id gets the image.
///
/// Throws IoError if the directory does not exist or contains no image; InvalidInput if no reading fits, or fewer than
/// half of the keyframes have images without `allow_missing`.
PMSP_API std::unique_ptr<ImageSource> open_image_folder(const SlamMap& map, const std::filesystem::path& folder,
                                                        const ImageFolderOptions& options = {});

/// Pairing of frames of a video and keyframes.
struct VideoOptions {
  double fps = 0.0;  ///< rate of frame indices [1/s]; 0 = MapCamera::fps
  /// Offset of the frame index to round(timestamp x fps), or with `presentation_times` the frame at time 0 (Unix times:
  /// at the first keyframe); nullopt = reading of timestamps and offset are estimated.
  std::optional<std::int64_t> frame_offset = std::nullopt;
  bool presentation_times = false;  ///< timestamps are presentation times; excludes `fps`
  bool allow_missing = false;       ///< accept frames for fewer than half of the keyframes
};

/// Opens a video, decoded once, in order. A keyframe gets the frame with the nearest presentation time (within half a
/// frame), or that with index round(timestamp x fps). Landmarks in at most 3000 frames decide between both and, if
/// neither fits, find a constant offset; of Unix times only differences count. If all timestamps are equal,
/// MapKeyframe::source_frame is used. Without landmarks, the length of the video decides.
///
/// Throws IoError if the video cannot be opened or no frame decoded; InvalidInput if no reading fits, several fit
/// equally, a frame rate is missing, or fewer than half of the keyframes have frames without `allow_missing`.
PMSP_API std::unique_ptr<ImageSource> open_video(const SlamMap& map, const std::filesystem::path& video,
                                                 const VideoOptions& options = {});

/// Reads a mask and scales it to `width` x `height`: black (0 in every channel; in a JPEG, less than half) = ignored
/// (0), any other colour = used (255). If colours mask nothing or all, or are those of a photo, an alpha channel
/// decides: transparent (less than half) = ignored. A scaled pixel is used only if all covered ones are.
///
/// Throws IoError; InvalidInput if the aspect ratio differs from that of the images, no pixel is used, or the file
/// looks like a photo or a depth map: over a tenth of its pixels outside the eight most frequent colours.
PMSP_API Image<std::uint8_t> read_mask(const std::filesystem::path& path, int width, int height);

/// Returns whether format and header of an image allow an alpha channel; false if it cannot be read.
PMSP_API bool may_have_alpha(const std::filesystem::path& image);

/// Sources of masks for the images of a mission.
struct MaskOptions {
  /// One of
  /// - an image for all keyframes, see read_mask;
  /// - a directory with a mask per image: "a/7.jpg.png" (COLMAP, OpenSfM), "a/7.png", "a/7_mask.png" (Metashape, ODM)
  /// or
  ///   "a/7.mask.png" (OpenMVS) for "a/7.jpg", also in other formats and without "a/"; none = all pixels used;
  /// - a YAML configuration (.yaml, .yml) of stella_vslam or OpenVSLAM with `mask_rectangles` [x_min, x_max, y_min,
  ///   y_max], as shares of width and height;
  /// - "", see `found`.
  std::filesystem::path path;
  std::filesystem::path images;  ///< directory of the images, base of names in a directory of masks
  double nadir_deg = 0.0;        ///< radius of an ignored cap at the nadir [deg], 0 to 90
  double zenith_deg = 0.0;       ///< radius of an ignored cap at the zenith [deg], 0 to 90
  /// Use of masks that come with the images: alpha channels and, without `path`, `named`, else a mask in the directory
  /// `masks` beside that of the images, else "7_mask.png" or "7.mask.png" beside the image.
  bool found = true;
  std::map<std::filesystem::path, std::filesystem::path> named{};  ///< MapKeyframe::mask by image
  bool named_are_instances = false;                                ///< SlamMap::masks_are_instances
};

/// Origins of masks, and the share that they hide. `summarise` samples at most 16 images with a mask.
struct MaskSummary {
  std::size_t images = 0;                        ///< number of images
  std::size_t in_folder = 0;                     ///< with a mask in the directory MaskOptions::path
  std::size_t named = 0;                         ///< with a mask named by the map
  std::size_t named_missing = 0;                 ///< with a missing mask named by the map
  std::filesystem::path first_missing;           ///< first missing mask
  std::size_t in_masks = 0;                      ///< with a mask in the directory `masks`
  std::size_t beside = 0;                        ///< with a mask beside the image
  std::filesystem::path first;                   ///< first file of a mask
  std::vector<std::filesystem::path> unmatched;  ///< files in the directory MaskOptions::path without an image
  std::size_t looked_at = 0;                     ///< number of sampled images, for the following fields
  std::size_t with_alpha = 0;                    ///< with an alpha channel that hides pixels
  bool by_alpha = false;                         ///< `first` is read from its alpha channel
  double hidden = 0.0;                           ///< ignored share of the sphere, mean, 0 to 1
  double least = 0.0, most = 0.0;                ///< minimum and maximum of `hidden` of an image
  double hidden_by_files = 0.0;  ///< mean share hidden by files alone, without alpha channels, rig and caps
  std::string colours;           ///< colours of `first`: "90 % #ffffff, 10 % #ff0000"
};

/// Masks of images, in the size of the image. Images are identified by ImageSource::Origin::name.
class PMSP_API MaskSource {
 public:
  /// Throws InvalidOption; IoError if the file or directory does not exist; InvalidInput if the YAML is invalid.
  explicit MaskSource(const MaskOptions& options);
  ~MaskSource();

  /// Sets the rig (RigMask::mask) hidden in all images, empty = none. Returns the previous one.
  Image<std::uint8_t> set_rig(Image<std::uint8_t> mask);

  bool is_folder() const;  ///< whether MaskOptions::path is a directory

  /// Returns the file of an image's mask, "" if none; alpha channels do not count.
  std::filesystem::path file_for(const std::filesystem::path& image) const;

  bool is_per_image(const std::filesystem::path& image) const;  ///< whether masks may differ between images

  bool has_mask(const std::filesystem::path& image) const;  ///< whether pixels may be ignored, without decoding

  /// Summarises masks of images of this size. Throws as read_mask; InvalidInput if a directory of masks fits no image.
  MaskSummary summarise(const std::vector<std::filesystem::path>& images, int width, int height);

  /// Returns the mask of an image, empty if all pixels are used; valid until the next call. Throws as read_mask.
  ImageView<const std::uint8_t> mask_for(const std::filesystem::path& image, int width, int height);

 private:
  void add_to_summary(const std::vector<std::filesystem::path>& images, int width, int height, MaskSummary& summary);

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmsp
