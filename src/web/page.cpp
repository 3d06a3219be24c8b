// SPDX-License-Identifier: BSD-2-Clause
#include "web/page.h"

namespace pmsp::web {
namespace {

constexpr const char* kDataMark = "<!--PMSP-DATA-->";

}  // namespace

bool has_report_page() { return std::string(kPageTemplate).find(kDataMark) != std::string::npos; }

std::pair<std::string, std::string> page_around_data(bool connects) {
  std::string page = kPageTemplate;
  const std::string none = "default-src 'none';", images = "img-src ";
  if (connects) {
    if (const std::size_t at = page.find(images); at != std::string::npos) page.insert(at + images.size(), "'self' ");
    if (const std::size_t at = page.find(none); at != std::string::npos)
      page.insert(at + none.size(), " connect-src 'self';");
  }
  const std::size_t mark = page.find(kDataMark);
  return {page.substr(0, mark), page.substr(mark + std::string(kDataMark).size())};
}

std::string script_json(const nlohmann::ordered_json& json) {
  const std::string plain = json.dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace);
  std::string text;
  text.reserve(plain.size());
  for (const char c : plain) {
    if (c == '<' || c == '>' || c == '&') {  // occur in strings only
      text += c == '<' ? "\\u003c" : c == '>' ? "\\u003e" : "\\u0026";
    } else {
      text += c;
    }
  }
  return text;
}

}  // namespace pmsp::web
