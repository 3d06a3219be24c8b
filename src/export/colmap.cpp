// SPDX-License-Identifier: BSD-2-Clause
// COLMAP model (binary, as of version 4.1; older readers ignore rigs and frames): sparse/0, images/, and masks/ with
// names for COLMAP's --ImageReader.mask_path. depths.json describes the depth images.
#include <map>
#include <string>
#include <utility>

#include <Eigen/Geometry>

#include "export/dataset_folder.h"
#include "export/little_endian.h"
#include "export/spool.h"
#include "pmsp/camera.h"
#include "pmsp/error.h"

namespace pmsp {

bool is_colmap_name(const std::string& name) {
  return name == "sparse" || name == "images" || name == "masks" || name == "pmsp.txt" ||
         DatasetDepthFiles::is_name(name);
}

namespace {

constexpr std::int32_t kEquirectangular = 17;  // COLMAP's camera model
constexpr std::int32_t kCamera = 0;            // COLMAP's sensor type
constexpr double kUnknownError = -1.0;

/// Observation of a point in an image.
struct Sighting {
  double x, y;
  std::uint64_t point;
};

void append_pose(std::string& text, const RigidTransform& pose) {
  Eigen::Quaterniond q(pose.rotation);
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  for (const double value : {q.w(), q.x(), q.y(), q.z()}) append_little(text, value);
  for (int i = 0; i < 3; ++i) append_little(text, pose.translation[i]);
}

class Colmap final : public CloudWriter {
 public:
  Colmap(const std::filesystem::path& path, const CloudHeader& header) : dataset_(path, is_colmap_name, header) {}

  void set_window(std::int64_t keyframe_id, const std::vector<std::int64_t>& window_ids) override {
    windows_[keyframe_id] = window_ids;
  }

  void add(const OutputPoint* points, std::size_t count) override { dataset_.add(points, count); }

  void add_depth(const DepthMap& map) override { dataset_.add_depth(map); }
  bool wants_depth() const override { return dataset_.wants_depth(); }

  void finish() override {
    views_ = dataset_.put_images();
    for (std::size_t i = 0; i < views_.size(); ++i) {
      const OutputView& view = views_[i];
      number_of_[view.keyframe_id] = i;
      cameras_.try_emplace({view.width, view.height}, static_cast<std::uint32_t>(cameras_.size() + 1));
    }
    make_folder(dataset_.folder() / "sparse" / "0");
    std::filesystem::path folder = dataset_.folder() / "sparse" / "0";
    Spool<Sighting> sightings(dataset_.header().scratch.string(), views_.size());
    AtomicFile points(folder / "points3D.bin");
    write_points(points, sightings);
    AtomicFile images(folder / "images.bin");
    write_images(images, sightings);
    points.commit();
    images.commit();
    write_file(folder / "cameras.bin", cameras());
    write_file(folder / "rigs.bin", rigs());
    write_file(folder / "frames.bin", frames());
    std::string notes;
    for (const std::string& comment : dataset_.header().comments) notes += comment + "\n";
    write_file(dataset_.folder() / "pmsp.txt", notes);
    if (const DatasetDepthFiles* depth = dataset_.depth()) {
      write_file(dataset_.folder() / "depths.json", depth->description().dump(1) + "\n");
    }
    dataset_.commit(views_);
  }

 private:
  void write_points(AtomicFile& file, Spool<Sighting>& sightings) {
    std::uint64_t count = 0;
    const auto head = [&count] {
      std::string text;
      append_little(text, count);
      return text;
    };
    file.write(head());
    dataset_.finish([&](const OutputPoint* points, std::size_t number) {
      for (const OutputPoint* point = points; point != points + number; ++point) {
        file.write(point_record(*point, ++count, sightings));
      }
    });
    file.patch(0, head());
  }

  std::string point_record(const OutputPoint& point, std::uint64_t id, Spool<Sighting>& sightings) const {
    std::string text;
    append_little(text, id);
    for (int i = 0; i < 3; ++i) append_little(text, point.position[i]);
    for (const std::uint8_t value : {point.color.r, point.color.g, point.color.b}) append_little(text, value);
    append_little(text, kUnknownError);
    std::string track;
    std::uint64_t length = 0;
    const auto sees = [&](std::int64_t keyframe_id) {
      const auto found = number_of_.find(keyframe_id);
      if (found == number_of_.end()) return;
      const OutputView& view = views_[found->second];
      const Eigen::Vector2d pixel = pixel_from_bearing(view.cam_from_file * point.position, view.width, view.height);
      append_little(track, image_id(found->second));
      append_little(track, static_cast<std::uint32_t>(sightings.size(found->second)));
      sightings.add(found->second, {pixel.x(), pixel.y(), id});
      ++length;
    };
    sees(point.keyframe_id);
    const auto window = windows_.find(point.keyframe_id);
    for (std::size_t k = 0; window != windows_.end() && k < window->second.size(); ++k) {
      if ((point.agree >> k & 1U) != 0) sees(window->second[k]);
    }
    append_little(text, length);
    return text + track;
  }

  void write_images(AtomicFile& file, const Spool<Sighting>& sightings) const {
    std::string text;
    append_little(text, static_cast<std::uint64_t>(views_.size()));
    file.write(text);
    for (std::size_t i = 0; i < views_.size(); ++i) {
      text.clear();
      append_little(text, image_id(i));
      append_pose(text, views_[i].cam_from_file);
      append_little(text, camera_id(i));
      text += views_[i].name + '\0';
      append_little(text, static_cast<std::uint64_t>(sightings.size(i)));
      file.write(text);
      sightings.read(i, [&](const Sighting* some, std::size_t count) {
        text.clear();
        for (const Sighting* it = some; it != some + count; ++it) {
          append_little(text, it->x);
          append_little(text, it->y);
          append_little(text, it->point);
        }
        file.write(text);
      });
    }
  }

  std::string cameras() const {
    std::string text;
    append_little(text, static_cast<std::uint64_t>(cameras_.size()));
    for (const auto& [size, id] : cameras_) {
      append_little(text, id);
      append_little(text, kEquirectangular);
      for (const int side : {size.first, size.second}) append_little(text, static_cast<std::uint64_t>(side));
      for (const int side : {size.first, size.second}) append_little(text, static_cast<double>(side));
    }
    return text;
  }

  /// One rig per camera.
  std::string rigs() const {
    std::string text;
    append_little(text, static_cast<std::uint64_t>(cameras_.size()));
    for (const auto& [size, id] : cameras_) {
      append_little(text, id);
      append_little(text, std::uint32_t{1});  // number of sensors
      append_little(text, kCamera);
      append_little(text, id);
    }
    return text;
  }

  /// One frame per image.
  std::string frames() const {
    std::string text;
    append_little(text, static_cast<std::uint64_t>(views_.size()));
    for (std::size_t i = 0; i < views_.size(); ++i) {
      append_little(text, image_id(i));   // frame id
      append_little(text, camera_id(i));  // rig id
      append_pose(text, views_[i].cam_from_file);
      append_little(text, std::uint32_t{1});  // number of images
      append_little(text, kCamera);
      append_little(text, camera_id(i));
      append_little(text, static_cast<std::uint64_t>(image_id(i)));
    }
    return text;
  }

  static std::uint32_t image_id(std::size_t view) { return static_cast<std::uint32_t>(view + 1); }
  std::uint32_t camera_id(std::size_t view) const { return cameras_.at({views_[view].width, views_[view].height}); }

  DatasetFolder dataset_;
  std::map<std::int64_t, std::vector<std::int64_t>> windows_;
  std::vector<OutputView> views_;
  std::map<std::int64_t, std::size_t> number_of_;         ///< index of a keyframe's view
  std::map<std::pair<int, int>, std::uint32_t> cameras_;  ///< by image size
};

}  // namespace

std::unique_ptr<CloudWriter> open_colmap(const std::filesystem::path& path, const CloudHeader& header) {
  return std::make_unique<Colmap>(path, header);
}

}  // namespace pmsp
