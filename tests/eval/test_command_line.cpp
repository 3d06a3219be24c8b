// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <sys/wait.h>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "eval/eval_flight.h"
#include "pmsp-eval/trajectory.h"
#include "pmsp/camera.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/depth.h"
#include "support/temp_dir.h"

using namespace pmsp::eval;
using nlohmann::json;
using pmsp_test::Flight;
using pmsp_test::read_text;
using pmsp_test::TempDir;
using pmsp_test::write_text;

namespace {

constexpr std::int64_t kFirstId = 40;

/// A flight through a sphere as files: truth, map, trajectory, cloud and depth maps.
class Mission {
 public:
  Mission() : flight(pmsp_test::sphere(4.0), 5, 0.5) {
    flight.write_truth(folder / "gt", 60);
    write_tum(folder / "k.txt", flight.keyframes());
    write_map();
    write_cloud();
    std::filesystem::create_directory(folder / "depth");
    for (std::size_t i = 0; i < 5; ++i) {
      pmsp::Image<float> depth = flight.range(i, 30);
      for (float& d : depth.pixels()) d *= static_cast<float>(1.015 / flight.truth_from_map().scale);
      pmsp::write_pfm(folder.path() / "depth" / ("depth_00004" + std::to_string(i) + ".pfm"), depth);
    }
  }

  /// Runs pmsp-eval and returns its exit code; its output is in `out` and `err`.
  int run(const std::string& arguments) {
    const std::string command =
        "cd '" + folder.path().string() + "' && '" + PMSP_EVAL_TOOL + "' " + arguments + " > stdout.txt 2> stderr.txt";
    const int status = std::system(command.c_str());
    out = read_text(folder / "stdout.txt");
    err = read_text(folder / "stderr.txt");
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  TempDir folder;
  Flight flight;
  std::string out;
  std::string err;

 private:
  void write_map() const {
    json keyframes = json::object();
    for (const TimedPose& pose : flight.keyframes()) {
      // As the SLAM stores it: the camera that has its pixel centres at whole numbers.
      const pmsp::RigidTransform cw = pmsp::cam_from_slam_cam(60).inverse() * pose.world_from_cam.inverse();
      const Eigen::Quaterniond q(cw.rotation);
      keyframes[std::to_string(pose.id + kFirstId)] = {
          {"ts", pose.timestamp + 1763660000.25},
          {"cam", "c"},
          {"rot_cw", {q.x(), q.y(), q.z(), q.w()}},
          {"trans_cw", {cw.translation.x(), cw.translation.y(), cw.translation.z()}},
          {"lm_ids", {0}},
          {"n_keypts", 1},
          {"undist_keypts", {{{"ang", 0.0}, {"oct", 0}, {"pt", {3.0, 4.0}}}}},
          {"orb_params", "o"},
          {"span_parent", -1},
          {"span_children", json::array()},
          {"loop_edges", json::array()},
          {"x_rights", json::array()},
          {"depths", json::array()},
          {"descs", {{1, 2, 3, 4, 5, 6, 7, 8}}}};
    }
    const json map = {{"cameras",
                       {{"c",
                         {{"model_type", "Equirectangular"},
                          {"setup_type", "Monocular"},
                          {"color_order", "BGR"},
                          {"cols", 60},
                          {"rows", 30},
                          {"fps", 10.0},
                          {"focal_x_baseline", 0.0}}}}},
                      {"orb_params", {{"o", {{"name", "o"}}}}},
                      {"keyframes", keyframes},
                      {"landmarks",
                       {{"0",
                         {{"1st_keyfrm", kFirstId},
                          {"n_fnd", 1},
                          {"n_vis", 1},
                          {"pos_w", {1.0, 2.0, 3.0}},
                          {"ref_keyfrm", kFirstId}}}}},
                      {"keyframe_next_id", 50},
                      {"landmark_next_id", 1}};
    const auto bytes = json::to_msgpack(map);
    write_text(folder / "map.msg", std::string(bytes.begin(), bytes.end()));
  }

  void write_cloud() const {
    const auto points = flight.points(60);
    std::ofstream file(folder / "cloud.ply");
    file << "ply\nformat ascii 1.0\nelement vertex " << points.size()
         << "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    for (const auto& p : points) file << p.x() << ' ' << p.y() << ' ' << p.z() << '\n';
  }
};

}  // namespace

TEST_CASE("help begins with examples") {
  Mission m;
  for (const char* command : {"--help", "cloud --help", "depth --help", "align --help"}) {
    CHECK(m.run(command) == 0);
    CHECK(m.out.rfind("Examples:\n  pmsp-eval ", 0) == 0);
  }
}

TEST_CASE("wrong usage is exit code 2") {
  Mission m;
  for (const char* command :
       {"", "fly", "cloud", "cloud cloud.ply --gt gt", "cloud cloud.ply --gt gt --map map.msg --trajectory k.txt",
        "cloud cloud.ply --gt gt --map map.msg --correct 0", "depth depth --gt gt --map map.msg --bogus",
        "align --map map.msg"}) {
    INFO(command);
    CHECK(m.run(command) == 2);
    CHECK_FALSE(m.err.empty());
  }
}

TEST_CASE("a cloud is measured from a trajectory") {
  Mission m;
  REQUIRE(m.run("cloud --relative 0.5,2 cloud.ply --gt gt --trajectory k.txt --view-height 60 --json f.json --render "
                "pictures "
                "--render-keyframes 2") == 0);
  CHECK(m.out.find("correct of hit") != std::string::npos);
  const json figures = json::parse(read_text(m.folder / "f.json"));
  CHECK(figures["alignment"]["scale"].get<double>() == Approx(1.7).epsilon(1e-6));
  CHECK(figures["views"]["hit"].get<double>() == Approx(1.0));
  CHECK(figures["views"]["correct"].get<double>() == Approx(1.0));
  CHECK(figures["views"]["per_keyframe"].size() == 5);
  CHECK(figures["surface"]["relative"][1]["threshold"].get<double>() == Approx(0.02));
  CHECK(figures["surface"]["relative"][1]["accuracy"].get<double>() == Approx(1.0));
  CHECK(figures["surface"]["absolute_m"].size() == 4);
  const cv::Mat picture = cv::imread((m.folder.path() / "pictures" / "view_000004.png").string());
  REQUIRE(picture.cols == 120);
  const auto pixel = picture.at<cv::Vec3b>(30, 60);
  CHECK(pixel[1] > 2 * pixel[2]);  // green: hit and right
  CHECK(std::distance(std::filesystem::directory_iterator(m.folder / "pictures"),
                      std::filesystem::directory_iterator()) == 2);
}

TEST_CASE("a map with Unix times needs an offset and the error suggests it") {
  Mission m;
  const std::string command = "depth depth --gt gt --map map.msg --json -";
  CHECK(m.run(command) == 3);
  CHECK(m.err.find("--time-offset=-1763660000.250") != std::string::npos);
  REQUIRE(m.run(command + " --time-offset -1763660000.25") == 0);
  CHECK(m.err.find("median") != std::string::npos);  // the table makes way for the JSON
  const json figures = json::parse(m.out);
  const json& depth = figures["depth"];
  CHECK(depth["keyframes"] == 5);
  CHECK(depth["per_keyframe"][2]["id"] == kFirstId + 2);
  CHECK(depth["mean"]["valid"].get<double>() == 1.0);
  CHECK(depth["mean"]["within"][0]["share"].get<double>() == 0.0);
  CHECK(depth["mean"]["within"][1]["share"].get<double>() == 1.0);
  CHECK(depth["mean"]["error_median_relative"].get<double>() == Approx(0.015).margin(0.002));
}

TEST_CASE("one depth map of a named keyframe") {
  Mission m;
  std::filesystem::copy_file(m.folder.path() / "depth" / "depth_000043.pfm", m.folder / "x.pfm");
  const std::string map = " --gt gt --map map.msg --time-offset=-1763660000.25";
  CHECK(m.run("depth x.pfm --keyframe 43 --json f.json --render pictures" + map) == 0);
  CHECK(json::parse(read_text(m.folder / "f.json"))["depth"]["keyframes"] == 1);
  CHECK(std::filesystem::exists(m.folder.path() / "pictures" / "depth_error_000043.png"));
  CHECK(m.run("depth x.pfm --keyframe 99" + map) == 3);
  CHECK(m.err.find("no keyframe 99") != std::string::npos);
  CHECK(m.run("depth x.pfm" + map) == 3);
  CHECK(m.err.find("--keyframe") != std::string::npos);
}

TEST_CASE("confidence beside the depth maps gives a calibration and its plot") {
  Mission m;
  const std::string command = "depth depth --gt gt --map map.msg --time-offset=-1763660000.25 --json f.json";
  REQUIRE(m.run(command) == 0);
  CHECK(json::parse(read_text(m.folder / "f.json"))["calibration"].is_null());
  CHECK(m.out.find("calibration") == std::string::npos);
  CHECK(m.run(command + " --calibration plot.png") == 3);
  CHECK_THAT(m.err, Catch::Contains("confidence_<keyframe id>.pfm"));

  for (int i = 0; i < 2; ++i) {  // of 5; the left half of each is the worse one
    const std::string number = "00004" + std::to_string(i) + ".pfm";
    pmsp::Image<float> depth = pmsp::read_pfm(m.folder.path() / "depth" / ("depth_" + number));
    pmsp::Image<float> confidence(60, 30);
    for (int y = 0; y < 30; ++y) {
      for (int x = 0; x < 60; ++x) {
        confidence(x, y) = static_cast<float>(x + 60 * y * (x >= 30 ? 1 : 0) + 1) / 2000.0F;
        if (x < 30) depth(x, y) *= 1.02F;
      }
    }
    pmsp::write_pfm(m.folder.path() / "depth" / ("depth_" + number), depth);
    pmsp::write_pfm(m.folder.path() / "depth" / ("confidence_" + number), confidence);
  }
  REQUIRE(m.run(command + " --calibration plot.png") == 0);
  CHECK_THAT(m.out, Catch::Contains("deciles of confidence") && Catch::Contains("confident half") &&
                        Catch::Contains("monotone"));
  const json calibration = json::parse(read_text(m.folder / "f.json"))["calibration"];
  CHECK(calibration["pixels"] == 2 * 60 * 30);
  for (const char* weighting : {"plain", "solid_angle"}) {
    const json& deciles = calibration[weighting]["deciles"];
    REQUIRE(deciles.size() == 10);
    CHECK(deciles[0]["error_median_relative"].get<double>() == Approx(0.0353).margin(0.003));
    CHECK(deciles[9]["error_median_relative"].get<double>() == Approx(0.015).margin(0.003));
    CHECK(deciles[0]["within"] == 0.0);
    CHECK(deciles[9]["within"] == 1.0);
    CHECK(calibration[weighting]["confident_half"]["error_median_relative"].get<double>() ==
          Approx(0.015).margin(0.003));
  }
  CHECK(cv::imread((m.folder / "plot.png").string()).cols == 800);
  CHECK(m.run(command + " --calibration no/such/folder/plot.png") == 6);
  pmsp::write_pfm(m.folder.path() / "depth" / "confidence_000042.pfm", pmsp::Image<float>(8, 4));
  CHECK(m.run(command) == 3);
  CHECK_THAT(m.err, Catch::Contains("confidence_000042.pfm") && Catch::Contains("8 x 4"));
}

TEST_CASE("published figures of depth maps are in the table and in the JSON") {
  Mission m;
  const std::string command = "depth depth --gt gt --map map.msg --time-offset=-1763660000.25 --json f.json";
  REQUIRE(m.run(command) == 0);
  CHECK_THAT(m.out, Catch::Contains("AbsRel") && Catch::Contains("one scale, of the alignment") &&
                        !Catch::Contains("normals   mean"));
  json depth = json::parse(read_text(m.folder / "f.json"))["depth"];
  for (const json* of : {&depth["mean"], &depth["per_keyframe"][3]}) {
    for (const char* weighting : {"plain", "solid_angle"}) {  // all depths are 1.5 % too large
      CHECK((*of)[weighting]["abs_rel"].get<double>() == Approx(0.015).margin(3e-4));
      CHECK((*of)[weighting]["log10"].get<double>() == Approx(std::log10(1.015)).margin(2e-4));
      CHECK((*of)[weighting]["delta_1"] == 1.0);
      CHECK((*of)[weighting]["normal_mean_deg"].is_null());
    }
  }

  // Normals: of the truth in its world, of the depth maps in the frames of the cameras.
  std::filesystem::create_directory(m.folder / "gt/normal");
  for (std::size_t i = 0; i < 5; ++i) {
    const pmsp::RigidTransform& pose = m.flight.truth()[i].world_from_cam;
    const pmsp::Image<float> range = m.flight.range(i, 30);
    pmsp::Image<Eigen::Vector3f> world(60, 30, Eigen::Vector3f::Zero()), camera = world;
    for (int y = 0; y < 30; ++y) {
      for (int x = 0; x < 60; ++x) {
        const Eigen::Vector3d ray = pose.rotation * pmsp::bearing_from_pixel({x + 0.5, y + 0.5}, 60, 30);
        const Eigen::Vector3d normal = -(pose.translation + static_cast<double>(range(x, y)) * ray) / 4.0;
        world(x, y) = normal.cast<float>();
        camera(x, y) = (pose.rotation.transpose() * normal).cast<float>();
      }
    }
    pmsp::write_pfm(m.folder / ("gt/normal/" + std::to_string(i) + "_normal.pfm"), world);
    pmsp::write_pfm(m.folder / ("depth/normal_00004" + std::to_string(i) + ".pfm"), camera);
  }
  REQUIRE(m.run(command + " --own-scales") == 0);
  CHECK_THAT(m.out, Catch::Contains("normals   mean") && Catch::Contains("own scale of each depth map"));
  depth = json::parse(read_text(m.folder / "f.json"))["depth"]["mean"];
  CHECK(depth["plain"]["normal_mean_deg"].get<double>() < 0.01);
  CHECK(depth["solid_angle"]["normal_11_25"] == 1.0);
  CHECK(depth["plain"]["abs_rel"].get<double>() < 1e-3);

  const pmsp::Image<float> range = m.flight.range(0, 30);
  pmsp::Image<float> estimate = pmsp::read_pfm(m.folder / "depth/depth_000040.pfm");
  for (std::size_t i = 0; i < range.size(); ++i) estimate.pixels()[i] *= range.pixels()[i] > 4.1F ? 2.0F : 1.0F;
  pmsp::write_pfm(m.folder / "depth/depth_000040.pfm", estimate);
  REQUIRE(m.run(command) == 0);
  CHECK(json::parse(read_text(m.folder / "f.json"))["depth"]["mean"]["plain"]["delta_3"].get<double>() < 0.99);
  REQUIRE(m.run(command + " --gt-max-range 4.05") == 0);
  CHECK(json::parse(read_text(m.folder / "f.json"))["depth"]["mean"]["plain"]["delta_1"] == 1.0);
  CHECK(m.run(command + " --own-scales --gt-max-range 1") == 0);
  depth = json::parse(read_text(m.folder / "f.json"))["depth"]["mean"];
  CHECK(depth["plain"]["rmse"].is_null());
  CHECK(depth["plain"]["normal_mean_deg"].is_null());
  CHECK(depth["valid"].is_null());
  write_text(m.folder / "gt/normal/0_normal.pfm", "PF\n4 4\n-1\n" + std::string(192, '\0'));
  CHECK(m.run(command) == 3);
  CHECK_THAT(m.err, Catch::Contains("0_normal.pfm") && Catch::Contains("4 x 4"));
}

TEST_CASE("the poses of a map may be the truth, with range maps by keyframe id") {
  Mission m;
  const double scale = m.flight.truth_from_map().scale;
  std::filesystem::create_directories(m.folder / "own/range");
  for (std::size_t i = 0; i < 5; ++i) {
    pmsp::Image<float> range = m.flight.range(i, 30);
    for (float& value : range.pixels()) value /= static_cast<float>(scale);  // the map's unit
    pmsp::write_exr(m.folder / ("own/range/0004" + std::to_string(i) + "_depth.exr"), {{"V", range}});
  }
  const std::string command = "depth depth --gt own --map map.msg --json f.json";
  CHECK(m.run(command) == 3);  // no traj_tum.txt
  CHECK_THAT(m.err, Catch::Contains("traj_tum.txt"));
  CHECK(m.run(command + " --map-is-truth --no-align") == 2);
  REQUIRE(m.run(command + " --map-is-truth") == 0);
  CHECK_THAT(m.out, Catch::Contains("poses of the map are the truth, 5 keyframes") && Catch::Contains("no scaling"));
  const json depth = json::parse(read_text(m.folder / "f.json"))["depth"];
  CHECK(depth["keyframes"] == 5);
  CHECK(depth["mean"]["plain"]["abs_rel"].get<double>() == Approx(0.015).margin(1e-5));
  REQUIRE(m.run("cloud cloud.ply --gt own --map map.msg --map-is-truth --view-height 30 --json f.json") == 0);
  CHECK(json::parse(read_text(m.folder / "f.json"))["views"]["correct"].get<double>() > 0.99);

  std::filesystem::copy(m.folder / "own/range/00040_depth.exr", m.folder / "own/range/40.exr");
  CHECK(m.run(command + " --map-is-truth") == 3);
  CHECK_THAT(m.err, Catch::Contains("frame 40 has a second file"));
  std::filesystem::rename(m.folder / "own/range/40.exr", m.folder / "own/range/50.exr");
  CHECK(m.run(command + " --map-is-truth") == 3);
  CHECK_THAT(m.err, Catch::Contains("no keyframe 50"));

  // A PNG of eighths of a metre.
  std::filesystem::remove_all(m.folder / "own/range");
  std::filesystem::create_directory(m.folder / "own/range");
  pmsp::write_png16(m.folder / "own/range/000042.png", pmsp::Image<float>(60, 30, 2.5F), 8.0);
  CHECK(m.run(command + " --map-is-truth") == 3);
  CHECK_THAT(m.err, Catch::Contains("--gt-png-scale"));
  REQUIRE(m.run("depth depth/depth_000042.pfm --gt own --map map.msg --map-is-truth --gt-png-scale 0.125 --json -") ==
          0);
  const double estimate = 1.015 * 4.0 / scale;  // about; from the middle of the sphere
  CHECK(json::parse(m.out)["depth"]["mean"]["plain"]["abs_rel"].get<double>() ==
        Approx(std::abs(estimate - 2.5) / 2.5).margin(0.02));
}

TEST_CASE("the transform in a cloud's header is inverted or refused") {
  Mission m;
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, 3.0).normalized()).toRotationMatrix();
  const pmsp::Similarity file_from_map{2.5, turn, {10.0, -20.0, 30.0}};
  json rows = json::array();
  for (int r = 0; r < 3; ++r) {
    const Eigen::RowVector3d row = 2.5 * turn.row(r);
    rows.push_back({row[0], row[1], row[2], file_from_map.translation[r]});
  }
  rows.push_back({0.0, 0.0, 0.0, 1.0});
  pmsp::CloudHeader header;
  header.center = file_from_map.translation;
  header.reach = 100.0;
  header.double_positions = true;
  header.comments = {"generated by pmsp-densify 0.1.0",
                     "cloud " + json{{"file_from_map", rows}, {"scale", 2.5}, {"unit", "m"}}.dump()};
  std::vector<pmsp::OutputPoint> points;
  for (const Eigen::Vector3d& position : m.flight.points(60)) {
    points.emplace_back();
    points.back().position = file_from_map * position;
  }
  const auto write = [&](const char* name) {
    pmsp::CloudOutput cloud(m.folder / name, header);
    cloud.add(points.data(), points.size(), {});
    cloud.commit();
  };
  write("moved.ply");
  write("moved.las");
  const std::string at_map = " --gt gt --map map.msg --time-offset=-1763660000.25 --view-height 60 --json f.json";
  REQUIRE(m.run("cloud cloud.ply" + at_map) == 0);
  const json plain = json::parse(read_text(m.folder / "f.json"));
  for (const std::string name : {"moved.ply", "moved.las"}) {
    REQUIRE(m.run("cloud " + name + at_map) == 0);
    CHECK(m.out.find("is undone (scale 2.5)") != std::string::npos);
    const json moved = json::parse(read_text(m.folder / "f.json"));
    CHECK(moved["transform_undone"] == true);
    CHECK(moved["surface"]["error_median_m"].get<double>() ==
          Approx(plain["surface"]["error_median_m"].get<double>()).margin(1e-3));
  }
  CHECK(m.run("cloud moved.ply --gt gt --trajectory k.txt") == 3);
  CHECK(m.err.find("--as-is") != std::string::npos);
  CHECK(m.run("cloud moved.ply --gt gt --trajectory k.txt --view-height 60 --as-is --json f.json") == 0);
  CHECK(json::parse(read_text(m.folder / "f.json"))["transform_undone"] == false);
  header.comments.pop_back();
  write("stripped.ply");
  CHECK(m.run("cloud stripped.ply" + at_map) == 3);
  CHECK(m.err.find("the header contains no frame") != std::string::npos);
}

TEST_CASE("figures by label are in the table and in the JSON") {
  Mission m;
  std::filesystem::create_directory(m.folder / "gt" / "label");
  for (int i = 0; i < 5; ++i) {
    pmsp::Image<float> label(120, 60);
    for (int y = 20; y < 40; ++y) label(60, y) = label(61, y) = 1.0F;
    pmsp::write_png16(m.folder.path() / "gt" / "label" / ("00000" + std::to_string(i) + ".png"), label, 1.0);
  }
  const std::string rest = " --gt gt --map map.msg --time-offset=-1763660000.25 --json f.json";
  REQUIRE(m.run("depth depth --correct 1" + rest) == 0);
  CHECK_THAT(m.out, Catch::Contains("thin grown") && Catch::Contains("behind"));
  json labels = json::parse(read_text(m.folder / "f.json"))["depth"]["labels"];
  CHECK(labels["thin"]["wrong"].get<double>() == 1.0);  // the depth maps are 1.5 % off
  CHECK(labels["thin"]["missing"].get<double>() == 0.0);
  CHECK(labels["all"]["behind_of_estimates"].get<double>() == 0.0);
  REQUIRE(m.run("depth depth" + rest) == 0);
  labels = json::parse(read_text(m.folder / "f.json"))["depth"]["labels"];
  CHECK(labels["thin"]["wrong"].get<double>() == 0.0);
  CHECK(labels["thin"]["grown"].get<double>() == 0.0);

  REQUIRE(m.run("cloud cloud.ply" + rest) == 0);
  const json figures = json::parse(read_text(m.folder / "f.json"));
  CHECK(figures["behind"]["all"].get<double>() == 0.0);
  CHECK(figures["views"]["labels"]["thin"]["wrong"].get<double>() == 0.0);
  CHECK(figures["views"]["labels"]["other"]["share"].get<double>() > 0.9);
}

TEST_CASE("a cloud as LAS has the figures of the same cloud as PLY") {
  Mission m;
  pmsp::CloudHeader header;
  header.reach = 10.0;
  pmsp::CloudOutput las(m.folder / "cloud.las", header);
  std::vector<pmsp::OutputPoint> points;
  for (const Eigen::Vector3d& position : m.flight.points(60)) {
    points.emplace_back();
    points.back().position = position;
  }
  las.add(points.data(), points.size(), {});
  las.commit();
  const auto figures = [&](const std::string& name) {
    REQUIRE(m.run("cloud " + name + " --gt gt --trajectory k.txt --view-height 60 --json f.json") == 0);
    return json::parse(read_text(m.folder / "f.json"));
  };
  const json ply = figures("cloud.ply"), same = figures("cloud.las");
  CHECK(same["surface"]["points"] == ply["surface"]["points"]);
  CHECK(same["surface"]["error_median_m"].get<double>() ==
        Approx(ply["surface"]["error_median_m"].get<double>()).margin(1e-4));
}

TEST_CASE("align writes the map's keyframes") {
  Mission m;
  REQUIRE(m.run("align --map map.msg --write-trajectory plain.txt") == 0);
  const auto plain = read_tum(m.folder / "plain.txt");
  const auto expected = m.flight.keyframes();
  REQUIRE(plain.size() == expected.size());
  for (std::size_t i = 0; i < plain.size(); ++i) {
    CHECK((plain[i].world_from_cam.translation - expected[i].world_from_cam.translation).norm() < 1e-9);
    CHECK((plain[i].world_from_cam.rotation - expected[i].world_from_cam.rotation).norm() < 1e-9);
  }
  REQUIRE(m.run("align --map map.msg --gt gt --time-offset=-1763660000.25 --write-trajectory a.txt --aligned") == 0);
  const auto aligned = read_tum(m.folder / "a.txt");
  for (std::size_t i = 0; i < aligned.size(); ++i) {
    CHECK((aligned[i].world_from_cam.translation - m.flight.truth()[i].world_from_cam.translation).norm() < 1e-6);
  }
}

TEST_CASE("input and output failures have their exit codes") {
  Mission m;
  const std::string rest = " --gt gt --trajectory k.txt";
  CHECK(m.run("cloud missing.ply" + rest) == 3);
  CHECK(m.err.find("missing.ply") != std::string::npos);
  CHECK(m.run("cloud cloud.ply --gt nowhere --trajectory k.txt") == 3);
  CHECK(m.err.find("nowhere") != std::string::npos);
  CHECK(m.run("cloud cloud.ply --gt gt --trajectory missing.txt") == 3);
  CHECK(m.run("cloud cloud.ply --gt gt --map missing.msg") == 3);
  CHECK(m.run("align" + rest + " --json no/such/folder/f.json") == 6);
  CHECK(m.run("cloud cloud.ply --render k.txt/pictures" + rest) == 6);
  write_text(
      m.folder / "empty.ply",
      "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n");
  CHECK(m.run("cloud empty.ply" + rest) == 3);
  CHECK(m.err.find("no points") != std::string::npos);
}
