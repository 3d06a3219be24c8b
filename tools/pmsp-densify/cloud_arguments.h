// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "export/cloud_frame.h"
#include "export/provenance.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/map.h"
#include "workspace/record.h"

namespace CLI {
class App;
}

namespace pmsp::tool {

struct Arguments;

/// Options of maps of free and occupied space (CloudFormat::is_map); nullopt = default of CloudHeader.
struct MapArguments {
  std::optional<double> cell_size;  ///< nullopt = default_cell_size
  std::optional<int> least_rays;
  std::optional<double> robot_height, robot_step, robot_slope_deg;
  bool map_units = false;
};

/// Cloud options of the command line.
struct CloudArguments {
  std::vector<std::filesystem::path> paths = {"cloud.ply"};
  std::vector<std::string> formats;  ///< parallel to `paths`; empty = by extension
  bool double_positions = false;
  double resolution = 0.0;    ///< see CloudHeader; 0 = default
  std::filesystem::path crs;  ///< WKT file
  int year = 0, day_of_year = 0;
  FrameOptions frame;
  CloudSelection amount;
  std::int64_t dataset_points = 1'000'000;
  DatasetDepth dataset_depth;  ///< formats
  MapArguments map;

  /// First output that is no map; nullptr = none.
  const std::filesystem::path* first_cloud() const;
  bool has_map() const;
  /// Targets of CloudOutput.
  std::vector<CloudOutput::Target> targets() const;
  /// Whether an output is a dataset with depth images.
  bool wants_depth() const;
  /// Returns "cloud.ply, cloud.las".
  std::string text() const;
};

/// Adds the cloud options; check_cloud_arguments must follow.
void add_cloud_options(CLI::App& app, CloudArguments& arguments);

/// Throws UsageError.
void check_cloud_arguments(const CloudArguments& arguments);

bool is_dataset(const CloudFormat& format);
/// Throws UsageError if a map would have lengths in map units that were not accepted or defined. `unit`: of the
/// outputs.
void check_map_units(const CloudArguments& arguments, const CloudUnit& unit);

/// Sets the header's fields for maps. `ranges`: see default_cell_size [map units]; `width`: of the depth maps.
void set_map_options(CloudHeader& header, const CloudArguments& arguments, const std::vector<double>& ranges,
                     int width);

/// Returns "ply, las, ...".
std::string names_of_formats();

/// Returns the name of a cloud's unit: the given one, "m" and "ft" for their synonyms, else "m" for clouds in metres;
/// "" = map units.
std::string unit_of_lengths(const std::string& given, const CloudUnit& unit);

/// Throws UsageError if `given`, the value of `option`, is a unit of length other than the cloud's. If that is unknown,
/// all are accepted.
void check_unit(const char* option, const std::string& given, const CloudUnit& unit);

/// Returns "metres, by --scale", "map units (no scale is known)", "not known".
std::string unit_text(const CloudUnit& unit);

/// Returns the workspace's record of its clouds.
workspace::RecordedCloud recorded_cloud(const DensifierOptions& options, const SlamMap& map);

/// Returns frame and dropped points of the cloud, for stats.json.
nlohmann::ordered_json cloud_json(const CloudArguments& arguments, const CloudFrame& frame);

/// Returns the folder of spilled data: --scratch, or that of the first cloud.
std::filesystem::path scratch_folder(const Arguments& arguments);
std::filesystem::path scratch_folder(const std::filesystem::path& given, const CloudArguments& cloud);

/// Reads the coordinate reference system from the file of --crs. Throws IoError.
std::string read_wkt(const std::filesystem::path& path);

/// Returns the metadata for cloud writers. Depends on inputs and options only, not on threads, paths or times, so that
/// equal inputs give equal bytes. Throws IoError if the file of --crs is unreadable.
CloudHeader cloud_header(const Arguments& arguments, const DensifierOptions& options, const SlamMap& map,
                         const CloudFrame& frame);

}  // namespace pmsp::tool
