// SPDX-License-Identifier: BSD-2-Clause
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <csignal>
#include <cstring>

#include <catch2/catch.hpp>

#include "export/files.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud.h"
#include "support/temp_dir.h"

using namespace pmsp;
using pmsp_test::read_text;
using pmsp_test::TempDir;
using pmsp_test::write_text;

namespace {

KeyframeCloud sample_cloud(int points) {
  KeyframeCloud cloud;
  cloud.cam_from_world.rotation << 0, 0, 1, 0, 1, 0, -1, 0, 0;
  cloud.cam_from_world.translation << 0.5, -1.25, 500000.125;
  for (int i = 0; i < points; ++i) {
    CloudPoint p;
    p.position = {0.1F * static_cast<float>(i), 1.0F, -2.0F};
    p.normal = {0.0F, 0.6F, -0.8F};
    p.color = {static_cast<std::uint8_t>(i), 20, 255};
    p.views = static_cast<std::uint8_t>(i % 7);
    p.confidence = 0.25F;
    cloud.points.push_back(p);
  }
  return cloud;
}

std::string message_of(const std::filesystem::path& path) {
  try {
    read_ply(path);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

std::string header(const std::string& format, const std::string& rest) {
  return "ply\nformat " + format + " 1.0\n" + rest + "end_header\n";
}

}  // namespace

TEST_CASE("a cloud is written with its own or given pose and scale") {
  const TempDir dir;
  KeyframeCloud cloud = sample_cloud(3);
  cloud.scale = 2.0;
  KeyframePose moved = cloud.pose();
  moved.cam_from_world.translation += Eigen::Vector3d(1.0, 2.0, 3.0);
  moved.scale = 0.5;
  CloudHeader options;
  options.double_positions = true;
  CloudOutput writer(dir / "c.ply", options);
  writer.add(cloud);
  writer.add(cloud, moved);
  writer.commit();
  const PlyCloud read = read_ply(dir / "c.ply");
  REQUIRE(read.positions.size() == 6);
  for (std::size_t i = 0; i < 6; ++i) {
    const KeyframePose& pose = i < 3 ? cloud.pose() : moved;
    const Eigen::Vector3d in_camera = pose.cam_from_world * read.positions[i];
    CHECK((in_camera - pose.scale * cloud.points[i % 3].position.cast<double>()).norm() < 1e-9);
  }
}

TEST_CASE("a cloud survives writing and reading, in world coordinates") {
  const TempDir dir;
  const KeyframeCloud cloud = sample_cloud(300);
  const RigidTransform world_from_cam = cloud.cam_from_world.inverse();
  const bool in_double = GENERATE(false, true);
  CloudHeader options;
  options.double_positions = in_double;
  options.comments = {"made by a test", "two\nlines"};
  CloudOutput writer(dir / "c.ply", options);
  writer.add(cloud);
  writer.add(cloud);
  CHECK(writer.points() == 600);
  writer.commit();

  const PlyCloud read = read_ply(dir / "c.ply");
  REQUIRE(read.positions.size() == 600);
  CHECK(read.comments == std::vector<std::string>{"made by a test", "two lines"});
  for (std::size_t i = 0; i < 600; ++i) {
    const CloudPoint& p = cloud.points[i % 300];
    const Eigen::Vector3d expected = world_from_cam * p.position.cast<double>();
    // 500 km from the origin a float is good to 0.03, a double keeps everything
    CHECK((read.positions[i] - expected).norm() < (in_double ? 1e-9 : 0.04));
    CHECK((read.normals[i] - Eigen::Vector3f(0.8F, 0.6F, 0.0F)).norm() < 1e-6F);
    CHECK(read.colors[i] == p.color);
    CHECK(read.views[i] == p.views);
    CHECK(read.confidence[i] == p.confidence);
  }
}

TEST_CASE("a large cloud is written in blocks without lost or reordered points") {
  const TempDir dir;
  const KeyframeCloud cloud = sample_cloud(250000);
  CloudOutput writer(dir / "c.ply");
  for (int i = 0; i < 3; ++i) writer.add(cloud);
  writer.add(sample_cloud(1));
  writer.commit();
  const PlyCloud read = read_ply(dir / "c.ply");
  REQUIRE(read.positions.size() == 750001);
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < 750000; ++i) {
    const Eigen::Vector3d expected = cloud.cam_from_world.inverse() * cloud.points[i % 250000].position.cast<double>();
    wrong += (read.positions[i] - expected).norm() < 0.04 && read.views[i] == cloud.points[i % 250000].views ? 0 : 1;
  }
  CHECK(wrong == 0);
}

TEST_CASE("a cloud has the same bytes for any number of threads and with a box around all points") {
  const TempDir dir;
  const std::string name = GENERATE("ply", "las");
  const KeyframeCloud cloud = sample_cloud(123457);
  const auto write = [&](const std::string& file, int threads, const std::optional<Box>& crop) {
    CloudHeader header;
    header.reach = 1e4;
    header.threads = threads;
    CloudOutput output(header, {crop, {}}, {{find_cloud_format(name), dir / file}});
    for (const double scale : {1.0, 2.5}) output.add(cloud, {cloud.cam_from_world, scale});
    output.commit();
    CHECK(output.points_in() == 2 * 123457);
    CHECK(output.points() == 2 * 123457);
    return read_text(dir / file);
  };
  const std::string one = write("one", 1, {});
  CHECK(write("five", 5, {}) == one);
  CHECK(write("boxed", 5, Box{Eigen::Vector3d::Constant(-1e9), Eigen::Vector3d::Constant(1e9)}) == one);
}

TEST_CASE("a box keeps its points unchanged and in order for any number of threads") {
  const TempDir dir;
  KeyframeCloud cloud = sample_cloud(123457);
  std::vector<Eigen::Vector3d> places;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    Eigen::Vector3f& position = cloud.points[i].position;
    position.x() = 0.1F * static_cast<float>(i * 7919 % cloud.points.size());
    places.push_back(cloud.cam_from_world.inverse() * position.cast<double>());
  }
  const Eigen::Vector3d margin = Eigen::Vector3d::Ones();
  const Box box{places[30000].cwiseMin(places[90001]) - margin, places[30000].cwiseMax(places[90001]) + margin};
  std::vector<std::size_t> inside;
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (box.contains(places[i])) inside.push_back(i);
  }
  REQUIRE(inside.size() > 1000);
  REQUIRE(inside.size() < 100000);
  std::string one;
  for (const int threads : {1, 5}) {
    CloudHeader header;
    header.threads = threads;
    header.double_positions = true;
    CloudOutput output(header, {box, {}}, {{find_cloud_format("ply"), dir / "c.ply"}});
    output.add(cloud);
    output.commit();
    CHECK(output.points_in() == 123457);
    CHECK(output.points() == static_cast<std::int64_t>(inside.size()));
    if (threads == 1) one = read_text(dir / "c.ply");
    CHECK(read_text(dir / "c.ply") == one);
    const PlyCloud read = read_ply(dir / "c.ply");
    REQUIRE(read.positions.size() == inside.size());
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < inside.size(); ++i) {
      const CloudPoint& p = cloud.points[inside[i]];
      const bool same = read.views[i] == p.views && read.confidence[i] == p.confidence && read.colors[i] == p.color;
      wrong += (read.positions[i] - places[inside[i]]).norm() < 1e-6 && same ? 0 : 1;
    }
    CHECK(wrong == 0);
  }
}

TEST_CASE("the PLY header is plain for the strictest of readers") {
  const TempDir dir;
  CloudOutput writer(dir / "c.ply");
  writer.add(sample_cloud(12));
  writer.commit();
  const std::string text = read_text(dir / "c.ply");
  CHECK(text.find("\nelement vertex 12\nproperty float x\nproperty float y\nproperty float z\n") != std::string::npos);
  CHECK(text.size() == text.find("end_header\n") + std::strlen("end_header\n") + 12 * 32);
  CHECK(dir.entries() == 1);
}

TEST_CASE("positions are doubles if floats are too coarse or if requested") {
  const TempDir dir;
  const auto type_of_x = [&](const CloudHeader& header) {
    find_cloud_format("ply")->open(dir / "c.ply", header)->finish();
    const std::string text = read_text(dir / "c.ply");
    const std::size_t begin = text.find("property ") + 9;
    return text.substr(begin, text.find('\n', begin) - begin);
  };
  CloudHeader header;
  header.reach = 50.0;
  CHECK(type_of_x(header) == "float x");
  header.center = {400000.0, 5000000.0, 80.0};  // as in UTM
  CHECK(type_of_x(header) == "double x");
  header.center = {0.0, 0.0, 0.0};
  header.double_positions = true;
  CHECK(type_of_x(header) == "double x");
}

TEST_CASE("an empty cloud is a valid PLY") {
  const TempDir dir;
  CloudOutput(dir / "c.ply").commit();
  CHECK(read_ply(dir / "c.ply").positions.empty());
}

TEST_CASE("a file holds small and large blocks in the order they were written") {
  const TempDir dir;
  std::string all;
  AtomicFile file(dir / "f");
  for (const std::size_t bytes : {std::size_t{10}, std::size_t{3} << 20, std::size_t{7}, std::size_t{1} << 20,
                                  (std::size_t{1} << 20) - 1, std::size_t{5}}) {
    const std::string piece(bytes, static_cast<char>('a' + all.size() % 26));
    file.write(piece);
    all += piece;
  }
  file.commit();
  CHECK(read_text(dir / "f") == all);
}

TEST_CASE("a writer that is not finished leaves the old file and no trace") {
  const TempDir dir;
  write_text(dir / "c.ply", "old");
  {
    CloudOutput writer(dir / "c.ply");
    writer.add(sample_cloud(100000));
  }
  CHECK(read_text(dir / "c.ply") == "old");
  CHECK(dir.entries() == 1);
}

TEST_CASE("a killed writer leaves the old file") {
  const TempDir dir;
  write_text(dir / "c.ply", "old");
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    CloudOutput writer(dir / "c.ply");
    writer.add(sample_cloud(100000));
    raise(SIGKILL);
    _exit(0);
  }
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  REQUIRE(WIFSIGNALED(status));
  CHECK(read_text(dir / "c.ply") == "old");
}

TEST_CASE("a full disk is an OutputError that names the file and the old file stays") {
  const TempDir dir;
  write_text(dir / "c.ply", "old");
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {  // a limit on file size simulates the full disk
    signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{1 << 16, 1 << 16};
    setrlimit(RLIMIT_FSIZE, &limit);
    int result = 1;
    try {
      CloudOutput writer(dir / "c.ply");
      writer.add(sample_cloud(100000));
      writer.commit();
    } catch (const OutputError& error) {
      result = std::string(error.what()).find("c.ply") != std::string::npos ? 0 : 2;
    }
    _exit(result);
  }
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  CHECK(WIFEXITED(status));
  CHECK(WEXITSTATUS(status) == 0);
  CHECK(read_text(dir / "c.ply") == "old");
  CHECK(dir.entries() == 1);
}

TEST_CASE("stale temporary files with names of this process do not interfere") {
  const TempDir dir;
  constexpr int kLeft = 400;  // more than the files that this program has written so far
  for (int i = 0; i < kLeft; ++i) {
    write_text(dir / (".c.ply." + std::to_string(getpid()) + "-" + std::to_string(i) + ".tmp"), "left");
  }
  CloudOutput writer(dir / "c.ply");
  writer.commit();
  CHECK(read_ply(dir / "c.ply").positions.empty());
  CHECK(dir.entries() == kLeft + 1);
}

TEST_CASE("temporary files contain the name of their target") {
  CHECK(target_of_temporary(".c.ply.123-0.tmp") == "c.ply");
  CHECK(target_of_temporary(".status.json.1-22.tmp") == "status.json");
  CHECK(target_of_temporary(".1-00112233445566aa.77-0.tmp") == "1-00112233445566aa");
  CHECK(target_of_temporary("..hidden.7-1.tmp") == ".hidden");
  for (const char* name :
       {"", ".", ".tmp", "c.ply", "c.ply.123-0.tmp", ".c.ply.tmp", ".c.ply.123.tmp", ".c.ply.-0.tmp", ".c.ply.123-.tmp",
        ".c.ply.12x-0.tmp", ".c.ply.123-0x.tmp", ".c.ply.1-2-3.tmp", ".c.ply.1-2", ".1-2.tmp"}) {
    CAPTURE(name);
    CHECK(target_of_temporary(name).empty());
  }
}

TEST_CASE("unwritable targets are refused before any work") {
  const TempDir dir;
  CHECK_THROWS_AS(CloudOutput(dir / "no/such/c.ply"), OutputError);
  CHECK_THROWS_AS(CloudOutput(dir.path()), OutputError);
  CHECK_THROWS_AS(CloudOutput("/dev/null"), OutputError);
}

TEST_CASE("ascii and both byte orders read alike and other elements and properties are ignored") {
  const TempDir dir;
  const std::string columns =
      "element camera 1\nproperty list uchar int ids\nproperty int n\nelement vertex 2\nproperty double x\n"
      "property float y\nproperty short z\nproperty list uchar float extra\nproperty uchar red\n"
      "property uchar green\nproperty uchar blue\nelement face 1\nproperty list uchar int vertex_indices\n";
  write_text(dir / "a.ply",
             header("ascii", columns) + "2 7 8 9\n1.5 +2.5 -3 1 0.5 1 2 3\r\n-1e3 0 4 0 4 5 6\n3 0 1 0\n");
  for (const bool big : {false, true}) {
    std::string body;
    const auto put = [&](auto value) {
      std::string bytes(sizeof(value), '\0');
      std::memcpy(bytes.data(), &value, sizeof(value));
      body += big ? std::string(bytes.rbegin(), bytes.rend()) : bytes;
    };
    put(std::uint8_t{2}), put(7), put(8), put(9);
    put(1.5), put(2.5F), put(short{-3}), put(std::uint8_t{1}), put(0.5F);
    put(std::uint8_t{1}), put(std::uint8_t{2}), put(std::uint8_t{3});
    put(-1000.0), put(0.0F), put(short{4}), put(std::uint8_t{0});
    put(std::uint8_t{4}), put(std::uint8_t{5}), put(std::uint8_t{6});
    write_text(dir / (big ? "b.ply" : "l.ply"),
               header(big ? "binary_big_endian" : "binary_little_endian", columns) + body);
  }
  for (const char* name : {"a.ply", "l.ply", "b.ply"}) {
    INFO(name);
    const PlyCloud cloud = read_ply(dir / name);
    REQUIRE(cloud.positions.size() == 2);
    CHECK(cloud.positions[0] == Eigen::Vector3d(1.5, 2.5, -3.0));
    CHECK(cloud.positions[1] == Eigen::Vector3d(-1000.0, 0.0, 4.0));
    CHECK(cloud.colors[1] == Rgb{4, 5, 6});
    CHECK(cloud.normals.empty());
    CHECK(cloud.confidence.empty());
  }
}

TEST_CASE("malformed PLY files give an error that names the file and the position") {
  const TempDir dir;
  const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
  struct Case {
    std::string text;
    std::string expected;
  };
  const std::vector<Case> cases{
      {"", "ends before end_header"},
      {"plx\n", "is no PLY"},
      {"ply\nelement vertex 0\n" + xyz + "end_header\n", "no format line"},
      {header("binary_middle_endian", ""), "line 2 names an unknown format"},
      {header("ascii", ""), "no element vertex"},
      {header("ascii", "element vertex 1\nproperty float x\nproperty float y\n") + "1 2 3 4\n", "lacks a property"},
      {header("ascii", "element vertex -1\n" + xyz), "line 3"},
      {header("ascii", "element vertex 99999999999999999999999\n" + xyz), "line 3"},
      {header("ascii", "element vertex 12x\n" + xyz), "line 3"},
      {header("binary_little_endian", "element vertex 9000000000000000000\n" + xyz) + "abc", "is it cut off"},
      {header("ascii", "element vertex 1000000000\n" + xyz) + "1 2 3\n", "is it cut off"},
      {header("ascii", "element a 1000000000000\nelement vertex 0\n" + xyz), "has no property"},
      {header("ascii", "property float x\n"), "before any element"},
      {header("ascii", "element vertex 1\nproperty quad x\n"), "unknown type"},
      {header("ascii", "element vertex 1\nproperty list float int x\n"), "unknown type"},
      {header("ascii", "element vertex 1\nproperty float x\nproperty float x\n"), "repeats"},
      {header("ascii", "element vertex 1\n" + xyz) + "1 two 3\n", "\"two\""},
      {header("ascii", "element vertex 1\n" + xyz) + "1 nan 3\n", "not finite"},
      {header("ascii", "element vertex 2\n" + xyz) + "1 2 3 4         \n\n", "in the middle"},
      {header("binary_little_endian", "element f 1\nproperty list uint int v\nelement vertex 0\n" + xyz) +
           "\xff\xff\xff\xff",
       "longer than the file"},
      {header("binary_little_endian", "element f 1\nproperty list int int v\nelement vertex 0\n" + xyz) +
           "\xff\xff\xff\xff",
       "negative length"},
      {"ply\n" + std::string(100000, 'x'), "longer than"},
      {"ply\nformat ascii 1.0\nwhatever\n", "line 3"},
  };
  for (const Case& c : cases) {
    write_text(dir / "bad.ply", c.text);
    const std::string message = message_of(dir / "bad.ply");
    INFO(c.text.substr(0, 200));
    CHECK_THAT(message, Catch::Contains(c.expected));
    CHECK_THAT(message, Catch::Contains("bad.ply"));
  }
  CHECK_THROWS_AS(read_ply(dir / "missing.ply"), IoError);
  CHECK_THROWS_AS(read_ply(dir.path()), IoError);
}

TEST_CASE("every truncated PLY is an error and none is read as a smaller cloud") {
  const TempDir dir;
  CloudOutput writer(dir / "c.ply");
  writer.add(sample_cloud(3));
  writer.commit();
  const std::string text = read_text(dir / "c.ply");
  for (std::size_t size = 0; size < text.size(); ++size) {
    write_text(dir / "cut.ply", text.substr(0, size));
    INFO(size);
    CHECK_THROWS_AS(read_ply(dir / "cut.ply"), InvalidInput);
  }
}
