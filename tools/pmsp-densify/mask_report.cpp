// SPDX-License-Identifier: BSD-2-Clause
#include "mask_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <system_error>

namespace pmsp::tool {
namespace {

namespace fs = std::filesystem;

constexpr double kHidesMost = 0.6;  ///< share of the sphere that causes a warning

std::string percent(double share) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f %%", 100.0 * share);
  return text;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%g", value);
  return text;
}

bool has_files(const MaskSummary& it) { return !it.first.empty(); }

/// Returns "mask.png and a cap of 20 degrees at the nadir".
std::string sources(const Arguments& arguments, const SlamMap& map, const MaskSummary& it) {
  std::vector<std::string> all;
  const auto some = [&it](std::size_t count) {
    return std::to_string(count) + " of " + std::to_string(it.images) + " images have one ";
  };
  if (it.in_folder > 0) {
    std::string text = some(it.in_folder) + "in " + arguments.mask.string();
    if (!it.unmatched.empty()) {
      text += " (files there of no image: " + std::to_string(it.unmatched.size()) + ", such as " +
              it.unmatched.front().filename().string() + ")";
    }
    all.push_back(text);
  } else if (!arguments.mask.empty()) {
    all.push_back(arguments.mask.string() + (it.by_alpha ? " (its alpha channel)" : ""));
  }
  if (it.named > 0) all.push_back(some(it.named) + "that " + map.path.filename().string() + " names");
  if (it.in_masks > 0) {
    all.push_back(some(it.in_masks) + "in the directory masks beside them" +
                  (it.named == 0 ? ", such as " + it.first.string() : ""));
  }
  if (it.beside > 0)
    all.push_back(some(it.beside) + "beside them, by a name such as 7_mask.png or 7.mask.png for 7.jpg");
  if (it.with_alpha > 0) all.emplace_back("alpha channels of images");
  for (const auto& [degrees, place] : {std::pair(arguments.mask_nadir, "nadir"), {arguments.mask_zenith, "zenith"}}) {
    if (degrees > 0.0) all.push_back("a cap of " + number(degrees) + " degrees at the " + place);
  }
  std::string text;
  for (const std::string& source : all) text += (text.empty() ? "" : " and ") + source;
  return text;
}

std::string hidden_text(const MaskSummary& it) {
  constexpr double kSame = 0.0005;
  std::string text = percent(it.hidden) + " of the sphere is hidden";
  if (it.most - it.least > kSame) text += " on average (" + percent(it.least) + " to " + percent(it.most) + ")";
  return text;
}

void warn_of_share(const MaskSummary& it, std::vector<std::string>& warnings) {
  if (has_files(it) && it.hidden_by_files == 0.0) {
    std::string text =
        "the mask " + it.first.string() + " hides nothing: black (0) is ignored, any other colour is used";
    if (!it.colours.empty()) text += ", and it is " + it.colours + "; paint ignored parts black";
    warnings.push_back(text);
  }
  if (it.hidden <= kHidesMost) return;
  const std::string much = "masks hide " + percent(it.hidden) + " of the sphere";
  if (has_files(it) && it.hidden_by_files > kHidesMost) {
    const bool by_alpha = it.by_alpha;
    warnings.push_back(much + ": " + (by_alpha ? "transparent" : "black (0)") + " is ignored, " +
                       (by_alpha ? "opaque" : "white (any other colour)") + " is used; if " + it.first.string() +
                       " is inverted, invert it back");
  } else if (it.with_alpha > 0) {
    warnings.push_back(much + ": transparent pixels of images are ignored; --no-masks uses them");
  } else {
    warnings.push_back(much + ", which leaves little to densify");
  }
}

/// Warns of files that look like masks but are unused.
void warn_of_unused(const Arguments& arguments, const SlamMap& map, const MaskSummary& it,
                    std::vector<std::string>& warnings) {
  if (arguments.no_masks || !arguments.mask.empty() || arguments.images.empty()) return;
  if (it.named_missing > 0) {
    warnings.push_back("missing masks that " + map.path.filename().string() +
                       " names: " + std::to_string(it.named_missing) + ", such as " + it.first_missing.string() +
                       "; their images are used without masks; add them, or give their directory with --mask");
  }
  std::error_code error;
  const fs::path images = fs::absolute(arguments.images, error).lexically_normal();
  const fs::path folder = (images.has_filename() ? images : images.parent_path()).parent_path() / "masks";
  if (it.named + it.in_masks > 0 || !fs::is_directory(folder, error) || fs::is_empty(folder, error)) return;
  warnings.push_back("the masks in " + folder.string() +
                     " are not used: none has the name of an image; expected 7.jpg.png, 7.png or 7_mask.png for 7.jpg");
}

}  // namespace

MaskReport look_at_masks(const Arguments& arguments, const SlamMap& map, const ImageSource& source, MaskSource& masks) {
  std::vector<fs::path> images;
  for (const std::int64_t id : source.keyframe_ids()) images.push_back(source.origin(id).file);
  MaskReport report;
  if (images.empty()) return report;
  const MapKeyframe* first = map.find_keyframe(source.keyframe_ids().front());
  const MapCamera& camera = map.cameras[static_cast<std::size_t>(first != nullptr ? first->camera : 0)];
  constexpr int kEnough = 2048;  // width [columns]
  int width = camera.width, height = camera.height;
  for (; width > kEnough && width % 2 == 0 && height % 2 == 0; height /= 2) width /= 2;
  const MaskSummary it = masks.look(images, width, height);
  warn_of_unused(arguments, map, it, report.warnings);
  const bool any = has_files(it) || it.with_alpha > 0 || arguments.mask_nadir > 0.0 || arguments.mask_zenith > 0.0;
  if (!any) return report;
  warn_of_share(it, report.warnings);
  report.text = sources(arguments, map, it) + "; " + hidden_text(it);
  if (it.named + it.in_masks + it.beside + it.with_alpha > 0)
    report.text += "; --no-masks ignores masks that come with images";
  const bool is_each = it.in_folder + it.named + it.in_masks + it.beside > 0;
  report.json = {{"hidden", it.hidden},
                 {"least", it.least},
                 {"most", it.most},
                 {"weighted_by", "solid angle"},
                 {"images", it.images},
                 {"with_file", is_each         ? it.in_folder + it.named + it.in_masks + it.beside
                               : has_files(it) ? it.images
                                               : 0},
                 {"with_alpha", it.with_alpha},
                 {"looked_at", it.looked_at},
                 {"file", it.first.string()},
                 {"nadir", arguments.mask_nadir},
                 {"zenith", arguments.mask_zenith}};
  return report;
}

}  // namespace pmsp::tool
