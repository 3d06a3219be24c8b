// SPDX-License-Identifier: BSD-2-Clause
#include "export/ply_header.h"

#include <algorithm>
#include <cstddef>

namespace pmsp {
namespace {

constexpr std::size_t kCountDigits = 19;  // of any non-negative int64

// Comments, split into lines that begin with "... " after the first: CloudCompare 2.11 stops at lines of 1 KiB.
std::string comment_lines(std::string text) {
  constexpr std::size_t kMostCommentBytes = 200;
  std::replace_if(
      text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20; }, ' ');
  std::string lines;
  while (text.size() > kMostCommentBytes) {
    const std::size_t comma = text.rfind(',', kMostCommentBytes - 1);
    const std::size_t end = comma != std::string::npos && comma > kMostCommentBytes / 2 ? comma + 1 : kMostCommentBytes;
    lines += "comment " + text.substr(0, end) + "\n";
    text = "... " + text.substr(end);
  }
  return lines + "comment " + text + "\n";
}

}  // namespace

PlyHeader::PlyHeader(const std::vector<std::string>& comments, const std::string& properties)
    : before_("ply\nformat binary_little_endian 1.0\n"), after_(properties + "end_header\n") {
  for (const std::string& comment : comments) before_ += comment_lines(comment);
}

// A blank comment before the vertex count pads to a fixed length, so that the count can be patched and needs no leading
// zeros or spaces, which some readers reject.
std::string PlyHeader::text(std::int64_t vertices) const {
  const std::string digits = std::to_string(vertices);
  return before_ + "comment" + std::string(kCountDigits - digits.size() + 1, ' ') + "\nelement vertex " + digits +
         "\n" + after_;
}

bool needs_double(const CloudHeader& header) {
  constexpr double kFloatStep = 6e-8;  // half of the last bit
  return (header.center.norm() + header.reach) * kFloatStep > 1e-6 * header.reach;
}

}  // namespace pmsp
