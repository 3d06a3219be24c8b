// SPDX-License-Identifier: BSD-2-Clause
#include "mask_names.h"

#include <algorithm>
#include <array>
#include <system_error>
#include <vector>

#include "image_naming.h"
#include "util/text.h"

namespace pmsp::io {
namespace {

namespace fs = std::filesystem;

constexpr std::array kEndings{".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp"};

}  // namespace

bool is_mask_name(const fs::path& path) {
  const std::string stem = lower_case(path.stem().string());
  const std::string end = stem.size() > kMaskEnd ? stem.substr(stem.size() - kMaskEnd) : "";
  return end == "_mask" || end == ".mask";
}

const MaskNames::Names& MaskNames::names_in(const fs::path& folder) {
  const auto [found, is_new] = folders_.try_emplace(folder);
  if (!is_new) return found->second;
  std::error_code error;
  std::vector<std::string> names;
  for (fs::directory_iterator at(folder, error); !error && at != fs::directory_iterator(); at.increment(error)) {
    if (is_image_name(at->path())) names.push_back(at->path().filename().string());
  }
  std::sort(names.begin(), names.end());
  for (const std::string& name : names) found->second.emplace(name, name);
  for (const std::string& name : names) found->second.emplace(lower_case(name), name);
  return found->second;
}

fs::path MaskNames::find(const fs::path& folder, const fs::path& image, bool says_mask) {
  const Names& names = names_in(folder);
  if (names.empty()) return {};
  const std::string name = image.filename().string();
  const std::string stem = image.stem().string();
  std::vector<std::string> beginnings{stem + "_mask", stem + ".mask", name + ".mask", name + "_mask"};
  if (!says_mask) beginnings.insert(beginnings.begin(), {name, stem});
  std::error_code error;
  const bool among_images = fs::equivalent(folder, image.parent_path(), error);
  for (const std::string& beginning : beginnings) {
    for (const char* ending : kEndings) {
      if (among_images && beginning == stem && ending != kEndings.front()) break;  // 7.jpg beside 7.png is an image
      auto found = names.find(beginning + ending);
      if (found == names.end()) found = names.find(lower_case(beginning + ending));
      if (found == names.end()) continue;
      fs::path path = folder / found->second;
      // Masks beside the images must not be the images themselves.
      std::error_code ignored;
      if (fs::is_regular_file(path, ignored) && !fs::equivalent(path, image, ignored)) return path;
    }
  }
  return {};
}

fs::path MaskNames::in_folder(const fs::path& folder, const fs::path& image) { return find(folder, image, false); }

fs::path MaskNames::beside(const fs::path& image) { return find(image.parent_path(), image, true); }

}  // namespace pmsp::io
