// SPDX-License-Identifier: BSD-2-Clause
#include "calibration.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <sstream>
#include <system_error>
#include <utility>

#include <nlohmann/json.hpp>

#include "export/files.h"
#include "numbers.h"
#include "options.h"
#include "pmsp/io/map.h"
#include "pmsp/stages.h"
#include "view_images.h"

namespace pmsp::tool {
namespace {

std::string describe(const LensDistance& it) {
  if (it.standard_error == 0.0) {
    return "lenses: taken for one; too few landmarks in the view of both (" + std::to_string(it.landmarks) + ")";
  }
  std::ostringstream text;
  text.precision(3);
  text << "lenses: " << it.distance << " map units apart (standard error " << it.standard_error << ", " << it.landmarks
       << " landmarks), " << (it.significant ? "corrected" : "taken for one");
  return text.str();
}

}  // namespace

Calibration calibrate(const Arguments& arguments, const DensifierOptions& options, const SlamMap& map,
                      const ImageSource& all_images, MaskSource& masks, bool growing,
                      const workspace::Record& recorded) {
  Calibration result;
  result.lens_distance = options.lens_distance;
  if (arguments.find_rig) result.rig = recorded_rig(recorded);
  bool wants_lenses =
      result.lens_distance == 0.0 && arguments.calibrate_lenses && quality_of(arguments) != Quality::kPaper;
  if (wants_lenses) result.lens_distance = nlohmann::json::parse(recorded.options).value("lens_distance", 0.0);
  wants_lenses = wants_lenses && result.lens_distance == 0.0;
  const bool wants_rig = arguments.find_rig && result.rig.mask.empty();
  const std::size_t now = all_images.keyframe_ids().size();
  const std::size_t then = recorded.lenses_looked_at;
  if ((!wants_lenses && !wants_rig) || !(growing ? now >= 2 * then : now != then)) return result;

  const Executor executor(options.threads, options.simd);
  std::optional<CameraCalibration> found =
      calibrate_camera(map, all_images, &masks, {wants_lenses, wants_rig}, executor);
  if (!found) return result;  // reported by the run when it reads that image or mask
  result.lenses = found->lenses;
  if (wants_rig) result.rig = std::move(found->rig);
  result.images = now;
  if (result.lenses && result.lenses->significant) result.lens_distance = result.lenses->distance;
  return result;
}

RigMask recorded_rig(const workspace::Record& record) {
  const nlohmann::json options = nlohmann::json::parse(record.options);
  const auto runs = options.find(workspace::kRigMask);
  if (runs == options.end()) return {};
  Image<std::uint8_t> mask(RigMaskEstimator::kWidth, RigMaskEstimator::kWidth / 2);
  auto at = mask.pixels().begin();
  std::uint8_t value = 0;
  for (const nlohmann::json& run : *runs) {
    if (!run.is_number_unsigned() || run.get<std::uint64_t>() > static_cast<std::uint64_t>(mask.pixels().end() - at))
      return {};
    at = std::fill_n(at, run.get<std::ptrdiff_t>(), value);
    value = static_cast<std::uint8_t>(255 - value);
  }
  return at == mask.pixels().end() ? rig_mask_of(std::move(mask)) : RigMask{};
}

nlohmann::ordered_json rig_json(const RigMask& rig) {
  nlohmann::ordered_json runs;
  std::uint8_t value = 0;
  for (auto at = rig.mask.pixels().begin(); at != rig.mask.pixels().end();) {
    const auto next = std::find_if(at, rig.mask.pixels().end(), [value](std::uint8_t it) { return it != value; });
    runs.push_back(static_cast<std::uint64_t>(next - at));
    value = static_cast<std::uint8_t>(255 - value);
    at = next;
  }
  return runs;
}

std::filesystem::path rig_mask_path(const Arguments& arguments) {
  return std::filesystem::path(arguments.cloud.paths.front()) += ".rig-mask.png";
}

bool write_rig_mask(const Arguments& arguments, const RigMask& rig) {
  const std::filesystem::path path = rig_mask_path(arguments);
  const std::vector<unsigned char> png = mask_png(rig.mask.view(), rig.mask.width(), rig.mask.height());
  std::error_code ignored;
  if (!arguments.force && std::filesystem::exists(path, ignored)) {
    std::ifstream file(path, std::ios::binary);
    const std::vector<unsigned char> there{std::istreambuf_iterator<char>(file), {}};
    return there == png;
  }
  write_file(path, png);
  return true;
}

std::vector<std::string> describe(const Calibration& calibration) {
  std::vector<std::string> texts;
  if (calibration.lenses) texts.push_back(describe(*calibration.lenses));
  if (!calibration.rig.mask.empty()) {
    texts.push_back("rig: " + percent_text(calibration.rig.share) +
                    " of the sphere moves with the camera and is masked; --mask none disables this");
  }
  return texts;
}

}  // namespace pmsp::tool
