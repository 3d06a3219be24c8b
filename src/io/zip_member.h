// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <set>
#include <string>

#include "pmsp/api.h"

namespace pmsp::io {

/// Maximum expansion of a byte by deflate ("maximum expansion factor", zlib's technical details).
constexpr std::size_t kMaxInflation = 1032;

/// Members of ZIP archives have paths like files: "depth/a.zip/00012.exr", "pose/a.npz/inds.npy". Returns the archive
/// of such a path; "" for other paths.
PMSP_API std::filesystem::path archive_of(const std::filesystem::path& path);

/// Returns the names of an archive's members. Throws IoError.
std::set<std::string> zip_members(const std::filesystem::path& archive);

/// Returns the bytes of a member, at most 1 GiB, stored or deflated. Throws IoError if it is missing or damaged;
/// InvalidInput if it is larger, or than deflate can expand it.
std::string read_zip_member(const std::filesystem::path& path);

}  // namespace pmsp::io
