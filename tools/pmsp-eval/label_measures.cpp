// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/label_measures.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <optional>

#include "pmsp-eval/ground_truth.h"
#include "pmsp-eval/image_compare.h"
#include "pmsp-eval/parallel.h"

namespace pmsp::eval {
namespace {

/// Pixels beside thin structures and their estimates.
class Growth {
 public:
  Growth(const Image<float>& estimate, const Image<float>& error, const Image<float>& truth,
         const Image<std::uint8_t>& labels, const LabelOptions& options)
      : estimate_(estimate),
        error_(error),
        truth_(truth),
        labels_(labels),
        options_(options),
        found_(estimate.width(), estimate.height()) {}

  void measure(LabelMeasures& thin) {
    for (int y = 0; y < labels_.height(); ++y) {
      for (int x = 0; x < labels_.width(); ++x) {
        if (labels_(x, y) == kThin && is_range(truth_(x, y))) look_around(x, y);
      }
    }
    for (int y = 0; y < found_.height(); ++y) {
      const double weight = row_weight(y, found_.height());
      for (int x = 0; x < found_.width(); ++x) {
        thin.beside += found_(x, y) != 0 ? weight : 0.0;
        thin.grown += found_(x, y) == kGrown ? weight : 0.0;
      }
    }
  }

 private:
  enum : std::uint8_t { kBeside = 1, kGrown = 2 };

  void look_around(int x, int y) {
    const int reach = options_.beside_px;
    const int width = found_.width();
    for (int row = std::max(y - reach, 0); row <= std::min(y + reach, found_.height() - 1); ++row) {
      const int columns = columns_within(reach, row, width, found_.height());
      for (int column = x - columns; column <= x + columns; ++column) look_at((column + width) % width, row, x, y);
    }
  }

  void look_at(int x, int y, int thin_x, int thin_y) {
    if (labels_(x, y) == kThin || !is_range(truth_(x, y))) return;
    std::uint8_t& found = found_(x, y);
    found = std::max(found, static_cast<std::uint8_t>(kBeside));
    const double range = options_.scale * static_cast<double>(estimate_(x, y));
    const double thin_range = static_cast<double>(truth_(thin_x, thin_y));
    const bool wrong = static_cast<double>(error_(x, y)) > options_.max_relative_error;  // false without estimate
    if (wrong && range > 0.0 && std::abs(range - thin_range) <= options_.max_relative_error * thin_range) {
      found = kGrown;
    }
  }

  const Image<float>& estimate_;
  const Image<float>& error_;
  const Image<float>& truth_;
  const Image<std::uint8_t>& labels_;
  const LabelOptions& options_;
  Image<std::uint8_t> found_;
};

/// Label of the surface that the point is least behind; nullopt if it is not behind in all views.
std::optional<int> behind_which(const Eigen::Vector3d& point, const std::vector<TrueView>& views, double max_offset) {
  double least = std::numeric_limits<double>::infinity();
  std::uint8_t label = kOther;
  for (const TrueView& view : views) {
    const Eigen::Vector3d in_cam = view.cam_from_world * point;
    const double distance = in_cam.norm();
    if (!(distance > 0.0)) return std::nullopt;
    const Eigen::Vector2i pixel = pixel_of(in_cam, view.range.width(), view.range.height());
    const float range = view.range(pixel.x(), pixel.y());
    if (!is_range(range)) continue;
    const double offset = distance / static_cast<double>(range) - 1.0;
    if (offset <= max_offset) return std::nullopt;
    if (offset >= least) continue;
    least = offset;
    if (!view.labels.empty()) label = view.labels(pixel.x(), pixel.y());
  }
  if (std::isinf(least)) return std::nullopt;
  return label;
}

/// True if all surrounding pixels have the label.
bool is_inside(const Image<std::uint8_t>& labels, const Eigen::Vector2i& pixel, int label) {
  for (int y = std::max(pixel.y() - 1, 0); y <= std::min(pixel.y() + 1, labels.height() - 1); ++y) {
    for (int x = pixel.x() - 1; x <= pixel.x() + 1; ++x) {
      if (labels((x + labels.width()) % labels.width(), y) != label) return false;
    }
  }
  return true;
}

/// Label of the background in front of which the view sees the point: kSky, kMover, or kOther for neither.
int floats_before(const Eigen::Vector3d& point, const TrueView& view, double max_relative_error) {
  const Eigen::Vector3d in_cam = view.cam_from_world * point;
  const Eigen::Vector2i pixel = pixel_of(in_cam, view.range.width(), view.range.height());
  const int label = view.labels(pixel.x(), pixel.y());
  if ((label != kSky && label != kMover) || !is_inside(view.labels, pixel, label)) return kOther;
  const float range = view.range(pixel.x(), pixel.y());
  const bool in_front = !is_range(range) || in_cam.norm() < (1.0 - max_relative_error) * static_cast<double>(range);
  return in_front ? label : kOther;
}

/// Numbers of points per label; `labels_of(point, add)` adds the labels of a point.
template <class LabelsOf>
std::map<int, std::size_t> count_points(const std::vector<Eigen::Vector3f>& points, int threads,
                                        const LabelsOf& labels_of) {
  std::map<int, std::size_t> counts;
  std::mutex mutex;
  parallel_chunks(points.size(), kPointsPerTask, threads, [&](std::size_t begin, std::size_t end) {
    std::map<int, std::size_t> chunk;
    for (std::size_t i = begin; i < end; ++i) {
      labels_of(points[i].cast<double>(), [&chunk](int label) { ++chunk[label]; });
    }
    const std::lock_guard<std::mutex> lock(mutex);
    for (const auto& [label, count] : chunk) counts[label] += count;
  });
  return counts;
}

}  // namespace

std::string label_name(int label) {
  switch (label) {
    case kAllLabels:
      return "all";
    case kOther:
      return "other";
    case kThin:
      return "thin";
    case kGlossy:
      return "glossy";
    case kBehindGlass:
      return "behind glass";
    case kSky:
      return "sky";
    case kRider:
      return "rider";
    case kMover:
      return "mover";
    default:
      return "label " + std::to_string(label);
  }
}

LabelMeasures& LabelMeasures::operator+=(const LabelMeasures& other) {
  for (const auto field :
       {&LabelMeasures::pixels, &LabelMeasures::estimates, &LabelMeasures::wrong, &LabelMeasures::behind,
        &LabelMeasures::in_front, &LabelMeasures::beside, &LabelMeasures::grown}) {
    this->*field += other.*field;
  }
  return *this;
}

LabelTable& operator+=(LabelTable& sum, const LabelTable& table) {
  for (const auto& [label, measures] : table) sum[label] += measures;
  return sum;
}

LabelTable measure_labels(const Image<float>& estimate, const Image<float>& error, const Image<float>& truth,
                          const Image<std::uint8_t>& labels, const LabelOptions& options) {
  const int width = estimate.width();
  const int height = estimate.height();
  const Image<float> range = resampled(truth, width, height);
  const Image<std::uint8_t> label = labels.empty() ? labels : resampled(labels, width, height);
  LabelTable table;
  table[kAllLabels];
  for (int y = 0; y < height; ++y) {
    const double weight = row_weight(y, height);
    for (int x = 0; x < width; ++x) {
      LabelMeasures pixel;
      pixel.pixels = weight;
      if (!is_range(range(x, y))) {
        const int without_range = label.empty() ? int{kOther} : int{label(x, y)};
        if (without_range != kSky && without_range != kRider) continue;
        if (estimate(x, y) > 0.0F) pixel.estimates = pixel.wrong = pixel.in_front = weight;
        table[without_range] += pixel;
        continue;
      }
      const double estimated = options.scale * static_cast<double>(estimate(x, y));
      if (std::isfinite(estimated) && estimated > 0.0) {
        const auto true_range = static_cast<double>(range(x, y));
        const bool thin = !label.empty() && label(x, y) == kThin;
        const double e = thin ? std::abs(estimated - true_range) / true_range : static_cast<double>(error(x, y));
        const bool farther = estimated > true_range;
        pixel.estimates = weight;
        pixel.wrong = e > options.max_relative_error ? weight : 0.0;
        pixel.behind = e > options.max_offset && farther ? weight : 0.0;
        pixel.in_front = e > options.max_offset && !farther ? weight : 0.0;
      }
      table[kAllLabels] += pixel;
      if (!label.empty()) table[label(x, y)] += pixel;
    }
  }
  const auto thin = table.find(kThin);
  if (thin != table.end()) Growth(estimate, error, range, label, options).measure(thin->second);
  return table;
}

std::map<int, std::size_t> count_floating(const std::vector<Eigen::Vector3f>& points,
                                          const std::vector<TrueView>& views, double max_relative_error, int threads) {
  return count_points(points, threads, [&](const Eigen::Vector3d& point, const auto& add) {
    bool before_sky = false;
    bool before_mover = false;
    for (const TrueView& view : views) {
      const int label = view.labels.empty() ? int{kOther} : floats_before(point, view, max_relative_error);
      before_sky = before_sky || label == kSky;
      before_mover = before_mover || label == kMover;
    }
    if (before_sky) add(kSky);
    if (before_mover) add(kMover);
  });
}

std::map<int, std::size_t> count_behind(const std::vector<Eigen::Vector3f>& points, const std::vector<TrueView>& views,
                                        double max_offset, int threads) {
  std::map<int, std::size_t> counts = count_points(points, threads, [&](const Eigen::Vector3d& point, const auto& add) {
    const std::optional<int> label = behind_which(point, views, max_offset);
    if (!label) return;
    add(kAllLabels);
    add(*label);
  });
  counts[kAllLabels];
  return counts;
}

}  // namespace pmsp::eval
