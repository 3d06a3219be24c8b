// SPDX-License-Identifier: BSD-2-Clause
#include "preview.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <utility>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "export/files.h"
#include "io/image_decode.h"
#include "numbers.h"
#include "pictures.h"
#include "progress.h"
#include "tool_files.h"

namespace pmsp::tool {
namespace {

constexpr std::size_t kStrips = 4;
constexpr std::size_t kMaxPoints = 2400000;  // then thinned to half
constexpr std::size_t kFewKeyframes = 8;     // their points are few enough to draw all
constexpr double kCoarser = 1.2;
constexpr int kMaxPanelWidth = 960;
constexpr int kLabelRows = 30;
constexpr const char* kAbove = "cloud_above.png";
constexpr const char* kCorner = "cloud_corner.png";

void write_png(const std::filesystem::path& path, const cv::Mat& image) {
  write_file(path, io::encoded(".png", image, path.string() + ": cannot be encoded as PNG"));
}

cv::Mat labelled(const cv::Mat& image, const std::string& words) {
  cv::Mat small = image;
  if (image.cols > kMaxPanelWidth) {
    cv::resize(image, small, {kMaxPanelWidth, std::max(1, image.rows * kMaxPanelWidth / image.cols)}, 0, 0,
               cv::INTER_AREA);
  }
  cv::Mat panel(small.rows + kLabelRows, small.cols, CV_8UC3, cv::Scalar(0, 0, 0));
  small.copyTo(panel.rowRange(kLabelRows, panel.rows));
  cv::putText(panel, words, {8, 21}, cv::FONT_HERSHEY_SIMPLEX, 0.5, cv::Scalar(235, 235, 235), 1, cv::LINE_AA);
  return panel;
}

/// Copy with the data of a strip.
DepthMap without_normals(const DepthMap& map) {
  DepthMap copy;
  copy.keyframe_id = map.keyframe_id;
  copy.depth = map.depth;
  copy.confidence = map.confidence;
  return copy;
}

cv::Mat strip_of(const cv::Mat& color, const DepthMap& map) {
  const DepthPicture picture = draw_depth(map, cv::COLORMAP_TURBO);
  const std::string depth_words = format("depth: %.1f %% of the pixels; %.3g (red) to %.3g (blue) map units",
                                         100.0 * picture.coverage, picture.near, picture.far);
  const std::string confidence_words =
      format("confidence: %g (violet) to %g (yellow), mean %.2f", 0.0, 1.0, picture.mean_confidence);
  cv::Mat strip;
  cv::hconcat(
      std::vector<cv::Mat>{labelled(color, "keyframe " + std::to_string(map.keyframe_id)),
                           labelled(picture.depth, depth_words), labelled(picture.confidence, confidence_words)},
      strip);
  return strip;
}

}  // namespace

Preview::Preview(const std::filesystem::path& folder, std::size_t keyframes)
    : folder_(folder, is_preview_file, ".part-pictures"), keyframes_(keyframes) {}

void Preview::add_keyframe(std::size_t index, std::int64_t id, const RigidTransform& cam_from_world,
                           ImageView<const Rgb> image, int depth_width, int depth_height) {
  scene_.path.push_back(cam_from_world.center());
  down_ += cam_from_world.rotation.row(1).transpose();
  if (strips_ >= kStrips) return;
  const int width = std::min(depth_width, kMaxPanelWidth);
  const cv::Size size(width, std::max(1, depth_height * width / std::max(depth_width, 1)));
  pending_.push_back({index, id, picture_of(image, size)});
}

void Preview::drop_keyframe(std::int64_t id) {
  if (!pending_.empty() && pending_.back().id == id) pending_.pop_back();
}

/// Runs work in the background, after the previous one.
void Preview::beside(std::function<void()> work) {
  if (working_.valid()) working_.get();
  working_ = std::async(std::launch::async, std::move(work));
}

void Preview::add_depth(const DepthMap& map) {
  // Depth maps are in the order of keyframes: earlier pending keyframes have none.
  while (!pending_.empty() && pending_.front().id != map.keyframe_id) pending_.pop_front();
  if (pending_.empty()) return;
  const Pending pending = std::move(pending_.front());
  pending_.pop_front();
  if (strips_ >= kStrips || pending.index < keyframes_ * (2 * strips_ + 1) / (2 * kStrips)) return;
  beside([path = folder_ / numbered_name("keyframe_", pending.id, ".png"), color = pending.color,
          map = without_normals(map)] { write_png(path, strip_of(color, map)); });
  ++strips_;
  if (strips_ == kStrips) pending_.clear();
}

/// Occupied cells of a grid: open-addressing hash table.
class Preview::Cells {
 public:
  explicit Cells(double spacing) : spacing_(spacing), table_(std::size_t{1} << 22U, kEmpty) {}

  double spacing() const { return spacing_; }

  /// True if the cell was empty; then it is marked. At most kMaxPoints cells.
  bool take(const Eigen::Vector3f& position) {
    const Eigen::Array3d cell = (position.cast<double>() / spacing_).array().floor().max(-1e9).min(1e9);
    std::uint64_t key = 0;  // cells two million apart coincide
    for (int axis = 0; axis < 3; ++axis) {
      key = key << 21U | (static_cast<std::uint64_t>(static_cast<std::int64_t>(cell[axis])) & 0x1fffffU);
    }
    std::size_t at = (key * 0x9e3779b97f4a7c15U) >> 42U;
    for (; table_[at] != kEmpty; at = (at + 1) % table_.size()) {
      if (table_[at] == key) return false;
    }
    table_[at] = key;
    return true;
  }

 private:
  static constexpr std::uint64_t kEmpty = ~std::uint64_t{0};
  double spacing_;
  std::vector<std::uint64_t> table_;
};

Preview::~Preview() = default;

/// Keeps one point per cell, with the smallest cell size that halves the maximum number of points.
void Preview::thin() {
  std::vector<ViewPoint>& points = scene_.points;
  double spacing = scene_.spacing * std::sqrt(2.0);
  if (scene_.spacing == 0.0) {
    std::vector<double> distances;
    for (std::size_t i = 0; i < points.size(); i += 97) {
      distances.push_back(static_cast<double>((points[i].position - points[0].position).norm()));
    }
    // Median, robust to distant clusters.
    spacing = std::max(percentile(distances, 50.0), 1e-9) / 1000.0;
  }
  constexpr double kMost = 0.5 * static_cast<double>(kMaxPoints);
  while (true) {
    cells_ = std::make_unique<Cells>(spacing);
    std::size_t kept = 0;
    for (const ViewPoint& point : points) {
      if (cells_->take(point.position)) points[kept++] = point;
    }
    points.resize(kept);
    const double share = static_cast<double>(points.size()) / kMost;
    if (share <= 1.0) break;
    // The number of cells on a surface is inversely proportional to the square of their size.
    spacing *= std::clamp(std::sqrt(share), kCoarser, 2.0);
  }
  scene_.spacing = spacing;
}

/// Large clouds are subsampled: where keyframes overlap, most points are thinned anyway.
void Preview::add_points(const KeyframeCloud& cloud) {
  const RigidTransform world_from_cam = cloud.cam_from_world.inverse();
  const Eigen::Matrix3f rotation = world_from_cam.rotation.cast<float>();
  const std::size_t most = kMaxPoints / std::clamp<std::size_t>(keyframes_, 1, kFewKeyframes);
  const std::size_t stride = std::max<std::size_t>(1, cloud.points.size() / most);
  std::vector<ViewPoint> points;
  points.reserve(cloud.points.size() / stride + 1);
  for (std::size_t i = 0; i < cloud.points.size(); i += stride) {
    const CloudPoint& point = cloud.points[i];
    ViewPoint& seen = points.emplace_back();
    seen.position = (world_from_cam * (cloud.scale * point.position.cast<double>())).cast<float>();
    const Eigen::Vector3f normal = rotation * point.normal;
    seen.normal = (normal.cwiseMax(-1.0F).cwiseMin(1.0F) * 127.0F).cast<std::int8_t>();
    seen.color = point.color;
  }
  beside([this, points = std::move(points)] { keep(points); });
}

void Preview::keep(const std::vector<ViewPoint>& points) {
  for (const ViewPoint& point : points) {
    if (cells_ && !cells_->take(point.position)) continue;
    scene_.points.push_back(point);
    if (scene_.points.size() >= kMaxPoints) thin();
  }
}

std::string Preview::finish(std::int64_t points) {
  if (working_.valid()) working_.get();
  if (scene_.points.empty()) return "";
  if (down_.norm() > 0.0) scene_.up = -down_.normalized();
  scene_.caption = count_text(points) + " points";
  if (scene_.points.size() < static_cast<std::size_t>(points)) {
    scene_.caption += ", " + count_text(static_cast<std::int64_t>(scene_.points.size())) + " drawn";
  }
  const std::string left_out = left_out_of(scene_);
  if (!left_out.empty()) scene_.caption += "; " + left_out;
  std::future<void> above =
      std::async(std::launch::async, [this] { write_png(folder_ / kAbove, draw_from_above(scene_)); });
  write_png(folder_ / kCorner, draw_from_corner(scene_));
  above.get();
  return left_out;
}

bool is_preview_file(const std::string& name) {
  return name == kAbove || name == kCorner || is_numbered_name(name, "keyframe_", ".png");
}

}  // namespace pmsp::tool
