// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-synth/mission_files.h"

#include <algorithm>
#include <string>
#include <system_error>
#include <vector>

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "export/files.h"
#include "io/image_decode.h"
#include "pmsp/error.h"
#include "pmsp/io/depth.h"
#include "util/numbered_name.h"

namespace pmsp::synth_tool {
namespace {

namespace fs = std::filesystem;

constexpr double kMillimetres = 1000.0;
constexpr Rgb kRigColor{24, 24, 26};

void write_mat(const fs::path& path, const cv::Mat& image, const std::vector<int>& parameters) {
  write_file(path, io::encoded(path.extension().string(), image, path.string() + ": cannot be encoded as an image",
                               parameters));
}

cv::Mat bgr_of(const Image<Rgb>& image) {
  cv::Mat bgr(image.height(), image.width(), CV_8UC3);
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      const Rgb& pixel = image(x, y);
      bgr.at<cv::Vec3b>(y, x) = cv::Vec3b(pixel.b, pixel.g, pixel.r);
    }
  }
  return bgr;
}

std::string trajectory(const synth::Mission& mission) {
  std::string text = "# timestamp tx ty tz qx qy qz qw, camera to world\n";
  for (const synth::Frame& frame : mission.frames) {
    const Eigen::Vector3d center = frame.cam_from_world.center();
    const Eigen::Quaterniond q = Eigen::Quaterniond(frame.cam_from_world.rotation.transpose()).normalized();
    text += format("%.6f %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", frame.timestamp, center.x(), center.y(), center.z(),
                   q.x(), q.y(), q.z(), q.w());
  }
  return text;
}

bool is_frame(const fs::path& path) {
  const std::string name = path.filename().string();
  return is_numbered_name(name, "", ".png") || is_numbered_name(name, "", ".jpg");
}

/// Removes frames of an earlier, longer mission, which would be read as part of this one.
void remove_frames(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> frames;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (is_frame(entry.path())) {
      frames.push_back(entry.path());
    }
  }
  for (const fs::path& frame : frames) {
    if (!fs::remove(frame, error)) {
      throw OutputError(frame.string() + ": cannot remove this frame of an earlier mission: " + error.message());
    }
  }
}

void prepare_folder(const fs::path& folder) {
  for (const char* name : {"images", "gt/range_mm"}) {
    make_folder(folder / name);
    remove_frames(folder / name);
  }
  remove_frames(folder / "gt/label");
  std::error_code error;
  fs::remove(folder / "gt/label", error);  // kept if it contains other files
  if (!fs::remove(folder / "mask.png", error) && error) {
    throw OutputError((folder / "mask.png").string() +
                      ": cannot remove this file of an earlier mission: " + error.message());
  }
}

bool has_labels(const synth::Mission& mission) {
  return std::any_of(mission.frames.begin(), mission.frames.end(), [](const synth::Frame& frame) {
    return std::any_of(frame.label.pixels().begin(), frame.label.pixels().end(), [](std::uint8_t l) { return l != 0; });
  });
}

}  // namespace

void write_image(const fs::path& path, const Image<Rgb>& image, int jpeg_quality) {
  std::vector<int> parameters;
  if (jpeg_quality > 0) parameters = {cv::IMWRITE_JPEG_QUALITY, jpeg_quality};
  write_mat(path, bgr_of(image), parameters);
}

void add_rig(synth::Mission& mission, double radius_deg) {
  mission.mask = Image<std::uint8_t>(mission.width, mission.height, 255);
  for (int y = 0; y < mission.height; ++y) {
    const double from_nadir_deg = 180.0 * (1.0 - (y + 0.5) / mission.height);
    if (from_nadir_deg > radius_deg) {
      continue;
    }
    std::fill_n(mission.mask.row(y), mission.width, std::uint8_t{0});
    for (synth::Frame& frame : mission.frames) {
      std::fill_n(frame.image.row(y), mission.width, kRigColor);
      std::fill_n(frame.depth.row(y), mission.width, 0.0F);
    }
  }
}

void check_folder(const MissionFilesOptions& options) {
  std::error_code error;
  if (!fs::exists(options.folder, error)) {
    return;
  }
  if (!fs::is_directory(options.folder, error)) {
    throw OutputError(options.folder.string() + ": exists and is no directory; give another one with --output");
  }
  if (!options.overwrite && !fs::is_empty(options.folder, error)) {
    throw OutputError(options.folder.string() +
                      ": is not empty; give a new directory, or --force to replace the mission in it");
  }
}

void write_mission(synth::Mission& mission, const MissionFilesOptions& options) {
  prepare_folder(options.folder);
  const bool labels = has_labels(mission);
  if (labels) {
    make_folder(options.folder / "gt" / "label");
  }
  for (std::size_t i = 0; i < mission.frames.size(); ++i) {
    synth::Frame& frame = mission.frames[i];
    const std::int64_t number = static_cast<std::int64_t>(i) * options.frame_step;
    frame.timestamp = static_cast<double>(number) / options.map.fps;
    const std::string name = numbered_name("", number, "");
    write_image(options.folder / "images" / (name + (options.jpeg_quality > 0 ? ".jpg" : ".png")), frame.image,
                options.jpeg_quality);
    write_png16(options.folder / "gt" / "range_mm" / (name + ".png"), frame.depth, kMillimetres);
    if (labels) {
      Image<float> label(frame.label.width(), frame.label.height());
      std::copy(frame.label.pixels().begin(), frame.label.pixels().end(), label.pixels().begin());
      write_png16(options.folder / "gt" / "label" / (name + ".png"), label, 1.0);
    }
  }
  if (!mission.mask.empty()) {
    write_mat(options.folder / "mask.png",
              cv::Mat(mission.height, mission.width, CV_8UC1, mission.mask.pixels().data()), {});
  }
  write_file(options.folder / "gt" / "traj_tum.txt", trajectory(mission));
  write_file(options.folder / "map.msg", slam_map(mission, options.map));
}

}  // namespace pmsp::synth_tool
