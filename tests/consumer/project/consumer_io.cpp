// SPDX-License-Identifier: BSD-2-Clause
// Links all of pmsp_io's own dependencies: maps (SQLite), images and video (OpenCV).
#include <cstdio>
#include <string>

#include <pmsp/error.h>
#include <pmsp/io/images.h>
#include <pmsp/io/map.h>

int main() {
  const std::string missing = "no-such-map.msg";
  try {
    const pmsp::SlamMap map = pmsp::read_map(missing);
    pmsp::open_video(map, "no-such-video.mp4");
  } catch (const pmsp::IoError& error) {
    std::printf("%s\n", error.what());
    return std::string(error.what()).find(missing) != std::string::npos ? 0 : 1;
  }
  return 1;
}
