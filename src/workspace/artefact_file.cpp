// SPDX-License-Identifier: BSD-2-Clause
#include "workspace/artefact_file.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "io/binary_input.h"
#include "pmsp/error.h"

namespace pmsp::workspace {
namespace {

constexpr char kPlanes[17] = "pmsp planes    1";
constexpr char kPoints[17] = "pmsp points    1";
constexpr char kImageRecord[17] = "pmsp look      1";
constexpr std::size_t kKindBytes = 16;
constexpr std::size_t kSumBytes = sizeof(std::uint64_t);

/// Size of a point: position, normal, confidence, colour, number of views.
constexpr std::size_t kStoredPointBytes = 7 * sizeof(float) + 4;

/// Returns the end of the written bytes.
char* encode(const CloudPoint& point, char* to) {
  std::memcpy(to, point.position.data(), 3 * sizeof(float));
  std::memcpy(to + 3 * sizeof(float), point.normal.data(), 3 * sizeof(float));
  std::memcpy(to + 6 * sizeof(float), &point.confidence, sizeof(float));
  const std::uint8_t bytes[] = {point.color.r, point.color.g, point.color.b, point.views};
  std::memcpy(to + 7 * sizeof(float), bytes, sizeof(bytes));
  return to + kStoredPointBytes;
}

const char* decode(const char* from, CloudPoint& point) {
  std::uint8_t bytes[4];
  std::memcpy(point.position.data(), from, 3 * sizeof(float));
  std::memcpy(point.normal.data(), from + 3 * sizeof(float), 3 * sizeof(float));
  std::memcpy(&point.confidence, from + 6 * sizeof(float), sizeof(float));
  std::memcpy(bytes, from + 7 * sizeof(float), sizeof(bytes));
  point.color = {bytes[0], bytes[1], bytes[2]};
  point.views = bytes[3];
  return from + kStoredPointBytes;
}

/// Writes data followed by their checksum.
class Writer {
 public:
  Writer(const std::filesystem::path& path, const char* kind) : file_(std::make_unique<AtomicFile>(path)) {
    XXH3_64bits_reset(&hash_);
    put(kind, kKindBytes);
  }
  void put(const void* data, std::size_t bytes) {
    if (bytes == 0) return;
    XXH3_64bits_update(&hash_, data, bytes);
    file_->write(data, bytes);
  }
  template <class T>
  void put(const T& value) {
    static_assert(std::is_arithmetic_v<T>, "numbers without gaps");
    put(&value, sizeof(value));
  }
  template <class T>
  void put_all(const std::vector<T>& values) {
    static_assert(std::is_arithmetic_v<T>, "numbers without gaps");
    put(static_cast<std::uint64_t>(values.size()));
    put(values.data(), values.size() * sizeof(T));
  }
  void put(const KeyframePose& pose) {
    for (int i = 0; i < 9; ++i) put(pose.cam_from_world.rotation(i / 3, i % 3));
    for (int i = 0; i < 3; ++i) put(pose.cam_from_world.translation[i]);
    put(pose.scale);
  }
  /// Writes points in blocks: a call per number would take longer than the disk.
  void put(const std::vector<CloudPoint>& points) {
    constexpr std::size_t kAtOnce = 4096;
    std::vector<char> bytes;
    put(static_cast<std::uint64_t>(points.size()));
    for (std::size_t first = 0; first < points.size(); first += kAtOnce) {
      const std::size_t count = std::min(kAtOnce, points.size() - first);
      bytes.resize(count * kStoredPointBytes);
      char* to = bytes.data();
      for (std::size_t i = 0; i < count; ++i) to = encode(points[first + i], to);
      put(bytes.data(), bytes.size());
    }
  }
  /// Returns the file, not yet in its place.
  std::unique_ptr<AtomicFile> finish() {
    const std::uint64_t sum = XXH3_64bits_digest(&hash_);
    file_->write(&sum, sizeof(sum));
    return std::move(file_);
  }

 private:
  std::unique_ptr<AtomicFile> file_;
  XXH3_state_t hash_;
};

class Reader {
 public:
  Reader(const std::filesystem::path& path, const char* kind) : in_(path) {
    if (in_.size() < kKindBytes + kSumBytes) refuse();
    const auto end = static_cast<std::size_t>(in_.size()) - kSumBytes;
    const char* const bytes = in_.take(end + kSumBytes);
    std::uint64_t sum = 0;
    std::memcpy(&sum, bytes + end, kSumBytes);
    if (XXH3_64bits(bytes, end) != sum || std::memcmp(bytes, kind, kKindBytes) != 0) refuse();
    in_.seek(kKindBytes);
  }
  void get(void* data, std::size_t bytes) {
    if (bytes > left()) refuse();
    if (bytes > 0) std::memcpy(data, in_.take(bytes), bytes);
  }
  std::vector<CloudPoint> points() {
    std::vector<CloudPoint> points(count(kStoredPointBytes));
    const char* from = in_.take(points.size() * kStoredPointBytes);
    for (CloudPoint& point : points) from = decode(from, point);
    return points;
  }
  template <class T>
  T get() {
    T value{};
    get(&value, sizeof(value));
    return value;
  }
  /// Reads the size of a list of elements of `size` bytes.
  std::size_t count(std::size_t size) {
    const std::uint64_t number = get<std::uint64_t>();
    if (number > left() / size) refuse();
    return static_cast<std::size_t>(number);
  }
  template <class T>
  std::vector<T> get_all() {
    std::vector<T> values(count(sizeof(T)));
    get(values.data(), values.size() * sizeof(T));
    return values;
  }
  KeyframePose pose() {
    KeyframePose pose;
    for (int i = 0; i < 9; ++i) pose.cam_from_world.rotation(i / 3, i % 3) = get<double>();
    for (int i = 0; i < 3; ++i) pose.cam_from_world.translation[i] = get<double>();
    pose.scale = get<double>();
    return pose;
  }
  [[noreturn]] void refuse() const {
    throw IoError(in_.path().string() + ": this file of the workspace is damaged; delete it and run again");
  }

 private:
  std::uint64_t left() const { return in_.remaining() - kSumBytes; }

  BinaryInput in_;
};

}  // namespace

std::unique_ptr<AtomicFile> planes_file(const std::filesystem::path& path, const PlaneMap& planes) {
  Writer file(path, kPlanes);
  file.put(planes.keyframe_id);
  file.put(planes.pose());
  file.put(static_cast<std::int32_t>(planes.width()));
  file.put(static_cast<std::int32_t>(planes.height()));
  for (const Image<float>* part : {&planes.x, &planes.y, &planes.z, &planes.score}) {
    file.put(part->pixels().data(), part->size() * sizeof(float));
  }
  return file.finish();
}

PlaneMap read_planes(const std::filesystem::path& path) {
  Reader file(path, kPlanes);
  const std::int64_t id = file.get<std::int64_t>();
  const KeyframePose pose = file.pose();
  const std::int32_t width = file.get<std::int32_t>();
  const std::int32_t height = file.get<std::int32_t>();
  if (width < 1 || height < 1 || width > 16384 || height > 16384) file.refuse();
  PlaneMap planes(width, height);
  planes.keyframe_id = id;
  planes.cam_from_world = pose.cam_from_world;
  planes.scale = pose.scale;
  for (Image<float>* part : {&planes.x, &planes.y, &planes.z, &planes.score}) {
    file.get(part->pixels().data(), part->size() * sizeof(float));
  }
  return planes;
}

std::unique_ptr<AtomicFile> points_file(const std::filesystem::path& path, const KeyframeCloud& cloud) {
  Writer file(path, kPoints);
  file.put(cloud.keyframe_id);
  file.put(cloud.pose());
  file.put(cloud.points);
  file.put_all(cloud.pixels);
  file.put_all(cloud.agree);
  file.put_all(cloud.window_ids);
  return file.finish();
}

KeyframeCloud read_points(const std::filesystem::path& path) {
  Reader file(path, kPoints);
  KeyframeCloud cloud;
  cloud.keyframe_id = file.get<std::int64_t>();
  const KeyframePose pose = file.pose();
  cloud.cam_from_world = pose.cam_from_world;
  cloud.scale = pose.scale;
  cloud.points = file.points();
  cloud.pixels = file.get_all<std::uint32_t>();
  cloud.agree = file.get_all<std::uint32_t>();
  cloud.window_ids = file.get_all<std::int64_t>();
  return cloud;
}

void write_image_record(const std::filesystem::path& path, const ImageRecord& record) {
  Writer file(path, kImageRecord);
  file.put(static_cast<std::int32_t>(record.width));
  file.put(static_cast<std::int32_t>(record.height));
  file.put(static_cast<std::uint64_t>(record.sharpness.landmarks.size()));
  for (const LandmarkSharpness& at : record.sharpness.landmarks) {
    file.put(at.id);
    file.put(at.horizontal);
    file.put(at.vertical);
  }
  file.finish()->commit();
}

ImageRecord read_image_record(const std::filesystem::path& path) {
  Reader file(path, kImageRecord);
  ImageRecord record;
  record.width = file.get<std::int32_t>();
  record.height = file.get<std::int32_t>();
  if (record.width < 1 || record.height < 1) file.refuse();
  record.sharpness.landmarks.resize(file.count(sizeof(std::int64_t) + 2 * sizeof(float)));
  for (LandmarkSharpness& at : record.sharpness.landmarks) {
    at.id = file.get<std::int64_t>();
    at.horizontal = file.get<float>();
    at.vertical = file.get<float>();
  }
  return record;
}

}  // namespace pmsp::workspace
