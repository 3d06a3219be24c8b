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
  Table& named(const char* key) { return set(&OptionEntry::key, key); }
  Table& shortly(const char* name) { return set(&OptionEntry::short_name, name); }
  Table& unit(const char* unit) { return set(&OptionEntry::unit, unit); }
  Table& range(double min, double max) { return set(&OptionEntry::min, min).set(&OptionEntry::max, max); }
  Table& even() { return set(&OptionEntry::numbers, OptionEntry::Numbers::kEven); }
  Table& odd() { return set(&OptionEntry::numbers, OptionEntry::Numbers::kOdd); }
  Table& zero_too() { return set(&OptionEntry::zero_too, true); }
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
      #field, +[](DensifierOptions & o) -> auto& { return owner.field; }, help)
#define PMSP_OPTION(field, help) PMSP_OPTION_OF(o, field, help)
#define PMSP_ADVANCED_OPTION(field, help) PMSP_OPTION_OF(o.advanced, field, help)

// Defaults are those of the structs, and the preset `online`. `paper` follows Surmann et al. 2022, with the values of
// their program if the paper has none, but without its defects: a blind strip at the seam, a depth range that ends at
// the ninth decile, planes that are not rotated with the camera.

void machine(Table& table) {
  table.stage("Size and machine");
  PMSP_OPTION(
      width,
      "Width of the depth maps; 0 = that of the images, up to 5760; of small ones, 1.5 times as much, up to 1440")
      .unit("px")
      .range(32, 16384)
      .even()
      .zero_too()
      .normal(1440)
      .high(0);
  PMSP_OPTION(height, "Height of the depth maps; 0 = as the images' shape asks, also where only a width is given")
      .unit("px")
      .range(16, 8192)
      .even()
      .zero_too()
      .normal(720)
      .high(0);
  PMSP_OPTION(seed, "Start of the random numbers; same input, seed, backend and simd, same bytes").range(0, kMostSeed);
  PMSP_OPTION(backend,
              "Where the stages run; auto takes CUDA where it is built in, a device answers and its memory suffices");
  PMSP_OPTION(devices, "CUDA devices that share the work, as the driver numbers them; the result is that of one")
      .named("device")
      .range(0, 255);
  PMSP_ADVANCED_OPTION(pipelined,
                       "CUDA: overlap copies and work of successive keyframes; results come one keyframe later");
  PMSP_OPTION(threads, "Threads; 0 = one for each CPU that the process may use").range(1, 1024).zero_too();
  PMSP_OPTION(simd, "Instruction set; auto takes the widest that this machine has");
  PMSP_OPTION(lens_distance,
              "Distance of the camera's two lenses along its forward axis, where panoramas are stitched as if they had "
              "one centre; 0 = one centre; estimated where it is not given")
      .unit("map units")
      .range(-kMaxPosition, kMaxPosition);
  PMSP_OPTION(unordered, "The images are a set, such as photo captures: their order means nothing");
}

void view_filter(Table& table) {
  table.stage("View filter");
  PMSP_ADVANCED_OPTION(view_filter.enabled,
                       "Leave out keyframes with too little or too much parallax, and those that are clearly blurred");
  PMSP_ADVANCED_OPTION(view_filter.min_parallax_deg, "Smallest useful parallax of a landmark")
      .unit("deg")
      .range(0, 180);
  PMSP_ADVANCED_OPTION(view_filter.max_parallax_deg, "Largest useful parallax of a landmark").unit("deg").range(0, 180);
  PMSP_ADVANCED_OPTION(view_filter.min_share,
                       "Share of the common landmarks that must have useful parallax; less accepts more keyframes")
      .range(0, 1)
      .paper(0.2);
  PMSP_ADVANCED_OPTION(
      view_filter.min_sharpness,
      "Sharpness, relative to that of the keyframes before, below which a keyframe is blurred; 0 = none is "
      "left out")
      .range(0, 1)
      .paper(0);
}

void init(Table& table) {
  table.stage("Initialisation");
  PMSP_ADVANCED_OPTION(init.sparse_points, "Start from planes through the keyframe's landmarks");
  PMSP_ADVANCED_OPTION(init.sparse_radius_px, "How far one landmark spreads")
      .unit("px of the depth map")
      .range(0, 100)
      .paper(kOnePixel);
  PMSP_ADVANCED_OPTION(init.warp_previous, "Start from the previous depth map, moved into this keyframe");
  PMSP_ADVANCED_OPTION(init.chain_keyframes, "Restart that with each block of so many keyframe ids; 0 = never")
      .unit("ids")
      .range(0, 100000)
      .paper(0);
  PMSP_ADVANCED_OPTION(init.range_margin, "Factor that widens the landmarks' depth range at both ends").range(1, 1000);
}

void patchmatch(Table& table) {
  table.stage("PatchMatch");
  PMSP_ADVANCED_OPTION(patchmatch.iterations, "Visits of every pixel in the first pass")
      .range(1, 100)
      .normal(2)
      .high(2)
      .paper(4);
  PMSP_ADVANCED_OPTION(patchmatch.neighbours, "Keyframes to match with; time grows in proportion")
      .range(1, kernels::kMaxViews)
      .normal(4)
      .high(6);
  PMSP_ADVANCED_OPTION(patchmatch.refinements, "Random draws per pixel and iteration").range(0, 32).paper(6);
  PMSP_ADVANCED_OPTION(patchmatch.fine_patch, "Size of the patch of textured pixels")
      .unit("share of the patch")
      .range(0.1, 1)
      .normal(0.4)
      .high(0.5)
      .paper(1);
  PMSP_ADVANCED_OPTION(patchmatch.image_scale,
                       "Width of the images that are compared, at most; finer ones keep edges sharper")
      .unit("widths of the depth map")
      .range(0.25, 8)
      .paper(1);
  PMSP_ADVANCED_OPTION(patchmatch.sigma_color, "Bilateral weight: difference in brightness")
      .unit("gray levels")
      .range(1, 1000)
      .paper(50);
  PMSP_ADVANCED_OPTION(patchmatch.min_sigma_color,
                       "The same where the surface around a pixel is smooth; from sigma_color on: everywhere the same")
      .unit("gray levels")
      .range(1, 1000)
      .paper(50);
  PMSP_ADVANCED_OPTION(patchmatch.plane_priors,
                       "Prefer planes through the reliable surface around where there is no texture")
      .paper(0);
  PMSP_ADVANCED_OPTION(patchmatch.geometric_passes,
                       "Further passes that prefer what neighbouring depth maps agree with")
      .range(0, 8)
      .normal(3)
      .high(3)
      .paper(0);  // normal, high: more neighbours propagate planes further per pass
}

void filters(Table& table) {
  table.stage("Median filter");
  PMSP_ADVANCED_OPTION(median.enabled, "Remove single outliers").paper(1);
  PMSP_ADVANCED_OPTION(median.max_relative_deviation,
                       "Deviation from the neighbourhood's median beyond which a pixel is dropped")
      .unit("share of the depth")
      .range(0, 1);
  PMSP_ADVANCED_OPTION(median.min_score, "Photometric score below which a pixel is dropped; 0: none")
      .unit("NCC")
      .range(-1, 1)
      .paper(0.1);

  PMSP_ADVANCED_OPTION(median.weighted, "Then move depth edges to where the image has them").paper(0);

  table.stage("Consistency filter");
  PMSP_ADVANCED_OPTION(consistency.enabled, "Keep only what several depth maps agree on");
  PMSP_ADVANCED_OPTION(consistency.window, "Depth maps compared, the filtered one in the middle")
      .unit("depth maps")
      .range(3, 15)
      .odd()
      .normal(7)
      .high(7);
  PMSP_ADVANCED_OPTION(consistency.min_views,
                       "Depth maps that must agree, the filtered one included; at most the window")
      .unit("depth maps")
      .range(1, 15);
  PMSP_ADVANCED_OPTION(consistency.max_relative_depth,
                       "Deviation that still counts as agreement; a pixel's angle where that is larger")
      .unit("share of the depth")
      .range(0, 1)
      .normal(0.007)
      .high(0.007)
      .paper(0.08);  // normal, high: finer pixels and more neighbours agree more closely
}

void fusion(Table& table) {
  table.stage("Fusion");
  PMSP_ADVANCED_OPTION(fusion.window, "Depth maps that are joined with each other")
      .unit("depth maps")
      .range(1, kernels::kMaxViewers - 1)
      .odd();
  PMSP_ADVANCED_OPTION(fusion.spacing_px, "Points closer than this are one point")
      .unit("px of its depth map")
      .range(0, 4)
      .paper(kOnePixel);
  PMSP_ADVANCED_OPTION(fusion.max_relative_depth, "Deviation up to which two depths are one surface")
      .unit("share of the depth")
      .range(0, 1)
      .paper(0.08);
  PMSP_ADVANCED_OPTION(fusion.max_normal_deg, "Angle of normals up to which they are one surface")
      .unit("deg")
      .range(0, 180)
      .paper(180);
  PMSP_ADVANCED_OPTION(fusion.min_confidence, "Points with less confidence are not written")
      .shortly("min_confidence")
      .range(0, 1)
      .paper(0);
  PMSP_ADVANCED_OPTION(
      fusion.suppression,
      "A pixel gives way to a clearly more confident one so near; 0: none does. More makes the cloud truer and "
      "sparser")
      .unit("expected errors")
      .range(0, 10)
      .high(2.0);
  PMSP_ADVANCED_OPTION(
      fusion.history,
      "With free_space.whole_mission: keyframes that may make the point of a place in place of this one")
      .unit("keyframes")
      .range(1, 100000)
      .high(30);
}

void free_space(Table& table) {
  table.stage("Free space");
  PMSP_ADVANCED_OPTION(free_space.enabled, "Remove points that other keyframes have looked through").paper(0);
  PMSP_ADVANCED_OPTION(free_space.views, "Viewers of each keyframe's points")
      .unit("keyframes")
      .range(1, kernels::kMaxViewers);
  PMSP_ADVANCED_OPTION(free_space.max_relative_depth, "Deviation that still confirms a point")
      .unit("share of the depth")
      .range(0, 1);
  PMSP_ADVANCED_OPTION(free_space.min_relative_gap, "A surface this much farther away has been seen through the point")
      .unit("share of the depth")
      .range(0, 1);
  PMSP_ADVANCED_OPTION(free_space.max_contradiction,
                       "What may speak against a point, relative to what speaks for it; less removes more")
      .range(0, 100);
  PMSP_ADVANCED_OPTION(free_space.mirrors, "Remove what mirrors show, such as polished floors");
  PMSP_ADVANCED_OPTION(free_space.whole_mission,
                       "Hold points back until the end, so that later keyframes have their say too")
      .normal(1)
      .high(1);
  PMSP_ADVANCED_OPTION(free_space.history,
                       "Keyframes that may be asked, half on either side; bounds the memory of long missions")
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
