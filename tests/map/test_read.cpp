// SPDX-License-Identifier: BSD-2-Clause
#if defined(__linux__)
#include <sched.h>
#endif

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>

#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "elementary.h"
#include "machine.h"
#include "map_files.h"
#include "pmsp/camera.h"
#include "pmsp/io/map.h"
#include "pmsp/stages.h"

namespace pmsp::test {
namespace {

bool same_bits(const MapKeyframe& a, const MapKeyframe& b) {
  if (a.id != b.id || a.timestamp != b.timestamp || a.camera != b.camera || a.source_frame != b.source_frame)
    return false;
  if (std::memcmp(&a.cam_from_world, &b.cam_from_world, sizeof a.cam_from_world) != 0) return false;
  if (a.observations.size() != b.observations.size()) return false;
  for (std::size_t i = 0; i < a.observations.size(); ++i) {
    if (a.observations[i].landmark_id != b.observations[i].landmark_id) return false;
    if (a.observations[i].pixel != b.observations[i].pixel) return false;
  }
  return true;
}

void check_same_bits(const SlamMap& a, const SlamMap& b) {
  REQUIRE(a.keyframes.size() == b.keyframes.size());
  REQUIRE(a.landmarks.size() == b.landmarks.size());
  REQUIRE(a.cameras.size() == b.cameras.size());
  CHECK(a.observations_skipped == b.observations_skipped);
  CHECK(a.observations_repeated == b.observations_repeated);
  for (std::size_t i = 0; i < a.cameras.size(); ++i) {
    CHECK(a.cameras[i].name == b.cameras[i].name);
    CHECK(a.cameras[i].width == b.cameras[i].width);
    CHECK(a.cameras[i].fps == b.cameras[i].fps);
  }
  std::size_t different = 0;
  for (std::size_t i = 0; i < a.keyframes.size(); ++i) different += same_bits(a.keyframes[i], b.keyframes[i]) ? 0 : 1;
  for (std::size_t i = 0; i < a.landmarks.size(); ++i) {
    const bool same = a.landmarks[i].id == b.landmarks[i].id &&
                      std::memcmp(a.landmarks[i].position_world.data(), b.landmarks[i].position_world.data(), 24) == 0;
    different += same ? 0 : 1;
  }
  CHECK(different == 0);
}

/// Expected result of reading each version of sample_map(), except `source_frame` and the dense file's pixels.
void check_sample(const SlamMap& map, bool pixels_from_file = true) {
  REQUIRE(map.cameras.size() == 2);
  CHECK(map.cameras[0].name == "another");
  CHECK(map.cameras[1].name == "theta");
  CHECK(map.cameras[1].width == 1920);
  CHECK(map.cameras[1].height == 960);
  CHECK(map.cameras[0].fps == 29.97);

  REQUIRE(map.keyframes.size() == 3);
  CHECK(map.keyframes[0].id == 2);
  CHECK(map.keyframes[1].id == 9);
  CHECK(map.keyframes[2].id == 10);
  CHECK(map.keyframes[1].camera == 0);
  CHECK(map.keyframes[2].camera == 1);
  CHECK(map.keyframes[2].timestamp == 2.5);

  REQUIRE(map.landmarks.size() == 5);
  CHECK(map.landmarks[1].id == 5);
  CHECK(map.landmarks[4].position_world == Eigen::Vector3d(0.1, -0.2, 3.25));

  CHECK(map.observations_skipped == 2);
  CHECK(map.observations_repeated == 1);
  REQUIRE(map.keyframes[0].observations.size() == 2);
  REQUIRE(map.keyframes[1].observations.size() == 2);
  CHECK(map.keyframes[0].observations[0].landmark_id == 5);
  CHECK(map.keyframes[0].observations[1].landmark_id == 100);
  if (pixels_from_file) {
    CHECK(map.keyframes[0].observations[0].pixel == Eigen::Vector2f(100.5F, 200.5F));
    CHECK(map.keyframes[0].observations[1].pixel == Eigen::Vector2f(7.5F, 8.5F));
    CHECK(map.keyframes[1].observations[0].pixel == Eigen::Vector2f(600.5F, 300.5F));  // the first of the two
  }
  for (const SampleKeyframe& expected : sample_map().keyframes) {
    const MapKeyframe* keyframe = map.find_keyframe(expected.id);
    REQUIRE(keyframe != nullptr);
    const int width = map.cameras[static_cast<std::size_t>(keyframe->camera)].width;
    const RigidTransform pose =
        cam_from_slam_cam(width) * RigidTransform{expected.rotation_cw, expected.translation_cw};
    CHECK((keyframe->cam_from_world.rotation - pose.rotation).cwiseAbs().maxCoeff() < 2e-9);
    CHECK((keyframe->cam_from_world.translation - pose.translation).cwiseAbs().maxCoeff() < 1e-14);
  }
}

#if defined(__linux__)
/// While it lives, the calling thread is pinned to one CPU and sees no other.
class OneCpu {
 public:
  OneCpu() {
    REQUIRE(sched_getaffinity(0, sizeof all_, &all_) == 0);
    int first = 0;
    while (!CPU_ISSET(first, &all_)) ++first;
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(first, &one);
    REQUIRE(sched_setaffinity(0, sizeof one, &one) == 0);
    REQUIRE(usable_cpus() == 1);
  }
  ~OneCpu() { sched_setaffinity(0, sizeof all_, &all_); }
  OneCpu(const OneCpu&) = delete;
  OneCpu& operator=(const OneCpu&) = delete;

 private:
  cpu_set_t all_{};
};
#endif

}  // namespace

TEST_CASE("a keyframe's pose error is the residual of its landmarks over the root of their number") {
  SlamMap map;
  map.cameras.push_back({"theta", 1920, 960, 30.0});
  MapKeyframe keyframe;
  keyframe.cam_from_world.translation = {0.5, -0.25, 2.0};
  constexpr double kDegree = kernels::kPi / 180.0;
  const Eigen::Vector3d center = keyframe.cam_from_world.center();
  const auto see = [&](const Eigen::Vector3d& direction, double degrees_off) {
    const auto id = static_cast<std::int64_t>(map.landmarks.size());
    map.landmarks.push_back({id, center + 3.0 * direction});
    const Eigen::AngleAxisd turn(degrees_off * kDegree, direction.unitOrthogonal());
    const Eigen::Vector2d pixel = pixel_from_bearing(turn * direction, 1920, 960);
    keyframe.observations.push_back({id, pixel.cast<float>()});
  };
  CHECK(keyframe_of(map, keyframe).pose_error == 0.0);
  for (const double degrees : {0.1, 0.2, 0.2, 0.2, 5.0}) {
    see(Eigen::Vector3d(1.0, 0.3 * degrees, -1.0).normalized(), degrees);
  }
  CHECK(keyframe_of(map, keyframe).pose_error == Approx(0.2 * kDegree / std::sqrt(5.0)).epsilon(1e-3));
  map.landmarks.push_back({5, center});  // in the camera: seen in no direction
  keyframe.observations.push_back({5, {10.0F, 20.0F}});
  CHECK(keyframe_of(map, keyframe).landmarks.size() == 6);
  CHECK(keyframe_of(map, keyframe).pose_error == Approx(0.2 * kDegree / std::sqrt(5.0)).epsilon(1e-3));
  keyframe.observations.clear();
  map.landmarks.clear();
  see(Eigen::Vector3d::UnitX(), 179.0);
  CHECK(keyframe_of(map, keyframe).pose_error == 1.0);
}

TEST_CASE("every version of MessagePack map reads the same") {
  struct Case {
    MsgpackVersion version;
    const char* format;
    bool has_source_frame;
  };
  const auto [version, format, has_source_frame] =
      GENERATE(Case{MsgpackVersion::openvslam, "OpenVSLAM, MessagePack", true},
               Case{MsgpackVersion::stella_0_3_0, "stella_vslam 0.3.0 to 0.3.1, MessagePack", true},
               Case{MsgpackVersion::stella_0_3_2, "stella_vslam 0.3.2 to 0.3.3, MessagePack", true},
               Case{MsgpackVersion::stella_0_3_4, "stella_vslam 0.3.4 to 0.3.5, MessagePack", true},
               Case{MsgpackVersion::stella_0_3_6, "stella_vslam >= 0.3.6, MessagePack", false},
               Case{MsgpackVersion::patchmatch, "PatchMatch-Stereo-Panorama, MessagePack", true},
               Case{MsgpackVersion::patchmatch_dense, "PatchMatch-Stereo-Panorama, dense points, MessagePack", true},
               Case{MsgpackVersion::stella_dense, "stella_vslam_dense, MessagePack", false});
  const TempDir folder;
  // The name has no effect: the content decides.
  const auto path = folder / "map.db";
  write_file(path, msgpack_bytes(msgpack_tree(sample_map(), version)));
  const SlamMap map = read_map(path);
  CHECK(map.format == format);
  CHECK(map.path == path);
  check_sample(map, version != MsgpackVersion::patchmatch_dense);
  CHECK(map.keyframes[0].source_frame.has_value() == has_source_frame);
  if (has_source_frame) CHECK(*map.keyframes[2].source_frame == 25);
}

TEST_CASE("every version of SQLite map reads the same") {
  struct Case {
    SqliteVersion version;
    const char* format;
    bool has_source_frame;
  };
  const auto [version, format, has_source_frame] =
      GENERATE(Case{SqliteVersion::stella_0_3_1, "stella_vslam 0.3.1, SQLite", true},
               Case{SqliteVersion::stella_0_3_2, "stella_vslam 0.3.2 to 0.3.5, SQLite", true},
               Case{SqliteVersion::stella_0_3_6, "stella_vslam >= 0.3.6, SQLite", false},
               Case{SqliteVersion::stella_0_6_0, "stella_vslam >= 0.3.6, SQLite", false},
               Case{SqliteVersion::stella_dense, "stella_vslam_dense, SQLite", false});
  const TempDir folder;
  const auto path = folder / "map 100%?x=1#\xC3\xA4.msg";
  write_sqlite(path, sample_map(), version);
  const SlamMap map = read_map(path);
  CHECK(map.format == format);
  check_sample(map);
  CHECK(map.keyframes[0].source_frame.has_value() == has_source_frame);
  if (has_source_frame) CHECK(*map.keyframes[1].source_frame == 17);
  // No other files were created.
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) files += entry.exists() ? 1 : 0;
  CHECK(files == 1);
}

TEST_CASE("MessagePack and SQLite of one map give the same bits") {
  const TempDir folder;
  SampleMap map = random_map(1500, 400, 7);
  for (int axis = 0; axis < 3; ++axis) {  // half turns, where a quaternion's sign is ambiguous
    map.keyframes[static_cast<std::size_t>(axis)].rotation_cw = -Eigen::Matrix3d::Identity();
    map.keyframes[static_cast<std::size_t>(axis)].rotation_cw(axis, axis) = 1.0;
  }
  nlohmann::json tree = msgpack_tree(map, MsgpackVersion::stella_0_3_6);
  write_file(folder / "map.msg", msgpack_bytes(tree));
  write_sqlite(folder / "map.db", map, SqliteVersion::stella_0_6_0);
  const SlamMap from_sqlite = read_map(folder / "map.db");
  check_same_bits(read_map(folder / "map.msg"), from_sqlite);

  SECTION("even where the quaternions' last bits and signs differ") {
    for (auto& item : tree["keyframes"].items()) {
      for (auto& q : item.value()["rot_cw"]) q = -q.get<double>() * (1.0 + 1e-15);
    }
    write_file(folder / "other.msg", msgpack_bytes(tree));
    check_same_bits(read_map(folder / "other.msg"), from_sqlite);
  }
}

#if defined(__linux__)
TEST_CASE("a large map reads the same by one thread and by several") {
  const TempDir folder;
  const auto path = folder / "map.msg";
  nlohmann::json tree = msgpack_tree(random_map(6000, 900, 3), MsgpackVersion::stella_0_3_6);
  write_file(path, msgpack_bytes(tree));
  REQUIRE(std::filesystem::file_size(path) > 4'000'000);
  const auto by_one_thread = [&] {
    const OneCpu one;
    return read_map(path);
  };
  check_same_bits(read_map(path), by_one_thread());

  SECTION("and so are its errors") {
    tree["keyframes"]["7"]["trans_cw"] = {1, 2};  // not the first one that is wrong, in the file's order
    tree["keyframes"]["6666"]["ts"] = "now";
    write_file(path, msgpack_bytes(tree));
    const std::string error = error_of(path);
    CHECK(error.find("keyframes[\"6666\"].ts: expected a number, found a string") != std::string::npos);
    const OneCpu one;
    CHECK(error_of(path) == error);
  }
}
#endif

TEST_CASE("a pose is rotated by half a pixel so that landmarks project to their keypoints") {
  // A landmark that the SLAM sees exactly at pixel index (1440, 480): a quarter turn to the right.
  SampleMap map;
  map.cameras = {{"theta", 1920, 960, 10.0}};
  map.landmarks = {{0, {2.0, 0.0, 0.0}}};
  map.keyframes = {{0, 0.0, 0, "theta", Eigen::Matrix3d::Identity(), {0.0, 0.0, 0.0}, {{1440.0F, 480.0F}}, {0}}};
  const TempDir folder;
  write_file(folder / "map.msg", msgpack_bytes(msgpack_tree(map, MsgpackVersion::stella_0_3_6)));
  const SlamMap result = read_map(folder / "map.msg");
  const MapKeyframe& keyframe = result.keyframes.at(0);
  const Eigen::Vector2d pixel =
      pixel_from_bearing(keyframe.cam_from_world * result.landmarks[0].position_world, 1920, 960);
  CHECK(keyframe.observations.at(0).pixel == Eigen::Vector2f(1440.5F, 480.5F));
  CHECK(pixel.x() == Approx(1440.5).margin(1e-6));
  CHECK(pixel.y() == Approx(480.0).margin(1e-6));  // in latitude the half pixel stays
}

TEST_CASE("keypoints of the dense file are in depth map pixels so landmarks are projected instead") {
  SampleMap map;
  map.cameras = {{"theta", 1920, 960, 10.0}};
  map.landmarks = {{0, {2.0, 0.0, 0.0}}};
  map.keyframes = {{0, 0.0, 0, "theta", Eigen::Matrix3d::Identity(), {0.0, 0.0, 0.0}, {{3.0F, 4.0F}}, {0}}};
  const TempDir folder;
  write_file(folder / "map", msgpack_bytes(msgpack_tree(map, MsgpackVersion::patchmatch_dense)));
  const Eigen::Vector2f pixel = read_map(folder / "map").keyframes.at(0).observations.at(0).pixel;
  CHECK(pixel.x() == Approx(1440.5F).margin(1e-3));
  CHECK(pixel.y() == Approx(480.5F).margin(1e-3));
}

TEST_CASE("landmarks and keyframes are found by id") {
  const TempDir folder;
  write_file(folder / "map.msg", msgpack_bytes(msgpack_tree(sample_map(), MsgpackVersion::openvslam)));
  const SlamMap map = read_map(folder / "map.msg");
  REQUIRE(map.find_landmark(30) != nullptr);
  CHECK(map.find_landmark(30)->position_world == Eigen::Vector3d(0.0, 2.0, 1.0));
  CHECK(map.find_keyframe(10) == &map.keyframes[2]);
  CHECK(map.find_landmark(77) == nullptr);
  CHECK(map.find_landmark(101) == nullptr);
  CHECK(map.find_keyframe(-1) == nullptr);

  SECTION("with unevenly spread ids") {
    SlamMap uneven;
    CHECK(uneven.find_landmark(0) == nullptr);
    std::int64_t id = -7;
    for (int i = 0; i < 200; ++i) {
      uneven.landmarks.push_back({id, Eigen::Vector3d::Zero()});
      id += i % 50 == 49 ? std::int64_t{1} << (i / 4) : 1 + i % 3;
    }
    uneven.landmarks.push_back({std::numeric_limits<std::int64_t>::max(), Eigen::Vector3d::Zero()});
    std::size_t wrong = 0;
    for (const MapLandmark& landmark : uneven.landmarks) {
      const bool followed = &landmark != &uneven.landmarks.back() && (&landmark)[1].id == landmark.id + 1;
      wrong += uneven.find_landmark(landmark.id) == &landmark ? 0 : 1;
      if (followed || landmark.id == std::numeric_limits<std::int64_t>::max()) continue;
      wrong += uneven.find_landmark(landmark.id + 1) == nullptr ? 0 : 1;
    }
    CHECK(wrong == 0);
  }
}

TEST_CASE("unusual but valid maps are read") {
  const TempDir folder;
  const auto path = folder / "map.msg";
  nlohmann::json tree = msgpack_tree(sample_map(), MsgpackVersion::stella_0_3_6);
  nlohmann::json& keyframe = tree["keyframes"]["9"];
  SECTION("whole numbers as floats, floats as whole numbers") {
    tree["cameras"]["theta"]["cols"] = 1920.0;
    tree["cameras"]["theta"]["fps"] = 10;
    keyframe["lm_ids"] = {30.0, 30, 5.0};
    keyframe["ts"] = 3;
    keyframe["trans_cw"] = {1, 2, 3};
    write_file(path, msgpack_bytes(tree));
    const SlamMap map = read_map(path);
    CHECK(map.keyframes[1].timestamp == 3.0);
    CHECK(map.keyframes[1].observations.size() == 2);
  }
  SECTION("keypoints before and after what refers to them, unknown keys, nested data") {
    keyframe["zzz"] = {{"undist_keypts", {1, 2, {{"pt", nullptr}}}}};
    keyframe["a"] = true;
    keyframe["undist_keypts"][0]["extra"] = {{"pt", "no"}};
    tree["zzz"] = {{"keyframes", 1}};
    tree["bin"] = nlohmann::json::binary({1, 2, 3});
    write_file(path, msgpack_bytes(tree));
    check_sample(read_map(path));
  }
  SECTION("rows of numbers longer than the read buffer at any offset") {
    nlohmann::json rows = nlohmann::json::array();
    for (std::uint32_t i = 0; i < 250000; ++i) rows.push_back(0xFFFFFFFFU - i);
    for (int i = 0; i < 250000; ++i) rows.push_back(i % 3 == 0 ? nlohmann::json(0.1 * i) : nlohmann::json(-i));
    keyframe["rows"] = rows;
    for (std::size_t before = 0; before < 9; ++before) {
      CAPTURE(before);
      tree["before"] = std::string(before, 'x');
      write_file(path, msgpack_bytes(tree));
      check_sample(read_map(path));
    }
  }
  SECTION("values of any type under unknown keys") {
    const auto zeros = [](std::size_t count) { return std::string(count, '\0'); };
    const std::string type = "\x05";
    const std::vector<std::string> values{
        "\x7F",
        "\xE0",
        "\xC0",
        "\xC2",
        "\xC3",
        "\x82\x01\xA1x\x02\x91\x03",
        "\x93\x01\x92\x01\x02\xC3",
        "\xA3xyz",
        "\xC4\x02" + zeros(2),
        "\xC5" + zeros(1) + "\x02" + zeros(2),
        "\xC6" + zeros(3) + "\x02" + zeros(2),
        "\xC7\x02" + type + zeros(2),
        "\xC8" + zeros(1) + "\x02" + type + zeros(2),
        "\xC9" + zeros(3) + "\x02" + type + zeros(2),
        "\xCA" + zeros(4),
        "\xCB" + zeros(8),
        "\xCC" + zeros(1),
        "\xCD" + zeros(2),
        "\xCE" + zeros(4),
        "\xCF" + zeros(8),
        "\xD0" + zeros(1),
        "\xD1" + zeros(2),
        "\xD2" + zeros(4),
        "\xD3" + zeros(8),
        "\xD4" + type + zeros(1),
        "\xD5" + type + zeros(2),
        "\xD6" + type + zeros(4),
        "\xD7" + type + zeros(8),
        "\xD8" + type + zeros(16),
        "\xD9\x02xy",
        "\xDA" + zeros(1) + "\x02xy",
        "\xDB" + zeros(3) + "\x02xy",
        "\xDC" + zeros(1) + "\x02\x01\xA1x",
        "\xDD" + zeros(3) + "\x02\x01\xA1x",
        "\xDE" + zeros(1) + "\x01\x01\xA1x",
        "\xDF" + zeros(3) + "\x01\x01\xA1x",
        std::string(1000000, '\x91') + "\xC0",                                   // deep
        "\xDD" + zeros(1) + "\x20" + zeros(2) + std::string(0x200000, '\x07')};  // long
    const std::string place =
        "\xA7"
        "a value";
    tree["zzz"] = "a value";
    keyframe["descs"] = "a value";
    const std::string bytes = msgpack_bytes(tree);
    for (const std::string& value : values) {
      CAPTURE(static_cast<int>(static_cast<unsigned char>(value[0])));
      std::string with = bytes;
      for (std::size_t at = with.find(place); at != std::string::npos; at = with.find(place)) {
        with.replace(at, place.size(), value);
      }
      write_file(path, with);
      check_sample(read_map(path));
    }
  }
  SECTION("undistorted keypoints take precedence over distorted ones") {
    for (auto& [id, each] : tree["keyframes"].items()) {
      each["keypts"] = each["undist_keypts"];
      for (nlohmann::json& keypoint : each["keypts"]) keypoint = {{"pt", {3, 4}}};
    }
    write_file(path, msgpack_bytes(tree));  // in alphabetical order
    check_sample(read_map(path));
    nlohmann::ordered_json later(tree);
    for (auto& [id, each] : later["keyframes"].items()) {
      const nlohmann::ordered_json keypoints = each["keypts"];
      each.erase("keypts");
      each["keypts"] = keypoints;
    }
    const std::vector<std::uint8_t> bytes = nlohmann::ordered_json::to_msgpack(later);
    write_file(path, std::string(bytes.begin(), bytes.end()));
    check_sample(read_map(path));
  }
  SECTION("no landmarks, no keypoints") {
    tree["landmarks"] = nlohmann::json::object();
    keyframe["lm_ids"] = nullptr;
    keyframe["undist_keypts"] = nullptr;
    write_file(path, msgpack_bytes(tree));
    const SlamMap map = read_map(path);
    CHECK(map.landmarks.empty());
    CHECK(map.observations_skipped == 6);
    CHECK(map.keyframes[1].observations.empty());
  }
  SECTION("a nearly unit quaternion and a missing reference keyframe and ids with leading zeros") {
    keyframe["rot_cw"] = {0.0, 0.0, 0.0, 1.0009};
    tree["landmarks"]["5"]["ref_keyfrm"] = 4711;
    tree["landmarks"]["0030"] = tree["landmarks"]["30"];
    tree["landmarks"].erase("30");
    write_file(path, msgpack_bytes(tree));
    const SlamMap map = read_map(path);
    CHECK(map.find_landmark(30) != nullptr);
    const Eigen::Matrix3d r = map.keyframes[1].cam_from_world.rotation;
    CHECK((r - cam_from_slam_cam(640).rotation).cwiseAbs().maxCoeff() < 1e-12);
    CHECK((r.transpose() * r - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-15);
  }
}

}  // namespace pmsp::test
