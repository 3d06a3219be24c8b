// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "support/temp_dir.h"

namespace pmsp::test {

using pmsp_test::TempDir;

struct SampleCamera {
  std::string name;
  int cols = 0;
  int rows = 0;
  double fps = 0.0;
};

struct SampleKeyframe {
  std::int64_t id = 0;
  double timestamp = 0.0;
  int source_frame = 0;
  std::string camera;
  Eigen::Matrix3d rotation_cw = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation_cw = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector2f> keypoints;  ///< as the SLAM has them: the first pixel's centre is (0, 0)
  std::vector<std::int64_t> landmark_ids;
};

struct SampleLandmark {
  std::int64_t id = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

struct SampleMap {
  std::vector<SampleCamera> cameras;
  std::vector<SampleKeyframe> keyframes;
  std::vector<SampleLandmark> landmarks;
};

/// Two cameras, keyframes 2, 9 and 10 (whose order as text is 10, 2, 9), landmarks 1, 5, 12, 30 and 100. The
/// observations include two of a missing landmark (77) and a duplicate one.
SampleMap sample_map();

/// `count` keyframes with random poses, seeing random ones of `landmarks` landmarks.
SampleMap random_map(int count, int landmarks, unsigned seed);

enum class MsgpackVersion {
  openvslam,         ///< to 0.2.4
  stella_0_3_0,      ///< and 0.3.1
  stella_0_3_2,      ///< and 0.3.3
  stella_0_3_4,      ///< and 0.3.5
  stella_0_3_6,      ///< and later
  patchmatch,        ///< the sparse map of PatchMatch-Stereo-Panorama
  patchmatch_dense,  ///< its file of dense points
  stella_dense,      ///< stella_vslam_dense
};

/// The tree that the SLAM of that version writes; tests modify it before writing it.
nlohmann::json msgpack_tree(const SampleMap& map, MsgpackVersion version);

void write_file(const std::filesystem::path& path, const std::string& bytes);
inline std::string read_file(const std::filesystem::path& path) { return pmsp_test::read_text(path); }
std::string msgpack_bytes(const nlohmann::json& tree);

enum class SqliteVersion { stella_0_3_1, stella_0_3_2, stella_0_3_6, stella_0_6_0, stella_dense };

/// Writes the database of that version, then runs `sql` on it.
void write_sqlite(const std::filesystem::path& path, const SampleMap& map, SqliteVersion version,
                  const std::string& sql = "");

/// Class name and message of the error of reading the file; "" if there is none.
std::string error_of(const std::filesystem::path& path);

}  // namespace pmsp::test
