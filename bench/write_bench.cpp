// SPDX-License-Identifier: BSD-2-Clause
#include "write_bench.h"
#include "machine.h"

#include <sched.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <string>
#include <system_error>
#include <vector>

#include "pmsp-densify/exit_code.h"
#include "pmsp/error.h"
#include "pmsp/io/cloud.h"
#include "pmsp/stages.h"
#include "util/thread_pool.h"

namespace pmsp::bench {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kOfKeyframe = 1'000'000;
constexpr double kStep = 0.5;  ///< distance between keyframes

struct WriteArguments {
  std::int64_t points = 100'000'000;
  std::vector<std::string> formats;
  fs::path folder = ".";
  int cores = 1;
  bool keep = false;
  CloudSelection amount;
};

/// Returns the view of a keyframe in a corridor with pillars, in camera frame.
KeyframeCloud corridor() {
  KeyframeCloud cloud;
  cloud.points.resize(kOfKeyframe);
  cloud.pixels.resize(kOfKeyframe);
  std::uint64_t state = 1;
  const auto draw = [&state] {
    state = state * 6364136223846793005U + 1442695040888963407U;
    return static_cast<float>(state >> 40) / 16777216.0F;
  };
  for (std::size_t i = 0; i < kOfKeyframe; ++i) {
    CloudPoint& p = cloud.points[i];
    const float longitude = 6.2831853F * draw(), sine = 2.0F * draw() - 1.0F;
    const float cosine = std::sqrt(1.0F - sine * sine);
    const Eigen::Vector3f ray(cosine * std::sin(longitude), sine, cosine * std::cos(longitude));
    const Eigen::Vector3f half(2.0F, 1.5F, 6.0F + std::sin(40.0F * longitude));
    const Eigen::Vector3f to_wall = half.cwiseQuotient(ray.cwiseAbs().cwiseMax(1e-3F));
    int axis = 0;
    const float distance = to_wall.minCoeff(&axis);
    p.position = (distance + 0.01F * (draw() - 0.5F)) * ray;
    p.normal[axis] = ray[axis] > 0.0F ? -1.0F : 1.0F;
    p.color = {static_cast<std::uint8_t>(255.0F * draw()), static_cast<std::uint8_t>(40 * axis), 90};
    p.views = static_cast<std::uint8_t>(3 + i % 4);
    p.confidence = draw();
    cloud.pixels[i] = static_cast<std::uint32_t>(i);
  }
  return cloud;
}

double seconds_of(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

std::uintmax_t bytes_of(const fs::path& path) {
  if (!fs::is_directory(path)) return fs::file_size(path);
  std::uintmax_t bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(path))
    bytes += entry.is_regular_file() ? entry.file_size() : 0;
  return bytes;
}

/// Restricts the process to the first of its available cores.
void stay_on(int cores) {
  cpu_set_t all, some;
  CPU_ZERO(&some);
  bool is_done = sched_getaffinity(0, sizeof(all), &all) == 0;
  for (int i = 0; is_done && i < CPU_SETSIZE && CPU_COUNT(&some) < cores; ++i) {
    if (CPU_ISSET(i, &all)) CPU_SET(i, &some);
  }
  is_done = is_done && sched_setaffinity(0, sizeof(some), &some) == 0;
  if (!is_done) throw BackendUnavailable("the system does not let this program choose its cores");
}

/// Runs in its own process, to measure the memory of one format.
void write_one(const WriteArguments& arguments, const CloudFormat& format, const fs::path& path) {
  stay_on(arguments.cores);
  KeyframeCloud cloud = corridor();
  CloudHeader header;
  header.generator = "pmsp-bench";
  const auto keyframes = static_cast<std::int64_t>((arguments.points + kOfKeyframe - 1) / kOfKeyframe);
  const double length = kStep * static_cast<double>(keyframes);
  header.center = {0.0, 0.0, 0.5 * length};
  header.reach = 0.5 * length + 8.0;
  header.scratch = arguments.folder;
  rusage before{}, after{};
  getrusage(RUSAGE_SELF, &before);
  const auto start = std::chrono::steady_clock::now();
  CloudOutput output(header, arguments.amount, {{&format, path}});
  for (std::int64_t i = 0; i < keyframes; ++i) {
    cloud.keyframe_id = i;
    cloud.cam_from_world.translation.z() = -kStep * static_cast<double>(i);
    const std::int64_t left = arguments.points - i * static_cast<std::int64_t>(kOfKeyframe);
    if (left < static_cast<std::int64_t>(kOfKeyframe)) {
      cloud.points.resize(static_cast<std::size_t>(left));
      cloud.pixels.resize(static_cast<std::size_t>(left));
    }
    output.add(cloud);
  }
  output.complete();
  output.commit();
  const double wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  getrusage(RUSAGE_SELF, &after);
  const double cpu = seconds_of(after.ru_utime) - seconds_of(before.ru_utime) + seconds_of(after.ru_stime) -
                     seconds_of(before.ru_stime);
  const auto millions = static_cast<double>(arguments.points) * 1e-6;
  std::printf("%-11s %12lld %9.1f %9.1f %8.1f %8.1f %8.1f %8.0f\n", format.name,
              static_cast<long long>(output.points()), wall, cpu, millions / wall, millions / cpu,
              static_cast<double>(bytes_of(path)) * 1e-9,
              static_cast<double>(after.ru_maxrss - before.ru_maxrss) / 1024.0);
  std::fflush(stdout);
}

/// Returns the child's exit code.
int in_child(const WriteArguments& arguments, const CloudFormat& format, const fs::path& path) {
  std::cout.flush();
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("no process can be started");
  if (child == 0) {
    int code = tool::kExitOk;
    try {
      write_one(arguments, format, path);
    } catch (const std::exception& error) {
      std::cerr << "pmsp-bench: " << error.what() << '\n';
      code = tool::exit_code_of(error);
    }
    _exit(code);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : tool::kExitUnexpected;
}

void check(const WriteArguments& arguments) {
  for (const std::string& name : arguments.formats) {
    const CloudFormat* const format = find_cloud_format(name);
    if (format == nullptr || format->is_map) throw tool::UsageError("--formats: there is no cloud format " + name);
  }
  if (arguments.points < 1) throw tool::UsageError("--points must be at least 1");
  if (arguments.cores < 1 || arguments.cores > usable_cpus()) {
    throw tool::UsageError("--cores must be from 1 to " + std::to_string(usable_cpus()));
  }
}

}  // namespace

int write_bench(int argc, char** argv) {
  WriteArguments arguments;
  for (const CloudFormat& format : cloud_formats()) {
    if (!format.is_map) arguments.formats.emplace_back(format.name);
  }
  CLI::App app("Times of the cloud's writers, from points in memory to files on the disk, on one core.\n",
               "pmsp-bench write");
  app.add_option("--points", arguments.points, "How many [default 100000000]")->type_name("N");
  app.add_option("--formats", arguments.formats, "Which [default all of clouds]")->type_name("NAMES")->delimiter(',');
  app.add_option("--folder", arguments.folder, "Existing folder to write to [default .]")->type_name("DIR");
  app.add_option("--cores", arguments.cores, "Cores to run on [default 1]")->type_name("N");
  app.add_option("--voxel", arguments.amount.thinning.voxel, "Thin the points, as pmsp-densify --voxel")
      ->type_name("L");
  app.add_option("--max-points", arguments.amount.thinning.max_points, "The same, as --max-points")->type_name("N");
  app.add_flag("--keep", arguments.keep, "Do not remove the files");
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    std::cout << app.help();
    return tool::kExitOk;
  } catch (const CLI::ParseError& error) {
    throw tool::UsageError(error.what());
  }
  check(arguments);
  std::printf("format            points    wall s     CPU s  M/s wall  M/s CPU       GB  MiB more\n");
  int code = tool::kExitOk;
  for (const std::string& name : arguments.formats) {
    const CloudFormat& format = *find_cloud_format(name);
    const fs::path path = arguments.folder / ("write-bench" + std::string(format.extension));
    code = std::max(code, in_child(arguments, format, path));
    std::error_code ignored;
    if (!arguments.keep) fs::remove_all(path, ignored);
  }
  return code;
}

}  // namespace pmsp::bench
