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

/// The stages of the Densifier as functions of plain data, on the CPU. They run the functors of the Densifier itself,
/// so that they give its bytes. One keyframe after the other:
/// 1. ViewFilter: whether the keyframe is worth a depth map.
/// 2. planes_from_landmarks, warp_planes: planes to start from.
/// 3. patchmatch, once without and then with maps of the neighbours and plane_priors.
/// 4. median_filter, weighted_median_filter, scores_without_priors, consistency_filter.
/// 5. fuse_pixels makes the points, free_space_filter removes those that other keyframes have looked through,
///    duplicate_round all but one of those that show the same place. Poses and scales are arguments: after a loop
///    closure the last two run again without matching.
///
/// `lens_distance`: as DensifierOptions::lens_distance, in the unit of the keyframes; the same in all calls.
namespace pmsp {

/// The threads and the instruction set that stages run on. Results never depend on the number of threads; AVX2 and
/// AVX-512 give the same. One executor serves one stage at a time; several executors do not disturb each other.
class PMSP_API Executor {
 public:
  /// `threads`: 1 to 1024, or 0 for one for each CPU that the process may use. Throws InvalidOption for other numbers,
  /// BackendUnavailable when this machine lacks the instruction set.
  explicit Executor(int threads = 0, Simd simd = Simd::kAuto);
  ~Executor();
  Executor(Executor&&) noexcept;
  Executor& operator=(Executor&&) noexcept;

  int threads() const;  ///< in force
  Simd simd() const;    ///< never kAuto

 private:
  friend struct Inside;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A keyframe's geometry as the stages work on it: a plane for each pixel, the vector v with v . X = 1 for the points X
/// of the plane, in the camera frame and the keyframe's unit. The range along a unit bearing b is 1 / (v . b), the unit
/// normal that faces the camera is -v / |v|. Zero = no plane. Where v . b is above 0 and below 1e-9, the
/// pixel is too far for any parallax, such as the sky. The images have one size, cover the whole sphere and are indexed
/// (column, row).
struct PlaneMap {
  PlaneMap() = default;
  /// Without planes.
  PlaneMap(int width, int height) : x(width, height), y(width, height), z(width, height), score(width, height) {}

  int width() const { return x.width(); }
  int height() const { return x.height(); }
  bool empty() const { return x.empty(); }

  std::int64_t keyframe_id = 0;
  RigidTransform cam_from_world;  ///< as it was when the keyframe was added
  double scale = 1.0;             ///< of the keyframe, likewise
  KeyframePose pose() const { return {cam_from_world, scale}; }
  Image<float> x, y, z;
  Image<float> score;  ///< photometric (NCC), up to 1, and what priors add (scores_without_priors)
};

/// Depth, normal and confidence of the planes; far pixels have none. `confidence`: of each pixel, 0 = leave it out;
/// nullptr = the score, 0 to
/// 1. Throws InvalidInput when sizes differ.
PMSP_API DepthMap depth_map_of(const PlaneMap& planes, const Image<float>* confidence, const Executor& executor);

/// The other way round; scores are the confidences.
PMSP_API PlaneMap plane_map_of(const DepthMap& map, const Executor& executor);

/// Normals of a depth map that has none, as DepthMap wants them: of the plane that fits the depths around a pixel,
/// those beyond an edge (a tenth of the depth) left out. The window is five samples wide and high, 1/640 of the circle
/// apart, at least a pixel. Facing the camera exactly where there is too little surface, never more slanted than 80
/// degrees. Depths out of range (0, not finite) count as none.
PMSP_API Image<Eigen::Vector3f> estimate_normals(const Image<float>& depth, const Executor& executor);

struct PanoramaData;

/// Resizes a mask: 255 where all that a target pixel covers is usable (nonzero), else 0.
PMSP_API Image<std::uint8_t> shrink_mask(ImageView<const std::uint8_t> mask, int width, int height);

/// A keyframe's image made ready for matching: colours on the grid of the depth map, and gray values, which may be
/// finer, on the six faces of a cube, which is how neighbours are looked up (one division instead of two arcus
/// functions a sample). Resampling averages over each pixel's area; near the poles, where columns crowd, over an area
/// as wide as at the equator.
class PMSP_API Panorama {
 public:
  /// `image`: equirectangular, any even size. `mask`: same size or empty; 0 = ignore. `width`, `height`: of the depth
  /// map, even. `image_scale`: see PatchMatchOptions. Throws InvalidInput.
  Panorama(ImageView<const Rgb> image, ImageView<const std::uint8_t> mask, int width, int height,
           const Executor& executor, double image_scale = PatchMatchOptions().image_scale);
  ~Panorama();
  Panorama(Panorama&&) noexcept;
  Panorama& operator=(Panorama&&) noexcept;

  int width() const;
  int height() const;

  /// Colours, `width` x `height`.
  const Image<Rgb>& color() const;

  /// 255 where a depth is wanted, 0 where the mask forbids it (a pixel that covers any masked pixel is masked); `width`
  /// x `height`; empty without a mask.
  const Image<std::uint8_t>& usable() const;

 private:
  friend struct Inside;
  std::unique_ptr<PanoramaData> data_;
};

/// Depths that single precision bears, in squares and products of three: what lies nearer or farther is passed over
/// [keyframe's unit].
constexpr double kMinDepth = 1e-6;
constexpr double kMaxDepth = 1e6;
inline bool is_usable_depth(double depth) { return depth >= kMinDepth && depth <= kMaxDepth; }

/// Smallest and largest range that a keyframe's pixels are looked for in.
struct DepthRange {
  double min = 0.0;
  double max = 0.0;
};

/// Range of the keyframe's landmarks in its own unit (2nd to 98th percentile), widened by `options.range_margin` at
/// both ends, from kMinDepth to kMaxDepth at most; {0, 0} when it observes none that lies between these.
PMSP_API DepthRange depth_range(const Keyframe& keyframe, const InitOptions& options);

/// Planes through the keyframe's landmarks, `width` x `height`: each pixel within `options.sparse_radius_px` of a
/// landmark gets the plane of the nearest one, perpendicular to the ray to it. Scores are 0.
PMSP_API PlaneMap planes_from_landmarks(const Keyframe& keyframe, int width, int height, const InitOptions& options,
                                        const Executor& executor, double lens_distance = 0.0);

/// The planes of one keyframe moved into another one, `width` x `height`: each is seen where its pixel's surface point
/// is; where several meet, the nearest to the camera wins. (Surmann et al. 2022, section III-B; normals turn with the
/// camera.) Scores are 0. Throws InvalidInput when a scale is out of range.
PMSP_API PlaneMap warp_planes(const PlaneMap& previous, const KeyframePose& pose, int width, int height,
                              const Executor& executor, double lens_distance = 0.0);

/// Parallax of the landmarks that two camera centres have in common.
struct CommonParallax {
  int landmarks = 0;        ///< observed from both
  int in_range = 0;         ///< with a parallax between the two angles
  double median_deg = 0.0;  ///< 0 without common landmarks
};

/// Parallax of a landmark = angle between the rays to it from the two centres. `a` and `b` need not be sorted.
PMSP_API CommonParallax common_parallax(const std::vector<Landmark>& a, const Eigen::Vector3d& center_a,
                                        const std::vector<Landmark>& b, const Eigen::Vector3d& center_b, double min_deg,
                                        double max_deg);

/// How sharply an image shows the surroundings of a landmark: squared differences of neighbouring pixels over the
/// variance of the patch, so that brightness and contrast do not matter. Blur lowers it.
struct LandmarkSharpness {
  std::int64_t id = 0;
  float horizontal = 0.0F;
  float vertical = 0.0F;
};

/// Accepts keyframes that see enough of what the newest accepted one saw from a usefully different place (Surmann et
/// al. 2022, section III-A). The first one is always accepted, and so is one that has landmarks but none in common, as
/// after a loss of tracking: it begins anew. One without landmarks is not.
///
/// Leaves out blurred ones too, where the keyframes around do without: while the newest accepted one shares half of its
/// landmarks and the parallax to it is below a quarter of `max_parallax_deg`. Landmarks seen in several images tell
/// blur from a lack of texture: the same spots lose their gradients.
class PMSP_API ViewFilter {
 public:
  /// `width`: of the depth maps, in whose pixels blur counts [px]; 0 = that of the images. Throws InvalidOption.
  explicit ViewFilter(const ViewFilterOptions& options, int width = 0);
  ~ViewFilter();
  ViewFilter(ViewFilter&&) noexcept;
  ViewFilter& operator=(ViewFilter&&) noexcept;

  /// Decides on the next keyframe; if accepted, it becomes the newest one. Without an image it counts as sharp.
  bool accept(const Keyframe& keyframe);

  /// Whether the last keyframe was left out for its blur alone.
  bool blurred() const;

  /// The next keyframe is accepted whatever it is.
  void reset();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A posed panorama. The pointers are not owned.
struct PosedPanorama {
  const Panorama* panorama = nullptr;
  KeyframePose pose;
};

/// What a depth map is made from. A first pass knows images only; in a further one, `start` and `neighbour_maps` are
/// what the pass before found, and planes score higher that agree with the neighbours' depth maps.
struct MatchInput {
  std::int64_t keyframe_id = 0;  ///< names the random numbers
  PosedPanorama reference;
  std::vector<PosedPanorama> neighbours;  ///< 1 to 8, of the reference's size, from other places
  DepthRange range;                       ///< [reference's unit]
  const PlaneMap* landmarks = nullptr;    ///< planes to try besides the random ones, of the reference's size
  const PlaneMap* warped = nullptr;       ///< likewise
  int first_iteration = 0;                ///< iterations of the passes before
  const PlaneMap* start = nullptr;        ///< the reference's own map; nullptr = random planes
  /// Planes of surfaces without texture (plane_priors), proposed and preferred there; nullptr = none.
  const PlaneMap* prior = nullptr;
  std::vector<const PlaneMap*> neighbour_maps = {};  ///< none, or one for each neighbour (nullptr or empty = not known)
  double lens_distance = 0.0;
};

/// Red-black PatchMatch on the sphere (Barnes et al. 2009; Galliani et al. 2015; Surmann et al. 2022): finds for each
/// unmasked pixel of the reference a plane under which its patch looks alike in the neighbours. Its score is the
/// photometric one (NCC, -1 to 1), less what the neighbours' depth maps have against it, and more by up to
/// 0.3 where it agrees with a prior. `seed` and the keyframe's id determine all random numbers. When
/// `cancel` becomes true, returns early with an empty map. Throws InvalidInput and InvalidOption.
PMSP_API PlaneMap patchmatch(const MatchInput& input, const PatchMatchOptions& options, std::uint64_t seed,
                             const Executor& executor, const std::atomic<bool>* cancel = nullptr);

/// Planes for the pixels of painted walls, ceilings and the like, where patches look alike under any plane: through
/// the reliable surface that surrounds them. `map` is what a pass of PatchMatch found in `panorama`, of the same size,
/// when it matched it with keyframes at `neighbours`, 1 to 8. Pixels get a plane where the picture alone does not tell
/// their depth: where their neighbourhood varies, besides a linear ramp, by a standard deviation of less than 1.5 gray
/// levels, or where what varies along the lines on which the neighbours see them move leaves the depth uncertain by
/// more than 2 %. A plane is proposed only if at least five of the first reliable points that lie around them in 16
/// directions, within 80 degrees, share it to 2 % of their depth (uncertain points to 6 %), three of which surround the
/// pixel or one whose plane explains the pixel's surroundings better. Points in front of the plane count less against
/// it than points behind it.
///
/// Others get (0, 0, 0), or where there is a `prior_depth` (see Keyframe) the plane that it has in and around a cell of
/// 1/160 of the sphere's width, corrected by how far the reliable points around are off it: only if three or more,
/// which count for 60 % of them, agree with each other to 10 % about that. Planes keep within `range` and to 80 degrees
/// between their normal and the ray. Throws InvalidInput when the sizes of map and panorama differ, or when there are
/// too few or too many neighbours. After the idea of a planar prior of Xu and Tao 2020 (ACMP).
PMSP_API PlaneMap plane_priors(const PlaneMap& map, const Panorama& panorama,
                               const std::vector<KeyframePose>& neighbours, const DepthRange& range,
                               const Executor& executor, ImageView<const float> prior_depth = {},
                               double lens_distance = 0.0);

/// Takes off `map`'s scores what `priors` have added in patchmatch(), up to 0.3; then they are cut off at 0 and 1. That
/// a plane agrees with a prior helps to choose it, and helps the median filters; it says nothing of how exact it is.
/// `map`: after the median filters; what consistency_filter tells of its errors is right only then. Throws InvalidInput
/// when the sizes differ.
PMSP_API PlaneMap scores_without_priors(const PlaneMap& map, const PlaneMap& priors, const Executor& executor);

struct FilterStats {
  std::int64_t before = 0;  ///< pixels with a plane
  std::int64_t after = 0;
};

/// Drops depths that deviate from the median of their 3 x 3 neighbourhood (around the seam and over the poles too) or
/// whose photometric score is too low. What stays keeps its plane; scores below 0 become 0. Throws InvalidOption.
PMSP_API PlaneMap median_filter(const PlaneMap& map, const MedianFilterOptions& options, const Executor& executor,
                                FilterStats* stats = nullptr);

/// Moves depth edges to where the image has them: each pixel that is off by more than 0.5 % takes the plane that gives
/// the weighted median of the depths around it (13 x 13 pixels, every other one; towards the poles wider). Planes count
/// the more the more similar their pixels' colours are, the nearer they are, and the better they match. Pixels without
/// a plane get one, but for those that `panorama`'s mask forbids. `map`: after the median filter. Source: Ma et al.
/// 2013, "Constant time weighted median filtering for stereo matching and beyond". Throws InvalidInput when the sizes
/// differ.
PMSP_API PlaneMap weighted_median_filter(const PlaneMap& map, const Panorama& panorama, const Executor& executor);

/// Drops depths on which fewer than `options.min_views` maps agree, `map` included; where fewer maps are at hand than
/// `options.window`, in proportion, and where the surfaces of some hide the point, as many as could see it (at least
/// one other). Drops also what as much speaks against as for: a map speaks against a depth if its surface lies clearly
/// behind the point, so that it has looked through it. Maps speak with the inverse fourth power of their camera's
/// distance from the point. A depth with others behind it on both sides is that of a thin thing: there a map may show
/// it up to two pixels beside its place. Returns confidences, 0 = dropped. They are made of the expected error (see
/// DepthMap), which grows with the spread of the maps that agree, with the deviation from the planes around, with what
/// a pixel of parallax is worth in depth and with the error of the poses, and falls with the share of maps that agree,
/// of those that could see the point, and with `map`'s photometric score. A point agrees with another map if that map's
/// surface in the point's direction is as far, within `options.max_relative_depth`. Without any other map confidences
/// are the scores. `map`, `others`: after the median filter, `map` with scores_without_priors; at most 30 others.
/// `pose_error`: of `map`'s keyframe, see Keyframe; 0 for the confidences that fuse_pixels and range_map take. Throws
/// InvalidOption, and InvalidInput when the maps differ in size.
PMSP_API Image<float> consistency_filter(const PlaneMap& map, const std::vector<const PlaneMap*>& others,
                                         const ConsistencyFilterOptions& options, const Executor& executor,
                                         FilterStats* stats = nullptr, double pose_error = 0.0,
                                         double lens_distance = 0.0);

/// How far a keyframe has seen: what is kept of its depth map for the rest of the mission, two bytes a pixel. One cell
/// stands for 2 x 2 pixels.
struct RangeMap {
  std::int64_t keyframe_id = 0;
  RigidTransform cam_from_world;  ///< as it was when the keyframe was added
  Image<float> nearest;           ///< smallest depth in the cell [keyframe's unit]; 0 = none known
  Image<float> farthest;          ///< largest depth
  double scale = 1.0;             ///< the keyframe's unit in scene units
};

/// `map`, of even size; `confidence`: from the consistency filter, 0 = no depth.
PMSP_API RangeMap range_map(const PlaneMap& map, const Image<float>& confidence, const Executor& executor);

/// A keyframe's map on its way through fusion; its images have one size.
struct FusionMap {
  const PlaneMap* map = nullptr;             ///< its own pose is not looked at
  const Image<float>* confidence = nullptr;  ///< from the consistency filter, 0 = no depth
  const Image<Rgb>* color = nullptr;
  KeyframePose pose;
  double pose_error = 0.0;  ///< see Keyframe; part of the confidence of the current keyframe's points
};

/// The points of a keyframe's pixels, and all that is kept of the keyframe until it is known which of them stay: with
/// windows of up to 9 maps 10 bytes a pixel (up to 17: 11), of which others read the first five. Encoded as
/// kernels/surfel.h says.
struct SurfelMap {
  std::int64_t keyframe_id = 0;
  Image<std::uint32_t> surfels;          ///< depth (to 0.013 %) and normal (2 degrees); 0 = no point
  Image<std::uint8_t> standings;         ///< confidence, and whether the pixel makes a point; so far all do
  Image<std::uint32_t> details;          ///< colour, confidence in the keyframe's own map, the rest of the normal
  std::vector<std::uint8_t> agree;       ///< `agree_bytes()` for each pixel, the lowest first; bit k: window_ids[k]
  std::vector<std::int64_t> window_ids;  ///< keyframe ids of the other maps
  int agree_bytes() const { return static_cast<int>((window_ids.size() + 7) / 8); }
};

/// Makes a point of each pixel of `window[current]` whose confidence is at least `options.min_confidence`, and that
/// gives way to none around (`options.suppression`): depth, normal and colour are averages over the maps that agree,
/// weighted with the inverse square of their expected errors (confidence, times the distance). `window`: 33 maps at
/// most, of one size. Throws InvalidOption, and InvalidInput when sizes differ, something is missing, a scale is out of
/// range or `current` is not in the window.
PMSP_API SurfelMap fuse_pixels(const std::vector<FusionMap>& window, std::size_t current, const FusionOptions& options,
                               const Executor& executor, double lens_distance = 0.0);

/// A keyframe that is asked about another one's points.
struct RangeMapFrom {
  const RangeMap* ranges = nullptr;  ///< its own pose is not looked at
  KeyframePose pose;
};

/// Removes floaters: points that other keyframes have looked through. Each viewer has the point on its surface (within
/// `max_relative_depth`), or has seen a surface behind it (farther than `min_relative_gap` behind), or has no say. Both
/// sides are added up, each keyframe with the inverse fourth power of its distance from the point, the point's own one
/// among those that confirm; a point stays while what speaks against it is at most `max_contradiction` of what speaks
/// for it. What stays has its confidence scaled by the share that speaks for it. What mirrors show goes as well
/// (kernels/mirror.h).
///
/// Returns the standings: points that stay are open, the others make no point. May be asked again at any time, with
/// other poses. `viewers`: of the same size. Throws InvalidOption,
/// InvalidInput.
PMSP_API Image<std::uint8_t> free_space_filter(const SurfelMap& map, const KeyframePose& pose,
                                               const std::vector<RangeMapFrom>& viewers,
                                               const FreeSpaceOptions& options, const Executor& executor,
                                               double lens_distance = 0.0);

/// A keyframe's points and what has been decided of them so far.
struct SurfelsFrom {
  const SurfelMap* map = nullptr;                  ///< its own standings are not looked at
  const Image<std::uint8_t>* standings = nullptr;  ///< from fuse_pixels, free_space_filter or a round
  KeyframePose pose;
};

/// One round that decides which pixels of `reference` make a point. A pixel asks for eligible ones of the viewers that
/// show the same side of the same surface within `options.spacing_px` of its own pixels and come first in the order:
/// finer sampling (by octaves), higher confidence, smaller keyframe id. Where one of these is known to make a point the
/// pixel makes none; where there is none left that may, it makes one; else it stays open. What is open after the last
/// round makes a point. (Rounds as in Luby 1986, with this order in place of random numbers.)
///
/// Returns the standings after the round. All standings that go in are those after the round before. `asked`: empty
/// before the first round; of each pixel that is open then, in row order, bit k: viewers[k] may still own its place.
/// `viewers`: 32 at most, in each round the same ones in the same order; those without a map are not asked. Throws
/// InvalidOption, and InvalidInput also where `asked` does not go with the standings.
PMSP_API Image<std::uint8_t> duplicate_round(const SurfelsFrom& reference, std::vector<std::uint32_t>& asked,
                                             const std::vector<SurfelsFrom>& viewers, const FusionOptions& options,
                                             const Executor& executor, double lens_distance = 0.0);

/// The points that a keyframe makes, in the order of its pixels, with their keys. Needs all of the map.
PMSP_API KeyframeCloud kept_points(const SurfelsFrom& points, double lens_distance = 0.0);

}  // namespace pmsp
