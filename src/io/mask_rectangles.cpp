// SPDX-License-Identifier: BSD-2-Clause
#include "mask_rectangles.h"

#include <cmath>
#include <cstdlib>
#include <string>

#include "pmsp/error.h"
#include "text_input.h"

namespace pmsp::io {
namespace {

constexpr const char* kKey = "mask_rectangles";
constexpr std::size_t kMaxBytes = std::size_t{1} << 20;
constexpr std::size_t kMaxRectangles = 1000;

std::string expected() {
  return "; expected mask_rectangles: with lines such as \"- [0.0, 1.0, 0.9, 1.0]\" (x_min, x_max, y_min, y_max as "
         "shares of the image, 0 to 1)";
}

/// Text from the key to the next one, without comments.
std::string list_text(const std::filesystem::path& path) {
  TextInput in(path);
  if (in.size() > kMaxBytes) fail(path, "", "larger than 1 MiB, expected a configuration");
  std::string list;
  bool inside = false;
  bool found = false;
  while (in.next_line()) {
    std::string line = in.line().substr(0, in.line().find('#'));
    const std::size_t colon = line.find(':');
    if (colon != std::string::npos) {
      std::string key = line.substr(0, colon);
      key.erase(0, key.find_last_of(" \t.\"'", key.find_last_not_of(" \t\"'")) + 1);  // also "Feature.mask_rectangles"
      inside = key.compare(0, std::string(kKey).size(), kKey) == 0;
      found = found || inside;
      line.erase(0, colon + 1);
    }
    if (inside) list += line + "\n";
  }
  if (!found) throw InvalidInput(path.string() + ": has no mask_rectangles" + expected());
  return list;
}

}  // namespace

std::vector<MaskRectangle> read_mask_rectangles(const std::filesystem::path& path) {
  const std::string text = list_text(path);
  std::vector<MaskRectangle> rectangles;
  std::vector<double> numbers;
  int depth = 0;
  for (std::size_t at = 0; at < text.size();) {
    const char c = text[at];
    const bool is_dash = c == '-' && depth == 0;
    if (std::string(" \t\r\n,").find(c) != std::string::npos || is_dash) {
      ++at;
    } else if (c == '[') {
      ++at;
      ++depth;
      numbers.clear();
    } else if (c == ']' && depth > 0) {
      ++at;
      --depth;
      if (numbers.empty()) continue;  // outer list
      if (numbers.size() != 4)
        throw InvalidInput(path.string() + ": rectangle " + std::to_string(rectangles.size() + 1) + " has " +
                           std::to_string(numbers.size()) + " numbers" + expected());
      const MaskRectangle r{numbers[0], numbers[1], numbers[2], numbers[3]};
      const auto is_span = [](double from, double to) { return from >= 0.0 && from < to && to <= 1.0; };
      if (!is_span(r.x_min, r.x_max) || !is_span(r.y_min, r.y_max))
        throw InvalidInput(path.string() + ": rectangle " + std::to_string(rectangles.size() + 1) +
                           " is empty or leaves the image" + expected());
      if (rectangles.size() == kMaxRectangles) throw InvalidInput(path.string() + ": more than 1000 mask_rectangles");
      rectangles.push_back(r);
      numbers.clear();
    } else {
      char* end = nullptr;
      const double number = std::strtod(text.c_str() + at, &end);
      if (depth == 0 || end == text.c_str() + at || !std::isfinite(number) || numbers.size() > 4)
        throw InvalidInput(path.string() + ": mask_rectangles cannot be read at \"" + text.substr(at, 20) + "\"" +
                           expected());
      numbers.push_back(number);
      at = static_cast<std::size_t>(end - text.c_str());
    }
  }
  if (rectangles.empty() || depth != 0) throw InvalidInput(path.string() + ": mask_rectangles is empty" + expected());
  return rectangles;
}

}  // namespace pmsp::io
