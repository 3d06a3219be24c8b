// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "export/files.h"
#include "io/image_decode.h"
#include "pmsp/error.h"
#include "pmsp/io/depth.h"

namespace pmsp {

void write_png16(const std::filesystem::path& path, const Image<float>& image, double scale) {
  if (image.empty()) throw InvalidInput(path.string() + ": an image without pixels cannot be written as PNG");
  if (!std::isfinite(scale) || scale <= 0.0) {
    throw InvalidInput(path.string() + ": scale " + std::to_string(scale) + " of a PNG is not > 0");
  }
  cv::Mat values(image.height(), image.width(), CV_16UC1);
  for (int y = 0; y < image.height(); ++y) {
    const float* from = image.row(y);
    auto* to = values.ptr<std::uint16_t>(y);
    for (int x = 0; x < image.width(); ++x) {
      const double value = std::floor(static_cast<double>(from[x]) * scale + 0.5);
      to[x] = value > 0.0 && value <= 65535.0 ? static_cast<std::uint16_t>(value) : std::uint16_t{0};
    }
  }
  write_file(path, io::encoded(".png", values, path.string() + ": cannot be encoded as PNG"));
}

void write_png16(const std::filesystem::path& path, const Image<Eigen::Vector3f>& normals) {
  if (normals.empty()) throw InvalidInput(path.string() + ": an image without pixels cannot be written as PNG");
  cv::Mat values(normals.height(), normals.width(), CV_16UC3, cv::Scalar::all(0));
  for (int y = 0; y < normals.height(); ++y) {
    for (int x = 0; x < normals.width(); ++x) {
      const Eigen::Vector3f& normal = normals.row(y)[x];
      if (normal.isZero(0.0F)) continue;
      for (int i = 0; i < 3; ++i) {  // BGR order of OpenCV
        const float share = std::clamp(0.5F * (normal[i] + 1.0F), 0.0F, 1.0F);
        values.ptr<cv::Vec3w>(y)[x][2 - i] = static_cast<std::uint16_t>(std::lround(65535.0F * share));
      }
    }
  }
  write_file(path, io::encoded(".png", values, path.string() + ": cannot be encoded as PNG"));
}

namespace {

cv::Mat decoded(const std::filesystem::path& path) {
  require_regular_file(path);
  cv::Mat values;
  try {
    values = cv::imread(path.string(), cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
    values.release();  // OpenCV's size limits; reported as an undecodable image
  }
  if (values.empty()) throw IoError(path.string() + ": cannot be decoded as an image");
  return values;
}

}  // namespace

Image<float> read_png16(const std::filesystem::path& path, double scale) {
  const cv::Mat values = decoded(path);
  if (values.type() != CV_16UC1 && values.type() != CV_8UC1) {
    throw InvalidInput(path.string() + ": has the wrong kind of pixels; expected one gray channel of 16 or 8 bits");
  }
  cv::Mat scaled;
  values.convertTo(scaled, CV_32F, scale);
  Image<float> image(scaled.cols, scaled.rows);
  for (int y = 0; y < scaled.rows; ++y) {
    const float* from = scaled.ptr<float>(y);
    std::copy(from, from + scaled.cols, image.row(y));
  }
  return image;
}

Image<Eigen::Vector3f> read_png16_normals(const std::filesystem::path& path) {
  const cv::Mat values = decoded(path);
  if (values.type() != CV_16UC3) {
    throw InvalidInput(path.string() + ": has the wrong kind of pixels; expected red, green and blue of 16 bits");
  }
  Image<Eigen::Vector3f> normals(values.cols, values.rows, Eigen::Vector3f::Zero());
  for (int y = 0; y < values.rows; ++y) {
    for (int x = 0; x < values.cols; ++x) {
      const cv::Vec3w& color = values.ptr<cv::Vec3w>(y)[x];
      if (color == cv::Vec3w(0, 0, 0)) continue;
      Eigen::Vector3f& normal = normals(x, y);
      for (int i = 0; i < 3; ++i) normal[i] = static_cast<float>(color[2 - i]) / 65535.0F * 2.0F - 1.0F;
      normal.normalize();
    }
  }
  return normals;
}

}  // namespace pmsp
