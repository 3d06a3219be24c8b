// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/calibration_plot.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "pmsp-eval/picture_file.h"
#include "util/text.h"

namespace pmsp::eval {
namespace {

constexpr int kWidth = 800;
constexpr int kHeight = 540;
constexpr int kLeft = 70;
constexpr int kRight = 20;
constexpr int kTop = 50;
constexpr int kBottom = 70;
constexpr double kSmallestError = 1e-6;

const cv::Scalar kBlack(0, 0, 0);
const cv::Scalar kGray(225, 225, 225);

using Error = double CalibrationBin::*;

/// Colours in BGR order.
struct Series {
  const char* name;
  const CalibrationCurve Calibration::*curve;
  Error error;
  cv::Scalar color;
};

const Series kSeries[] = {
    {"median error", &Calibration::plain, &CalibrationBin::error_median, {180, 90, 20}},
    {"by solid angle", &Calibration::solid_angle, &CalibrationBin::error_median, {235, 190, 140}},
    {"90 % of errors below", &Calibration::plain, &CalibrationBin::error_p90, {30, 30, 200}},
    {"by solid angle", &Calibration::solid_angle, &CalibrationBin::error_p90, {160, 160, 245}},
};

/// Range of powers of ten on the error axis.
struct Decades {
  int low = 0;
  int high = 0;
};

Decades decades_of(const Calibration& calibration) {
  double low = 1.0;
  double high = kSmallestError;
  for (const Series& series : kSeries) {
    for (const CalibrationBin& bin : (calibration.*series.curve).deciles) {
      if (bin.share == 0.0) continue;
      low = std::min(low, std::max(bin.*series.error, kSmallestError));
      high = std::max(high, bin.*series.error);
    }
  }
  Decades decades{static_cast<int>(std::floor(std::log10(low))), static_cast<int>(std::ceil(std::log10(high)))};
  decades.high = std::max(decades.high, decades.low + 1);
  return decades;
}

class Plot {
 public:
  explicit Plot(const Decades& decades) : decades_(decades), image_(kHeight, kWidth, CV_8UC3, {255, 255, 255}) {}

  void draw(const Calibration& calibration) {
    draw_grid(calibration);
    int x = kLeft;
    for (const Series& series : kSeries) {
      draw_series((calibration.*series.curve).deciles, series);
      cv::line(image_, {x, 22}, {x + 24, 22}, series.color, 2, cv::LINE_AA);
      text(series.name, {x + 30, 26}, 0.42);
      x += 45 + 8 * static_cast<int>(std::string(series.name).size());
    }
  }

  const cv::Mat& image() const { return image_; }

 private:
  static int column(std::size_t decile) {
    return kLeft + static_cast<int>((static_cast<double>(decile) + 0.5) * (kWidth - kLeft - kRight) / 10.0);
  }

  int row(double error) const {
    const double exponent = std::log10(std::max(error, kSmallestError));
    const double position = (exponent - decades_.low) / (decades_.high - decades_.low);
    return kHeight - kBottom - static_cast<int>(std::lround(position * (kHeight - kTop - kBottom)));
  }

  void text(const std::string& words, const cv::Point& at, double size) {
    cv::putText(image_, words, at, cv::FONT_HERSHEY_SIMPLEX, size, kBlack, 1, cv::LINE_AA);
  }

  void draw_grid(const Calibration& calibration) {
    for (int decade = decades_.low; decade <= decades_.high; ++decade) {
      const double value = std::pow(10.0, decade);
      const int y = row(value);
      cv::line(image_, {kLeft, y}, {kWidth - kRight, y}, kGray, 1);
      text(percent(value), {6, y + 4}, 0.42);
      if (decade == decades_.high) break;
      for (const double factor : {2.0, 5.0}) {
        const int between = row(factor * value);
        cv::line(image_, {kLeft, between}, {kLeft + 6, between}, kBlack, 1);
      }
    }
    cv::rectangle(image_, {kLeft, kTop}, {kWidth - kRight, kHeight - kBottom}, kBlack, 1);
    for (std::size_t i = 0; i < calibration.plain.deciles.size(); ++i) {
      const CalibrationBin& bin = calibration.plain.deciles[i];
      text(std::to_string(i + 1), {column(i) - 6, kHeight - kBottom + 18}, 0.42);
      if (bin.share > 0.0)
        text(number_text(bin.confidence_min, "%.3f"), {column(i) - 18, kHeight - kBottom + 36}, 0.36);
    }
    text("decile of confidence, and the least confidence in it", {kLeft, kHeight - 12}, 0.42);
  }

  void draw_series(const std::array<CalibrationBin, 10>& deciles, const Series& series) {
    cv::Point last(-1, -1);
    for (std::size_t i = 0; i < deciles.size(); ++i) {
      if (deciles[i].share == 0.0) continue;
      const cv::Point at(column(i), row(deciles[i].*series.error));
      cv::circle(image_, at, 3, series.color, cv::FILLED, cv::LINE_AA);
      if (last.x >= 0) cv::line(image_, last, at, series.color, 2, cv::LINE_AA);
      last = at;
    }
  }

  Decades decades_;
  cv::Mat image_;
};

}  // namespace

void write_calibration_plot(const std::filesystem::path& path, const Calibration& calibration) {
  Plot plot(decades_of(calibration));
  plot.draw(calibration);
  write_png(path, plot.image());
}

}  // namespace pmsp::eval
