// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <unordered_map>

namespace pmsp::io {

/// Finds masks by the names that programs give them. Each folder is listed once; capitals make no difference.
class MaskNames {
 public:
  /// The mask of an image "7.jpg" in a folder: 7.jpg.png (COLMAP, OpenSfM), 7.png, 7_mask.png (Metashape, ODM),
  /// 7.mask.png (OpenMVS), 7.jpg.mask.png, 7_mask or 7.jpg_mask in any format that images have. "" = there is none.
  std::filesystem::path in_folder(const std::filesystem::path& folder, const std::filesystem::path& image);

  /// The same in the folder of the image, of names that say "mask".
  std::filesystem::path beside(const std::filesystem::path& image);

 private:
  using Names = std::unordered_map<std::string, std::string>;  ///< as they are, and in small letters
  const Names& names_in(const std::filesystem::path& folder);
  std::filesystem::path find(const std::filesystem::path& folder, const std::filesystem::path& image, bool says_mask);

  std::map<std::filesystem::path, Names> folders_;
};

/// Whether a name is that of a mask by a program's rule: its stem ends like "7_mask" or "7.mask", in any case.
constexpr std::size_t kMaskEnd = 5;  ///< letters of "_mask"
bool is_mask_name(const std::filesystem::path& path);

/// Text in small letters (ASCII).
std::string lower_case(std::string text);

}  // namespace pmsp::io
