// SPDX-License-Identifier: BSD-2-Clause
#include "pictures.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "numbers.h"

namespace pmsp::tool {
namespace {

constexpr int kOutermost = 1;  ///< percent dropped at either end in any case
constexpr int kInnermost = 45;
constexpr double kWorth = 8.0;
constexpr std::size_t kMostDistances = 2'000, kMostPlaces = 500;  ///< for pairwise distances

std::size_t stride_for(std::size_t count, std::size_t most) { return std::max<std::size_t>(1, count / most); }

/// Coordinates of the points that are inside the box on the other axes.
std::vector<double> coordinates(const std::vector<Eigen::Vector3d>& points, int axis, const FramedBox& box) {
  std::vector<double> values;
  for (const Eigen::Vector3d& point : points) {
    bool is_in = true;
    for (int other = 0; other < 3; ++other) {
      is_in = is_in && (other == axis || (point[other] >= box.low[other] && point[other] <= box.high[other]));
    }
    if (is_in) values.push_back(point[axis]);
  }
  return values;
}

/// Median distance of the points from the path, which is not empty.
double usual_distance(const std::vector<Eigen::Vector3d>& points, const std::vector<Eigen::Vector3d>& path) {
  std::vector<double> distances;
  for (std::size_t i = 0; i < points.size(); i += stride_for(points.size(), kMostDistances)) {
    double nearest = std::numeric_limits<double>::max();
    for (std::size_t k = 0; k < path.size(); k += stride_for(path.size(), kMostPlaces)) {
      nearest = std::min(nearest, (points[i] - path[k]).norm());
    }
    distances.push_back(nearest);
  }
  std::sort(distances.begin(), distances.end());
  return distances[distances.size() / 2];
}

}  // namespace

Interval framing_interval(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const auto at = [&values](int percent) {
    return values[static_cast<std::size_t>(percent) * (values.size() - 1) / 100];
  };
  Interval best{at(kOutermost), at(100 - kOutermost)};
  const double least = 1e-6 * (best.high - best.low);  // guards against equal values
  if (!(least > 0.0)) return best;
  double lowest = std::numeric_limits<double>::max();
  for (int low = kOutermost; low <= kInnermost; ++low) {
    for (int high = 100 - kOutermost; high >= 100 - kInnermost; --high) {
      const double length = std::max(at(high) - at(low), least);
      const double cost = std::log(length) - kWorth * std::log(0.01 * (high - low));
      if (cost >= lowest) continue;
      lowest = cost;
      best = {at(low), at(high)};
    }
  }
  return best;
}

FramedBox framing_box(const std::vector<Eigen::Vector3d>& points, const std::vector<Eigen::Vector3d>& path) {
  if (points.empty()) return {};
  constexpr double kAll = std::numeric_limits<double>::max();
  FramedBox box{Eigen::Vector3d::Constant(-kAll), Eigen::Vector3d::Constant(kAll)};
  for (int round = 0; round < 2; ++round) {
    for (int axis = 0; axis < 3; ++axis) {
      const std::vector<double> values = coordinates(points, axis, box);
      if (values.empty()) continue;
      const Interval stretch = framing_interval(values);
      box.low[axis] = stretch.low;
      box.high[axis] = stretch.high;
    }
  }
  if (path.empty()) return box;
  FramedBox around{path.front(), path.front()};
  for (const Eigen::Vector3d& place : path) {
    around.low = around.low.cwiseMin(place);
    around.high = around.high.cwiseMax(place);
  }
  box.low = box.low.cwiseMin(around.low);
  box.high = box.high.cwiseMax(around.high);
  const Eigen::Vector3d reach = Eigen::Vector3d::Constant(usual_distance(points, path));
  const Eigen::Vector3d low = around.low - reach, high = around.high + reach;
  for (const Eigen::Vector3d& point : points) {
    if ((point.array() < low.array()).any() || (point.array() > high.array()).any()) continue;
    box.low = box.low.cwiseMin(point);
    box.high = box.high.cwiseMax(point);
  }
  return box;
}

namespace {

constexpr int kWidth = 1600;
constexpr int kHeight = 1000;
constexpr int kTitle = 36;  // height of the title bar [rows]
const cv::Scalar kBackground(24, 22, 20);
const cv::Scalar kInk(235, 235, 235);
const cv::Scalar kPath(0, 165, 255);
const cv::Scalar kStart(80, 220, 80);
const cv::Scalar kEnd(60, 60, 240);

// Axes aligned with gravity and the building: coordinates are (along, across, height).
struct Frame {
  Eigen::Matrix3d frame_from_world = Eigen::Matrix3d::Identity();
  Eigen::Vector3d low = Eigen::Vector3d::Zero();  // bounds of the drawing
  Eigen::Vector3d high = Eigen::Vector3d::Ones();
};

// Subsampling for percentiles and axes.
std::size_t stride_of(const ViewScene& scene) { return std::max<std::size_t>(1, scene.points.size() / 50000); }

Frame make_frame(const ViewScene& scene) {
  const Eigen::Vector3d up = scene.up.normalized();
  const Eigen::Vector3d other = std::abs(up.z()) < 0.9 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitX();
  const Eigen::Vector3d e1 = up.cross(other).normalized();
  const Eigen::Vector3d e2 = up.cross(e1);
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
  // Sum of wall normals, raised to the fourth power so that the four directions of a room coincide.
  std::complex<double> walls;
  double count = 0.0;
  for (std::size_t i = 0; i < scene.points.size(); i += stride_of(scene)) {
    const Eigen::Vector3d p = scene.points[i].position.cast<double>();
    const Eigen::Vector3d n = scene.points[i].normal.cast<double>() / 127.0;
    const Eigen::Vector2d flat(e1.dot(p), e2.dot(p));
    mean += flat;
    second += flat * flat.transpose();
    count += 1.0;
    const std::complex<double> direction(e1.dot(n), e2.dot(n));
    if (std::norm(direction) > 0.9) walls += direction * direction * direction * direction;
  }
  mean /= std::max(count, 1.0);
  const Eigen::Matrix2d covariance = second / std::max(count, 1.0) - mean * mean.transpose();
  Eigen::Vector2d along = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance).eigenvectors().col(1);
  if (std::abs(walls) > 0.0) {
    const std::complex<double> wall = std::pow(walls, 0.25);
    const Eigen::Vector2d a(wall.real(), wall.imag());
    const Eigen::Vector2d b(-a.y(), a.x());
    along = (std::abs(along.dot(a)) > std::abs(along.dot(b)) ? a : b).normalized();
  }
  if (!scene.path.empty()) {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& center : scene.path) middle += center / static_cast<double>(scene.path.size());
    const Eigen::Vector3d from_middle = scene.path.front() - middle;
    if (along.dot(Eigen::Vector2d(e1.dot(from_middle), e2.dot(from_middle))) > 0.0) along = -along;
  }
  Frame frame;
  frame.frame_from_world.row(0) = (along.x() * e1 + along.y() * e2).transpose();
  frame.frame_from_world.row(2) = up.transpose();
  frame.frame_from_world.row(1) = up.cross(Eigen::Vector3d(frame.frame_from_world.row(0).transpose())).transpose();
  return frame;
}

// Sets the bounds of the building; points outside are dropped.
void bound(const ViewScene& scene, Frame& frame) {
  std::vector<Eigen::Vector3d> points, path;
  for (std::size_t i = 0; i < scene.points.size(); i += stride_of(scene)) {
    points.emplace_back(frame.frame_from_world * scene.points[i].position.cast<double>());
  }
  for (const Eigen::Vector3d& center : scene.path) path.emplace_back(frame.frame_from_world * center);
  const FramedBox box = framing_box(points, path);
  const Eigen::Vector3d margin = 0.03 * (box.high - box.low).cwiseMax(1e-6);
  frame.low = box.low - margin;
  frame.high = box.high + margin;
}

// Cuts at a height slightly above the camera's path.
void cut_off_above(const ViewScene& scene, Frame& frame) {
  std::vector<double> heights;
  for (const Eigen::Vector3d& center : scene.path) heights.push_back((frame.frame_from_world * center).z());
  const double camera = percentile(heights, 90.0), floor = frame.low.z();
  if (!heights.empty() && camera > floor) frame.high.z() = std::min(frame.high.z(), camera + 0.25 * (camera - floor));
}

Frame bounded_frame(const ViewScene& scene) {
  Frame frame = make_frame(scene);
  bound(scene, frame);
  return frame;
}

bool inside(const Frame& frame, const Eigen::Vector3d& q) {
  return (q.array() >= frame.low.array()).all() && (q.array() <= frame.high.array()).all();
}

// Image with a depth buffer; smaller wins.
struct Canvas {
  cv::Mat image{kHeight, kWidth, CV_8UC3, kBackground};
  cv::Mat nearness{kHeight, kWidth, CV_32FC1, cv::Scalar(std::numeric_limits<float>::max())};

  void splat(double x, double y, float distance, int size, const Rgb& color) {
    const int x0 = static_cast<int>(std::floor(x)) - (size - 1) / 2;
    const int y0 = static_cast<int>(std::floor(y)) - (size - 1) / 2;
    for (int row = std::max(y0, kTitle); row < std::min(y0 + size, kHeight); ++row) {
      for (int column = std::max(x0, 0); column < std::min(x0 + size, kWidth); ++column) {
        float& nearest = nearness.at<float>(row, column);
        if (distance >= nearest) continue;
        nearest = distance;
        image.at<cv::Vec3b>(row, column) = {color.b, color.g, color.r};
      }
    }
  }

  void text(const std::string& words, cv::Point at, double scale, const cv::Scalar& color) {
    cv::putText(image, words, at, cv::FONT_HERSHEY_SIMPLEX, scale, cv::Scalar(0, 0, 0), 3, cv::LINE_AA);
    cv::putText(image, words, at, cv::FONT_HERSHEY_SIMPLEX, scale, color, 1, cv::LINE_AA);
  }

  void title(const std::string& words) {
    cv::rectangle(image, {0, 0}, {kWidth, kTitle - 1}, cv::Scalar(0, 0, 0), cv::FILLED);
    const double wide = cv::getTextSize(words, cv::FONT_HERSHEY_SIMPLEX, 0.6, 1, nullptr).width;
    text(words, {12, 24}, std::min(0.6, 0.6 * (kWidth - 24) / wide), kInk);
  }

  void path(const std::vector<cv::Point2d>& points) {
    std::vector<cv::Point> line;
    for (const cv::Point2d& p : points) line.emplace_back(cvRound(p.x), cvRound(p.y));
    if (line.empty()) return;
    cv::polylines(image, line, false, kPath, 2, cv::LINE_AA);
    for (const cv::Point& p : line) cv::circle(image, p, 3, kPath, cv::FILLED, cv::LINE_AA);
    for (const auto& [p, name, color] :
         {std::tuple(line.front(), "start", kStart), std::tuple(line.back(), "end", kEnd)}) {
      cv::circle(image, p, 7, color, cv::FILLED, cv::LINE_AA);
      text(name, {p.x + 10, p.y - 8}, 0.6, color);
    }
  }
};

// Splat size at which the points of a surface close up.
int splat_size(const ViewScene& scene, const Frame& frame, double px_per_unit) {
  const auto drawn = std::count_if(scene.points.begin(), scene.points.end(), [&frame](const ViewPoint& point) {
    return inside(frame, frame.frame_from_world * point.position.cast<double>());
  });
  const double by_count = std::sqrt(2.0 * kWidth * kHeight / static_cast<double>(std::max<std::ptrdiff_t>(drawn, 1)));
  const double size = scene.spacing > 0.0 ? 1.5 * scene.spacing * px_per_unit + 1.0 : by_count;
  return static_cast<int>(std::clamp(std::lround(size), 2L, 6L));
}

void scale_bar(Canvas& canvas, double px_per_unit) {
  double length = std::pow(10.0, std::floor(std::log10(300.0 / px_per_unit)));
  if (length * px_per_unit < 60.0) length *= 5.0;
  if (length * px_per_unit < 120.0) length *= 2.0;
  const cv::Point from(30, kHeight - 30);
  const cv::Point to(30 + cvRound(length * px_per_unit), kHeight - 30);
  cv::line(canvas.image, from, to, cv::Scalar(0, 0, 0), 6);
  cv::line(canvas.image, from, to, kInk, 3);
  canvas.text(number_text(length) + " map units", {30, kHeight - 42}, 0.6, kInk);
}

}  // namespace

std::string left_out_of(const ViewScene& scene) {
  const Frame frame = bounded_frame(scene);
  std::size_t outside = 0;
  double farthest = 0.0;
  for (const ViewPoint& point : scene.points) {
    const Eigen::Vector3d q = frame.frame_from_world * point.position.cast<double>();
    if (inside(frame, q)) continue;
    ++outside;
    farthest = std::max(farthest, (q - q.cwiseMax(frame.low).cwiseMin(frame.high)).norm());
  }
  const double percent =
      100.0 * static_cast<double>(outside) / static_cast<double>(std::max<std::size_t>(scene.points.size(), 1));
  if (percent < 0.05) return "";
  return format("%.1f %% of the points lie outside, up to %.3g map units away", percent, farthest);
}

cv::Mat draw_from_above(const ViewScene& scene) {
  Frame frame = bounded_frame(scene);
  cut_off_above(scene, frame);
  const Eigen::Vector3d extent = frame.high - frame.low;
  const double px_per_unit = std::min(kWidth / extent.x(), (kHeight - kTitle) / extent.y());
  const Eigen::Vector3d middle = 0.5 * (frame.low + frame.high);
  const auto project = [&](const Eigen::Vector3d& q) {
    return cv::Point2d(0.5 * kWidth + (q.x() - middle.x()) * px_per_unit,
                       0.5 * (kHeight + kTitle) - (q.y() - middle.y()) * px_per_unit);
  };
  Canvas canvas;
  const int size = splat_size(scene, frame, px_per_unit);
  for (const ViewPoint& point : scene.points) {
    const Eigen::Vector3d q = frame.frame_from_world * point.position.cast<double>();
    if (!inside(frame, q)) continue;
    const cv::Point2d at = project(q);
    canvas.splat(at.x, at.y, static_cast<float>(-q.z()), size, point.color);
  }
  std::vector<cv::Point2d> path;
  for (const Eigen::Vector3d& center : scene.path) path.push_back(project(frame.frame_from_world * center));
  canvas.path(path);
  scale_bar(canvas, px_per_unit);
  canvas.title("From above, cut off just above the camera: " + scene.caption);
  return canvas.image;
}

namespace {

// Camera outside an upper corner of the bounds, which fill the image.
struct CornerCamera {
  explicit CornerCamera(const Frame& frame) {
    const Eigen::Vector3d middle = 0.5 * (frame.low + frame.high);
    const Eigen::Vector3d half = 0.5 * (frame.high - frame.low);
    const Eigen::Vector3d flat(-0.6 * half.x(), -1.0 * half.y(), 0.0);
    const Eigen::Vector3d forward = -(flat.normalized() + Eigen::Vector3d(0.0, 0.0, 0.8)).normalized();
    const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
    view_from_frame << right.transpose(), forward.cross(right).transpose(), forward.transpose();
    distance = 2.2 * half.norm();
    eye = middle - distance * forward;
    Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::max());
    Eigen::Vector2d high = -low;
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d signs((corner & 1) != 0 ? 1.0 : -1.0, (corner & 2) != 0 ? 1.0 : -1.0,
                                  (corner & 4) != 0 ? 1.0 : -1.0);
      const Eigen::Vector3d v = view_from_frame * (middle + half.cwiseProduct(signs) - eye);
      low = low.cwiseMin(v.head<2>() / v.z());
      high = high.cwiseMax(v.head<2>() / v.z());
    }
    const int rows = kHeight - kTitle;
    focal = 0.97 * std::min(kWidth / (high.x() - low.x()), rows / (high.y() - low.y()));
    center = {0.5 * kWidth - focal * 0.5 * (low.x() + high.x()),
              kTitle + 0.5 * rows - focal * 0.5 * (low.y() + high.y())};
  }

  cv::Point2d project(const Eigen::Vector3d& q, double& depth) const {
    const Eigen::Vector3d v = view_from_frame * (q - eye);
    depth = v.z();
    return {center.x + focal * v.x() / depth, center.y + focal * v.y() / depth};
  }

  Eigen::Matrix3d view_from_frame;
  Eigen::Vector3d eye;
  double distance = 1.0;
  double focal = 1.0;
  cv::Point2d center;
};

}  // namespace

cv::Mat draw_from_corner(const ViewScene& scene) {
  Frame frame = bounded_frame(scene);
  cut_off_above(scene, frame);
  const CornerCamera camera(frame);
  Canvas canvas;
  const int size = splat_size(scene, frame, camera.focal / camera.distance);
  for (const ViewPoint& point : scene.points) {
    const Eigen::Vector3d q = frame.frame_from_world * point.position.cast<double>();
    const Eigen::Vector3d normal = frame.frame_from_world * point.normal.cast<double>();
    if (!inside(frame, q) || normal.dot(camera.eye - q) < 0.0) continue;
    double depth = 0.0;
    const cv::Point2d at = camera.project(q, depth);
    const int here = std::clamp(static_cast<int>(std::lround(size * camera.distance / depth)), 1, 12);
    if (depth > 0.0) canvas.splat(at.x, at.y, static_cast<float>(depth), here, point.color);
  }
  std::vector<cv::Point2d> path;
  for (const Eigen::Vector3d& center : scene.path) {
    double depth = 0.0;
    path.push_back(camera.project(frame.frame_from_world * center, depth));
  }
  canvas.path(path);
  canvas.title("From a corner, cut off just above the camera, without back faces: " + scene.caption);
  return canvas.image;
}

namespace {

cv::Mat view_of(const Image<float>& image) {
  cv::Mat copy(image.height(), image.width(), CV_32FC1);
  for (int y = 0; y < image.height(); ++y) std::copy_n(image.row(y), image.width(), copy.ptr<float>(y));
  return copy;
}

// Colour-maps `values` from `low` to `high`; black without depth.
cv::Mat colored(const cv::Mat& values, const cv::Mat& depth, double low, double high, int map) {
  cv::Mat gray;
  const double scale = high > low ? 255.0 / (high - low) : 0.0;
  values.convertTo(gray, CV_8U, scale, -low * scale);
  cv::Mat image;
  cv::applyColorMap(gray, image, map);
  image.setTo(cv::Scalar(0, 0, 0), depth <= 0.0F);
  return image;
}

}  // namespace

DepthPicture draw_depth(const DepthMap& map, int palette) {
  const cv::Mat depth = view_of(map.depth);
  std::vector<double> inverse;
  double confidence_sum = 0.0;
  for (std::size_t i = 0; i < map.depth.size(); ++i) {
    if (map.depth.pixels()[i] <= 0.0F) continue;
    inverse.push_back(1.0 / static_cast<double>(map.depth.pixels()[i]));
    confidence_sum += static_cast<double>(map.confidence.pixels()[i]);
  }
  const double far = percentile(inverse, 2.0);
  const double near = percentile(inverse, 98.0);
  cv::Mat values;
  cv::divide(1.0, cv::max(depth, 1e-12), values);
  const auto valid = static_cast<double>(inverse.size());
  DepthPicture picture;
  picture.depth = colored(values, depth, far, near, palette);
  picture.confidence = colored(view_of(map.confidence), depth, 0.0, 1.0, cv::COLORMAP_VIRIDIS);
  picture.near = near > 0.0 ? 1.0 / near : 0.0;
  picture.far = far > 0.0 ? 1.0 / far : 0.0;
  picture.coverage = valid / static_cast<double>(map.depth.size());
  picture.mean_confidence = valid > 0.0 ? confidence_sum / valid : 0.0;
  return picture;
}

cv::Mat picture_of(ImageView<const Rgb> image, cv::Size size) {
  const cv::Mat rgb(image.height, image.width, CV_8UC3, const_cast<Rgb*>(image.data),
                    static_cast<std::size_t>(image.stride) * sizeof(Rgb));  // read-only
  cv::Mat small;
  cv::resize(rgb, small, size, 0, 0, cv::INTER_AREA);
  cv::Mat picture;
  cv::cvtColor(small, picture, cv::COLOR_RGB2BGR);
  return picture;
}

cv::Mat picture_of(ImageView<const Rgb> image, int width) {
  if (image.width <= width) return picture_of(image, {image.width, image.height});
  return picture_of(image, {width, std::max(1, image.height * width / image.width)});
}

}  // namespace pmsp::tool
