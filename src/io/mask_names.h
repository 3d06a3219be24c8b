// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <unordered_map>

namespace pmsp::io {

/// Finds masks by the naming rules of various programs, case-insensitive. Each folder is listed once.
class MaskNames {
 public:
  /// Returns the mask of an image "7.jpg" in a folder: 7.jpg.png (COLMAP, OpenSfM), 7.png, 7_mask.png (Metashape, ODM),
  /// 7.mask.png (OpenMVS), 7.jpg.mask.png, 7_mask or 7.jpg_mask in any image format. "" = none.
  std::filesystem::path in_folder(const std::filesystem::path& folder, const std::filesystem::path& image);

  /// As in_folder, in the folder of the image, for names that contain "mask".
  std::filesystem::path beside(const std::filesystem::path& image);

 private:
  using Names = std::unordered_map<std::string, std::string>;  ///< lower case to original
  const Names& names_in(const std::filesystem::path& folder);
  std::filesystem::path find(const std::filesystem::path& folder, const std::filesystem::path& image, bool says_mask);

  std::map<std::filesystem::path, Names> folders_;
};

/// True for mask names by a program's rule: the stem ends in "_mask" or ".mask", in any case.
constexpr std::size_t kMaskEnd = 5;  ///< length of "_mask"
bool is_mask_name(const std::filesystem::path& path);

}  // namespace pmsp::io
