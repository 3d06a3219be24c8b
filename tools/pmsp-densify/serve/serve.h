// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "web/http_server.h"

namespace pmsp::tool {

/// Answers with the files of a folder. `page`: the one that the folder itself shows; "" = index.html, the only page in
/// it, or a list of its pages. Throws IoError.
class FolderHandler {
 public:
  FolderHandler(const std::filesystem::path& folder, std::string page);

  std::optional<web::HttpReply> operator()(const web::HttpRequest& request) const;

 private:
  std::vector<std::string> pages() const;
  web::HttpReply front_page() const;

  std::filesystem::path path_;
  web::ServedFolder folder_;
  std::string page_;
};

}  // namespace pmsp::tool
