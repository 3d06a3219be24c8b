// SPDX-License-Identifier: BSD-2-Clause
#include "disk_space.h"

#include <sys/stat.h>
#include <algorithm>
#include <map>
#include <system_error>

#include "cloud_arguments.h"
#include "estimates.h"
#include "pmsp/error.h"
#include "tool_files.h"

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

/// Per point in a file, in datasets with its track; for COLMAP, Potree, splats and maps the peak while writing.
double bytes_of_point(const CloudFormat& about) {
  constexpr double kLas = 53.0, kSplat = 68.0 + 32.0, kPotree = 35.0 + 36.0, kDataset = 160.0, kMapRays = 16.0;
  if (about.is_map) return kMapRays;
  const std::string format = about.name;
  return format == "ply"      ? kPlyBytes
         : format == "las"    ? kLas
         : format == "splat"  ? kSplat
         : format == "potree" ? kPotree
                              : kDataset;
}

/// Per pixel of a depth map. PNGs are compressed to about half of 16 bits per channel.
double bytes_of_pixel(const DepthFormats& formats) {
  constexpr double kChannels = 5.0;  // depth, normal, confidence
  return (formats.pfm ? 4.0 * kChannels : 0.0) + (formats.exr ? 4.0 * kChannels : 0.0) +
         (formats.png         ? kChannels
          : formats.depth_png ? 1.0
                              : 0.0);
}

fs::path existing_folder(fs::path path) {
  std::error_code ignored;
  while (!fs::is_directory(path, ignored) && path.has_relative_path()) path = path.parent_path();
  return path;
}

/// Total size of the image files; 0 for videos.
double bytes_of(const ImageSource& images) {
  double sum = 0.0;
  for (const std::int64_t id : images.keyframe_ids()) {
    const ImageSource::Origin origin = images.origin(id);
    std::error_code error;
    const std::uintmax_t bytes = origin.frame.empty() ? fs::file_size(origin.file, error) : 0;
    if (!error) sum += static_cast<double>(bytes);
  }
  return sum;
}

}  // namespace

std::vector<DiskNeed> disk_needs(const Arguments& arguments, const Budget& budget, const ImageSource& images,
                                 double in_workspace) {
  const double pixels = static_cast<double>(budget.width) * budget.height * static_cast<double>(budget.depth_maps);
  const CloudSelection& amount = arguments.cloud.amount;
  double points = budget.points;
  if (amount.thinning.max_points > 0) points = std::min(points, static_cast<double>(amount.thinning.max_points));
  if (amount.crop || amount.thinning.voxel > 0.0) points = 0.0;  // unpredictable
  std::vector<DiskNeed> needs;
  for (const CloudOutput::Target& target : arguments.cloud.targets()) {
    const bool has_images = is_dataset(*target.format);
    const DatasetDepth& depth = arguments.cloud.dataset_depth;
    const double of_pixel = has_images ? bytes_of_pixel({false, depth.exr, depth.png, false}) : 0.0;
    const double most = has_images ? static_cast<double>(arguments.cloud.dataset_points) : points;
    needs.push_back({target.path, (has_images ? bytes_of(images) : 0.0) + of_pixel * pixels,
                     bytes_of_point(*target.format) * std::min(points, most)});
  }
  for (const fs::path& folder : {arguments.depth_maps, arguments.raw_depth_maps}) {
    if (!folder.empty()) needs.push_back({folder, bytes_of_pixel(arguments.depth_formats) * pixels, 0.0});
  }
  if (arguments.delete_workspace) {  // planes only, and only those worth keeping
    needs.push_back({arguments.workspace, 0.0, in_workspace * kPlanesBytes * pixels});
  } else if (!arguments.workspace.empty()) {
    const double planes = kPlanesBytes * pixels;
    needs.push_back({arguments.workspace, in_workspace * planes, in_workspace * (budget.workspace_bytes - planes)});
  }
  needs.push_back({scratch_folder(arguments), 0.0, budget.memory.scratch});
  return needs;
}

std::string compare_disk_space(const DiskNeed& need, double free) {
  const double expected = need.fixed + need.points;
  if (expected <= free) return "";
  const std::string text = need.folder.string() + ": about " + bytes_text(expected) + " will be written there, " +
                           bytes_text(free) + " are free; ";
  constexpr double kCertain = 0.5, kCertainPoints = 0.1;  // certain shares of the forecast
  if (kCertain * need.fixed + kCertainPoints * need.points <= free) return text + "the disk may become full";
  throw OutputError(text +
                    "free some space, give outputs, --workspace and --scratch on another disk, or omit some of them");
}

std::string check_disk_space(const std::vector<DiskNeed>& needs) {
  std::map<dev_t, DiskNeed> disks;
  for (const DiskNeed& need : needs) {
    const fs::path folder = existing_folder(place_of(need.folder));
    struct stat about = {};
    if (::stat(folder.c_str(), &about) != 0) continue;
    DiskNeed& disk = disks[about.st_dev];
    if (disk.folder.empty()) disk.folder = folder;
    disk.fixed += need.fixed;
    disk.points += need.points;
  }
  std::string warning;
  for (const auto& [device, disk] : disks) {
    std::error_code error;
    const fs::space_info space = fs::space(disk.folder, error);
    if (!error && warning.empty()) warning = compare_disk_space(disk, static_cast<double>(space.available));
  }
  return warning;
}

double share_to_make(const workspace::Step& step) {
  const auto made = std::count_if(step.keyframes.begin(), step.keyframes.end(),
                                  [](const auto& planned) { return planned.second.passes > 0; });
  return static_cast<double>(made) / std::max<double>(1.0, static_cast<double>(step.keyframes.size()));
}

bool knows_size(DensifierOptions& options, const SlamMap& map) {
  if (options.width > 0 && options.height == 0) options.height = options.width / 2;
  return options.width > 0 || (!map.cameras.empty() && map.cameras[0].width > 0);
}

std::string disk_warning(const Arguments& arguments, const SlamMap& map, const ImageSource& images, const Plan& plan,
                         DensifierOptions options, double in_workspace) {
  if (!knows_size(options, map)) return "";
  try {
    const Budget budget = estimate_budget({map, plan, options, 0, 0, {}});
    return check_disk_space(disk_needs(arguments, budget, images, in_workspace));
  } catch (const InvalidInput&) {  // reported by the densifier
    return "";
  }
}

}  // namespace pmsp::tool
