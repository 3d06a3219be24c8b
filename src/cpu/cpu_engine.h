// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "engine.h"
#include "pmsp/initialiser.h"
#include "pmsp/panorama.h"
#include "pmsp/patchmatch.h"
#include "util/scratch_file.h"

namespace pmsp {

struct CpuFrame;

/// The stages on the CPU, one after the other; each hands its result out before it returns.
class CpuEngine : public Engine {
 public:
  CpuEngine(const EngineContext& context, Executor executor) : Engine(context, std::move(executor)) {}

  std::unique_ptr<Frame> prepare(const Keyframe& keyframe) override;
  void match(const MatchTask& task) override;
  void filter(Frame& reference, const std::vector<const Frame*>& others) override;
  void fuse(Frame& reference, const std::vector<const Frame*>& window, std::size_t current) override;
  void judge(Frame& reference, const std::vector<const Frame*>& viewers) override;
  void round(Frame& reference, const std::vector<const Frame*>& others, int round) override;
  void hand_out(Frame& reference) override;
  void release(Frame& frame, Artefact artefact) override;
  void deliver(bool /*all*/) override {}

 private:
  PlaneMap run_pass(const MatchTask& task);
  PlaneMap warped_planes(const CpuFrame& previous, const RigidTransform& cam_from_world);
  void finish_match(CpuFrame& reference, const PlaneMap& raw);

  std::unique_ptr<ScratchFile> scratch_;  ///< where a folder is given
};

}  // namespace pmsp
