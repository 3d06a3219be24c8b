// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <utility>

#include "engine.h"

namespace pmsp {

/// The stages on the CPU, one after the other; each hands its result out before it returns.
class CpuEngine : public Engine {
 public:
  CpuEngine(const EngineContext& context, Executor executor) : Engine(context, std::move(executor)) {}

  std::unique_ptr<Frame> prepare(const Keyframe& keyframe) override;
  void match(const MatchTask& task) override;
  void filter(Frame& reference, const std::vector<const Frame*>& others) override;
  void fuse(const std::vector<Frame*>& window, std::size_t current) override;
  void deliver(bool /*all*/) override {}
};

}  // namespace pmsp
