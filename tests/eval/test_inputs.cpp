// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>

#include "eval/eval_flight.h"
#include "pmsp-eval/depth_files.h"
#include "pmsp-eval/ground_truth.h"
#include "pmsp-eval/trajectory.h"
#include "pmsp/error.h"
#include "pmsp/io/depth.h"
#include "support/temp_dir.h"

using namespace pmsp::eval;
using pmsp_test::Flight;
using pmsp_test::TempDir;
using pmsp_test::write_text;

TEST_CASE("a TUM trajectory survives writing and reading") {
  const TempDir folder;
  const Flight flight(pmsp_test::sphere(4.0), 5, 1.0);
  auto poses = flight.keyframes();
  for (auto& pose : poses) pose.timestamp += 1763660000.25;
  write_tum(folder / "k.txt", poses);
  const auto read = read_tum(folder / "k.txt");
  REQUIRE(read.size() == 5);
  for (std::size_t i = 0; i < 5; ++i) {
    CHECK(read[i].id == static_cast<int>(i));
    CHECK(std::abs(read[i].timestamp - poses[i].timestamp) < 1e-6);
    CHECK((read[i].world_from_cam.rotation - poses[i].world_from_cam.rotation).norm() < 1e-12);
    CHECK((read[i].world_from_cam.translation - poses[i].world_from_cam.translation).norm() < 1e-12);
  }
  CHECK(folder.entries() == 1);
}

TEST_CASE("errors in trajectories name their line") {
  const TempDir folder;
  const auto path = folder / "k.txt";
  CHECK_THROWS_AS(read_tum(path), pmsp::IoError);
  write_text(path, "# nothing\n\n");
  CHECK_THROWS_WITH(read_tum(path), Catch::Contains("no pose"));
  write_text(path, "# ts\n0 1 2 3 0 0 0 1\n1 1 2 3 0 0 0\n");
  CHECK_THROWS_WITH(read_tum(path), Catch::Contains("k.txt:3"));
  write_text(path, "0 1 nan 3 0 0 0 1\n");
  CHECK_THROWS_AS(read_tum(path), pmsp::InvalidInput);
  write_text(path, "0 1 2 3 0 0 0 2\n");
  CHECK_THROWS_WITH(read_tum(path), Catch::Contains("quaternion"));
}

TEST_CASE("ground truth is found by frame number and time") {
  const TempDir folder;
  const Flight flight(pmsp_test::sphere(4.0), 5, 1.0);
  flight.write_truth(folder.path(), 16);
  std::filesystem::remove(folder.path() / "range_mm" / "000003.png");
  const GroundTruth truth(folder.path(), {});
  CHECK(truth.range_maps().size() == 4);
  REQUIRE(truth.find(4) != nullptr);
  CHECK(truth.find(4)->frame == 4);
  CHECK(truth.find(3) == nullptr);
  const auto range = GroundTruth::load(*truth.find(4));
  CHECK(range.width() == 32);
  CHECK(range(7, 5) == Approx(flight.range(4, 16)(7, 5)).margin(0.0006));
}

TEST_CASE("ranges may also come as PFM in metres") {
  const TempDir folder;
  const Flight flight(pmsp_test::sphere(4.0), 3, 1.0);
  write_tum(folder / "traj_tum.txt", flight.truth());
  std::filesystem::create_directory(folder / "range");
  pmsp::write_pfm(folder.path() / "range" / "000001.pfm", flight.range(1, 16));
  const GroundTruth truth(folder.path(), {});
  REQUIRE(truth.range_maps().size() == 1);
  CHECK(truth.range_maps()[0].row == 1);
  CHECK(GroundTruth::load(truth.range_maps()[0])(7, 5) == flight.range(1, 16)(7, 5));
}

TEST_CASE("saturated pixels of PNGs are no surface") {
  const TempDir folder;
  const Flight flight(pmsp_test::sphere(4.0), 1, 1.0);
  write_tum(folder / "traj_tum.txt", flight.truth());
  for (const auto& [name, scale] : {std::pair("range_mm", 0.001), {"range", 0.125}}) {
    std::filesystem::create_directory(folder / name);
    pmsp::Image<float> gray(32, 16, 65534.0F);
    gray(3, 5) = 65535.0F;
    pmsp::write_png16(folder / name / "0.png", gray, 1.0);
    const auto range = GroundTruth::load(GroundTruth(folder.path(), {10.0, 0.125}).range_maps().at(0));
    CHECK(range(2, 5) == Approx(65534.0 * scale));
    CHECK(range(3, 5) == 0.0F);
    std::filesystem::remove_all(folder / name);
  }
}

TEST_CASE("broken ground truth is refused") {
  const TempDir folder;
  const Flight flight(pmsp_test::sphere(4.0), 5, 1.0);
  CHECK_THROWS_AS(GroundTruth(folder / "missing", {}), pmsp::IoError);
  CHECK_THROWS_AS(GroundTruth(folder.path(), {}), pmsp::IoError);
  write_tum(folder / "traj_tum.txt", flight.truth());
  CHECK_THROWS_WITH(GroundTruth(folder.path(), {}), Catch::Contains("range_mm"));
  flight.write_truth(folder.path(), 16);
  CHECK_THROWS_WITH(GroundTruth(folder.path(), TruthOptions{3.0}), Catch::Contains("--gt-fps"));
  write_text(folder.path() / "range_mm" / "000002.png", "no picture");
  const GroundTruth truth(folder.path(), {});
  CHECK_THROWS_AS(GroundTruth::load(truth.range_maps()[2]), pmsp::Error);
  auto backwards = flight.truth();
  std::swap(backwards[1], backwards[2]);
  write_tum(folder / "traj_tum.txt", backwards);
  CHECK_THROWS_WITH(GroundTruth(folder.path(), {}), Catch::Contains("earlier"));
}

TEST_CASE("numbers in file names") {
  CHECK(number_in_name("a/depth_000042.pfm", "depth_", ".pfm") == 42);
  CHECK(number_in_name("depth_1234567.pfm", "depth_", ".pfm") == 1234567);
  for (const char* name : {"depth_.pfm", "depth_12.png", "depth_1x.pfm", "normal_12.pfm", "depth_-1.pfm", "12.pfm",
                           "depth_99999999999999999999.pfm"}) {
    CHECK_FALSE(number_in_name(name, "depth_", ".pfm").has_value());
  }
}

TEST_CASE("depth maps are listed by keyframe id") {
  const TempDir folder;
  const pmsp::Image<float> depth(8, 4, 1.0F);
  for (const char* name : {"depth_000010.pfm", "depth_000002.pfm", "confidence_000002.pfm", "odd.pfm"}) {
    pmsp::write_pfm(folder / name, depth);
  }
  pmsp::write_png16(folder / "depth_000005.png", depth, 100.0);

  const auto files = list_depth_files({folder.path()}, 0.0, std::nullopt);
  REQUIRE(files.size() == 2);
  CHECK(files[0].keyframe_id == 2);
  CHECK(files[1].keyframe_id == 10);
  const auto pngs = list_depth_files({folder.path()}, 0.01, std::nullopt);
  REQUIRE(pngs.size() == 1);
  CHECK(load_depth(pngs[0].path, 0.01)(3, 3) == Approx(1.0F));
  CHECK_THROWS_WITH(load_depth(pngs[0].path, 0.0), Catch::Contains("--png-scale"));

  CHECK(list_depth_files({folder / "odd.pfm"}, 0.0, 7)[0].keyframe_id == 7);
  CHECK(list_depth_files({folder.path()}, 0.0, 10).size() == 1);
  CHECK_THROWS_WITH(list_depth_files({folder.path()}, 0.0, 11), Catch::Contains("keyframe 11"));
  CHECK_THROWS_WITH(list_depth_files({folder / "odd.pfm"}, 0.0, std::nullopt), Catch::Contains("--keyframe"));
  CHECK_THROWS_AS(list_depth_files({folder / "missing"}, 0.0, std::nullopt), pmsp::IoError);
  CHECK_THROWS_WITH(list_depth_files({folder / "depth_000002.pfm", folder.path()}, 0.0, std::nullopt),
                    Catch::Contains("second"));
  pmsp::write_pfm(folder / "square.pfm", pmsp::Image<float>(8, 8, 1.0F));
  CHECK_THROWS_WITH(load_depth(folder / "square.pfm", 0.0), Catch::Contains("8 x 8"));
}
