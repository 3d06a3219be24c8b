// SPDX-License-Identifier: BSD-2-Clause
// Depth files of other programs: EXR, NPY.
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include <zlib.h>

#include <catch2/catch.hpp>

#include "export/little_endian.h"
#include "pmsp/error.h"
#include "pmsp/io/depth.h"
#include "support/temp_dir.h"
#include "support/zip_file.h"

using namespace pmsp;
using Catch::Matchers::Contains;
using pmsp_test::read_text;
using pmsp_test::TempDir;
using pmsp_test::write_text;

namespace {

Image<float> depth_ramp(int width, int height) {
  Image<float> image(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image(x, y) = 0.5F * static_cast<float>(y) + 0.25F * static_cast<float>(x);
  }
  return image;
}

/// As numpy.save writes it.
std::string npy(const std::string& type, const std::string& shape, const std::string& values,
                const std::string& order = "False") {
  std::string header = "{'descr': '" + type + "', 'fortran_order': " + order + ", 'shape': (" + shape + "), }";
  while ((10 + header.size() + 1) % 64 != 0) header += ' ';
  header += '\n';
  std::string file = "\x93NUMPY";
  file += '\x01';
  file += '\0';
  append_little(file, static_cast<std::uint16_t>(header.size()));
  return file + header + values;
}

template <class T>
std::string values_of(const Image<float>& image) {
  std::string bytes;
  for (const float value : image.pixels()) append_little(bytes, static_cast<T>(value));
  return bytes;
}

std::string attribute(const std::string& name, const std::string& type, const std::string& value) {
  std::string text = name + '\0' + type + '\0';
  append_little(text, static_cast<std::int32_t>(value.size()));
  return text + value;
}

/// One half channel, ZIP: as written by cv2.imwrite and most networks' tools. `bits`: of all values, row by row.
std::string zip_exr(int width, int height, const std::vector<std::uint16_t>& bits, const std::string& channel = "Y") {
  std::string list = channel + '\0', window;
  append_little(list, std::int32_t{1});
  append_little(list, std::int32_t{0});
  append_little(list, std::int32_t{1});
  append_little(list, std::int32_t{1});
  list += '\0';
  for (const int value : {0, 0, width - 1, height - 1}) append_little(window, std::int32_t{value});
  std::string file;
  append_little(file, std::int32_t{20000630});
  append_little(file, std::int32_t{2});
  file += attribute("channels", "chlist", list) + attribute("compression", "compression", std::string(1, '\x03')) +
          attribute("dataWindow", "box2i", window) + '\0';
  const int blocks = (height + 15) / 16;
  for (int i = 0; i < blocks; ++i) append_little(file, std::uint64_t{0});
  for (int i = 0; i < blocks; ++i) {
    std::string raw;
    for (int k = i * 16 * width; k < std::min((i + 1) * 16, height) * width; ++k) {
      append_little(raw, bits[static_cast<std::size_t>(k)]);
    }
    std::string sorted;
    for (std::size_t k = 0; k < raw.size(); k += 2) sorted += raw[k];
    for (std::size_t k = 1; k < raw.size(); k += 2) sorted += raw[k];
    std::string differences = sorted;
    for (std::size_t k = 1; k < sorted.size(); ++k) {
      differences[k] = static_cast<char>(sorted[k] - sorted[k - 1] + 128);
    }
    uLongf size = compressBound(static_cast<uLong>(differences.size()));
    std::string packed(size, '\0');
    compress(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(differences.data()),
             static_cast<uLong>(differences.size()));
    packed.resize(size);
    append_little(file, std::int32_t{i * 16});
    append_little(file, static_cast<std::int32_t>(packed.size()));
    file += packed;
  }
  return file;
}

}  // namespace

TEST_CASE("the depth of an own EXR is read back") {
  const TempDir dir;
  write_exr(dir / "d.exr", {{"confidence", Image<float>(6, 3, 0.5F)}, {"Z", depth_ramp(6, 3)}});
  CHECK(read_exr_depth(dir / "d.exr").pixels() == depth_ramp(6, 3).pixels());
  write_exr(dir / "one.exr", {{"whatever", depth_ramp(6, 3)}});
  CHECK(read_exr_depth(dir / "one.exr").pixels() == depth_ramp(6, 3).pixels());
  const char* const names[] = {"Z", "depth", "Y", "V"};
  for (int first = 0; first < 3; ++first) {  // in the file, channels are in alphabetical order
    write_exr(dir / "all.exr", {{names[first], depth_ramp(6, 3)}, {names[first + 1], Image<float>(6, 3, 0.5F)}});
    CHECK(read_exr_depth(dir / "all.exr").pixels() == depth_ramp(6, 3).pixels());
    write_exr(dir / "all.exr", {{names[first], depth_ramp(6, 3)}, {names[3], Image<float>(6, 3, 0.5F)}});
    CHECK(read_exr_depth(dir / "all.exr").pixels() == depth_ramp(6, 3).pixels());
  }
  write_exr(dir / "two.exr", {{"R", depth_ramp(6, 3)}, {"G", depth_ramp(6, 3)}});
  CHECK_THROWS_WITH(read_exr_depth(dir / "two.exr"), Contains("G, R"));
}

TEST_CASE("depth that Blender writes is read") {
  const TempDir dir;
  write_exr(dir / "v.exr", {{"A", Image<float>(6, 3, 1.0F)}, {"V", depth_ramp(6, 3)}});
  CHECK(read_exr_depth(dir / "v.exr").pixels() == depth_ramp(6, 3).pixels());
  std::vector<std::uint16_t> bits(16 * 8, 0x4248);  // 3.140625
  bits[3] = 0x7c00;                                 // the sky: 1e10 is infinite as half
  write_text(dir / "half.exr", zip_exr(16, 8, bits, "V"));
  CHECK(read_exr_depth(dir / "half.exr")(0, 0) == 3.140625F);
  CHECK(std::isinf(read_exr_depth(dir / "half.exr")(3, 0)));

  Image<float> ramp = depth_ramp(6, 3);
  ramp(2, 2) = std::nanf("");
  write_exr(dir / "gray.exr", {{"R", ramp}, {"G", ramp}, {"B", ramp}});
  CHECK(read_exr_depth(dir / "gray.exr")(5, 2) == ramp(5, 2));
  write_exr(dir / "color.exr", {{"R", ramp}, {"G", ramp}, {"B", depth_ramp(6, 3)}});
  CHECK_THROWS_WITH(read_exr_depth(dir / "color.exr"), Contains("R, G, B differ"));
}

TEST_CASE("a packed EXR of halves is read") {
  const TempDir dir;
  const int width = 64, height = 40;                                                  // not a whole number of blocks
  std::vector<std::uint16_t> bits(static_cast<std::size_t>(width * height), 0x3c00);  // 1
  bits[1] = 0xc000;                                                                   // -2
  bits[2] = 0x0001;                                                                   // the smallest, 2^-24
  bits[3] = 0x7c00;                                                                   // infinite
  bits[64 * 17 + 5] = 0x4248;                                                         // 3.140625
  write_text(dir / "h.exr", zip_exr(width, height, bits));
  const Image<float> image = read_exr_depth(dir / "h.exr");
  REQUIRE(image.width() == width);
  REQUIRE(image.height() == height);
  CHECK(image(0, 0) == 1.0F);
  CHECK(image(1, 0) == -2.0F);
  CHECK(image(2, 0) == std::ldexp(1.0F, -24));
  CHECK(std::isinf(image(3, 0)));
  CHECK(image(5, 17) == 3.140625F);
  CHECK(image(63, 39) == 1.0F);
}

TEST_CASE("NPY of three kinds of floats is read") {
  const TempDir dir;
  const Image<float> image = depth_ramp(5, 3);
  write_text(dir / "f4.npy", npy("<f4", "3, 5", values_of<float>(image)));
  write_text(dir / "f8.npy", npy("<f8", "1, 3, 5", values_of<double>(image)));
  CHECK(read_npy(dir / "f4.npy").pixels() == image.pixels());
  CHECK(read_npy(dir / "f8.npy").pixels() == image.pixels());
  std::string halves;
  for (const int value : {0x3c00, 0x4000}) append_little(halves, static_cast<std::uint16_t>(value));
  write_text(dir / "f2.npy", npy("<f2", "1, 2", halves));
  CHECK(read_npy(dir / "f2.npy").pixels() == std::vector<float>{1.0F, 2.0F});

  write_text(dir / "i4.npy", npy("<i4", "3, 5", values_of<float>(image)));
  CHECK_THROWS_WITH(read_npy(dir / "i4.npy"), Contains("<i4") && Contains("<f4"));
  write_text(dir / "order.npy", npy("<f4", "3, 5", values_of<float>(image), "True"));
  CHECK_THROWS_WITH(read_npy(dir / "order.npy"), Contains("C order"));
  write_text(dir / "line.npy", npy("<f4", "15,", values_of<float>(image)));
  CHECK_THROWS_AS(read_npy(dir / "line.npy"), InvalidInput);
  write_text(dir / "huge.npy", npy("<f4", "1000000000, 1000000000", values_of<float>(image)));
  CHECK_THROWS_AS(read_npy(dir / "huge.npy"), InvalidInput);
  write_text(dir / "long.npy", npy("<f4", "8000, 8000", values_of<float>(image)));
  CHECK_THROWS_WITH(read_npy(dir / "long.npy"), Contains("truncated"));
}

TEST_CASE("depth files in a ZIP archive are read by their path") {
  const TempDir dir;
  const Image<float> ramp = depth_ramp(40, 20);
  write_exr(dir / "a.exr", {{"Z", ramp}});
  const std::string sound = npy("<f4", "20, 40", values_of<float>(ramp));
  pmsp_test::write_zip(dir / "depth.zip", {{"00001.exr", read_text(dir / "a.exr")}, {"2.npy", sound}});
  CHECK(read_exr_depth(dir / "depth.zip/00001.exr").pixels() == ramp.pixels());
  CHECK(read_npy(dir / "depth.zip/2.npy").pixels() == ramp.pixels());
  CHECK_THROWS_WITH(read_npy(dir / "depth.zip/3.npy"),
                    Contains("3.npy") && Contains("no such member; correct the name"));
  CHECK_THROWS_AS(read_npy(dir / "other.zip/2.npy"), IoError);

  const std::string bytes = read_text(dir / "depth.zip");
  const auto refused = [&](std::size_t at, const std::string& by, const std::string& message) {
    std::string broken = bytes;
    broken.replace(at, by.size(), by);
    write_text(dir / "broken.zip", broken);
    CHECK_THROWS_WITH(read_npy(dir / "broken.zip/2.npy"), Contains("2.npy") && Contains(message));
  };
  const std::size_t entry = bytes.rfind("PK\x01\x02");  // of 2.npy: "central directory header" of APPNOTE.TXT
  refused(entry + 20, std::string("\xff\xff\xff\x01\xff\xff\xff\x7f", 8), "expected at most 1 GiB; write smaller");
  refused(entry + 24, std::string("\xff\xff\xff\x3f", 4), "1032 times");
  refused(entry + 10, std::string("\x0c\x00", 2), "method 12");
  const std::size_t data = bytes.rfind("2.npy", entry) + 5;
  refused(data + 20, std::string(8, '\xff'), "cannot be unpacked");
  write_text(dir / "broken.zip", bytes.substr(0, bytes.size() / 2));
  CHECK_THROWS_WITH(read_npy(dir / "broken.zip/2.npy"), Contains("ZIP archive"));
}

TEST_CASE("depth files broken at any offset are refused") {
  const TempDir dir;
  write_exr(dir / "good.exr", {{"Z", depth_ramp(6, 3)}});
  const std::vector<std::string> files = {read_text(dir / "good.exr"),
                                          zip_exr(20, 20, std::vector<std::uint16_t>(400, 0x3c00)),
                                          npy("<f4", "3, 5", values_of<float>(depth_ramp(5, 3)))};
  for (std::size_t k = 0; k < files.size(); ++k) {
    CAPTURE(k);
    const auto path = dir / (k < 2 ? "broken.exr" : "broken.npy");
    const auto read = [&] { return k < 2 ? read_exr_depth(path) : read_npy(path); };
    for (std::size_t size = 0; size < files[k].size(); ++size) {
      write_text(path, files[k].substr(0, size));
      CHECK_THROWS_AS(read(), Error);
    }
    for (std::size_t at = 0; at < files[k].size(); ++at) {  // any single byte: an image, or an error
      std::string bytes = files[k];
      bytes[at] = static_cast<char>(bytes[at] ^ 0x7f);
      write_text(path, bytes);
      try {
        read();
      } catch (const Error&) {
      }
    }
  }
}

TEST_CASE("the requested channels of an EXR are read", "[prior files]") {
  const TempDir dir;
  write_exr(dir / "d.exr",
            {{"confidence", Image<float>(6, 3, 0.5F)}, {"N.X", depth_ramp(6, 3)}, {"Z", Image<float>(6, 3)}});
  const std::vector<ImageChannel> channels = read_exr(dir / "d.exr", {"N.X", "N.Y", "confidence"});
  REQUIRE(channels.size() == 2);
  CHECK(channels[0].name == "N.X");
  CHECK(channels[0].values.pixels() == depth_ramp(6, 3).pixels());
  CHECK(channels[1].name == "confidence");
  CHECK(channels[1].values(5, 2) == 0.5F);
  CHECK(read_exr(dir / "d.exr", {"A"}).empty());
  CHECK(read_exr_vectors(dir / "d.exr", {"Z", "N.X", "confidence"})(5, 2) ==
        Eigen::Vector3f(0.0F, depth_ramp(6, 3)(5, 2), 0.5F));
  CHECK(read_exr_vectors(dir / "d.exr", {"N.X", "N.Y", "N.Z"}).empty());
  const std::string bytes = read_text(dir / "d.exr");
  write_text(dir / "cut.exr", bytes.substr(0, bytes.size() - 5));
  CHECK_THROWS_AS(read_exr(dir / "cut.exr", {"N.X"}), InvalidInput);
  write_text(dir / "no.exr", "v/1");
  CHECK_THROWS_AS(read_exr(dir / "no.exr", {"N.X"}), InvalidInput);
  // A list of channels that ends before its first: what remains of each row is no byte.
  const std::size_t list = bytes.find("chlist") + 7 + 4;
  std::string empty = bytes;
  empty[list] = '\0';
  write_text(dir / "empty.exr", empty);
  CHECK_THROWS_WITH(read_exr(dir / "empty.exr", {"N.X"}), Contains("no channels"));
  CHECK_THROWS_WITH(read_exr_depth(dir / "empty.exr"), Contains("no channels"));
}
