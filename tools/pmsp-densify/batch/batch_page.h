// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

#include "batch_arguments.h"
#include "batch_report.h"

namespace pmsp::tool {

/// index.html of a batch: its table for a browser, with links to what each mission has left in its folder. One file,
/// without scripts, which needs no network; `serve` shows it for the batch's folder.
std::string batch_page(const BatchReport& report, const BatchArguments& batch);

}  // namespace pmsp::tool
