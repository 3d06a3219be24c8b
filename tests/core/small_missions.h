// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/recording.h"
#include "plan/plan.h"

namespace pmsp::test {

/// Keyframes with tiny images, and their options.
struct SmallMission {
  std::string name;
  DensifierOptions options;
  std::vector<Keyframe> keyframes;  ///< the views point to images that outlive them
};

/// Out and back through a room, again and again. Some ids are missing, as after culling; some keyframes show what the
/// one before shows, and one in the middle sees no landmarks. Each third keyframe has a mask.
std::vector<Keyframe> small_flight(std::size_t count);

/// The stages of a preset, with as many passes, neighbours, rounds and windows, on 32 x 16 pixels. Histories are short,
/// so that parts of a short flight do not depend on all of it.
DensifierOptions small_preset(Quality quality, std::uint64_t seed = 1);

/// A flight with each preset but `paper`, and with `online` a set of photos and a flight without a view filter.
std::vector<SmallMission> small_missions(std::uint64_t seed = 1);

Plan plan_of(const SmallMission& mission);
void fly_through(Densifier& densifier, const SmallMission& mission);  ///< adds all keyframes and flushes
std::vector<std::int64_t> ids_of(const std::vector<Keyframe>& keyframes);
Keyframe keyframe_of(const SmallMission& mission, std::int64_t id);

/// Gives keyframes units of their own, by powers of two, by which nothing is rounded.
void give_scales(SmallMission& mission);

/// Delivered results by keyframe, in any order.
struct ResultsById {
  std::map<std::int64_t, DepthMap> raw, filtered;
  std::map<std::int64_t, KeyframeCloud> clouds;

  void add(const Recording& recording);
  std::size_t points() const;
  int repeated = 0;  ///< repeated results of a keyframe
};
ResultsById by_id(const Recording& recording);
ResultsById in_scene_units(ResultsById results);

/// First difference; empty if equal.
std::string difference(const ResultsById& a, const ResultsById& b);

/// Of a Densifier that makes its own plan.
Recording whole_run(const SmallMission& mission);

/// Of one that runs the given plan for some keyframes and is given exactly the images that the halo names. `images`
/// counts them.
Recording run_part(const SmallMission& mission, const Plan& plan, const std::vector<std::int64_t>& ids,
                   std::size_t* images = nullptr);

}  // namespace pmsp::test
