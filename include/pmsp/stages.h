// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "pmsp/api.h"
#include "pmsp/options.h"
#include "pmsp/types.h"

/// The stages of the Densifier as functions of plain data, with the results of its CPU backend, bit by bit. For each
/// keyframe:
/// 1. ViewFilter: selection.
/// 2. planes_from_landmarks, warp_planes: initial planes.
/// 3. patchmatch: a first pass, then geometric passes with the maps of the source views and plane_priors.
/// 4. median_filter, weighted_median_filter, subtract_priors, consistency_filter.
/// 5. fuse_pixels, range_map, free_space_filter, duplicate_round, extract_points. After a loop closure, the free-space
///    test and duplicate removal run again with the new poses, without matching.
///
/// `lens_distance`: see DensifierOptions::lens_distance; the same in all calls.
namespace pmsp {

/// Threads and instruction set of the stages. Results do not depend on the number of threads, and are the same with
/// AVX2 and AVX-512. An executor runs one stage at a time; several are independent.
class PMSP_API Executor {
 public:
  /// `threads`: 1 to 1024; 0 = one per CPU available to the process. Throws InvalidOption for other numbers,
  /// BackendUnavailable if the machine lacks the instruction set.
  explicit Executor(int threads = 0, Simd simd = Simd::kAuto);
  ~Executor();
  Executor(Executor&&) noexcept;
  Executor& operator=(Executor&&) noexcept;

  int threads() const;  ///< number of threads in use
  Simd simd() const;    ///< never kAuto

 private:
  friend struct ImplAccess;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Plane map of a keyframe. The plane of a pixel is the vector v with v . X = 1 for its points X, in camera frame and
/// unit of the keyframe; 0 = none. The range along a unit bearing b is 1 / (v . b), the unit normal facing the camera
/// -v / |v|. 0 < v . b < 1e-9 is a far plane: too far for parallax, such as sky. The images have one size, cover the
/// whole sphere and are indexed (column, row).
struct PlaneMap {
  PlaneMap() = default;
  PlaneMap(int width, int height) : x(width, height), y(width, height), z(width, height), score(width, height) {}

  int width() const { return x.width(); }
  int height() const { return x.height(); }
  bool empty() const { return x.empty(); }

  std::int64_t keyframe_id = 0;
  RigidTransform cam_from_world;  ///< pose when the keyframe was added
  double scale = 1.0;             ///< scale when the keyframe was added
  KeyframePose pose() const { return {cam_from_world, scale}; }
  Image<float> x, y, z;
  Image<float> score;  ///< NCC, at most 1, less geometric penalty, plus prior bonus: see patchmatch
};

/// Converts planes to depth, normal and confidence; far pixels get none. `confidence`: of each pixel, 0 = no depth;
/// nullptr = the score, clamped to 0 to 1. Throws InvalidInput if sizes differ.
PMSP_API DepthMap depth_map_of(const PlaneMap& planes, const Image<float>* confidence, const Executor& executor);

/// Converts a depth map to planes, with confidences as scores.
PMSP_API PlaneMap plane_map_of(const DepthMap& map, const Executor& executor);

/// Estimates DepthMap::normal from depths: the plane that fits 5 x 5 samples, 1/640 of the circle and at least a pixel
/// apart, without those beyond an edge (a tenth of the depth). Normals are at most 80 degrees from the direction to
/// the camera, and point to it if there are too few samples. Depths out of range (0, not finite) are ignored.
PMSP_API Image<Eigen::Vector3f> estimate_normals(const Image<float>& depth, const Executor& executor);

struct PanoramaData;

/// Resizes a mask: 255 where all covered pixels are used (nonzero), else 0.
PMSP_API Image<std::uint8_t> shrink_mask(ImageView<const std::uint8_t> mask, int width, int height);

/// Image prepared for matching: colours on the grid of the depth map, gray levels, up to `image_scale` times finer, on
/// a cube map. Resampling averages over the area of a pixel, towards the poles as wide as at the equator.
class PMSP_API Panorama {
 public:
  /// `image`: equirectangular, of even size. `mask`: of the same size, 0 = ignored; empty = none. `width`, `height`: of
  /// the depth map, even. `image_scale`: see PatchMatchOptions. Throws InvalidInput.
  Panorama(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask, int width, int height,
           const Executor& executor, double image_scale = PatchMatchOptions().image_scale);
  ~Panorama();
  Panorama(Panorama&&) noexcept;
  Panorama& operator=(Panorama&&) noexcept;

  int width() const;
  int height() const;

  const Image<Rgb>& color() const;  ///< `width` x `height`

  const Image<std::uint8_t>& mask() const;  ///< mask as by shrink_mask, `width` x `height`; empty = none

 private:
  friend struct ImplAccess;
  std::unique_ptr<PanoramaData> data_;
};

/// Range of depths whose squares and triple products fit single precision [keyframe's unit]; others are ignored.
constexpr double kMinDepth = 1e-6;
constexpr double kMaxDepth = 1e6;
inline bool is_usable_depth(double depth) { return depth >= kMinDepth && depth <= kMaxDepth; }

/// Depth range of a keyframe's pixels [keyframe's unit].
struct DepthRange {
  double min = 0.0;
  double max = 0.0;
};

/// Returns the depth range of the landmarks [keyframe's unit]: 2nd to 98th percentile, widened by
/// `options.range_margin` at both ends, clamped to kMinDepth and kMaxDepth; {0, 0} without a landmark between these.
PMSP_API DepthRange depth_range(const Keyframe& keyframe, const InitOptions& options);

/// Returns planes through landmarks, perpendicular to their rays; each pixel within `options.sparse_radius_px` gets
/// that of the nearest one. Scores are 0.
PMSP_API PlaneMap planes_from_landmarks(const Keyframe& keyframe, int width, int height, const InitOptions& options,
                                        const Executor& executor, double lens_distance = 0.0);

/// Warps planes into another keyframe, each to the pixel of its surface point; the nearest to the camera wins (Surmann
/// et al. 2022, section III-B, with normals rotated). Scores are 0. Throws InvalidInput if a scale is out of range.
PMSP_API PlaneMap warp_planes(const PlaneMap& previous, const KeyframePose& pose, int width, int height,
                              const Executor& executor, double lens_distance = 0.0);

/// Parallax of common landmarks of two keyframes.
struct CommonParallax {
  int landmarks = 0;        ///< number of common landmarks
  int in_range = 0;         ///< number with a parallax between the two angles
  double median_deg = 0.0;  ///< median parallax; 0 without common landmarks
};

/// Parallax is the angle between the rays from both centres to a landmark. `a` and `b` need not be sorted.
PMSP_API CommonParallax common_parallax(const std::vector<Landmark>& a, const Eigen::Vector3d& center_a,
                                        const std::vector<Landmark>& b, const Eigen::Vector3d& center_b, double min_deg,
                                        double max_deg);

/// Sharpness around a landmark: squared differences of adjacent pixels over the variance of the patch.
struct LandmarkSharpness {
  std::int64_t id = 0;
  float horizontal = 0.0F;
  float vertical = 0.0F;
};

/// Accepts the first keyframe, those with enough useful parallax to the newest accepted one (Surmann et al. 2022,
/// section III-A), and those that have landmarks, but none in common with it (tracking loss).
///
/// Rejects blurred keyframes if overlap suffices without them: half of the landmarks in common with the newest accepted
/// one, and a parallax below a quarter of `max_parallax_deg`. Sharpness is compared at common landmarks, so that lack
/// of texture is not taken for blur.
class PMSP_API ViewFilter {
 public:
  /// `width`: of the depth maps, for the measure of blur [px]; 0 = of the images. Throws InvalidOption.
  explicit ViewFilter(const ViewFilterOptions& options, int width = 0);
  ~ViewFilter();
  ViewFilter(ViewFilter&&) noexcept;
  ViewFilter& operator=(ViewFilter&&) noexcept;

  bool accept(const Keyframe& keyframe);  ///< whether it is accepted; without image it counts as sharp

  bool blurred() const;  ///< whether the last keyframe was rejected only because of blur

  void reset();  ///< restarts: the next keyframe is accepted as the first one

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Panorama with pose; non-owning.
struct PosedPanorama {
  const Panorama* panorama = nullptr;
  KeyframePose pose;
};

/// Input of a pass of PatchMatch. In a geometric pass `start` and `neighbour_maps` are results of the previous pass.
struct MatchInput {
  std::int64_t keyframe_id = 0;  ///< selects the random numbers, with the seed
  PosedPanorama reference;
  std::vector<PosedPanorama> neighbours;             ///< source views, 1 to 8, of the same size, at other positions
  DepthRange range;                                  ///< [reference's unit]
  const PlaneMap* landmarks = nullptr;               ///< planes_from_landmarks, of the same size; nullptr = none
  const PlaneMap* warped = nullptr;                  ///< warp_planes, of the same size; nullptr = none
  int first_iteration = 0;                           ///< number of iterations of previous passes
  const PlaneMap* start = nullptr;                   ///< map of the reference view; nullptr = random planes
  const PlaneMap* prior = nullptr;                   ///< result of plane_priors; nullptr = none
  std::vector<const PlaneMap*> neighbour_maps = {};  ///< none, or one per source view (nullptr or empty = unknown)
  double lens_distance = 0.0;
};

/// Red-black PatchMatch on the sphere (Barnes et al. 2009; Galliani et al. 2015; Surmann et al. 2022): returns for each
/// unmasked pixel of the reference view the plane of the best score: NCC (-1 to 1), less a penalty for disagreement
/// with the maps of the source views, plus up to 0.3 (1 for far priors) for agreement with a prior. `seed` and the
/// keyframe id determine all random numbers. Returns early with an empty map when `cancel` becomes true. Throws
/// InvalidInput, InvalidOption.
PMSP_API PlaneMap patchmatch(const MatchInput& input, const PatchMatchOptions& options, std::uint64_t seed,
                             const Executor& executor, const std::atomic<bool>* cancel = nullptr);

/// Returns prior planes for untextured surfaces, after the planar prior of Xu and Tao 2020 (ACMP). `map`: result of a
/// pass over `panorama`, of the same size, with source views at `neighbours`, 1 to 8.
///
/// Pixels get a prior plane if their image evidence is insufficient: deviation from a linear ramp below 1.5 gray levels
/// (up to 3 in noisy images), or an expected depth error, from epipolar lines, above 2 %. Supports are the first
/// reliable pixels in 16 directions, within 80 degrees. At least five must lie on the plane within 2 % of their depth
/// (uncertain ones 6 %), three of which surround the pixel; planes of other pixels are taken if they explain its
/// surroundings better. Supports in front of the plane count less against it than those behind.
///
/// Other pixels get (0, 0, 0) or, with `prior_depth` (see Keyframe), the plane that fits its depths in and around a
/// cell of 1/160 of the width, scaled to the supports around: at least three, with 60 % of their weight, must agree on
/// the scale within 10 %. Planes lie within `range`, their normals within 80 degrees of the ray. Throws InvalidInput if
/// sizes differ or the number of `neighbours` is wrong.
PMSP_API PlaneMap plane_priors(const PlaneMap& map, const Panorama& panorama,
                               const std::vector<KeyframePose>& neighbours, const DepthRange& range,
                               const Executor& executor, ImageView<const float> prior_depth = {},
                               double lens_distance = 0.0);

/// Subtracts the bonus of `priors` in patchmatch() from the scores and clamps them to 0 to 1: agreement with a prior
/// helps selection and median filters, but is no evidence of accuracy. To be called after the median filters and before
/// consistency_filter. Throws InvalidInput if sizes differ.
PMSP_API PlaneMap subtract_priors(const PlaneMap& map, const PlaneMap& priors, const Executor& executor);

struct FilterStats {
  std::int64_t before = 0;  ///< pixels with a plane
  std::int64_t after = 0;
};

/// Drops planes whose depth deviates from the median of 3 x 3 pixels (also across seam and poles) or whose photometric
/// score is too low. Scores below 0 become 0. Throws InvalidOption.
PMSP_API PlaneMap median_filter(const PlaneMap& map, const MedianFilterOptions& options, const Executor& executor,
                                FilterStats* stats = nullptr);

/// Moves depth edges to image edges: each pixel that deviates by more than 0.5 % from the weighted median of the depths
/// around it (every other of 13 x 13 pixels, wider towards the poles), weighted by colour, distance and
/// score. Unmasked pixels without a plane get one. `map`: after the median filter. Reference: Ma et al. 2013, "Constant
/// time weighted median filtering for stereo matching and beyond". Throws InvalidInput if sizes differ.
PMSP_API PlaneMap weighted_median_filter(const PlaneMap& map, const Panorama& panorama, const Executor& executor);

/// Compares a plane map with others along the ray and returns confidences, 0 = dropped. `map`, `others`: after the
/// median filters, `map` after subtract_priors; at most 30 others. `pose_error`: see Keyframe; 0 for confidences
/// that are passed to fuse_pixels and range_map.
///
/// A map agrees with a point if its surface in that direction is as far within `options.max_relative_depth`, and
/// contradicts it if clearly farther (seen through). A point needs the agreement of `options.min_views` maps, `map`
/// included, less in proportion if there are fewer maps than `options.window`, or of all in which it is not occluded,
/// at least one other; and more weight of these than of contradictions; weights are the inverse fourth power of the
/// distance of camera and point. Thin structures, in front of the pixels on both sides, may be up to two pixels off in
/// other maps.
///
/// Confidence follows from the expected error (see DepthMap): spread of agreeing maps, deviation of surrounding planes,
/// depth resolution at the parallax, `pose_error`, share of agreeing among unhidden maps, photometric score. Without
/// other maps it is the score. Throws InvalidOption; InvalidInput if sizes differ.
PMSP_API Image<float> consistency_filter(const PlaneMap& map, const std::vector<const PlaneMap*>& others,
                                         const ConsistencyFilterOptions& options, const Executor& executor,
                                         FilterStats* stats = nullptr, double pose_error = 0.0,
                                         double lens_distance = 0.0);

/// Range map of a keyframe for the free-space test, with cells of 2 x 2 pixels: two bytes per pixel.
struct RangeMap {
  std::int64_t keyframe_id = 0;
  RigidTransform cam_from_world;  ///< pose when the keyframe was added
  Image<float> nearest;           ///< smallest depth in the cell [keyframe's unit]; 0 = none
  Image<float> farthest;          ///< largest depth
  double scale = 1.0;             ///< the keyframe's unit in map units
};

/// `map`: of even size. `confidence`: of consistency_filter, 0 = no depth.
PMSP_API RangeMap range_map(const PlaneMap& map, const Image<float>& confidence, const Executor& executor);

/// Input of fuse_pixels; images of one size.
struct FusionMap {
  const PlaneMap* map = nullptr;             ///< its pose is ignored
  const Image<float>* confidence = nullptr;  ///< of consistency_filter, 0 = no depth
  const Image<Rgb>* color = nullptr;
  KeyframePose pose;
  double pose_error = 0.0;  ///< see Keyframe; used for the current keyframe
};

/// Points of a keyframe before free-space test and duplicate removal, encoded as in kernels/surfel.h: 10 bytes per
/// pixel with windows of up to 9 maps, 11 up to 17. Other keyframes need `surfels` and `statuses` only.
struct SurfelMap {
  std::int64_t keyframe_id = 0;
  Image<std::uint32_t> surfels;          ///< depth (to 0.013 %) and normal (2 degrees); 0 = no point
  Image<std::uint8_t> statuses;          ///< confidence, and status: open
  Image<std::uint32_t> details;          ///< colour, confidence of the depth map, low bits of the normal
  std::vector<std::uint8_t> agree;       ///< `agree_bytes()` per pixel, little endian; bit k: window_ids[k]
  std::vector<std::int64_t> window_ids;  ///< other keyframes of the fusion window
  int agree_bytes() const { return static_cast<int>((window_ids.size() + 7) / 8); }
};

/// Returns a point for each pixel of `window[current]` with a confidence of at least `options.min_confidence` that is
/// not suppressed (`options.suppression`). Depth, normal and colour are averages over agreeing maps, weighted by the
/// inverse square of the expected error (from confidence, times distance). `window`: at most 33 maps of one size.
/// Throws InvalidOption; InvalidInput if sizes differ, data are missing, or a scale or `current` is out of range.
PMSP_API SurfelMap fuse_pixels(const std::vector<FusionMap>& window, std::size_t current, const FusionOptions& options,
                               const Executor& executor, double lens_distance = 0.0);

/// Viewer of the free-space test.
struct PosedRangeMap {
  const RangeMap* ranges = nullptr;  ///< its pose is ignored
  KeyframePose pose;
};

/// Free-space test: returns the status of all pixels, open or none for removed points. A viewer confirms a point on its
/// surface (within `max_relative_depth`) and contradicts it if its surface is farther (by more than
/// `min_relative_gap`). Weights are the inverse fourth power of the distance from the point; the keyframe itself
/// confirms. Points are removed if contradictions exceed `max_contradiction` times the confirmations, and if they are
/// mirror images (kernels/mirror.h). Confidence is multiplied by the confirming share.
///
/// May be repeated with other poses. `viewers`: at most 32, of the same size. Throws InvalidOption, InvalidInput.
PMSP_API Image<std::uint8_t> free_space_filter(const SurfelMap& map, const KeyframePose& pose,
                                               const std::vector<PosedRangeMap>& viewers,
                                               const FreeSpaceOptions& options, const Executor& executor,
                                               double lens_distance = 0.0);

/// Points of a keyframe with their current status.
struct PosedSurfels {
  const SurfelMap* map = nullptr;                 ///< its `statuses` are ignored
  const Image<std::uint8_t>* statuses = nullptr;  ///< of fuse_pixels, free_space_filter or duplicate_round
  KeyframePose pose;
};

/// Round of duplicate removal (maximal independent set, Luby 1986, with ranks instead of random numbers): returns the
/// new status of the pixels of `reference`. Duplicates of a pixel are points of the `others` on the same side of the
/// same surface, within `options.spacing_px` of its pixels, of better rank: finer sampling (by octaves), then higher
/// confidence, then smaller keyframe id. A pixel is dropped if a duplicate is kept, kept if none is kept or open, else
/// stays open. Pixels that are open after the last round count as kept.
///
/// All inputs have the status of the previous round. `candidates`: empty before the first round; for each open pixel,
/// in row order, bit k is set while others[k] may contain a duplicate. `others`: at most 32, the same in each round;
/// those without map are ignored. Throws InvalidOption; InvalidInput also if `candidates` does not match the status.
PMSP_API Image<std::uint8_t> duplicate_round(const PosedSurfels& reference, std::vector<std::uint32_t>& candidates,
                                             const std::vector<PosedSurfels>& others, const FusionOptions& options,
                                             const Executor& executor, double lens_distance = 0.0);

/// Returns the kept and open points of a keyframe, in the order of its pixels, with their keys. Needs the complete map.
PMSP_API KeyframeCloud extract_points(const PosedSurfels& points, double lens_distance = 0.0);

}  // namespace pmsp
