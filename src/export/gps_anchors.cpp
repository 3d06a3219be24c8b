// SPDX-License-Identifier: BSD-2-Clause
#include <cmath>

#include "elementary.h"
#include "export/cloud_frame.h"
#include "io/exif.h"
#include "pmsp/error.h"
#include "util/text.h"

namespace pmsp {
namespace {

/// Earth-centred coordinates [m]: WGS 84 (NIMA TR8350.2, equation 4-14).
Eigen::Vector3d earth_centred(const io::GpsPosition& gps) {
  constexpr double kRadius = 6378137.0, kFlattening = 1.0 / 298.257223563;
  constexpr double kEccentricity = kFlattening * (2.0 - kFlattening);  // squared
  const double lat = gps.latitude_deg * kernels::kDegree, lon = gps.longitude_deg * kernels::kDegree;
  const double normal = kRadius / std::sqrt(1.0 - kEccentricity * std::sin(lat) * std::sin(lat));
  return {(normal + gps.altitude_m) * std::cos(lat) * std::cos(lon),
          (normal + gps.altitude_m) * std::cos(lat) * std::sin(lon),
          ((1.0 - kEccentricity) * normal + gps.altitude_m) * std::sin(lat)};
}

/// Rows: east, north and up.
Eigen::Matrix3d axes_at(const io::GpsPosition& gps) {
  const double lat = gps.latitude_deg * kernels::kDegree, lon = gps.longitude_deg * kernels::kDegree;
  Eigen::Matrix3d axes;
  axes << -std::sin(lon), std::cos(lon), 0.0,                                         //
      -std::sin(lat) * std::cos(lon), -std::sin(lat) * std::sin(lon), std::cos(lat),  //
      std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon), std::sin(lat);
  return axes;
}

}  // namespace

std::vector<Anchor> gps_anchors(const SlamMap& map, const ImageFiles& images, std::string& origin) {
  std::vector<Anchor> anchors;
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  for (const MapKeyframe& keyframe : map.keyframes) {
    const auto image = images.find(keyframe.id);
    if (image == images.end()) continue;
    std::optional<io::GpsPosition> gps;
    try {
      gps = io::read_exif(image->second).gps;
    } catch (const IoError&) {
      continue;  // reported when the image is decoded
    }
    if (!gps) continue;
    const Eigen::Vector3d place = earth_centred(*gps);
    if (anchors.empty()) {
      first = place;
      axes = axes_at(*gps);
      origin = format("latitude %.8f, longitude %.8f, altitude %.2f m", gps->latitude_deg, gps->longitude_deg,
                      gps->altitude_m);
    }
    anchors.push_back({"keyframe " + std::to_string(keyframe.id), keyframe.cam_from_world.center(),
                       axes * (place - first), std::nullopt});
  }
  return anchors;
}

}  // namespace pmsp
