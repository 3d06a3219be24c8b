// SPDX-License-Identifier: BSD-2-Clause
#pragma once

namespace pmsp::tool {

/// The page of tools/viewer, with a mark where the data go; "" where it was left out (PMSP_VIEWER).
extern const char* const kReportTemplate;

}  // namespace pmsp::tool
