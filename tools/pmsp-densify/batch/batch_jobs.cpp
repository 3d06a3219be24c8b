// SPDX-License-Identifier: BSD-2-Clause
#include "batch_jobs.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <system_error>

#include <nlohmann/json.hpp>

#include "pmsp/error.h"
#include "process.h"

#if defined(__linux__)
#include <sys/prctl.h>
#endif

namespace pmsp::tool {
namespace {

constexpr int kNotStarted = 127;  ///< as a shell's

void say(const char* text) {
  if (::write(STDERR_FILENO, text, std::strlen(text)) < 0) _exit(kNotStarted);
}

/// Runs between fork and exec: async-signal-safe calls only.
[[noreturn]] void become(char* const* argv, int log, pid_t parent) {
#if defined(__linux__)
  prctl(PR_SET_PDEATHSIG, SIGKILL);
#endif
  if (getppid() != parent) _exit(kNotStarted);  // parent has already ended
  setpgid(0, 0);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  const int nothing = open("/dev/null", O_RDONLY);
  if (nothing >= 0) dup2(nothing, STDIN_FILENO);
  dup2(log, STDOUT_FILENO);
  dup2(log, STDERR_FILENO);
#if defined(__linux__)
  execv("/proc/self/exe", argv);  // also works if the file was replaced in the meantime
#endif
  execvp(argv[0], argv);
  say("pmsp-densify: cannot be started: ");
  say(std::strerror(errno));
  say("\n");
  _exit(kNotStarted);
}

extern "C" void ignore_signal(int) {}

}  // namespace

TemporaryFile::TemporaryFile() {
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::temp_directory_path(error);
  std::string name = ((error ? "/tmp" : folder) / "pmsp-densify-XXXXXX").string();
  const int file = ::mkstemp(name.data());
  if (file < 0) throw OutputError(name + ": no temporary file can be made: " + std::strerror(errno));
  ::close(file);
  path_ = name;
}

TemporaryFile::~TemporaryFile() {
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

pid_t start_child(const std::vector<std::string>& words, const std::filesystem::path& log) {
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  const int file = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (file < 0) throw OutputError(log.string() + ": cannot be written: " + std::strerror(errno));
  const pid_t parent = getpid();
  const pid_t child = fork();
  const int code = errno;
  if (child == 0) become(argv.data(), file, parent);
  ::close(file);
  if (child < 0) throw std::system_error(code, std::generic_category(), "no process can be started");
  return child;
}

std::optional<ChildEnd> end_of_child(pid_t child) {
  int status = 0;
  rusage usage = {};
  pid_t ended = 0;
  do {
    ended = wait4(child, &status, WNOHANG, &usage);
  } while (ended < 0 && errno == EINTR);
  if (ended == 0) return std::nullopt;
  if (ended < 0) throw std::system_error(errno, std::generic_category(), "a process that was started is lost");
  ChildEnd end;
  end.peak_memory_mib = peak_memory_mib(usage);
  if (WIFSIGNALED(status)) {
    end.signal = WTERMSIG(status);
  } else {
    end.exit_code = WEXITSTATUS(status);
  }
  return end;
}

SignalQueue::SignalQueue() {
  struct sigaction action = {};
  action.sa_handler = ignore_signal;  // some systems discard default-ignored signals even if blocked
  sigemptyset(&action.sa_mask);
  sigaction(SIGCHLD, &action, &child_before_);
  sigemptyset(&signals_);
  for (const int signal : {SIGINT, SIGTERM, SIGCHLD}) sigaddset(&signals_, signal);
  sigprocmask(SIG_BLOCK, &signals_, &before_);
}

SignalQueue::~SignalQueue() {
  sigprocmask(SIG_SETMASK, &before_, nullptr);
  sigaction(SIGCHLD, &child_before_, nullptr);
}

int SignalQueue::wait() {
  int signal = 0;
  while (sigwait(&signals_, &signal) != 0) continue;
  return signal;
}

std::vector<int> devices_of_job(std::size_t job, std::size_t jobs, const std::vector<int>& devices) {
  if (devices.empty()) return {};
  if (devices.size() <= jobs) return {devices[job % devices.size()]};
  std::vector<int> shared;
  for (std::size_t i = job; i < devices.size(); i += jobs) shared.push_back(devices[i]);
  return shared;
}

namespace {

namespace fs = std::filesystem;

constexpr double kContext = 600.0 * 1024 * 1024;  // additional GPU memory: CUDA context, kernels and their stacks

/// Number after a name in lines such as "MemAvailable:  123 kB"; 0 = none.
double number_after(const fs::path& file, const std::string& name) {
  std::ifstream lines(file);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string word;
    double number = 0.0;
    if (words >> word >> number && word == name) return number;
  }
  return 0.0;
}

/// First number of a file; nullopt = none ("max").
std::optional<double> first_number_in(const fs::path& file) {
  double number = 0.0;
  if (std::ifstream(file) >> number) return number;
  return std::nullopt;
}

/// Memory files of a version of Linux control groups.
struct Groups {
  const char* controllers;  ///< in /proc/self/cgroup
  const char* root;
  const char* limit;
  const char* used;
  const char* cached;  ///< key in memory.stat: reclaimable memory
};
constexpr Groups kGroups[] = {
    {"", "/sys/fs/cgroup", "memory.max", "memory.current", "inactive_file"},
    {"memory", "/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"}};

/// Minimum of the memory left in a group and its ancestors [bytes].
double left_in(const Groups& groups, const fs::path& path) {
  double left = std::numeric_limits<double>::infinity();
  for (fs::path group = path;; group = group.parent_path()) {
    const fs::path folder = groups.root / group.relative_path();
    const auto limit = first_number_in(folder / groups.limit);
    const auto used = first_number_in(folder / groups.used);
    if (limit && used) left = std::min(left, *limit - *used + number_after(folder / "memory.stat", groups.cached));
    if (!group.has_relative_path()) return left;
  }
}

}  // namespace

MemoryNeed memory_need_from(const std::string& log) {
  const std::size_t line = log.rfind("\n{");
  try {
    const nlohmann::json parsed = nlohmann::json::parse(log.substr(line == std::string::npos ? 0 : line));
    const nlohmann::json& gpu = parsed.at("gpu");
    MemoryNeed need;
    need.host = parsed.at("cpu").at("memory_bytes").get<double>();
    need.gpu_host = gpu.at("memory_bytes").get<double>();
    need.device = gpu.at("device_bytes").get<double>();
    need.device_least = gpu.at("least_device_bytes").get<double>();
    need.device_free = gpu.at("free_device_bytes").get<double>();
    need.devices = gpu.at("devices").get<std::vector<int>>();
    return need;
  } catch (const nlohmann::json::exception&) {
    return {};
  }
}

std::optional<MemoryShares::Share> MemoryShares::take(const MemoryNeed& need) {
  Share share{need.host, 0.0, {}};
  if (need.device_free > 0.0) {
    double bytes = std::numeric_limits<double>::infinity();  // of the GPU with least memory
    for (const int number : need.devices) {
      Device& device = devices_[number];
      device.bytes = std::max(device.bytes, need.device_free);
      bytes = std::min(bytes, device.bytes);
    }
    if (need.device_least <= bytes) {
      share = {need.gpu_host, (need.device <= bytes ? need.device : need.device_least) + kContext, need.devices};
    }
  }
  if (users_ > 0 && taken_ + share.host > host_) return std::nullopt;
  for (const int number : share.devices) {
    const Device& device = devices_[number];
    if (device.users > 0 && device.taken + share.device > device.bytes) return std::nullopt;
  }
  taken_ += share.host;
  ++users_;
  for (const int number : share.devices) {
    devices_[number].taken += share.device;
    ++devices_[number].users;
  }
  return share;
}

void MemoryShares::give_back(const Share& share) {
  taken_ -= share.host;
  --users_;
  for (const int number : share.devices) {
    devices_[number].taken -= share.device;
    --devices_[number].users;
  }
}

double free_host_memory() {
  double left = 1024.0 * number_after("/proc/meminfo", "MemAvailable:");
  if (left == 0.0) left = static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE));
  std::ifstream lines("/proc/self/cgroup");
  for (std::string line; std::getline(lines, line);) {  // "0::/user.slice" or "4:memory:/jobs/7"
    const std::size_t first = line.find(':');
    const std::size_t second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    for (const Groups& groups : kGroups) {
      if (controllers == groups.controllers) left = std::min(left, left_in(groups, line.substr(second + 1)));
    }
  }
  return std::max(left, 0.0);
}

}  // namespace pmsp::tool
