// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "export/little_endian.h"
#include "export/record_file.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud.h"

namespace pmsp {
namespace {

constexpr int kCountDigits = 19;  // of any non-negative int64

// Line with the vertex count. A blank comment before it pads to a fixed length, so that the count can be patched and
// needs no leading zeros or spaces, which some readers reject.
std::string vertex_lines(std::int64_t count) {
  const std::string digits = std::to_string(count);
  return "comment" + std::string(static_cast<std::size_t>(kCountDigits) - digits.size() + 1, ' ') +
         "\nelement vertex " + digits + "\n";
}

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

// Header up to the vertex count.
std::string first_lines(const std::vector<std::string>& comments) {
  std::string lines = "ply\nformat binary_little_endian 1.0\n";
  for (const std::string& comment : comments) lines += comment_lines(comment);
  return lines;
}

// Header after the vertex count. CloudCompare reads further properties if their names begin with "scalar_".
std::string last_lines(bool double_positions) {
  std::string lines;
  for (const char* axis : {"x", "y", "z"}) {
    lines += std::string("property ") + (double_positions ? "double " : "float ") + axis + "\n";
  }
  return lines +
         "property float nx\nproperty float ny\nproperty float nz\n"
         "property uchar red\nproperty uchar green\nproperty uchar blue\n"
         "property float scalar_confidence\nproperty uchar scalar_views\nend_header\n";
}

// True if the resolution of float at the cloud's distance from the origin is worse than 1e-6 of the reach.
bool needs_double(const CloudHeader& header) {
  constexpr double kFloatStep = 6e-8;  // half of the last bit
  return (header.center.norm() + header.reach) * kFloatStep > 1e-6 * header.reach;
}

template <class Coordinate>
void encode(const OutputPoint* points, std::size_t count, char* to) {
  for (const OutputPoint* point = points; point != points + count; ++point) {
    for (int i = 0; i < 3; ++i) to = put_little(to, static_cast<Coordinate>(point->position[i]));
    for (int i = 0; i < 3; ++i) to = put_little(to, point->normal[i]);
    to = put_little(to, point->color.r);
    to = put_little(to, point->color.g);
    to = put_little(to, point->color.b);
    to = put_little(to, point->confidence);
    to = put_little(to, point->views);
  }
}

class Ply final : public CloudWriter {
 public:
  Ply(const std::filesystem::path& path, const CloudHeader& header)
      : Ply(path, first_lines(header.comments), header.double_positions || needs_double(header), header.threads) {}

  void add(const OutputPoint* points, std::size_t count) override {
    file_.add(points, count, double_positions_ ? encode<double> : encode<float>);
  }

  bool add_parallel(std::size_t count, const PointProducer& producer) override {
    file_.add(count, producer, double_positions_ ? encode<double> : encode<float>);
    return true;
  }

  void finish() override {
    file_.patch(count_offset_, vertex_lines(file_.points()));
    file_.commit();
  }

 private:
  Ply(const std::filesystem::path& path, const std::string& first, bool double_positions, int threads)
      : double_positions_(double_positions),
        count_offset_(static_cast<std::int64_t>(first.size())),
        file_(path, first + vertex_lines(0) + last_lines(double_positions),
              (double_positions ? 3 * sizeof(double) : 3 * sizeof(float)) + 3 * sizeof(float) + 3 + sizeof(float) + 1,
              threads) {}

  bool double_positions_;
  std::int64_t count_offset_;
  RecordFile file_;
};

}  // namespace

std::unique_ptr<CloudWriter> open_ply(const std::filesystem::path& path, const CloudHeader& header) {
  return std::make_unique<Ply>(path, header);
}

}  // namespace pmsp
