// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

#include "arguments.h"
#include "pmsp/io/cloud_frame.h"
#include "pmsp/io/cloud_writer.h"
#include "pmsp/io/map.h"

namespace pmsp::tool {

/// The frame of the cloud and what was left out of it, for stats.json.
nlohmann::ordered_json cloud_json(const CloudArguments& arguments, const CloudFrame& frame);

/// The folder for what memory should not hold: --scratch, or that of the first cloud.
std::filesystem::path scratch_folder(const Arguments& arguments);

/// What the writers are told: of inputs and options alone, no threads, paths or times, so that the same input gives the
/// same bytes. Throws IoError where the file of --crs cannot be read.
CloudHeader cloud_header(const Arguments& arguments, const DensifierOptions& options, const SlamMap& map,
                         const CloudFrame& frame);

}  // namespace pmsp::tool
