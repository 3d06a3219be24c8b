// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/options.h"

#include <algorithm>
#include <sstream>
#include <string>
#include <type_traits>

#include "option_table.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

/// Checks the ranges of a stage's options, or of all ("").
void check(const DensifierOptions& options, const std::string& stage) {
  for (const OptionEntry& entry : option_table()) {
    if (std::string(entry.key).rfind(stage, 0) == 0) entry.check(options);
  }
}

/// Checks the ranges of one stage's options.
template <class Stage>
void check(Stage AdvancedOptions::*member, const Stage& stage, const std::string& prefix) {
  DensifierOptions options;
  options.advanced.*member = stage;
  check(options, prefix);
}

}  // namespace

// Ranges are in the table; the following functions check relations between options.

void ViewFilterOptions::validate() const {
  check(&AdvancedOptions::view_filter, *this, "view_filter.");
  if (min_parallax_deg >= max_parallax_deg) {
    std::ostringstream text;
    text << "view_filter.min_parallax_deg is " << min_parallax_deg
         << "; expected less than view_filter.max_parallax_deg, " << max_parallax_deg;
    throw InvalidOption(text.str());
  }
}

void InitOptions::validate() const { check(&AdvancedOptions::init, *this, "init."); }

void PatchMatchOptions::validate() const { check(&AdvancedOptions::patchmatch, *this, "patchmatch."); }

void MedianFilterOptions::validate() const { check(&AdvancedOptions::median, *this, "median."); }

void ConsistencyFilterOptions::validate() const {
  check(&AdvancedOptions::consistency, *this, "consistency.");
  if (min_views > window) {
    throw InvalidOption("consistency.min_views is " + std::to_string(min_views) +
                        "; expected no more than consistency.window, " + std::to_string(window));
  }
}

void FusionOptions::validate() const { check(&AdvancedOptions::fusion, *this, "fusion."); }

void FreeSpaceOptions::validate() const { check(&AdvancedOptions::free_space, *this, "free_space."); }

void DensifierOptions::validate() const {
  check(*this, "");
  if (advanced.expected_keyframes < 0) {
    throw InvalidOption("expected_keyframes is " + std::to_string(advanced.expected_keyframes) +
                        "; expected 0 (not known) or more");
  }
  advanced.view_filter.validate();
  advanced.consistency.validate();
}

DensifierOptions preset(Quality quality) {
  DensifierOptions options;
  for (const OptionEntry& entry : option_table()) {
    const std::optional<double>& value = entry.presets[static_cast<std::size_t>(quality)];
    if (!value) continue;
    std::visit(
        [&](auto at) {
          using T = std::decay_t<decltype(at(options))>;
          if constexpr (std::is_arithmetic_v<T>) at(options) = static_cast<T>(*value);
        },
        entry.access);
  }
  return options;
}

Quality quality_from_name(const std::string& name) {
  if (name == "paper") return Quality::kPaper;
  if (name == "online") return Quality::kOnline;
  if (name == "normal") return Quality::kNormal;
  if (name == "high") return Quality::kHigh;
  throw InvalidOption("quality is '" + name + "'; expected paper, online, normal or high");
}

Backend backend_from_name(const std::string& name) {
  for (const Backend backend : {Backend::kAuto, Backend::kCpu, Backend::kCuda}) {
    if (name == name_of(backend)) return backend;
  }
  throw InvalidOption("backend is '" + name + "'; expected auto, cpu or cuda");
}

const char* name_of(Backend backend) {
  switch (backend) {
    case Backend::kCpu:
      return "cpu";
    case Backend::kCuda:
      return "cuda";
    case Backend::kAuto:
      break;
  }
  return "auto";
}

Simd simd_from_name(const std::string& name) {
  for (const Simd simd : {Simd::kAuto, Simd::kScalar, Simd::kAvx2, Simd::kAvx512}) {
    if (name == name_of(simd)) return simd;
  }
  throw InvalidOption("simd is '" + name + "'; expected auto, scalar, avx2 or avx512");
}

const char* name_of(Simd simd) {
  switch (simd) {
    case Simd::kScalar:
      return "scalar";
    case Simd::kAvx2:
      return "avx2";
    case Simd::kAvx512:
      return "avx512";
    case Simd::kAuto:
      break;
  }
  return "auto";
}

}  // namespace pmsp
