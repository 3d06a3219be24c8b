// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

namespace pmsp::tool {

/// Returns the token in a file. A missing file is created, readable by its owner only, with a random token; "" = no
/// file, no token. Throws IoError, OutputError, InvalidOption.
std::string token_from_file(const std::filesystem::path& file);

/// Whether the build contains QR codes (libqrencode).
bool has_qr_codes();

/// Returns a QR code for a terminal, as lines of half blocks; "" if it needs more than `columns`, or without
/// has_qr_codes(). Without `colors` it assumes a dark background.
std::string qr_text(const std::string& text, std::size_t columns, bool colors);

/// Returns the URL of a page as other computers reach it: an unspecified host (0.0.0.0, ::) is replaced by the first
/// address of this computer.
std::string url_for_others(const std::string& url);

/// For a page that others can reach: prints a warning to stderr, its URL if it differs from `url`, and on a terminal
/// its QR code. `address`: that the server listens at.
void print_access(const std::string& address, const std::string& url);

}  // namespace pmsp::tool
