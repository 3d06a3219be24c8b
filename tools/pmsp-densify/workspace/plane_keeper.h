// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "arguments.h"
#include "pmsp/densifier.h"
#include "pmsp/io/image_source.h"
#include "pmsp/io/map.h"
#include "pmsp/io/workspace/workspace.h"
#include "time_account.h"

namespace pmsp::tool {

/// Whether planes are worth keeping for a run after a kill: from a GPU they come faster than a disk takes them, and are
/// made again in less time than it takes to read and check them.
class PlanesPace {
 public:
  bool is_worth_keeping(const PlaneMap& planes);

 private:
  using Clock = std::chrono::steady_clock;

  std::optional<Clock::time_point> first_;  ///< when the first ones came, which tell no pace, and
  double bytes_ = 0.0;                      ///< of planes since then
};

/// A run with --delete-workspace in a workspace in which nothing lies: one as without, whose planes are kept under the
/// names at which a WorkspaceStep finds them after a kill.
class PlaneKeeper {
 public:
  /// All must outlive it. `options`: as told.
  PlaneKeeper(workspace::Workspace& workspace, const Arguments& arguments, const DensifierOptions& options,
              const SlamMap& map, const ImageSource& source, TimeAccount& time);

  /// `densifier`: that which makes them.
  void keep(const PlaneMap& planes, const Densifier& densifier);
  /// When the cloud is there.
  void remove();

 private:
  workspace::Workspace& workspace_;
  const Arguments& arguments_;
  const DensifierOptions options_;
  const SlamMap& map_;
  const ImageSource& source_;
  TimeAccount& time_;
  PlanesPace pace_;
  std::string step_;  ///< from the first planes on
};

}  // namespace pmsp::tool
