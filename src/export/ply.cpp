// SPDX-License-Identifier: BSD-2-Clause
#include <string>

#include "export/little_endian.h"
#include "export/ply_header.h"
#include "export/record_file.h"
#include "pmsp/io/cloud.h"

namespace pmsp {
namespace {

// CloudCompare reads further properties if their names begin with "scalar_".
std::string property_lines(bool double_positions) {
  std::string lines;
  for (const char* axis : {"x", "y", "z"}) {
    lines += std::string("property ") + (double_positions ? "double " : "float ") + axis + "\n";
  }
  return lines +
         "property float nx\nproperty float ny\nproperty float nz\n"
         "property uchar red\nproperty uchar green\nproperty uchar blue\n"
         "property float scalar_confidence\nproperty uchar scalar_views\n";
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
      : double_positions_(header.double_positions || needs_double(header)),
        header_(header.comments, property_lines(double_positions_)),
        file_(path, header_.text(0),
              (double_positions_ ? 3 * sizeof(double) : 3 * sizeof(float)) + 3 * sizeof(float) + 3 + sizeof(float) + 1,
              header.threads) {}

  void add(const OutputPoint* points, std::size_t count) override {
    file_.add(points, count, double_positions_ ? encode<double> : encode<float>);
  }

  bool add_parallel(std::size_t count, const PointProducer& producer) override {
    file_.add(count, producer, double_positions_ ? encode<double> : encode<float>);
    return true;
  }

  void finish() override {
    file_.patch(0, header_.text(file_.points()));
    file_.commit();
  }

 private:
  bool double_positions_;
  PlyHeader header_;
  RecordFile file_;
};

}  // namespace

std::unique_ptr<CloudWriter> open_ply(const std::filesystem::path& path, const CloudHeader& header) {
  return std::make_unique<Ply>(path, header);
}

}  // namespace pmsp
