// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "pmsp/error.h"
#include "support/temp_dir.h"
#include "workspace/shards.h"

using namespace pmsp;
using namespace pmsp::workspace;
using Catch::Contains;
using pmsp_test::TempDir;
using pmsp_test::write_text;

namespace {

ShardJob some_job() {
  ShardJob job;
  job.step = "0123456789abcdef";
  job.count = 3;
  job.engine = "a machine";
  job.build = "a program";
  job.options = R"({"width":64,"threads":1,"fusion":{"window":4,"spacing_px":0.5}})";
  job.map = "../map.msg";
  job.map_bytes = "m";
  job.images = "../images";
  job.fps = 29.97;
  job.frame_offset = -3;
  return job;
}

ShardMarker some_marker(int index, Wave wave = Wave::kPlanes) {
  ShardMarker marker;
  marker.shard = {index, 3};
  marker.wave = wave;
  marker.step = some_job().step;
  marker.engine = some_job().engine;
  marker.build = some_job().build;
  marker.host = "node7";
  marker.seconds = 1.5;
  marker.keyframes = 4;
  marker.made = 3;
  marker.without = {12};
  return marker;
}

}  // namespace

TEST_CASE("ranges of shards partition the list in order and nearly equally", "[shards]") {
  for (const int count : {1, 2, 3, 7, 64}) {
    for (const std::size_t size : {std::size_t{0}, std::size_t{1}, std::size_t{6}, std::size_t{7}, std::size_t{1000}}) {
      std::size_t next = 0, least = size, most = 0;
      for (int index = 0; index < count; ++index) {
        const IdRange stretch = id_range_of({index, count}, size);
        CHECK(stretch.first == next);
        REQUIRE(stretch.last >= stretch.first);
        least = std::min(least, stretch.last - stretch.first);
        most = std::max(most, stretch.last - stretch.first);
        next = stretch.last;
      }
      CHECK(next == size);
      CHECK(most - std::min(least, most) <= 1);
    }
  }
}

TEST_CASE("the first job is kept for comparison by others", "[shards]") {
  const TempDir dir;
  const ShardFolder folder(dir / "shards");
  CHECK_FALSE(folder.job(""));
  folder.make();
  ShardJob job = some_job();
  CHECK(difference(folder.post(job), job).empty());
  job.count = 4;
  const ShardJob first = folder.post(job);
  CHECK(first.count == 3);
  CHECK(first.fps == 29.97);
  CHECK(first.frame_offset == -3);
  CHECK(first.images == "../images");
  CHECK(first.options == some_job().options);
  CHECK_THAT(difference(job, first), Contains("one of 4 shards, not of 3"));
  CHECK_FALSE(folder.job("fedcba9876543210"));
  CHECK(folder.ended_job(job.step));
  CHECK_FALSE(folder.ended_job("other"));
  write_text(dir / "shards/job-new.json", "{");
  CHECK_THROWS_WITH(folder.job(""), Contains("job-new.json") && Contains("damaged"));
}

TEST_CASE("jobs differ by the inputs of their results and the difference is named", "[shards]") {
  const ShardJob job = some_job();
  const auto differs = [&](const auto& change) {
    ShardJob mine = job;
    change(mine);
    return difference(mine, job);
  };
  CHECK(differs([](ShardJob& mine) { mine.map = mine.images = "elsewhere"; }).empty());
  CHECK(differs([](ShardJob& mine) { mine.step = mine.engine = mine.build = ""; }).empty());
  CHECK(differs([](ShardJob& mine) {
          mine.options = R"({"width":64,"threads":8,"fusion":{"window":4,"spacing_px":0.5}})";
        }).empty());
  CHECK_THAT(differs([](ShardJob& mine) {
               mine.options = R"({"width":96,"threads":1,"fusion":{"window":4,"spacing_px":0.75}})";
             }),
             Contains("fusion.spacing_px 0.75 instead of 0.5") && Contains("width 96"));
  CHECK_THAT(differs([](ShardJob& mine) { mine.map_bytes = "n"; }), Contains("map"));
  CHECK_THAT(differs([](ShardJob& mine) { mine.mask_bytes = "n"; }), Contains("mask"));
  CHECK_THAT(differs([](ShardJob& mine) { mine.engine = "b"; }), Contains("\"b\"") && Contains("\"a machine\""));
  CHECK_THAT(differs([](ShardJob& mine) { mine.build = "b"; }), Contains("\"b\"") && Contains("\"a program\""));
  CHECK_THAT(differs([](ShardJob& mine) { mine.step = "b"; }), Contains("images"));
  CHECK_THAT(differs([](ShardJob& mine) { mine.points = "b"; }), Contains("--points"));
  CHECK_THAT(differs([](ShardJob& mine) { mine.image_list = "b"; }), Contains("--image-list"));
  CHECK_THAT(differs([](ShardJob& mine) { mine.component = 1; }), Contains("--component"));
  CHECK_THAT(differs([](ShardJob& mine) { mine.fps = 25.0; }), Contains("--fps"));
  CHECK_THAT(differs([](ShardJob& mine) { mine.frame_offset = 0; }), Contains("--frame-offset"));
}

TEST_CASE("shards store their state and a failure never replaces a success", "[shards]") {
  const TempDir dir;
  const ShardFolder folder(dir / "shards");
  CHECK(folder.markers().empty());
  folder.make();
  folder.post(some_job());
  folder.mark(some_marker(1, Wave::kPoints));
  folder.mark(some_marker(2));
  ShardMarker failed = some_marker(0);
  failed.failure = "the disk is full";
  folder.mark(failed);
  std::vector<ShardMarker> markers = folder.markers();
  REQUIRE(markers.size() == 3);
  CHECK(markers[0].failure == "the disk is full");
  CHECK(markers[0].host == "node7");
  CHECK((markers[1].shard.index == 2 && markers[1].failure.empty() &&
         markers[1].without == std::vector<std::int64_t>{12}));
  CHECK(markers[2].wave == Wave::kPoints);
  folder.mark(some_marker(0));
  folder.mark(failed);
  markers = folder.markers();
  CHECK(markers[0].failure.empty());
  CHECK(difference(markers[0], some_job()).empty());
  markers[0].engine = "b";
  CHECK_THAT(difference(markers[0], some_job()), Contains("\"b\"") && Contains("\"a machine\""));
  write_text(dir / "shards/notes.txt", "mine");
  folder.end(some_job().step);
  CHECK(folder.markers().empty());
  CHECK(folder.job(""));
  folder.end("another step");
  CHECK_FALSE(folder.job(""));
  CHECK(std::filesystem::exists(dir / "shards/notes.txt"));
}
