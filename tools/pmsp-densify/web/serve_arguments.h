// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>

#include "web/http_server.h"

namespace pmsp::tool {

struct ServeArguments {
  std::filesystem::path folder;
  std::string page;  ///< the file that "/" shows; "" = that of the folder, or a list
  HttpOptions http;
};

/// nullopt when help was asked for, which is then on stdout. Throws UsageError, InvalidOption, IoError.
std::optional<ServeArguments> parse_serve_arguments(int argc, const char* const* argv);

/// Of an option such as --port. Throws UsageError.
std::uint16_t port_from(const char* option, const std::string& text);

}  // namespace pmsp::tool
