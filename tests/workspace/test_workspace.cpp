// SPDX-License-Identifier: BSD-2-Clause
#include <catch2/catch.hpp>
#include <filesystem>
#include <string>

#include "pmsp/error.h"
#include "support/temp_dir.h"
#include "workspace/workspace.h"

using namespace pmsp;
using namespace pmsp::workspace;
using Catch::Contains;
using pmsp_test::TempDir;
using pmsp_test::write_text;

namespace {

constexpr const char* kKept = "1-0123456789abcdef";
constexpr const char* kOld = "1-00112233445566aa";

Record record_naming(const std::string& file) {
  Record record;
  record.step = "s";
  RecordedKeyframe& keyframe = record.keyframes[1];
  keyframe.image = "i";
  keyframe.width = 64;
  keyframe.height = 32;
  keyframe.planes = RecordedPlanes{file, "own", 5, {}, {}};
  keyframe.points = RecordedPoints{file, "inputs", "s"};
  record.poses["s"][1] = {};
  return record;
}

}  // namespace

TEST_CASE("a finished step is reloaded and files that it does not list are deleted") {
  const TempDir dir;
  const std::filesystem::path folder = dir / "work";
  {
    Workspace workspace(folder);
    CHECK(workspace.record().keyframes.empty());
    for (const char* name : {kKept, kOld}) {
      workspace.save_planes(name, PlaneMap(4, 2));
      workspace.save_points(name, {});
    }
    workspace.commit(record_naming(kKept));
    CHECK_FALSE(std::filesystem::exists(folder / "planes" / kOld));
    CHECK_FALSE(std::filesystem::exists(folder / "points" / kOld));
  }
  {
    const Workspace workspace(folder);
    CHECK(workspace.record().keyframes.at(1).planes);
    CHECK(workspace.load_planes(kKept).width() == 4);
    CHECK(workspace.load_points(kKept).points.empty());
  }
  std::filesystem::remove(folder / "points" / kKept);
  const Workspace workspace(folder);
  CHECK(workspace.record().keyframes.at(1).planes);
  CHECK_FALSE(workspace.record().keyframes.at(1).points);
}

TEST_CASE("foreign files stay anywhere in the workspace") {
  const TempDir dir;
  const std::filesystem::path folder = dir / "work";
  { const Workspace workspace(folder); }
  for (const char* name : {"boeing.jpg", "1-2", "notes-0123456789abcdef", "-0123456789012345", ".profile"}) {
    write_text(folder / "planes" / name, "mine");
    write_text(folder / "points" / name, "mine");
  }
  write_text(folder / "planes" / ".1-00112233445566aa.77-0.tmp", "of a killed run");
  Workspace workspace(folder);
  workspace.save_planes(kOld, PlaneMap(4, 2));
  workspace.commit({});
  CHECK_FALSE(std::filesystem::exists(folder / "planes" / kOld));
  std::size_t left = 0;
  for (const char* part : {"planes", "points"}) {
    for (const auto& file : std::filesystem::directory_iterator(folder / part)) left += file.is_regular_file();
  }
  CHECK(left == 10);
}

TEST_CASE("saved files are written at the latest when the workspace is closed") {
  constexpr int kFiles = 200;
  const TempDir dir;
  const auto name_of = [](int id) { return std::to_string(id) + "-0123456789abcdef"; };
  const auto save = [&](Workspace& workspace, int first) {
    for (int id = first; id < first + kFiles; ++id) {
      PlaneMap planes(8, 4);
      planes.keyframe_id = id;
      KeyframeCloud cloud;
      cloud.keyframe_id = id;
      cloud.points.resize(static_cast<std::size_t>(id));
      workspace.save_planes(name_of(id), planes);
      workspace.save_points(name_of(id), cloud);
    }
  };
  {
    Workspace workspace(dir / "work");
    save(workspace, 0);
    workspace.wait_until_saved();
    for (int id = 0; id < kFiles; ++id) {
      REQUIRE(workspace.load_planes(name_of(id)).keyframe_id == id);
      REQUIRE(workspace.load_points(name_of(id)).points.size() == static_cast<std::size_t>(id));
    }
    save(workspace, kFiles);
  }
  const Workspace workspace(dir / "work");
  for (int id = 0; id < 2 * kFiles; ++id) {
    REQUIRE(workspace.load_planes(name_of(id)).keyframe_id == id);
    REQUIRE(workspace.load_points(name_of(id)).points.size() == static_cast<std::size_t>(id));
  }
}

TEST_CASE("an unwritable file fails one wait and later files are saved") {
  const TempDir dir;
  Workspace workspace(dir / "work");
  std::filesystem::create_directories(dir / "work" / "planes" / kKept);
  workspace.save_planes(kKept, PlaneMap(4, 2));
  CHECK_THROWS_WITH(workspace.wait_until_saved(), Contains(kKept) && Contains("names a directory"));
  CHECK_NOTHROW(workspace.wait_until_saved());
  workspace.save_planes(kOld, PlaneMap(4, 2));
  CHECK_NOTHROW(workspace.wait_until_saved());
  CHECK(workspace.load_planes(kOld).width() == 4);
  workspace.save_planes(kKept, PlaneMap(4, 2));
  CHECK_THROWS_AS(workspace.commit({}), OutputError);
}

TEST_CASE("a workspace no longer needed is removed and other files stay") {
  const TempDir dir;
  for (const bool has_others : {false, true}) {
    CAPTURE(has_others);
    const std::filesystem::path folder = dir / "work";
    {
      Workspace workspace(folder);
      workspace.save_planes(kKept, PlaneMap(4, 2));
      workspace.commit(record_naming(kKept));
      workspace.save_planes(kOld, PlaneMap(4, 2));
      workspace.save_points(kOld, {});
      if (has_others) write_text(folder / "planes" / "notes.txt", "mine");
      workspace.remove();
    }
    CHECK(std::filesystem::exists(folder) == has_others);
    CHECK_FALSE(std::filesystem::exists(folder / "planes" / kKept));
    CHECK_FALSE(std::filesystem::exists(folder / "planes" / kOld));
  }
  CHECK(std::filesystem::exists(dir / "work" / "planes" / "notes.txt"));
  CHECK_NOTHROW(Workspace(dir / "work"));  // the remains are a workspace
}

TEST_CASE("a directory is a workspace once created and may be a symbolic link") {
  const TempDir dir;
  std::filesystem::create_directories(dir / "elsewhere");
  std::filesystem::create_directory_symlink(dir / "elsewhere", dir / "work");
  { const Workspace workspace(dir / "work"); }
  CHECK(std::filesystem::exists(dir / "elsewhere" / "workspace.json"));
  CHECK_NOTHROW(Workspace(dir / "work"));
}

TEST_CASE("a workspace is locked for other processes") {
  const TempDir dir;
  {
    const Workspace workspace(dir / "work");
    CHECK_THROWS_WITH(Workspace(dir / "work"), Contains("work") && Contains("another process"));
    CHECK_THROWS_AS(Workspace(dir / "work"), OutputError);
  }
  CHECK_NOTHROW(Workspace(dir / "work"));
}

TEST_CASE("shards share a workspace with each other and with no other process") {
  using Access = Workspace::Access;
  const TempDir dir;
  const auto refuses = [&](Access access) {
    CHECK_THROWS_WITH(Workspace(dir / "work", access), Contains("another process"));
  };
  {
    const Workspace first(dir / "work", Access::kShared);
    const Workspace second(dir / "work", Access::kShared);
    refuses(Access::kAlone);
    refuses(Access::kMerge);
  }
  {
    const Workspace workspace(dir / "work", Access::kMerge);
    refuses(Access::kShared);
  }
  CHECK_NOTHROW(Workspace(dir / "work"));
}

TEST_CASE("image records are kept until a step ends") {
  const TempDir dir;
  Workspace workspace(dir / "work", Workspace::Access::kShared);
  CHECK_FALSE(workspace.find_image_record(kKept));
  workspace.save_image_record(kKept, {64, 32, {{{7, 0.5F, 0.25F}}}});
  const auto look = workspace.find_image_record(kKept);
  REQUIRE(look);
  CHECK((look->width == 64 && look->height == 32));
  REQUIRE(look->sharpness.landmarks.size() == 1);
  CHECK(look->sharpness.landmarks[0].id == 7);
  CHECK(look->sharpness.landmarks[0].vertical == 0.25F);
  write_text(dir / "work/image_records" / kOld, "pmsp look      1");
  CHECK_THROWS_WITH(workspace.find_image_record(kOld), Contains("damaged"));
  workspace.commit({});
  CHECK_FALSE(workspace.find_image_record(kKept));
}

TEST_CASE("image records of a workspace with their former folder name are found") {
  const TempDir dir;
  const ImageRecord record{64, 32, {{{7, 0.5F, 0.25F}}}};
  Workspace(dir / "work", Workspace::Access::kShared).save_image_record(kKept, record);
  std::filesystem::rename(dir / "work/image_records", dir / "work/looks");
  CHECK(Workspace(dir / "work", Workspace::Access::kShared).find_image_record(kKept));
  CHECK_FALSE(std::filesystem::exists(dir / "work/looks"));
}

TEST_CASE("a directory with foreign files is no workspace") {
  const TempDir dir;
  write_text(dir / "photo.jpg", "mine");
  CHECK_THROWS_WITH(Workspace(dir.path()), Contains("not empty"));
  CHECK(dir.entries() == 1);
  write_text(dir / "workspace.json", "{}");
  CHECK_THROWS_WITH(Workspace(dir.path()), Contains("workspace.json"));
  CHECK(std::filesystem::exists(dir / "photo.jpg"));
  std::filesystem::remove(dir / "workspace.json");
  std::filesystem::create_directories(dir / "planes");
  CHECK_THROWS_WITH(Workspace(dir.path()), Contains("not empty"));
  CHECK_THROWS_AS(Workspace(dir / "photo.jpg"), Error);
}
