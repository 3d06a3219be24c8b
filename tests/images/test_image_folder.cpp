// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <cstdio>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "drawn_scene.h"
#include "pmsp/error.h"

using namespace pmsp;
using namespace pmsp::test;
using Catch::Matchers::Contains;

namespace {

using Ids = std::vector<std::int64_t>;
using Frames = std::vector<int>;

const double kUnix = 1763660000.25;

std::string numbered(const char* format, long long number) {
  char name[64];
  std::snprintf(name, sizeof name, format, number);
  return name;
}

/// Keyframes with holes in ids and frames; timestamps are frame / 10 fps.
std::vector<Shot> shots_from(double t0) {
  std::vector<Shot> shots;
  for (const auto& [id, frame] : {std::pair{0, 0}, {1, 1}, {2, 5}, {5, 13}, {6, 19}, {9, 31}})
    shots.push_back({id, t0 + frame / 10.0, frame});
  return shots;
}

void write_frames(const TempDir& folder, const char* format, const std::vector<Shot>& shots, int offset = 0) {
  for (const Shot& shot : shots) write_gray_frame(folder / numbered(format, shot.frame + offset), shot.frame);
}

const Ids kAllIds = {0, 1, 2, 5, 6, 9};
const Frames kAllFrames = {0, 1, 5, 13, 19, 31};

}  // namespace

TEST_CASE("File names are read as frame indices") {
  TempDir folder;
  const double t0 = GENERATE(0.0, kUnix);
  const auto shots = shots_from(t0);
  write_frames(folder, GENERATE("%06lld.png", "frame_%lld.jpg", "%lldrgb.PNG"), shots);
  const auto source = open_image_folder(bare_map(shots), folder.path());
  CHECK(source->keyframe_ids() == kAllIds);
  CHECK_THAT(source->description(), Contains("6 of 6 keyframes") && Contains("frame indices") && Contains("x 10 fps"));
  const Drained drained = drain(*source);
  CHECK(drained.ids == kAllIds);
  CHECK(drained.frames == kAllFrames);
  CHECK(source->skipped().empty());
}

TEST_CASE("File names are read as keyframe ids") {
  TempDir folder;
  const auto shots = shots_from(0.0);
  for (const Shot& shot : shots) write_gray_frame(folder / numbered("image%lld.png", shot.id), shot.frame);
  // What stella_vslam_dense writes beside them must not be taken for images.
  for (const Shot& shot : shots) write_gray_frame(folder / numbered("depthvis%lld.png", shot.id), 50);
  for (const Shot& shot : shots) write_gray_frame(folder / numbered("mask%lld.png", shot.id), 51);
  const auto source = open_image_folder(bare_map(shots), folder.path());
  CHECK_THAT(source->description(), Contains("keyframe ids"));
  CHECK(drain(*source).frames == kAllFrames);
}

TEST_CASE("Masks beside the images are not taken for images even if there are more of them") {
  TempDir folder;
  auto shots = shots_from(0.0);
  for (const char* name : {"%lld.png.png", "%lld_mask.png", "%lld.mask.png"}) {
    for (const Shot& shot : shots) write_gray_frame(folder / numbered(name, shot.frame), 51);
  }
  const SlamMap map = bare_map(shots);
  shots.pop_back();
  for (const Shot& shot : shots) write_gray_frame(folder / numbered("%lld.png", shot.frame), shot.frame);
  CHECK(drain(*open_image_folder(map, folder.path())).frames == Frames{0, 1, 5, 13, 19});
}

TEST_CASE("Row numbers of a file without ids are no image names") {
  TempDir folder;
  SlamMap map = bare_map({{0, 0.0}, {1, 0.7}, {2, 1.3}, {3, 2.1}});
  map.cameras[0].fps = 0.0;
  for (int i = 0; i < 4; ++i) write_gray_frame(folder / numbered("%06lld.png", i), i);
  CHECK_THAT(open_image_folder(map, folder.path())->description(), Contains("keyframe ids"));
  map.ids_are_row_numbers = true;
  CHECK_THROWS_WITH(open_image_folder(map, folder.path()), Contains("--fps"));
}

TEST_CASE("File names are read as timestamps in any unit") {
  TempDir folder;
  const auto shots = shots_from(kUnix);
  const std::string unit = GENERATE("seconds", "milliseconds", "microseconds", "nanoseconds");
  for (const Shot& shot : shots) {
    const long long ms = 1763660000250LL + 100LL * shot.frame;
    std::string name = numbered("%lld", ms);
    if (unit == "seconds") name = numbered("%lld", ms / 1000) + numbered(".%03lld", ms % 1000);
    if (unit == "microseconds") name += "000";
    if (unit == "nanoseconds") name += "000000";
    write_gray_frame(folder / (name + ".png"), shot.frame);
  }
  const auto source = open_image_folder(bare_map(shots), folder.path());
  CHECK_THAT(source->description(), Contains("timestamps in " + unit));
  CHECK(drain(*source).frames == kAllFrames);
}

TEST_CASE("A timestamp as name is matched by time at any frame rate") {
  SlamMap map = bare_map({{0, kUnix}, {1, kUnix + 1.0}, {2, kUnix + 2.0}, {3, kUnix + 3.0}});
  map.cameras[0].fps = 1.0;
  for (const int late_ms : {40, 200}) {
    TempDir folder;
    for (int i = 0; i < 4; ++i) {
      const long long ms = 250 + late_ms;
      write_gray_frame(folder / (numbered("%lld.", 1763660000LL + i) + numbered("%03lld.png", ms)), i);
    }
    if (late_ms == 40) {
      CHECK(drain(*open_image_folder(map, folder.path())).frames == Frames{0, 1, 2, 3});
    } else {
      CHECK_THROWS_AS(open_image_folder(map, folder.path()), InvalidInput);
    }
  }
}

TEST_CASE("File names are read as the SLAM's count of frames") {
  TempDir folder;
  SlamMap map = bare_map({{0, 0.0}, {1, 0.0}, {2, 0.0}});
  const std::vector<int> frames = {4, 11, 19};
  for (std::size_t i = 0; i < 3; ++i) {
    map.keyframes[i].source_frame = frames[i];
    write_gray_frame(folder / numbered("rgb_%lld.png", frames[i]), frames[i]);
    write_gray_frame(folder / numbered("gray_%lld.png", frames[i]), 50);
  }
  const auto source = open_image_folder(map, folder.path());
  CHECK_THAT(source->description(), Contains("count of frames"));
  CHECK(drain(*source).frames == frames);
}

TEST_CASE("A constant offset between index and name is detected or given") {
  TempDir folder;
  const auto shots = shots_from(kUnix);
  write_frames(folder, "%06lld.png", shots, 240);
  const auto source = open_image_folder(bare_map(shots), folder.path());
  CHECK_THAT(source->description(), Contains("+ 240"));
  CHECK(drain(*source).frames == kAllFrames);

  ImageFolderOptions options;
  options.frame_offset = 240;
  CHECK(drain(*open_image_folder(bare_map(shots), folder.path(), options)).frames == kAllFrames);
  options.frame_offset = 100;
  CHECK_THROWS_AS(open_image_folder(bare_map(shots), folder.path(), options), InvalidInput);
}

TEST_CASE("A given rate converts timestamps to indices") {
  TempDir folder;
  for (const int frame : {0, 3, 6, 15}) write_gray_frame(folder / numbered("%04lld.png", frame), frame);
  ImageFolderOptions options;
  options.fps = 30.0;
  const auto source = open_image_folder(bare_map({{10, 0.0}, {11, 0.1}, {12, 0.2}, {17, 0.5}}), folder.path(), options);
  CHECK_THAT(source->description(), Contains("x 30 fps"));
  CHECK(drain(*source).frames == Frames{0, 3, 6, 15});
}

TEST_CASE("Missing images and repeated timestamps are listed and skipped") {
  TempDir folder;
  auto shots = shots_from(0.0);
  write_frames(folder, "%06lld.png", shots);
  std::filesystem::remove(folder / "000013.png");
  shots.push_back({11, 3.1, 32});
  shots.push_back({12, 3.1, 33});
  const auto source = open_image_folder(bare_map(shots), folder.path());
  CHECK(source->keyframe_ids() == Ids{0, 1, 2, 6, 9});
  REQUIRE(source->skipped().size() == 3);
  CHECK_THAT(skip_reason(*source, 5), Contains("no image") && Contains("13"));
  CHECK_THAT(skip_reason(*source, 11), Contains("timestamp of keyframe 9") && Contains("3.1 s"));
  CHECK_THAT(skip_reason(*source, 12), Contains("timestamp of keyframe 9"));
  CHECK_THAT(source->description(), Contains("5 of 8"));
}

TEST_CASE("A repeated timestamp has no effect on names by keyframe id") {
  TempDir folder;
  std::vector<Shot> shots = shots_from(0.0);
  shots.push_back({11, 3.1, 40});
  for (const Shot& shot : shots) write_gray_frame(folder / numbered("%lld.png", shot.id), shot.frame);
  const auto source = open_image_folder(bare_map(shots), folder.path());
  CHECK(source->keyframe_ids() == Ids{0, 1, 2, 5, 6, 9, 11});
  CHECK(drain(*source).frames == Frames{0, 1, 5, 13, 19, 31, 40});
}

TEST_CASE("Ambiguous naming schemes are resolved by the images") {
  // All frames of the flight are there: each name is a keyframe id as well as a frame index.
  std::vector<Shot> by_index, by_id;
  for (int i = 0; i < 7; ++i) by_index.push_back({i, 0.3 * i, 3 * i});
  for (int i = 0; i < 7; ++i) by_id.push_back({i, 0.3 * i, i});
  TempDir folder;
  for (int frame = 0; frame <= 20; ++frame) write_image(folder / numbered("%06lld.png", frame), render_room(frame));

  const auto indices = open_image_folder(room_map(by_index), folder.path());
  CHECK_THAT(indices->description(), Contains("frame indices (timestamp x 10 fps)"));
  CHECK(indices->keyframe_ids().size() == 7);
  const auto ids = open_image_folder(room_map(by_id), folder.path());
  CHECK_THAT(ids->description(), Contains("keyframe ids"));

  std::vector<Shot> shifted;
  for (int i = 0; i < 6; ++i) shifted.push_back({i + 100, kUnix + 0.3 * i, 3 * i + 2});
  const auto offset = open_image_folder(room_map(shifted), folder.path());
  CHECK_THAT(offset->description(), Contains("+ 2)"));
}

TEST_CASE("Names that match fewer than half of the keyframes are refused unless allowed") {
  TempDir folder;
  const auto shots = shots_from(0.0);
  for (const int frame : {0, 13}) write_gray_frame(folder / numbered("%06lld.png", frame), frame);
  CHECK_THROWS_WITH(
      open_image_folder(bare_map(shots), folder.path()),
      Contains("2 of 6 keyframes") && Contains("--fps") && Contains("--image-list") && Contains("--allow-missing"));
  ImageFolderOptions options;
  options.allow_missing = true;
  CHECK(drain(*open_image_folder(bare_map(shots), folder.path(), options)).frames == Frames{0, 13});
}

TEST_CASE("Missing images that the map names are listed if most are missing") {
  TempDir folder;
  SlamMap map = bare_map(shots_from(0.0));
  for (MapKeyframe& keyframe : map.keyframes) keyframe.image = numbered("pano %lld.png", keyframe.id);
  write_gray_frame(folder / "pano 0.png", 0);
  write_gray_frame(folder / "pano 9.png", 31);
  CHECK_THROWS_WITH(open_image_folder(map, folder.path()),
                    Contains("2 of 6 keyframes") && Contains("pano 1.png") && Contains("and 1 more"));
  ImageFolderOptions options;
  options.allow_missing = true;
  CHECK(drain(*open_image_folder(map, folder.path(), options)).frames == Frames{0, 31});
}

TEST_CASE("Without a rate or times or in nanoseconds the naming is verified by the images") {
  TempDir folder;
  std::vector<Shot> shots;
  for (const int frame : {1, 4, 6, 9, 13, 16}) {
    shots.push_back({static_cast<std::int64_t>(shots.size()), frame / 10.0, frame});
    write_image(folder / numbered("%06lld.png", frame), render_room(frame));
  }
  SlamMap map = room_map(shots);
  const std::string fault = GENERATE("no rate", "wrong rate", "no times", "nanoseconds", "Unix nanoseconds");
  CAPTURE(fault);
  map.cameras[0].fps = fault == "no rate" || fault == "no times" ? 0.0 : fault == "wrong rate" ? 30.0 : 10.0;
  for (MapKeyframe& keyframe : map.keyframes) {
    if (fault == "no times") keyframe.timestamp = 0.0;
    if (fault == "nanoseconds") keyframe.timestamp *= 1e9;
    if (fault == "Unix nanoseconds") keyframe.timestamp = 1e9 * (kUnix + keyframe.timestamp);
  }
  const auto source = open_image_folder(map, folder.path());
  INFO(source->description());
  CHECK(source->keyframe_ids() == Ids{0, 1, 2, 3, 4, 5});
  CHECK(source->origin(4).file.filename() == "000013.png");
  for (MapKeyframe& keyframe : map.keyframes) keyframe.observations.clear();
  map.landmarks.clear();
  if (fault == "wrong rate" || fault.find("nano") != std::string::npos) return;
  // A rate that gives each keyframe an image and each image a keyframe is proof enough, as is the order without times.
  map.ids_are_row_numbers = true;
  CHECK(open_image_folder(map, folder.path())->origin(4).file.filename() == "000013.png");
  write_image(folder / "000017.png", render_room(17));
  CHECK_THROWS_WITH(open_image_folder(map, folder.path()), Contains("--image-list"));
}

TEST_CASE("The last varying number in names counts") {
  TempDir folder;
  const auto shots = shots_from(0.0);
  const std::string name =
      GENERATE("frame_%06lld_cam0.png", "2024-05-01_%06lld_1920x960.png", "12_%lld (2).png", "2024.05.01.%06lld.png");
  write_frames(folder, name.c_str(), shots);
  CHECK(drain(*open_image_folder(bare_map(shots), folder.path())).frames == kAllFrames);
}

TEST_CASE("Images of a rig's cameras in one directory are separate series") {
  TempDir folder;
  const auto shots = shots_from(0.0);
  for (const Shot& shot : shots)
    for (int camera = 0; camera < 2; ++camera)
      write_gray_frame(folder / (numbered("%06lld", shot.frame) + numbered("_cam%lld.png", camera)),
                       camera == 0 ? shot.frame : 50);
  CHECK(drain(*open_image_folder(bare_map(shots), folder.path())).frames == kAllFrames);
}

TEST_CASE("ROS names images by seconds and nanoseconds") {
  TempDir folder;
  const auto shots = shots_from(kUnix);
  for (const Shot& shot : shots) {
    const long long ms = 1763660000250LL + 100LL * shot.frame;
    write_gray_frame(folder / (numbered("%lld", ms / 1000) + numbered("_%03lld000000.png", ms % 1000)), shot.frame);
  }
  SlamMap map = bare_map(shots);
  map.cameras[0].fps = 0.0;
  map.ids_are_row_numbers = true;
  const auto source = open_image_folder(map, folder.path());
  CHECK_THAT(source->description(), Contains("timestamps in seconds"));
  CHECK(drain(*source).frames == kAllFrames);
}

TEST_CASE("Among all frames of a recording the offset that fits the images is found") {
  TempDir folder;
  for (int frame = 0; frame <= 33; ++frame)
    write_image(folder / numbered("%06lld.png", 100 + frame), render_room(frame));
  std::vector<Shot> shots;
  for (int i = 0; i < 7; ++i) shots.push_back({i, kUnix + 0.2 * i, 18 + 2 * i});
  const auto source = open_image_folder(room_map(shots), folder.path());
  INFO(source->description());
  CHECK(source->keyframe_ids().size() == 7);
  CHECK(source->origin(0).file.filename() == "000118.png");
}

TEST_CASE("Upside-down images do not select a less likely naming") {
  TempDir folder;
  std::vector<Shot> shots;
  for (int i = 0; i < 7; ++i) shots.push_back({i, 0.3 * i, 3 * i});
  for (int frame = 0; frame <= 20; ++frame) {
    cv::Mat turned = bgr_of(render_room(frame));
    cv::flip(turned, turned, -1);
    cv::imwrite((folder / numbered("%06lld.png", frame)).string(), turned);
  }
  const auto source = open_image_folder(room_map(shots), folder.path());
  CHECK_THAT(source->description(), Contains("frame indices (timestamp x 10 fps)"));
}

TEST_CASE("Images come in the camera's colours and at any scale of its size") {
  TempDir folder;
  const auto shots = shots_from(0.0);
  for (const Shot& shot : shots)
    cv::imwrite((folder / numbered("%lld.png", shot.frame)).string(), cv::Mat(16, 32, CV_8UC3, cv::Scalar(30, 20, 10)));
  auto item = open_image_folder(bare_map(shots), folder.path())->next();
  REQUIRE(item.has_value());
  CHECK(item->image.width() == 32);
  CHECK(item->image(3, 4) == Rgb{10, 20, 30});
}

TEST_CASE("Files of wrong size and truncated and broken files are named and the rest is read") {
  TempDir folder;
  const auto shots = shots_from(0.0);
  write_frames(folder, "%06lld.jpg", shots);
  cv::imwrite((folder / "000000.jpg").string(), cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(9)));
  std::filesystem::resize_file(folder / "000001.jpg", std::filesystem::file_size(folder / "000001.jpg") - 20);
  std::ofstream(folder / "000005.jpg") << "no image at all";
  std::ofstream(folder / "000013.jpg").flush();
  const auto source = open_image_folder(bare_map(shots), folder.path());
  source->read_ahead(GENERATE(0, 1, 3, 100));
  CHECK_THROWS_WITH(source->next(), Contains("000000.jpg") && Contains("64x48") && Contains("64x32"));
  CHECK_THROWS_WITH(source->next(), Contains("000001.jpg") && Contains("end marker"));
  CHECK_THROWS_AS(source->next(), IoError);
  CHECK_THROWS_WITH(source->next(), Contains("000013.jpg") && Contains("empty"));
  CHECK(drain(*source).frames == Frames{19, 31});
}

TEST_CASE("A partial panorama is refused and a full one accepted with any XMP data") {
  TempDir folder;
  const auto shots = shots_from(0.0);
  write_frames(folder, "%06lld.jpg", shots);
  add_xmp(folder / "000000.jpg",
          "<a GPano:FullPanoWidthPixels=\"128\" GPano:FullPanoHeightPixels=\"64\" "
          "GPano:CroppedAreaImageWidthPixels=\"64\" GPano:CroppedAreaImageHeightPixels=\"32\"/>");
  add_xmp(folder / "000001.jpg",
          "<GPano:FullPanoWidthPixels>64</GPano:FullPanoWidthPixels><GPano:FullPanoHeightPixels>32</GPano:"
          "FullPanoHeightPixels><GPano:CroppedAreaImageWidthPixels>64</GPano:CroppedAreaImageWidthPixels><GPano:"
          "CroppedAreaImageHeightPixels>32</GPano:CroppedAreaImageHeightPixels>");
  add_xmp(folder / "000005.jpg", "<a GPano:FullPanoWidthPixels=\"\" GPano:CroppedAreaImageWidthPixels=\"x\"/>");
  const auto source = open_image_folder(bare_map(shots), folder.path());
  CHECK_THROWS_WITH(source->next(), Contains("000000.jpg") && Contains("64x32 of 128x64") && Contains("GPano"));
  CHECK(drain(*source).frames == Frames{1, 5, 13, 19, 31});
}

TEST_CASE("Prefetched images keep their order and a source may be destroyed while decoding") {
  TempDir folder;
  const auto shots = shots_from(0.0);
  write_frames(folder, "%06lld.png", shots);
  const auto source = open_image_folder(bare_map(shots), folder.path());
  source->restrict_to({1, 2, 6, 9});
  source->read_ahead(GENERATE(1, 2, 100));
  const Drained drained = drain(*source);
  CHECK(drained.ids == Ids{1, 2, 6, 9});
  CHECK(drained.frames == Frames{1, 5, 19, 31});
  CHECK_FALSE(source->next().has_value());
  const auto left = open_image_folder(bare_map(shots), folder.path());
  left->read_ahead(100);
  CHECK(left->next()->keyframe_id == 0);
}

TEST_CASE("A small file that declares gigabytes of pixels is refused before allocation") {
  TempDir folder;
  const auto shots = shots_from(0.0);
  write_frames(folder, "%06lld.jpg", shots);
  const auto overwrite = [&](const char* name, std::streamoff at, const std::string& bytes) {
    std::fstream file(folder / name, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(at).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  };
  // In a JPEG, height and width stand 5 bytes behind the mark FF C0, in a PNG, width and height at byte 16.
  const std::string bytes = pmsp_test::read_text(folder / "000000.jpg");
  overwrite("000000.jpg", static_cast<std::streamoff>(bytes.find("\xFF\xC0")) + 5, "\xFF\xF0\xFF\xF1");
  write_gray_frame(folder / "000001.png", 1);
  std::filesystem::rename(folder / "000001.png", folder / "000001.jpg");
  overwrite("000001.jpg", 16, std::string("\x00\x00\x80\x00\x00\x00\x40\x00", 8));
  const auto source = open_image_folder(bare_map(shots), folder.path());
  CHECK_THROWS_WITH(source->next(), Contains("000000.jpg") && Contains("65521x65520") && Contains("16384x8192"));
  CHECK_THROWS_WITH(source->next(), Contains("000001.jpg") && Contains("32768x16384"));
  CHECK(source->next().has_value());
}

TEST_CASE("A truncated PNG is an error and not a gray image") {
  TempDir folder;
  const auto shots = shots_from(0.0);
  for (const Shot& shot : shots) write_image(folder / numbered("%lld.png", shot.frame), render_room(shot.frame, 64));
  std::filesystem::resize_file(folder / "0.png", std::filesystem::file_size(folder / "0.png") / 2);
  const auto source = open_image_folder(bare_map(shots), folder.path());
  CHECK_THROWS_AS(source->next(), IoError);
}

TEST_CASE("Unusable directories are refused") {
  TempDir folder;
  const SlamMap map = bare_map(shots_from(0.0));
  CHECK_THROWS_WITH(open_image_folder(map, folder / "missing"), Contains("missing"));
  std::ofstream(folder / "notes 12.txt") << "no image";
  std::ofstream(folder / "._000001.jpg") << "hidden";
  std::filesystem::create_directory(folder / "000002.jpg");
  CHECK_THROWS_AS(open_image_folder(map, folder.path()), IoError);
  write_gray_frame(folder / "panorama.png", 1);
  CHECK_THROWS_WITH(open_image_folder(map, folder.path()), Contains("none of its 1 images") && Contains("number"));
  write_gray_frame(folder / "panorama 777777.png", 1);
  CHECK_THROWS_WITH(open_image_folder(map, folder.path()),
                    Contains("panorama 777777.png") && Contains("hand-made.msg"));
  write_gray_frame(folder / "panorama 99999999999999999999999999999999.png", 1);
  CHECK_THROWS_AS(open_image_folder(map, folder.path()), InvalidInput);
  ImageFolderOptions options;
  options.fps = -3.0;
  CHECK_THROWS_AS(open_image_folder(map, folder.path(), options), InvalidOption);
}
