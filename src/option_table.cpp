// SPDX-License-Identifier: BSD-2-Clause
#include "option_table.h"

#include "patch.h"
#include "pmsp/types.h"
#include "ranges.h"

namespace pmsp {
namespace {

constexpr double kMostSeed = 18446744073709551615.0;

/// Radius of a disc that covers one pixel [px]: in the paper's program a point changes its pixel only.
constexpr double kOnePixel = 0.56;

/// Builder of the table, one row per option.
class Table {
 public:
  void stage(const char* name) { stage_ = name; }

  Table& option(const char* key, OptionEntry::Access access, const char* help) {
    rows.push_back({key, stage_, help, access});
    return *this;
  }
  Table& key(const char* key) { return set(&OptionEntry::key, key); }
  Table& short_name(const char* name) { return set(&OptionEntry::short_name, name); }
  Table& unit(const char* unit) { return set(&OptionEntry::unit, unit); }
  Table& range(double min, double max) { return set(&OptionEntry::min, min).set(&OptionEntry::max, max); }
  Table& even() { return set(&OptionEntry::numbers, OptionEntry::Numbers::kEven); }
  Table& odd() { return set(&OptionEntry::numbers, OptionEntry::Numbers::kOdd); }
  Table& allows_zero() { return set(&OptionEntry::allows_zero, true); }
  Table& normal(double value) { return preset(Quality::kNormal, value); }
  Table& high(double value) { return preset(Quality::kHigh, value); }
  Table& paper(double value) { return preset(Quality::kPaper, value); }

  std::vector<OptionEntry> rows;

 private:
  template <class T>
  Table& set(T OptionEntry::*member, T value) {
    rows.back().*member = value;
    return *this;
  }
  Table& preset(Quality quality, double value) {
    rows.back().presets[static_cast<std::size_t>(quality)] = value;
    return *this;
  }

  const char* stage_ = "";
};

#define PMSP_OPTION_OF(owner, field, help) \
  table.option(                            \
      #field, +[](DensifierOptions & o) -> auto& { return (owner).field; }, help)
#define PMSP_OPTION(field, help) PMSP_OPTION_OF(o, field, help)
#define PMSP_ADVANCED_OPTION(field, help) PMSP_OPTION_OF(o.advanced, field, help)

// Defaults are those of the structs, and the preset `online`. `paper` follows Surmann et al. 2022, with the values of
// their program if the paper has none, but without its defects: a blind strip at the seam, a depth range that ends at
// the ninth decile, planes that are not rotated with the camera.

void machine(Table& table) {
  table.stage("Size and machine");
  PMSP_OPTION(width, "Width of the depth maps; 0 = that of the images, enlarged by 1.5 up to 1440, at most 5760")
      .unit("px")
      .range(32, 16384)
      .even()
      .allows_zero()
      .normal(1440)
      .high(0);
  PMSP_OPTION(height, "Height of the depth maps; 0, or only a width: by the aspect ratio of the images")
      .unit("px")
      .range(16, 8192)
      .even()
      .allows_zero()
      .normal(720)
      .high(0);
  PMSP_OPTION(seed, "Seed of the random numbers; same input, seed, backend and simd give the same bytes")
      .range(0, kMostSeed);
  PMSP_OPTION(
      backend,
      "Processor of the stages; auto: CUDA if built in, with a usable device of sufficient memory, else the CPU");
  PMSP_OPTION(devices, "CUDA devices that share the work, as numbered by the driver; same results as with one")
      .key("device")
      .range(0, 255);
  PMSP_ADVANCED_OPTION(pipelined,
                       "CUDA: copies and kernels of successive keyframes overlap; results come one keyframe later");
  PMSP_OPTION(threads, "Number of threads; 0 = one per CPU available to the process").range(1, 1024).allows_zero();
  PMSP_OPTION(simd, "Instruction set; auto: the widest of the machine");
  PMSP_OPTION(lens_distance,
              "Distance of the camera's two lenses along its forward axis, for panoramas stitched as if both had one "
              "centre; 0 = one centre; estimated by default")
      .unit("map units")
      .range(-kMaxPosition, kMaxPosition);
  PMSP_OPTION(unordered, "The keyframes are a set without temporal order, such as photos");
}

void view_filter(Table& table) {
  table.stage("View filter");
  PMSP_ADVANCED_OPTION(view_filter.enabled,
                       "Rejection of keyframes with too little or too much parallax, and of blurred ones");
  PMSP_ADVANCED_OPTION(view_filter.min_parallax_deg, "Minimum useful parallax of a landmark").unit("deg").range(0, 180);
  PMSP_ADVANCED_OPTION(view_filter.max_parallax_deg, "Maximum useful parallax of a landmark").unit("deg").range(0, 180);
  PMSP_ADVANCED_OPTION(view_filter.min_share,
                       "Minimum share of common landmarks with useful parallax; larger values accept fewer keyframes")
      .range(0, 1)
      .paper(0.2);
  PMSP_ADVANCED_OPTION(
      view_filter.min_sharpness,
      "Minimum sharpness relative to the last accepted keyframes; 0 = no rejection of blurred keyframes")
      .range(0, 1)
      .paper(0);
}

void init(Table& table) {
  table.stage("Initialisation");
  PMSP_ADVANCED_OPTION(init.sparse_points, "Initial planes through the landmarks of the keyframe");
  PMSP_ADVANCED_OPTION(init.sparse_radius_px, "Radius around a landmark that gets its plane")
      .unit("px of the depth map")
      .range(0, 100)
      .paper(kOnePixel);
  PMSP_ADVANCED_OPTION(init.warp_previous, "Initial planes from the warped plane map of the previous keyframe");
  PMSP_ADVANCED_OPTION(init.chain_keyframes, "Length of chains of warped plane maps; 0 = unlimited")
      .unit("ids")
      .range(0, 100000)
      .paper(0);
  PMSP_ADVANCED_OPTION(init.range_margin, "Factor that widens the depth range of the landmarks at both ends")
      .range(1, 1000);
}

void patchmatch(Table& table) {
  table.stage("PatchMatch");
  PMSP_ADVANCED_OPTION(patchmatch.iterations, "Iterations of the first pass").range(1, 100).normal(2).high(2).paper(4);
  PMSP_ADVANCED_OPTION(patchmatch.neighbours, "Source views per depth map; time is proportional")
      .range(1, kernels::kMaxViews)
      .normal(4)
      .high(6);
  PMSP_ADVANCED_OPTION(patchmatch.refinements, "Random hypotheses per pixel and iteration").range(0, 32).paper(6);
  PMSP_ADVANCED_OPTION(patchmatch.fine_patch, "Patch size at textured pixels; 1 = one size")
      .unit("share of the patch")
      .range(0.1, 1)
      .normal(0.4)
      .high(0.5)
      .paper(1);
  PMSP_ADVANCED_OPTION(patchmatch.image_scale,
                       "Maximum width of the compared images; larger values preserve thin structures, and noise")
      .unit("widths of the depth map")
      .range(0.25, 8)
      .paper(1);
  PMSP_ADVANCED_OPTION(patchmatch.sigma_color, "Maximum standard deviation of the gray levels in the bilateral weights")
      .unit("gray levels")
      .range(1, 1000)
      .paper(50);
  PMSP_ADVANCED_OPTION(
      patchmatch.min_sigma_color,
      "Minimum standard deviation, where the patch is smooth; if at least sigma_color, that everywhere")
      .unit("gray levels")
      .range(1, 1000)
      .paper(50);
  PMSP_ADVANCED_OPTION(patchmatch.plane_priors, "Prior planes for untextured pixels, from reliable surroundings")
      .paper(0);
  PMSP_ADVANCED_OPTION(patchmatch.geometric_passes,
                       "Passes in which disagreement with the depth maps of source views lowers the score")
      .range(0, 8)
      .normal(3)
      .high(3)
      .paper(0);  // normal, high: more neighbours propagate planes further per pass
}

void filters(Table& table) {
  table.stage("Median filter");
  PMSP_ADVANCED_OPTION(median.enabled, "Removal of outliers").paper(1);
  PMSP_ADVANCED_OPTION(median.max_relative_deviation, "Maximum deviation from the median of 3 x 3 pixels")
      .unit("share of the depth")
      .range(0, 1);
  PMSP_ADVANCED_OPTION(median.min_score, "Minimum photometric score; 0 = none").unit("NCC").range(-1, 1).paper(0.1);

  PMSP_ADVANCED_OPTION(median.weighted, "Shift of depth edges to image edges, after the median").paper(0);

  table.stage("Consistency filter");
  PMSP_ADVANCED_OPTION(consistency.enabled, "Removal of pixels on which too few depth maps agree");
  PMSP_ADVANCED_OPTION(consistency.window, "Depth maps compared, including the filtered one in the middle")
      .unit("depth maps")
      .range(3, 15)
      .odd()
      .normal(7)
      .high(7);
  PMSP_ADVANCED_OPTION(consistency.min_views,
                       "Minimum number of depth maps that agree, including the filtered one; at most the window")
      .unit("depth maps")
      .range(1, 15);
  PMSP_ADVANCED_OPTION(consistency.max_relative_depth,
                       "Maximum relative depth difference for agreement; at least the angle of a pixel")
      .unit("share of the depth")
      .range(0, 1)
      .normal(0.007)
      .high(0.007)
      .paper(0.08);  // normal, high: finer pixels and more neighbours agree more closely
}

void fusion(Table& table) {
  table.stage("Fusion");
  PMSP_ADVANCED_OPTION(fusion.window, "Depth maps averaged into a point")
      .unit("depth maps")
      .range(1, kernels::kMaxViewers - 1)
      .odd();
  PMSP_ADVANCED_OPTION(fusion.spacing_px, "Minimum distance of points; 0 = keep duplicates")
      .unit("px of its depth map")
      .range(0, 4)
      .paper(kOnePixel);
  PMSP_ADVANCED_OPTION(fusion.max_relative_depth, "Maximum relative depth difference on one surface")
      .unit("share of the depth")
      .range(0, 1)
      .paper(0.08);
  PMSP_ADVANCED_OPTION(fusion.max_normal_deg, "Maximum angle between normals on one surface")
      .unit("deg")
      .range(0, 180)
      .paper(180);
  PMSP_ADVANCED_OPTION(fusion.min_confidence, "Minimum confidence of a point")
      .short_name("min_confidence")
      .range(0, 1)
      .paper(0);
  PMSP_ADVANCED_OPTION(
      fusion.suppression,
      "Suppression by clearly more confident pixels within this distance; 0 = none; larger values give more accurate "
      "and sparser clouds")
      .unit("expected errors")
      .range(0, 10)
      .high(2.0);
  PMSP_ADVANCED_OPTION(fusion.history,
                       "With free_space.whole_mission: keyframes checked for duplicates, half on either side")
      .unit("keyframes")
      .range(1, 100000)
      .high(30);
}

void free_space(Table& table) {
  table.stage("Free space");
  PMSP_ADVANCED_OPTION(free_space.enabled, "Removal of points that other depth maps see through").paper(0);
  PMSP_ADVANCED_OPTION(free_space.views, "Viewers of the points of a keyframe, besides the fusion window")
      .unit("keyframes")
      .range(1, kernels::kMaxViewers);
  PMSP_ADVANCED_OPTION(free_space.max_relative_depth, "Maximum relative depth difference that confirms a point")
      .unit("share of the depth")
      .range(0, 1);
  PMSP_ADVANCED_OPTION(free_space.min_relative_gap,
                       "Minimum relative distance behind a point of a surface seen through it")
      .unit("share of the depth")
      .range(0, 1);
  PMSP_ADVANCED_OPTION(free_space.max_contradiction,
                       "Maximum weight of contradictions relative to confirmations; smaller values remove more points")
      .range(0, 100);
  PMSP_ADVANCED_OPTION(free_space.mirrors, "Removal of mirror images, as in polished floors");
  PMSP_ADVANCED_OPTION(
      free_space.whole_mission,
      "Later keyframes are viewers, too, and duplicates beyond the fusion window are removed; points come late")
      .normal(1)
      .high(1);
  PMSP_ADVANCED_OPTION(
      free_space.history,
      "Keyframes from which viewers are chosen, half on either side; limits the memory of long missions")
      .unit("keyframes")
      .range(1, 100000);
}

#undef PMSP_ADVANCED_OPTION
#undef PMSP_OPTION
#undef PMSP_OPTION_OF

std::vector<OptionEntry> make_table() {
  Table table;
  machine(table);
  view_filter(table);
  init(table);
  patchmatch(table);
  filters(table);
  fusion(table);
  free_space(table);
  return std::move(table.rows);
}

}  // namespace

const std::vector<OptionEntry>& option_table() {
  static const std::vector<OptionEntry> table = make_table();
  return table;
}

}  // namespace pmsp
