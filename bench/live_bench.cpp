// SPDX-License-Identifier: BSD-2-Clause
// pmsp-live-bench: load of a LiveDensifier on the SLAM beside it, and its latency.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "fake_slam.h"
#include "pmsp-densify/exit_code.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud.h"
#include "pmsp/io/images.h"
#include "pmsp/io/map.h"
#include "pmsp/live.h"
#include "pmsp/version.h"
#include "synth/mission.h"

namespace pmsp::bench {
namespace {

using Clock = std::chrono::steady_clock;

constexpr const char* kFooter =
    R"(With MAP and IMAGES the mission is played at its own speed by a fake SLAM, which moves each keyframe about thirty
times. --busy threads stand for its processor time until the last keyframe: each works for 70 ms and rests for 30. What
they get done is compared with what they get done in as much time before and after the flight. Without a mission, calls
are timed: keyframes of 64 x 32 pixels, 13 to a room, in as many rooms as it takes; or, with --one-room, in one that is
flown through again and again, where time and memory must not grow.

Examples:
  pmsp-live-bench map.msg keyframes/ --busy 2 --backend cpu -o live.ply
  pmsp-live-bench --keyframes 1000
  pmsp-live-bench --keyframes 10000 --one-room

Exit codes: 0 done, 2 wrong usage, 3 input, 4 no such backend, 6 the cloud cannot be written.)";

struct Arguments {
  std::string map, images, cloud, quality = "online", backend = "auto";
  double speed = 1.0;
  double drift = 0.0;
  int busy = 0;
  int keyframes = 1000;
  bool one_room = false;
};

std::optional<Arguments> parse_arguments(int argc, char** argv) {
  Arguments arguments;
  CLI::App app("Plays a mission beside busy threads, or times the calls of LiveDensifier.", "pmsp-live-bench");
  app.footer(kFooter);
  app.set_version_flag("--version", std::string("pmsp-live-bench ") + PMSP_VERSION_STRING);
  CLI::Option* const map = app.add_option("MAP", arguments.map, "map of a SLAM")->check(CLI::ExistingFile);
  map->needs(
      app.add_option("IMAGES", arguments.images, "folder of its keyframes' images")->check(CLI::ExistingDirectory));
  app.add_option("--quality", arguments.quality, "preset: paper, online, normal, high; default online");
  app.add_option("--backend", arguments.backend, "auto, cpu, cuda; default auto");
  app.add_option("--speed", arguments.speed, "times as fast as it was flown, 0.01 to 100; default 1")
      ->check(CLI::Range(0.01, 100.0));
  app.add_option("--drift", arguments.drift, "of the scale until the loop is closed, 0 to 1; default 0")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--busy", arguments.busy, "busy threads, 0 to 256; default 0")->check(CLI::Range(0, 256));
  app.add_option("-o,--output", arguments.cloud, "write the final points to this PLY file")->needs(map);
  app.add_option("--keyframes", arguments.keyframes, "of the timed calls, 13 to 1000000; default 1000")
      ->check(CLI::Range(13, 1000000));
  app.add_flag("--one-room", arguments.one_room, "all of these are in one room");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {
      app.exit(error);
      return std::nullopt;
    }
    throw tool::UsageError(std::string(error.what()) + "; see pmsp-live-bench --help");
  }
  return arguments;
}

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// `share`: 0.5 = the median.
double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(std::lround(share * static_cast<double>(values.size() - 1)))];
}

LiveOptions live_options(const Arguments& arguments) {
  LiveOptions options;
  options.densifier = preset(quality_from_name(arguments.quality));
  options.densifier.backend = backend_from_name(arguments.backend);
  return options;
}

LiveCallbacks report_errors() {
  LiveCallbacks callbacks;
  callbacks.on_error = [](const std::string& what) { std::fprintf(stderr, "pmsp-live-bench: %s\n", what.c_str()); };
  return callbacks;
}

LiveImage live_image(std::shared_ptr<const Image<Rgb>> image) {
  LiveImage result;
  result.data = &image->pixels().data()->r;
  result.width = image->width();
  result.height = image->height();
  result.owner = std::move(image);
  return result;
}

/// Load of a SLAM: each thread does work of 70 ms on an idle machine, then sleeps for 30 ms.
class BusyThreads {
 public:
  explicit BusyThreads(int count) {
    if (count == 0) return;
    const Clock::time_point start = Clock::now();
    std::uint64_t rounds = 0;
    for (; seconds_since(start) < 1.0; ++rounds) spin(1);
    rounds_ = static_cast<std::uint64_t>(0.07 * static_cast<double>(rounds));
    for (int i = 0; i < count; ++i) threads_.emplace_back([this] { work(); });
  }
  ~BusyThreads() { stop(); }
  BusyThreads(const BusyThreads&) = delete;
  BusyThreads& operator=(const BusyThreads&) = delete;

  void stop() {
    ends_ = true;
    for (std::thread& thread : threads_) thread.join();
    threads_.clear();
  }
  std::int64_t done() const { return done_; }

  /// Returns the pieces of work per second.
  double rate(double seconds) const {
    const std::int64_t before = done_;
    const Clock::time_point start = Clock::now();
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    return static_cast<double>(done_ - before) / seconds_since(start);
  }

 private:
  static void spin(std::uint64_t rounds) {
    std::uint64_t state = rounds;
    for (std::uint64_t i = 0; i < 20000 * rounds; ++i) {
      state = state * 6364136223846793005ULL + 1442695040888963407ULL;
      asm volatile("" : "+r"(state));
    }
  }
  void work() {
    constexpr std::uint64_t kPieces = 70;  // of a millisecond each
    while (!ends_) {
      for (std::uint64_t piece = 0; piece < kPieces; ++piece) {
        spin(rounds_ / kPieces);
        ++done_;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(30));
    }
  }

  std::uint64_t rounds_ = 0;
  std::atomic<std::int64_t> done_{0};
  std::atomic<bool> ends_{false};
  std::vector<std::thread> threads_;
};

struct PlayedMission {
  std::vector<LiveKeyframe> keyframes;
  std::vector<double> seconds;  ///< from the first one
};

PlayedMission read_mission(const Arguments& arguments) {
  const SlamMap map = read_map(arguments.map);
  const std::unique_ptr<ImageSource> images = open_image_folder(map, arguments.images);
  PlayedMission mission;
  double start = 0.0;
  while (std::optional<ImageSource::Item> item = images->next()) {
    const MapKeyframe& in_map = *map.find_keyframe(item->keyframe_id);
    const Keyframe from = keyframe_of(map, in_map);
    LiveKeyframe keyframe;
    keyframe.id = from.id;
    keyframe.cam_from_world = from.cam_from_world;
    keyframe.landmarks = from.landmarks;
    keyframe.pose_error = from.pose_error;
    keyframe.image = live_image(std::make_shared<Image<Rgb>>(std::move(item->image)));
    if (mission.keyframes.empty()) start = in_map.timestamp;
    mission.seconds.push_back(in_map.timestamp - start);
    mission.keyframes.push_back(std::move(keyframe));
  }
  if (mission.keyframes.empty()) throw InvalidInput(arguments.images + ": no image of a keyframe of " + arguments.map);
  return mission;
}

/// Times of keyframes and of their first points.
class Delays {
 public:
  void watch(LiveDensifier* live) {
    const std::lock_guard<std::mutex> lock(mutex_);
    live_ = live;
  }
  void came(std::int64_t id) {
    const std::lock_guard<std::mutex> lock(mutex_);
    came_[id] = Clock::now();
  }
  /// On the worker's thread.
  void look() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (live_ == nullptr) return;
    const LiveChanges changes = live_->changes_since(version_);
    version_ = changes.to;
    for (const auto* clouds : {&changes.added, &changes.replaced}) {
      for (const LiveCloud& cloud : *clouds) {
        if (came_.count(cloud.keyframe_id) != 0)
          seen_.try_emplace(cloud.keyframe_id, seconds_since(came_.at(cloud.keyframe_id)));
      }
    }
  }
  /// Returns the delays of all keyframes, 1e9 without points.
  std::vector<double> seconds() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::vector<double> result;
    for (const auto& [id, when] : came_) result.push_back(seen_.count(id) != 0 ? seen_.at(id) : 1e9);
    return result;
  }

 private:
  LiveDensifier* live_ = nullptr;
  mutable std::mutex mutex_;
  std::map<std::int64_t, Clock::time_point> came_;
  std::map<std::int64_t, double> seen_;
  LiveVersion version_ = 0;
};

void write_cloud(const LiveSnapshot& snapshot, const std::string& path) {
  CloudOutput output(path);
  for (const LiveCloud& cloud : snapshot.clouds) {
    if (!cloud.preliminary) output.add(*cloud.cloud, cloud.pose);
  }
  output.commit();
}

void play(const Arguments& arguments) {
  const PlayedMission mission = read_mission(arguments);
  const double end = mission.seconds.back() / arguments.speed;
  BusyThreads busy(arguments.busy);
  const double before = arguments.busy > 0 ? busy.rate(end) : 0.0;
  Delays delays;
  LiveCallbacks callbacks = report_errors();
  callbacks.changed = [&](LiveVersion) { delays.look(); };
  LiveDensifier live(live_options(arguments), callbacks);
  delays.watch(&live);
  FakeSlam slam(mission.keyframes, arguments.drift);
  std::vector<double> calls;
  const std::int64_t begun = busy.done();
  const Clock::time_point start = Clock::now();
  for (std::size_t k = 0; k < slam.size(); ++k) {
    const std::chrono::duration<double> at(mission.seconds[k] / arguments.speed);
    std::this_thread::sleep_until(start + std::chrono::duration_cast<Clock::duration>(at));
    LiveKeyframe keyframe = slam.next();
    delays.came(keyframe.id);
    const Clock::time_point call = Clock::now();
    live.add(std::move(keyframe));
    live.update(slam.moved());
    calls.push_back(1e3 * seconds_since(call));
  }
  const double flown = seconds_since(start);
  const double beside = static_cast<double>(busy.done() - begun) / flown;
  live.update(slam.closed());
  live.finish();
  const Clock::time_point last = Clock::now();
  const LiveStats at_end = live.stats();
  const LiveBacklog backlog = live.backlog();
  double after = 0.0;
  busy.stop();
  double complete = -1.0;
  std::optional<double> at_20, at_35;
  const auto write_at = [&](std::optional<double>& done, double seconds, const char* suffix) {
    if (done || seconds_since(last) < seconds || arguments.cloud.empty()) return;
    done = seconds_since(last);
    write_cloud(*live.snapshot(), arguments.cloud + suffix);
  };
  while (!live.wait(std::chrono::milliseconds(20))) {
    if (complete < 0.0 && live.backlog().waiting == 0 && live.backlog().unstable == 0) complete = seconds_since(last);
    write_at(at_20, 20.0, ".20s.ply");
    write_at(at_35, 35.0, ".35s.ply");
  }
  const double idle = seconds_since(last);
  if (complete < 0.0) complete = idle;
  if (arguments.busy > 0) {
    BusyThreads again(arguments.busy);
    after = again.rate(end);
  }
  const LiveStats stats = live.stats();
  std::printf("%s; %zu keyframes in %.1f s, %lld used, %lld left out for being late\n", live.backend().c_str(),
              slam.size(), flown, static_cast<long long>(stats.used), static_cast<long long>(stats.dropped_late));
  if (arguments.busy > 0) {
    std::printf("busy threads: %.0f pieces of work a second before, %.0f beside, %.0f after: %.1f %% lost\n", before,
                beside, after, 100.0 * (1.0 - 2.0 * beside / (before + after)));
  }
  std::printf("add and update together: median %.2f ms, most %.2f ms\n", quantile(calls, 0.5), quantile(calls, 1.0));
  const std::vector<double> first = delays.seconds();
  std::printf("first points after the image: median %.2f s, 95 %% within %.2f s, of %zu keyframes %zu without\n",
              quantile(first, 0.5), quantile(first, 0.95), first.size(),
              static_cast<std::size_t>(std::count(first.begin(), first.end(), 1e9)));
  std::printf("at the last keyframe: %lld waiting, %lld unstable, %lld MiB\n", static_cast<long long>(backlog.waiting),
              static_cast<long long>(backlog.unstable), static_cast<long long>(at_end.memory_mib));
  std::printf("after it: none waits after %.1f s, nothing to do after %.1f s\n", complete, idle);
  const auto work = [](const char* when, const LiveStats& of) {
    std::printf("work %s: %lld passes, %lld keyframes matched again, %lld clouds, %lld previews\n", when,
                static_cast<long long>(of.passes), static_cast<long long>(of.matched_again),
                static_cast<long long>(of.clouds), static_cast<long long>(of.previews));
  };
  work("until the last keyframe", at_end);
  work("in all", stats);
  std::printf("lenses: %.4f apart\n", stats.lens_distance);
  delays.watch(nullptr);
  if (!arguments.cloud.empty()) write_cloud(*live.snapshot(), arguments.cloud);
  if (stats.errors > 0) throw Error(stats.last_error);
}

constexpr int kRoom = 13;

/// Returns keyframes of rooms: another room for each traversal, or the same one again.
std::vector<LiveKeyframe> rooms(int count, bool one_room) {
  synth::Recipe recipe;
  recipe.width = 64;
  recipe.height = 32;
  recipe.keyframes = kRoom;
  recipe.mission.render.samples = 1;
  recipe.mission.landmarks.count = 400;
  const synth::Mission mission = synth::textured_room(recipe);
  std::vector<LiveKeyframe> keyframes;
  for (int n = 0; n < count; ++n) {
    const int room = one_room ? 0 : n / kRoom;
    const synth::Frame& frame = mission.frames[static_cast<std::size_t>(n % kRoom)];
    const Eigen::Vector3d offset(0.0, 0.0, 100.0 * room);
    LiveKeyframe keyframe;
    keyframe.id = n;
    keyframe.cam_from_world = frame.cam_from_world;
    keyframe.cam_from_world.translation -= frame.cam_from_world.rotation * offset;
    for (const Landmark& landmark : frame.landmarks) {
      const std::int64_t id = landmark.id + static_cast<std::int64_t>(room) * 100000;
      keyframe.landmarks.push_back({id, landmark.position_world + offset});
    }
    keyframe.image = live_image(std::make_shared<Image<Rgb>>(frame.image));
    keyframes.push_back(std::move(keyframe));
  }
  return keyframes;
}

void time_calls(const Arguments& arguments) {
  std::vector<LiveKeyframe> keyframes = rooms(arguments.keyframes, arguments.one_room);
  LiveOptions options = live_options(arguments);
  options.densifier.width = 64;
  options.densifier.height = 32;
  LiveDensifier live(options, report_errors());
  std::vector<double> adds, tenths;
  std::vector<std::int64_t> memory;
  Clock::time_point begin = Clock::now();
  const std::size_t tenth = keyframes.size() / 10;
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    LiveKeyframe keyframe = keyframes[k];
    const Clock::time_point call = Clock::now();
    live.add(std::move(keyframe));
    adds.push_back(1e3 * seconds_since(call));
    if (k % kRoom == kRoom - 1) live.wait(std::chrono::minutes(1));
    if ((k + 1) % tenth != 0) continue;
    tenths.push_back(1e3 * seconds_since(begin) / static_cast<double>(tenth));
    memory.push_back(live.stats().memory_mib);
    begin = Clock::now();
  }
  live.finish();
  live.wait(std::chrono::minutes(30));
  std::printf("%s; %d keyframes in %s, %zu clouds\n", live.backend().c_str(), arguments.keyframes,
              arguments.one_room ? "one room" : "rooms of 13", live.snapshot()->clouds.size());
  std::printf("add: median %.3f ms, 99 %% within %.3f ms, most %.3f ms\n", quantile(adds, 0.5), quantile(adds, 0.99),
              quantile(adds, 1.0));
  std::printf("ms a keyframe, by tenths of the flight:");
  for (const double ms : tenths) std::printf(" %.2f", ms);
  std::printf("\nMiB kept besides points:");
  for (const std::int64_t mib : memory) std::printf(" %lld", static_cast<long long>(mib));
  std::printf("\n");
  std::size_t landmarks = 0;
  for (const LiveKeyframe& keyframe : keyframes) landmarks += keyframe.landmarks.size();
  const auto time = [&](const char* what, bool with_landmarks, const auto& tell) {
    std::vector<double> calls;
    for (int i = 0; i < 10; ++i) {
      std::vector<LiveKeyframe> now;
      for (LiveKeyframe& keyframe : keyframes) {
        keyframe.cam_from_world.translation *= 1.0001;
        now.push_back({keyframe.id, keyframe.cam_from_world, {}, {}, 0});
        if (with_landmarks) now.back().landmarks = keyframe.landmarks;
      }
      const Clock::time_point call = Clock::now();
      tell(now);
      live.snapshot();
      calls.push_back(1e3 * seconds_since(call));
    }
    std::printf("%s until a snapshot shows it: median %.2f ms, most %.2f ms\n", what, quantile(calls, 0.5),
                quantile(calls, 1.0));
  };
  const auto update = [&](const std::vector<LiveKeyframe>& now) { live.update(now); };
  const auto sync = [&](const std::vector<LiveKeyframe>& now) { live.sync(now); };
  std::printf("%.0f landmarks a keyframe\n", static_cast<double>(landmarks) / static_cast<double>(keyframes.size()));
  time("update of all poses", false, update);
  time("sync of all poses", false, sync);
  time("update of all, with landmarks,", true, update);
  time("sync of all, with landmarks,", true, sync);
}

}  // namespace
}  // namespace pmsp::bench

int main(int argc, char** argv) {
  try {
    const std::optional<pmsp::bench::Arguments> arguments = pmsp::bench::parse_arguments(argc, argv);
    if (arguments) arguments->map.empty() ? pmsp::bench::time_calls(*arguments) : pmsp::bench::play(*arguments);
    return pmsp::tool::kExitOk;
  } catch (const std::exception& error) {
    std::cerr << "pmsp-live-bench: " << error.what() << '\n';
    return pmsp::tool::exit_code_of(error);
  }
}
