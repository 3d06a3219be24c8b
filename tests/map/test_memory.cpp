// SPDX-License-Identifier: BSD-2-Clause
#include <cstdint>
#include <cstring>
#include <fstream>
#include <string>
#include <utility>

#include <catch2/catch.hpp>

#include "map_files.h"
#include "pmsp/io/map.h"

namespace pmsp::test {
namespace {

#if defined(__linux__) && !defined(PMSP_SANITIZED)
constexpr bool kMeasured = true;
#else
constexpr bool kMeasured = false;  // sanitizers take memory and time of their own
#endif
constexpr int kKeyframes = kMeasured ? 2000 : 40;
constexpr std::uint16_t kKeypoints = 3000;
constexpr int kLandmarks = 150000;

/// MessagePack, byte by byte, for a tree that is too large to be built.
class Writer {
 public:
  void map(unsigned size) { head(0xDF, size, 4); }
  void array(unsigned size) { head(0xDC, size, 2); }
  void string(const std::string& text) {
    head(0xD9, static_cast<unsigned>(text.size()), 1);
    bytes_ += text;
  }
  void whole(std::uint32_t value) { head(0xCE, value, 4); }
  void none() { bytes_ += '\xFF'; }
  void real(double value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    head(0xCB, bits, 8);
  }
  std::string take() { return std::exchange(bytes_, {}); }

 private:
  void head(unsigned type, std::uint64_t value, int size) {
    bytes_ += static_cast<char>(type);
    for (int i = size - 1; i >= 0; --i) bytes_ += static_cast<char>((value >> (8 * i)) & 0xFFU);
  }
  std::string bytes_;
};

std::string keypoints() {
  Writer w;
  w.string("undist_keypts");
  w.array(kKeypoints);
  for (int i = 0; i < kKeypoints; ++i) {
    w.map(3);
    w.string("ang");
    w.real(92.13862609863281);
    w.string("oct");
    w.whole(1);
    w.string("pt");
    w.array(2);
    w.real(i % 1900 + 0.5);
    w.real(i % 900);
  }
  return w.take();
}

std::string descriptors() {
  Writer w;
  w.string("descs");
  w.array(kKeypoints);
  for (int i = 0; i < kKeypoints; ++i) {
    w.array(8);
    for (int word = 0; word < 8; ++word) w.whole(3765440635U);
  }
  return w.take();
}

std::string keyframe(int index) {
  Writer w;
  w.string(std::to_string(index));
  w.map(7);
  w.string("ts");
  w.real(index / 10.0);
  w.string("cam");
  w.string("theta");
  w.string("rot_cw");
  w.array(4);
  for (const double x : {0.0, 0.6, 0.0, 0.8}) w.real(x);
  w.string("trans_cw");
  w.array(3);
  for (const double x : {1.0, 2.0, 3.0}) w.real(x);
  w.string("lm_ids");
  w.array(kKeypoints);
  for (int i = 0; i < kKeypoints; ++i) {
    if (i % 3 == 0) {
      w.whole(static_cast<std::uint32_t>((index * 70 + i) % kLandmarks));
    } else {
      w.none();
    }
  }
  return w.take();
}

void write_large_map(const std::filesystem::path& path) {
  std::ofstream file(path, std::ios::binary);
  const auto put = [&](const std::string& bytes) {
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  };
  Writer w;
  w.map(3);
  w.string("cameras");
  w.map(1);
  w.string("theta");
  w.map(4);
  w.string("model_type");
  w.string("Equirectangular");
  w.string("cols");
  w.whole(1920);
  w.string("rows");
  w.whole(960);
  w.string("fps");
  w.real(10.0);
  w.string("keyframes");
  w.map(kKeyframes);
  put(w.take());
  const std::string shared = descriptors() + keypoints();
  for (int i = 0; i < kKeyframes; ++i) {
    put(keyframe(i));
    put(shared);
  }
  w.string("landmarks");
  w.map(kLandmarks);
  for (int i = 0; i < kLandmarks; ++i) {
    w.string(std::to_string(i));
    w.map(1);
    w.string("pos_w");
    w.array(3);
    for (const double x : {0.1, 0.2, 0.3 + i}) w.real(x);
  }
  put(w.take());
  file.close();
  REQUIRE(file.good());
}

/// Peak of the process's resident memory [MB].
double peak_memory() {
  std::ifstream status("/proc/self/status");
  std::string line;
  while (std::getline(status, line)) {
    if (line.rfind("VmHWM:", 0) == 0) return std::stod(line.substr(6)) / 1024.0;
  }
  return 0.0;
}

}  // namespace

TEST_CASE("a map of 2000 keyframes is read in bounded memory") {
  const TempDir folder;
  const auto path = folder / "map.msg";
  write_large_map(path);
  const SlamMap map = read_map(path);
  const double megabytes = peak_memory();
  CHECK(map.keyframes.size() == kKeyframes);
  CHECK(map.landmarks.size() == kLandmarks);
  CHECK(map.keyframes.back().observations.size() == kKeypoints / 3);
  CHECK(map.observations_skipped == 0);
  if (kMeasured) {
    CHECK(std::filesystem::file_size(path) > 450000000);
    CHECK(megabytes > 10.0);
    CHECK(megabytes < 300.0);
  }
}

}  // namespace pmsp::test
