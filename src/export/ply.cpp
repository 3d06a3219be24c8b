// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/io/ply.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

#include "export/background_file.h"
#include "pmsp/error.h"
#include "util/thread_pool.h"

namespace pmsp {
namespace {

constexpr std::size_t kBlockBytes = std::size_t{1} << 20;
constexpr std::size_t kBlocksAtOnce = 8;
constexpr int kMostThreads = 4;   // as fast as any disk
constexpr int kCountDigits = 19;  // every non-negative int64

// The line with the vertex count. A blank comment before it takes up what the count leaves of a fixed length, so that
// the number itself is written plainly: some readers take neither leading zeros nor spaces.
std::string vertex_lines(std::int64_t count) {
  const std::string digits = std::to_string(count);
  return "comment" + std::string(static_cast<std::size_t>(kCountDigits) - digits.size() + 1, ' ') +
         "\nelement vertex " + digits + "\n";
}

std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20; }, ' ');
  return text;
}

template <class T>
char* put(char* at, T value) {
  unsigned char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
  std::reverse(bytes, bytes + sizeof(T));
#endif
  std::memcpy(at, bytes, sizeof(T));
  return at + sizeof(T);
}

}  // namespace

struct PlyWriter::Impl {
  Impl(const std::filesystem::path& path, const Options& options)
      : file(path), name(path.string()), double_positions(options.double_positions) {
    std::string header = "ply\nformat binary_little_endian 1.0\n";
    for (const std::string& comment : options.comments) header += "comment " + one_line(comment) + "\n";
    count_offset = static_cast<std::int64_t>(header.size());
    header += vertex_lines(0);
    for (const char* axis : {"x", "y", "z"}) {
      header += std::string("property ") + (double_positions ? "double " : "float ") + axis + "\n";
    }
    header +=
        "property float nx\nproperty float ny\nproperty float nz\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        "property float confidence\nproperty uchar views\nend_header\n";
    file.write(BackgroundFile::Block(header.begin(), header.end()));
  }

  std::size_t record_bytes() const { return 3 * (double_positions ? 8 : 4) + 3 * 4 + 3 + 4 + 1; }

  template <class Coordinate>
  static char* put_point(char* at, const CloudPoint& point, double scale, const RigidTransform& world_from_cam,
                         const Eigen::Matrix3f& rotation) {
    const Eigen::Vector3d position = world_from_cam * (scale * point.position.cast<double>());
    const Eigen::Vector3f normal = rotation * point.normal;
    for (int i = 0; i < 3; ++i) at = put(at, static_cast<Coordinate>(position[i]));
    for (int i = 0; i < 3; ++i) at = put(at, normal[i]);
    at = put(at, point.color.r);
    at = put(at, point.color.g);
    at = put(at, point.color.b);
    at = put(at, point.confidence);
    return put(at, point.views);
  }

  template <class Coordinate>
  void add(const KeyframeCloud& cloud, double scale, const RigidTransform& world_from_cam) {
    const Eigen::Matrix3f rotation = world_from_cam.rotation.cast<float>();
    const std::size_t bytes = record_bytes();
    const std::size_t each = kBlockBytes / bytes;
    const std::size_t count = (cloud.points.size() + each - 1) / each;
    for (std::size_t begin = 0; begin < count; begin += kBlocksAtOnce) {
      std::vector<BackgroundFile::Block> blocks(std::min(kBlocksAtOnce, count - begin));
      for (BackgroundFile::Block& block : blocks) block = file.block();
      pool.for_each(static_cast<int>(blocks.size()), [&](int at) {
        const std::size_t first = (begin + static_cast<std::size_t>(at)) * each;
        const std::size_t last = std::min(first + each, cloud.points.size());
        BackgroundFile::Block& block = blocks[static_cast<std::size_t>(at)];
        block.resize((last - first) * bytes);
        char* to = block.data();
        for (std::size_t i = first; i < last; ++i) {
          to = put_point<Coordinate>(to, cloud.points[i], scale, world_from_cam, rotation);
        }
      });
      for (BackgroundFile::Block& block : blocks) file.write(std::move(block));
    }
    points += static_cast<std::int64_t>(cloud.points.size());
  }

  BackgroundFile file;
  ThreadPool pool{std::min(kMostThreads, usable_cpus())};
  std::string name;
  bool double_positions;
  std::int64_t count_offset = 0;
  std::int64_t points = 0;
  bool finished = false;
};

PlyWriter::PlyWriter(const std::filesystem::path& path, const Options& options)
    : impl_(std::make_unique<Impl>(path, options)) {}

PlyWriter::~PlyWriter() = default;

void PlyWriter::add(const KeyframeCloud& cloud, const KeyframePose& pose) {
  if (impl_->finished) throw OutputError(impl_->name + ": points added after the file was finished");
  const RigidTransform world_from_cam = pose.cam_from_world.inverse();
  if (impl_->double_positions) return impl_->add<double>(cloud, pose.scale, world_from_cam);
  impl_->add<float>(cloud, pose.scale, world_from_cam);
}

std::int64_t PlyWriter::points() const { return impl_->points; }

void PlyWriter::finish() {
  if (impl_->finished) return;
  impl_->file.patch(impl_->count_offset, vertex_lines(impl_->points));
  impl_->file.commit();
  impl_->finished = true;
}

}  // namespace pmsp
