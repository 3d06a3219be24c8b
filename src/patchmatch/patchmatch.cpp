// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/stages.h"

#include <sstream>
#include <string>

#include "cpu/cpu_processor.h"
#include "densifier_checks.h"
#include "patchmatch/match_setup.h"
#include "pmsp/error.h"
#include "sphere/panorama_data.h"
#include "sphere/plane_views.h"
#include "util/eigen_kernels.h"

namespace pmsp {
namespace {

using Pass = CpuProcessor::Pass;

void check_map(const PlaneMap* map, const char* what, const Panorama& reference) {
  if (map == nullptr || map->empty() || same_size(*map, reference)) return;
  throw InvalidInput(std::string("patchmatch: ") + what + " not of the reference's size");
}

void check(const MatchInput& input, const PatchMatchOptions& options) {
  options.validate();
  if (input.reference.panorama == nullptr) throw InvalidInput("patchmatch: no reference panorama");
  check_scale("patchmatch: ", input.reference.pose.scale);
  const int width = input.reference.panorama->width();
  const int height = input.reference.panorama->height();
  const std::size_t count = input.neighbours.size();
  if (count < 1 || count > static_cast<std::size_t>(kernels::kMaxViews)) {
    throw InvalidInput("patchmatch: " + std::to_string(count) + " neighbours; expected 1 to " +
                       std::to_string(kernels::kMaxViews));
  }
  for (const PosedPanorama& neighbour : input.neighbours) {
    if (neighbour.panorama == nullptr || neighbour.panorama->width() != width ||
        neighbour.panorama->height() != height) {
      throw InvalidInput("patchmatch: a neighbour is missing or not of the reference's size");
    }
    check_scale("patchmatch: ", neighbour.pose.scale);
  }
  if (!input.neighbour_maps.empty() && input.neighbour_maps.size() != count) {
    throw InvalidInput("patchmatch: " + std::to_string(input.neighbour_maps.size()) + " depth maps of " +
                       std::to_string(count) + " neighbours; expected none or one for each");
  }
  const bool is_first_pass = input.start == nullptr || input.start->empty();
  if (!is_first_pass && (input.landmarks != nullptr || input.warped != nullptr)) {
    throw InvalidInput(
        "patchmatch: planes of landmarks and warped ones belong to a first pass, without a map to start from");
  }
  if (is_first_pass && input.prior != nullptr) {
    throw InvalidInput("patchmatch: prior planes belong to a further pass, which has a map to start from");
  }
  const Panorama& reference = *input.reference.panorama;
  check_map(input.landmarks, "planes of landmarks are", reference);
  check_map(input.warped, "warped planes are", reference);
  check_map(input.start, "the map to start from is", reference);
  check_map(input.prior, "prior planes are", reference);
  for (const PlaneMap* map : input.neighbour_maps) check_map(map, "a neighbour's map is", reference);
  if (!(input.range.min >= kMinDepth) || !(input.range.max > input.range.min) || !(input.range.max <= kMaxDepth)) {
    std::ostringstream text;
    text << "patchmatch: the depth range is " << input.range.min << " to " << input.range.max << "; expected "
         << kMinDepth << " <= min < max <= " << kMaxDepth;
    throw InvalidInput(text.str());
  }
  for (const PosedPanorama& neighbour : input.neighbours) {
    const double distance =
        (neighbour.pose.cam_from_world.center() - input.reference.pose.cam_from_world.center()).norm();
    if (!(distance <= 4e12)) throw InvalidInput("patchmatch: a neighbour is more than 4e12 map units away");
  }
}

kernels::PlaneMapView view_of_given(const PlaneMap* map) {
  return map == nullptr ? kernels::PlaneMapView{} : view_of(*map);
}

/// Pass without its state.
Pass pass_for(const MatchInput& input, const PatchMatchOptions& options, std::uint64_t seed,
              const kernels::GridView& grid) {
  const Panorama& reference = *input.reference.panorama;
  Pass pass{};
  pass.match_args = make_match_args(impl_of(reference).gray.view(), impl_of(reference).noise, options,
                                    reference.width(), input.range, seed, input.keyframe_id);
  for (std::size_t i = 0; i < input.neighbours.size(); ++i) {
    const PosedPanorama& neighbour = input.neighbours[i];
    const PanoramaData& data = impl_of(*neighbour.panorama);
    pass.match_args.views[i] = {
        data.gray.view(), data.matchable.view(),
        relative_pose(neighbour.pose, input.reference.pose, 0.5 * input.lens_distance).other_from_first,
        view_of_given(input.neighbour_maps.empty() ? nullptr : input.neighbour_maps[i])};
  }
  pass.match_args.num_views = static_cast<int>(input.neighbours.size());
  pass.grid = grid;
  if (!reference.mask().empty()) pass.mask = {reference.mask().pixels().data()};
  pass.priors = view_of_given(input.prior);
  pass.landmarks = view_of_given(input.landmarks);
  pass.warped = view_of_given(input.warped);
  return pass;
}

}  // namespace

PlaneMap patchmatch(const MatchInput& input, const PatchMatchOptions& options, std::uint64_t seed,
                    const Executor& executor, const std::atomic<bool>* cancel) {
  check(input, options);
  const CpuProcessor on(executor, input.reference.panorama->width(), input.reference.panorama->height());
  const CpuProcessor::Planes state = on.planes();
  Pass pass = pass_for(input, options, seed, on.grid());
  pass.state = on.to(state);
  const bool has_start_map = input.start != nullptr && !input.start->empty();
  if (has_start_map) {
    on.launch(kernels::ReorderPlanes<kernels::HostViewTypes>{view_of(*input.start), pass.state, false}, nullptr);
  } else {
    on.start(pass);
  }
  const auto cancelled = [&] { return cancel != nullptr && cancel->load(std::memory_order_relaxed); };
  run_iterations(on, pass, {input.first_iteration, options.iterations}, has_start_map, cancelled);
  if (cancelled()) return {};
  PlaneMap map(pass.grid.width, pass.grid.height);
  map.keyframe_id = input.keyframe_id;
  map.cam_from_world = input.reference.pose.cam_from_world;
  map.scale = input.reference.pose.scale;
  on.launch(kernels::ReorderPlanes<kernels::HostViewTypes>{on.map(state), arrays_of(map), true}, nullptr);
  return map;
}

}  // namespace pmsp
