// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <functional>

#include "pmsp/api.h"
#include "pmsp/io/cloud.h"
#include "workspace/workspace.h"

namespace pmsp::workspace {

/// Whether the folder has a record.
PMSP_API bool is_workspace(const std::filesystem::path& folder);

/// Points of a workspace in the frame and map units, in the order of the plan.
class PMSP_API WorkspaceCloud final : public CloudReader {
 public:
  /// Throws as Workspace; locks it.
  explicit WorkspaceCloud(const std::filesystem::path& folder);

  const Record& record() const { return workspace_.record(); }

  void read(const Take& take) override;
  /// Delivers the points keyframe by keyframe, at their poses of the last step. Throws IoError.
  void each(const std::function<void(const KeyframeCloud& cloud)>& take) const;

 private:
  Workspace workspace_;
};

}  // namespace pmsp::workspace
