// SPDX-License-Identifier: BSD-2-Clause
#include <limits>
#include <random>

#include <catch2/catch.hpp>

#include "map_files.h"
#include "pmsp/error.h"
#include "pmsp/io/map.h"

namespace pmsp::test {
namespace {

using Catch::Contains;
using Catch::StartsWith;
using nlohmann::json;

json good_tree() { return msgpack_tree(sample_map(), MsgpackVersion::stella_0_3_6); }

std::string error_of_tree(const json& tree) {
  const TempDir folder;
  write_file(folder / "map.msg", msgpack_bytes(tree));
  return error_of(folder / "map.msg");
}

std::string error_of_bytes(const std::string& bytes) {
  const TempDir folder;
  write_file(folder / "map.msg", bytes);
  return error_of(folder / "map.msg");
}

std::string replaced(std::string bytes, const std::string& from, const std::string& to) {
  const std::size_t at = bytes.find(from);
  if (at == std::string::npos) throw std::logic_error(from + " is not there");
  return bytes.replace(at, from.size(), to);
}

/// The map with one value of keyframe 9 replaced, and the key that the message must name.
void check_keyframe(const std::string& key, const json& value, const std::string& expected) {
  json tree = good_tree();
  tree["keyframes"]["9"][key] = value;
  INFO(key << " = " << value);
  const std::string error = error_of_tree(tree);
  CHECK_THAT(error, StartsWith("InvalidInput: ") && Contains("map.msg: ") && Contains("keyframes[\"9\"]." + key));
  CHECK_THAT(error, Contains(expected));
}

void check_without_keyframe_key(const std::string& key) {
  json tree = good_tree();
  tree["keyframes"]["9"].erase(key);
  INFO(key);
  CHECK_THAT(error_of_tree(tree), StartsWith("InvalidInput: ") && Contains("keyframes[\"9\"]") && Contains(key));
}

const double kNan = std::numeric_limits<double>::quiet_NaN();
const double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

TEST_CASE("a file that is no map is told by what it looks like") {
  const TempDir folder;
  const auto path = folder / "file";
  const auto error = [&](const std::string& bytes) {
    write_file(path, bytes);
    return error_of(path);
  };
  CHECK_THAT(error(""), StartsWith("InvalidInput: ") && Contains(path.string()) && Contains("empty"));
  CHECK_THAT(error("{\"cameras\": {}}"), Contains("JSON"));
  CHECK_THAT(error("ply\nformat ascii 1.0\n"), Contains("PLY"));
  CHECK_THAT(error("\x89PNG\r\n\x1A\n"), Contains("image"));
  CHECK_THAT(error("\xFF\xD8\xFF\xE0"), Contains("image"));
  CHECK_THAT(error(std::string("\0\0\0\x18", 4) + "ftypisom"), Contains("video"));
  CHECK_THAT(error("# a note\n"), Contains("text file"));
  CHECK_THAT(error("\x1F\x8B\x08"), Contains("archive"));
  CHECK_THAT(error("SQLite format 3"), StartsWith("InvalidInput: ") && Contains("SQLite"));
  CHECK_THAT(error("\xC1\x01"), Contains("0xc1"));
  CHECK_THAT(error_of(folder / "none"), StartsWith("IoError: ") && Contains("no such file"));
  CHECK_THAT(error_of(folder.path()), StartsWith("InvalidInput: ") && Contains("directory"));
}

TEST_CASE("a map without its sections, or without keyframes, is refused") {
  CHECK_THAT(error_of_bytes("\x80"), Contains("has no \"cameras\""));
  for (const char* key : {"cameras", "keyframes", "landmarks"}) {
    json tree = good_tree();
    tree.erase(key);
    CHECK_THAT(error_of_tree(tree), StartsWith("InvalidInput: ") && Contains(std::string("has no \"") + key));
    tree[key] = {1, 2};
    CHECK_THAT(error_of_tree(tree), Contains(key) && Contains("expected a map, found an array"));
  }
  json tree = good_tree();
  tree["keyframes"] = json::object();
  CHECK_THAT(error_of_tree(tree), Contains("holds no keyframe"));
  tree["keyframes"] = nullptr;
  CHECK_THAT(error_of_tree(tree), Contains("holds no keyframe"));
  tree = good_tree();
  tree["keyframes"]["9"] = "x";
  CHECK_THAT(error_of_tree(tree), Contains("keyframes[\"9\"]: expected a map, found a string"));
  tree = good_tree();
  tree["keyframeX"] = json::object();
  CHECK_THAT(error_of_bytes(replaced(msgpack_bytes(tree), "keyframeX", "keyframes")),
             Contains("keyframes: appears twice"));
}

TEST_CASE("wrong types and missing keys of a keyframe are named") {
  for (const char* key : {"ts", "cam", "rot_cw", "trans_cw", "lm_ids", "undist_keypts"})
    check_without_keyframe_key(key);
  for (const json& value : {json("12"), json(nullptr), json(true), json::array({1}), json::object({{"a", 1}})}) {
    check_keyframe("ts", value, "expected a number");
    if (!value.is_array()) check_keyframe("rot_cw", value, "expected an array of 4 numbers");
    if (!value.is_string()) check_keyframe("cam", value, "expected a string");
  }
  check_keyframe("rot_cw", {0, 0, 1}, "expected an array of 4 numbers (x, y, z, w), found one of 3");
  check_keyframe("rot_cw", {0, 0, 1, "1"}, "expected a number, found a string");
  check_keyframe("rot_cw", {0, 0, 1, json::array()}, "expected a number, found an array");
  check_keyframe("trans_cw", {0, 0, 1, 2}, "expected an array of 3 numbers, found one of 4");
  check_keyframe("lm_ids", 5, "expected an array of landmark ids, found a number");
  check_keyframe("lm_ids", {1, 2.5, 3}, "lm_ids[1]: expected a whole number");
  check_keyframe("lm_ids", {1, 1e300, 3}, "expected a whole number");
  check_keyframe("lm_ids", {1, UINT64_MAX, 3}, "expected a whole number");
  check_keyframe("lm_ids", {1, 2}, "has 2 elements where there are 3 keypoints");
  check_keyframe("lm_ids", {1, 2, 3, 4}, "has 4 elements where there are 3 keypoints");
  check_keyframe("undist_keypts", {1, 2, 3}, "undist_keypts[0]: expected [x, y]");
  check_keyframe("undist_keypts", {json::array({1, 2}), json::array({1}), json::array({1, 2})}, "[1]: expected [x, y]");
  check_keyframe("undist_keypts", json::array({json::array({1, 2, 3})}), "[0]: expected [x, y]");
  check_keyframe("undist_keypts", json::array({{{"ang", 1.0}}}), "expected \"pt\": [x, y], found none");
  check_keyframe("undist_keypts", json::array({{{"pt", 1.0}}}), "expected \"pt\": [x, y], found a number");
  check_keyframe("undist_keypts", json::array({{{"pt", {1.0, nullptr}}}}), "found null");
  check_keyframe("src_frm_id", -1, "expected a whole number >= 0");
  check_keyframe("src_frm_id", 0.5, "expected a whole number >= 0");
}

TEST_CASE("values that make no sense are refused with their place") {
  check_keyframe("ts", kNan, "finite");
  check_keyframe("ts", kInfinity, "finite");
  check_keyframe("rot_cw", {0.0, 0.0, 0.0, 2.1}, "length 1");
  check_keyframe("rot_cw", {0.0, 0.0, 0.0, 0.4}, "length 1");
  check_keyframe("trans_cw", {0.0, 2e12, 0.0}, "at most 1e12");
  check_keyframe("cam", "nobody's", "no camera \"nobody's\"");
  for (const double x : {kNan, kInfinity, -1.0, 641.0, 1e300}) {
    json keypoints = good_tree()["keyframes"]["9"]["undist_keypts"];
    keypoints[0]["pt"][0] = x;
    check_keyframe("undist_keypts", keypoints, "the keypoint of landmark 30");
  }
  json tree = good_tree();
  tree["landmarks"]["12"]["pos_w"][2] = -2e12;
  CHECK_THAT(error_of_tree(tree), Contains("landmarks[\"12\"].pos_w") && Contains("at most 1e12"));
  tree["landmarks"]["12"].erase("pos_w");
  CHECK_THAT(error_of_tree(tree), Contains("landmarks[\"12\"].pos_w") && Contains("array of 3 numbers"));
}

TEST_CASE("what a SLAM has lost is left out and counted, all of it refused") {
  const auto read = [](const json& tree) {
    const TempDir folder;
    write_file(folder / "map.msg", msgpack_bytes(tree));
    return read_map(folder / "map.msg");
  };
  const json good = good_tree();
  const std::size_t keyframes = read(good).keyframes.size();
  for (const json& rotation :
       {json({kNan, 0.0, 0.0, 1.0}), json({0.0, 0.0, kInfinity, 1.0}), json({0.0, 0.0, 0.0, 0.0})}) {
    json tree = good;
    tree["keyframes"]["9"]["rot_cw"] = rotation;
    const SlamMap map = read(tree);
    CHECK(map.keyframes.size() == keyframes - 1);
    CHECK(map.find_keyframe(9) == nullptr);
    REQUIRE(map.notes.size() == 1);
    CHECK_THAT(map.notes[0], Contains("poses are lost") && Contains(": 1"));
  }
  json tree = good;
  tree["keyframes"]["9"]["trans_cw"][1] = kNan;
  tree["landmarks"]["12"]["pos_w"][2] = kInfinity;
  tree["keyframes"]["10"]["rot_cw"] = {0.0, 0.0, 0.0, 1.5};
  const SlamMap map = read(tree);
  CHECK(map.find_keyframe(9) == nullptr);
  CHECK(map.find_landmark(12) == nullptr);
  REQUIRE(map.notes.size() == 3);
  CHECK_THAT(map.notes[1], Contains("points left out") && Contains(": 1"));
  CHECK_THAT(map.notes[2], Contains("not of length 1, normalised: 1"));
  CHECK(map.find_keyframe(10)->cam_from_world.rotation.determinant() == Approx(1.0));
  for (auto& keyframe : tree["keyframes"]) keyframe["trans_cw"] = {kNan, kNan, kNan};
  CHECK_THAT(error_of_tree(tree), Contains("none of the 3 keyframes"));
  tree = good;
  for (auto& landmark : tree["landmarks"]) landmark["pos_w"] = {kNan, kNan, kNan};
  CHECK_THAT(error_of_tree(tree), Contains("none of the") && Contains("finite position"));
}

TEST_CASE("a perspective camera beside panoramas is left out, an odd row is taken away") {
  const TempDir folder;
  json tree = good_tree();
  const std::string other = tree["keyframes"]["9"]["cam"].get<std::string>();
  tree["cameras"][other]["model_type"] = "Perspective";
  write_file(folder / "map.msg", msgpack_bytes(tree));
  const SlamMap map = read_map(folder / "map.msg");
  CHECK(map.cameras.size() == 1);
  CHECK(map.find_keyframe(9) == nullptr);
  REQUIRE(map.notes.size() == 1);
  CHECK_THAT(map.notes[0], Contains("not equirectangular"));

  tree = good_tree();
  const SlamMap even = (write_file(folder / "even.msg", msgpack_bytes(tree)), read_map(folder / "even.msg"));
  for (auto& camera : tree["cameras"]) camera["rows"] = camera["rows"].get<int>() + 1;
  write_file(folder / "odd.msg", msgpack_bytes(tree));
  const SlamMap odd = read_map(folder / "odd.msg");
  for (std::size_t i = 0; i < even.cameras.size(); ++i) {
    CHECK(odd.cameras[i].width == even.cameras[i].width);
    CHECK(odd.cameras[i].height == even.cameras[i].height);
  }
  const MapKeyframe& keyframe = even.keyframes[0];
  const auto rows = static_cast<float>(even.cameras[static_cast<std::size_t>(keyframe.camera)].height);
  CHECK(odd.keyframes[0].observations[0].pixel.x() == keyframe.observations[0].pixel.x());
  CHECK(odd.keyframes[0].observations[0].pixel.y() ==
        Approx(keyframe.observations[0].pixel.y() * rows / (rows + 1.0F)));
  CHECK_THAT(odd.notes.at(0), Contains("are resized to"));
}

TEST_CASE("cameras that are no full panorama are refused") {
  const auto error = [](const char* key, const json& value) {
    json tree = good_tree();
    tree["cameras"]["theta"][key] = value;
    return error_of_tree(tree);
  };
  CHECK_THAT(error("model_type", 7), Contains("cameras[\"theta\"].model_type: expected a string"));
  CHECK_THAT(error("cols", 0), Contains("cameras[\"theta\"].cols"));
  CHECK_THAT(error("cols", -1920), Contains("cameras[\"theta\"].cols"));
  CHECK_THAT(error("cols", 1910), Contains("cols = 2 x rows"));
  CHECK_THAT(error("cols", 1920.5), Contains("cameras[\"theta\"].cols: expected a whole number"));
  CHECK_THAT(error("cols", 4294967296), Contains("cameras[\"theta\"].cols"));
  CHECK_THAT(error("rows", 0), Contains("cameras[\"theta\"].rows"));
  CHECK_THAT(error("rows", 970), Contains("cols = 2 x rows, within one row"));
  CHECK_THAT(error("fps", kNan), Contains("cameras[\"theta\"].fps"));
  CHECK_THAT(error("fps", -1.0), Contains("cameras[\"theta\"].fps"));
  json tree = good_tree();
  for (auto& camera : tree["cameras"]) camera["model_type"] = "Perspective";
  CHECK_THAT(error_of_tree(tree), Contains(".model_type") && Contains("Perspective") && Contains("Equirectangular"));
  tree = good_tree();
  tree["cameras"]["theta"].erase("rows");
  CHECK_THAT(error_of_tree(tree), Contains("cameras[\"theta\"].rows"));
}

TEST_CASE("ids that are no ids, or that come twice, are refused") {
  const std::string bytes = msgpack_bytes(good_tree());
  const auto renamed = [&](const char* section, const std::string& from, const std::string& to) {
    json tree = good_tree();
    tree[section][to] = tree[section][from];
    tree[section].erase(from);
    return tree;
  };
  for (const char* id : {"", "x", "-1", "1.0", " 1", "0x1", "1234567890123456789", "\n\x01"}) {
    CHECK_THAT(error_of_tree(renamed("keyframes", "9", id)), Contains("keyframes") && Contains("no id"));
    CHECK_THAT(error_of_tree(renamed("landmarks", "5", id)), Contains("landmarks") && Contains("no id"));
  }
  // JSON libraries merge equal keys, so the bytes are changed.
  const auto with = [&](const char* section, const std::string& id) {
    json tree = good_tree();
    tree[section][id] = tree[section].begin().value();
    return msgpack_bytes(tree);
  };
  CHECK_THAT(error_of_bytes(replaced(with("keyframes", "7777"),
                                     "\xA4"
                                     "7777",
                                     "\xA4"
                                     "0009")),
             Contains("keyframes[\"9\"]: this id appears more than once"));
  CHECK_THAT(error_of_bytes(replaced(with("keyframes", "7"),
                                     "\xA1"
                                     "7",
                                     "\xA1"
                                     "9")),
             Contains("more than once"));
  CHECK_THAT(error_of_bytes(replaced(with("landmarks", "777"),
                                     "\xA3"
                                     "777",
                                     "\xA3"
                                     "100")),
             Contains("landmarks[\"100\"]: this id appears more than once"));
  CHECK_THAT(error_of_bytes(replaced(with("landmarks", "77"),
                                     "\xA2"
                                     "77",
                                     "\xA2"
                                     "05")),
             Contains("more than once"));
  json tree = good_tree();
  tree["keyframes"]["9"]["rot_cX"] = {0, 0, 0, 1};
  CHECK_THAT(error_of_bytes(replaced(msgpack_bytes(tree), "rot_cX", "rot_cw")), Contains("rot_cw: appears twice"));
  tree = good_tree();
  tree["cameras"]["thetb"] = tree["cameras"]["theta"];
  CHECK_THAT(error_of_bytes(replaced(msgpack_bytes(tree), "thetb", "theta")), Contains("two cameras"));
}

TEST_CASE("a file that ends too early is refused, wherever it ends") {
  const TempDir folder;
  const auto path = folder / "map.msg";
  const auto version = GENERATE(MsgpackVersion::stella_0_3_6, MsgpackVersion::openvslam);
  const std::string bytes = msgpack_bytes(msgpack_tree(sample_map(), version));
  std::size_t wrong = 0;
  for (std::size_t size = 1; size < bytes.size(); ++size) {
    write_file(path, bytes.substr(0, size));
    const std::string error = error_of(path);
    const bool right =
        error.find("InvalidInput: " + path.string() + ": byte ") == 0 && error.find("truncated") != std::string::npos;
    wrong += right ? 0 : 1;
  }
  CHECK(wrong == 0);
  write_file(path, bytes + '\0');
  CHECK_THAT(error_of(path), Contains("more data after the end"));
  write_file(path, bytes);
  CHECK(error_of(path).empty());
}

TEST_CASE("hostile files neither crash nor fill the memory") {
  const std::string huge("\xFF\xFF\xFF\xFF", 4);
  const std::string keyframe = std::string("\x81\xA9keyframes\x81\xA1") + "1\x81";
  SECTION("counts that the file does not hold") {
    CHECK_THAT(error_of_bytes("\xDF" + huge), Contains("truncated"));
    CHECK_THAT(error_of_bytes("\x81\xA9keyframes\xDF" + huge), Contains("truncated"));
    CHECK_THAT(error_of_bytes("\x81\xA9keyframes\xDB" + huge), Contains("truncated"));
    CHECK_THAT(error_of_bytes("\x81\xA9keyframes\xC6" + huge), Contains("truncated"));
    CHECK_THAT(error_of_bytes("\x81\xDB" + huge), Contains("truncated"));
    CHECK_THAT(error_of_bytes(keyframe + "\xA6lm_ids\xDD" + huge), Contains("claims 4294967295 elements"));
    CHECK_THAT(error_of_bytes(keyframe + "\xADundist_keypts\xDD" + huge), Contains("claims 4294967295 elements"));
    CHECK_THAT(error_of_bytes(keyframe +
                              "\xA5"
                              "descs\xDD" +
                              huge),
               Contains("truncated"));
    CHECK_THAT(error_of_bytes(keyframe + "\xA6rot_cw\xDD" + huge), Contains("expected an array of 4 numbers"));
  }
  SECTION("a string of megabytes") {
    const std::string text("\x00\x40\x00\x00", 4);
    const std::string body(1U << 22U, 'x');
    CHECK_THAT(error_of_bytes("\x81\xDB" + text + body), Contains("more than a mebibyte"));
    CHECK_THAT(error_of_bytes("\x81\xA1x\xDB" + text + body), Contains("more than a mebibyte"));
    CHECK_THAT(error_of_bytes("\x81\xA1x\xC6" + text + body), Contains("more than a mebibyte"));
  }
  SECTION("arrays and maps in one another") {
    std::string maps;
    for (int i = 0; i < 100000; ++i) maps += "\x81\xA1x";
    CHECK_THAT(error_of_bytes(maps), Contains("truncated"));
    CHECK_THAT(error_of_bytes("\x81\xA1x" + std::string(1000000, '\x91')), Contains("truncated"));
    CHECK_THAT(error_of_bytes(keyframe +
                              "\xA5"
                              "descs" +
                              std::string(1000000, '\x91')),
               Contains("truncated"));
    CHECK_THAT(error_of_bytes(keyframe + "\xADundist_keypts\x91\x81\xA3" + "ang" + std::string(1000000, '\x91')),
               Contains("truncated"));
    CHECK_THAT(error_of_bytes(keyframe + "\xA6lm_ids" + std::string(1000000, '\x91')), Contains("whole number"));
  }
  SECTION("bytes that MessagePack does not know, keys that are no strings") {
    CHECK_THAT(error_of_bytes("\x81\xA1x\xC1"), Contains("byte 4: broken MessagePack data"));
    CHECK_THAT(error_of_bytes("\x81\x01\x01"), Contains("byte 2: broken MessagePack data"));
    CHECK_THAT(error_of_bytes("\x81\xAAkeyframes\x01\x80"), !Contains("\x01"));
  }
}

TEST_CASE("random damage gives an error or a sound map") {
  const TempDir folder;
  const auto path = folder / "map";
  const bool sqlite = GENERATE(false, true);
  if (sqlite) {
    write_sqlite(path, sample_map(), SqliteVersion::stella_0_6_0);
  } else {
    write_file(path, msgpack_bytes(good_tree()));
  }
  const std::string bytes = read_file(path);
  std::mt19937 random(sqlite ? 5 : 4);
  int read = 0;
  int refused = 0;
  for (int i = 0; i < 2000; ++i) {
    std::string damaged = bytes;
    const std::size_t flips = 1 + random() % 3;
    for (std::size_t k = 0; k < flips; ++k) damaged[random() % damaged.size()] = static_cast<char>(random() % 256);
    write_file(path, damaged);
    try {
      const SlamMap map = read_map(path);
      ++read;
      for (const MapKeyframe& keyframe : map.keyframes) {
        const Eigen::Matrix3d& r = keyframe.cam_from_world.rotation;
        REQUIRE((r.transpose() * r - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-12);
        REQUIRE(keyframe.camera >= 0);
        REQUIRE(static_cast<std::size_t>(keyframe.camera) < map.cameras.size());
        REQUIRE(keyframe.cam_from_world.translation.allFinite());
        for (const MapObservation& o : keyframe.observations) REQUIRE(map.find_landmark(o.landmark_id) != nullptr);
      }
      for (const MapLandmark& landmark : map.landmarks) REQUIRE(landmark.position_world.allFinite());
    } catch (const Error& error) {
      ++refused;
      REQUIRE_THAT(error.what(), StartsWith(path.string()));
    }
  }
  CHECK(read > 0);
  CHECK(refused > 0);
}

}  // namespace pmsp::test
