// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp/io/cloud.h"

#include <algorithm>
#include <map>
#include <optional>

#include "export/placed_points.h"
#include "export/robot_map.h"
#include "export/thinning.h"
#include "pmsp/error.h"
#include "pmsp/io/map.h"

namespace pmsp {

CloudHeader cloud_header_of(const SlamMap& map, const Similarity& file_from_map, double range_margin) {
  CloudHeader header;
  header.file_from_map = file_from_map;
  if (map.keyframes.empty()) return header;
  Eigen::Vector3d low = map.keyframes.front().cam_from_world.center(), high = low;
  for (const MapKeyframe& keyframe : map.keyframes) {
    const Eigen::Vector3d center = keyframe.cam_from_world.center();
    low = low.cwiseMin(center);
    high = high.cwiseMax(center);
    header.cameras[keyframe.id] = file_from_map * keyframe.cam_from_world.inverse();
  }
  const double reach = 0.5 * (high - low).norm() + farthest_landmarks(map) * range_margin;
  header.center = file_from_map * (0.5 * (low + high));
  header.reach = file_from_map.scale * (reach > 0.0 ? reach : 1.0);
  return header;
}

struct CloudOutput::Impl {
  Impl(const CloudHeader& header, const CloudSelection& amount, const std::vector<Target>& to)
      : file_from_map(header.file_from_map),
        cameras(header.cameras),
        cell_size(header.cell_size),
        crop(amount.crop),
        targets(to),
        threads(header.threads) {
    std::vector<Target> maps;
    for (const Target& target : targets) {
      if (target.format->is_map) {
        maps.push_back(target);
      } else {
        clouds.push_back(target);
        writers.push_back(target.format->open(target.path, header));
      }
    }
    if (!maps.empty()) map = open_robot_map(maps, header, amount.crop);
    if (amount.thinning.is_needed()) thinning = std::make_unique<Thinning>(amount.thinning, header.scratch.string());
  }

  void require_open() const {
    if (!committed) return;
    throw OutputError((targets.empty() ? std::string("cloud") : targets[0].path.string()) +
                      ": points added after the file was finished");
  }

  /// Rays of maps start at the cameras of the header.
  void require_camera(std::int64_t keyframe_id, const KeyframePose& pose) const {
    const auto camera = cameras.find(keyframe_id);
    const Eigen::Vector3d center = file_from_map * pose.cam_from_world.center();
    if (camera != cameras.end() && (camera->second.translation - center).norm() <= cell_size) return;
    throw InvalidInput(
        "keyframe " + std::to_string(keyframe_id) + ": its camera is " +
        (camera == cameras.end() ? "missing" : "elsewhere") +
        " in CloudHeader::cameras, which a map needs; open the output when poses have their final values");
  }

  /// All receivers of the points.
  std::vector<CloudWriter*> all_writers() const {
    std::vector<CloudWriter*> all;
    for (const auto& writer : writers) all.push_back(writer.get());
    all.insert(all.end(), others.begin(), others.end());
    return all;
  }

  ThreadPool& own_pool() {
    if (!pool) pool.emplace(threads);
    return *pool;
  }

  void each_piece(std::size_t count, const PointProducer& place,
                  const std::function<void(const OutputPoint* points, std::size_t count)>& take) {
    if (!placed) placed.emplace(own_pool());
    placed->for_each_piece(count, place, take);
  }

  void write(const std::vector<CloudWriter*>& to, const OutputPoint* points, std::size_t count) {
    for (CloudWriter* writer : to) writer->add(points, count);
    written += static_cast<std::int64_t>(count);
  }

  Similarity file_from_map;
  std::map<std::int64_t, RigidTransform> cameras;  ///< see CloudHeader
  double cell_size;
  std::optional<Box> crop;
  std::vector<Target> targets;
  std::vector<Target> clouds;  ///< targets of `writers`
  std::vector<std::unique_ptr<CloudWriter>> writers;
  std::unique_ptr<CloudWriter> map;  ///< of all other targets; nullptr = none
  std::vector<CloudWriter*> others;
  std::unique_ptr<Thinning> thinning;  ///< nullptr = none
  int threads;
  std::optional<ThreadPool> pool;
  std::optional<PointChunks> placed;  ///< for points that do not go through PointProducer
  std::vector<OutputPoint> moved;
  std::int64_t added = 0, written = 0;
  bool committed = false;
};

namespace {

std::vector<CloudOutput::Target> target_of(const std::filesystem::path& path) {
  const CloudFormat* format = cloud_format_of(path);
  if (format == nullptr && !path.has_extension()) format = &cloud_formats().front();
  if (format != nullptr) return {{format, path}};
  std::string known;
  for (const CloudFormat& it : cloud_formats()) known += (known.empty() ? "" : ", ") + std::string(it.extension);
  throw InvalidOption(path.string() + ": no format of clouds has this extension; expected one of " + known);
}

}  // namespace

CloudOutput::CloudOutput(const CloudHeader& header, const CloudSelection& amount, const std::vector<Target>& targets)
    : impl_(std::make_unique<Impl>(header, amount, targets)) {}

CloudOutput::CloudOutput(const std::filesystem::path& path, const CloudHeader& header)
    : CloudOutput(header, {}, target_of(path)) {}

CloudOutput::CloudOutput(const std::filesystem::path& path) : CloudOutput(path, CloudHeader()) {}

CloudOutput::~CloudOutput() = default;

void CloudOutput::add_writer(CloudWriter& writer) { impl_->others.push_back(&writer); }

void CloudOutput::add(const KeyframeCloud& cloud) { add(cloud, cloud.pose()); }

void CloudOutput::add(const KeyframeCloud& cloud, const KeyframePose& pose) {
  Impl& impl = *impl_;
  impl.require_open();
  if (impl.map) impl.require_camera(cloud.keyframe_id, pose);
  for (const auto& writer : impl.writers) writer->set_window(cloud.keyframe_id, cloud.window_ids);
  impl.added += static_cast<std::int64_t>(cloud.points.size());
  const PointTransform points(cloud, pose, impl.file_from_map);
  if (impl.map) {
    impl.map->set_window(cloud.keyframe_id, cloud.window_ids);
    impl.each_piece(
        points.size(),
        [&](std::size_t first, std::size_t last, OutputPoint* to) {
          for (std::size_t i = first; i < last; ++i) points.place(i, *to++);
        },
        [&](const OutputPoint* some, std::size_t count) { impl.map->add(some, count); });
  }
  std::vector<std::uint32_t> inside;
  if (impl.crop) inside = points_in_box(points, *impl.crop, impl.own_pool());
  const std::size_t size = impl.crop ? inside.size() : points.size();
  const PointProducer place = [&](std::size_t first, std::size_t last, OutputPoint* to) {
    for (std::size_t i = first; i < last; ++i) points.place(impl.crop ? inside[i] : i, *to++);
  };
  std::vector<CloudWriter*> writers = impl.all_writers();
  if (!impl.thinning) {
    const auto takes = [&](CloudWriter* writer) { return writer->add_parallel(size, place); };
    writers.erase(std::remove_if(writers.begin(), writers.end(), takes), writers.end());
    if (writers.empty()) {
      impl.written += static_cast<std::int64_t>(size);
      return;
    }
  }
  impl.each_piece(size, place, [&](const OutputPoint* some, std::size_t count) {
    if (impl.thinning) {
      impl.thinning->add(some, count);
    } else {
      impl.write(writers, some, count);
    }
  });
}

void CloudOutput::add(const OutputPoint* points, std::size_t count, const Similarity& file_from_points) {
  Impl& impl = *impl_;
  impl.require_open();
  if (impl.map) throw InvalidInput("a map needs the keyframes that see its points, which these points do not have");
  const bool moves = !file_from_points.is_identity();
  const Eigen::Matrix3f rotation = file_from_points.rotation.cast<float>();
  impl.added += static_cast<std::int64_t>(count);
  impl.moved.clear();
  for (const OutputPoint* point = points; point != points + count; ++point) {
    OutputPoint it = *point;
    if (moves) {
      it.position = file_from_points * it.position;
      it.normal = rotation * it.normal;
    }
    if (!impl.crop || impl.crop->contains(it.position)) impl.moved.push_back(it);
  }
  if (impl.thinning) {
    impl.thinning->add(impl.moved.data(), impl.moved.size());
  } else if (!impl.moved.empty()) {
    impl.write(impl.all_writers(), impl.moved.data(), impl.moved.size());
  }
}

void CloudOutput::add_depth(const DepthMap& map) {
  impl_->require_open();
  for (const auto& writer : impl_->writers) writer->add_depth(map);
}

bool CloudOutput::wants_depth() const {
  const auto wants = [](const auto& writer) { return writer->wants_depth(); };
  return std::any_of(impl_->writers.begin(), impl_->writers.end(), wants);
}

std::int64_t CloudOutput::points_in() const { return impl_->added; }
std::int64_t CloudOutput::points() const { return impl_->written; }

void CloudOutput::complete() {
  if (!impl_->thinning) return;
  const std::vector<CloudWriter*> writers = impl_->all_writers();
  impl_->thinning->finish([&](const OutputPoint* points, std::size_t count) { impl_->write(writers, points, count); });
  impl_->thinning.reset();
}

void CloudOutput::commit() {
  if (impl_->committed) return;
  complete();
  for (const bool folders : {true, false}) {  // folders first: most of their writing, which may fail, is still pending
    for (std::size_t i = 0; i < impl_->writers.size(); ++i) {
      if (impl_->clouds[i].format->is_folder() == folders) impl_->writers[i]->finish();
    }
  }
  impl_->committed = true;
  if (impl_->map) impl_->map->finish();
}

}  // namespace pmsp
