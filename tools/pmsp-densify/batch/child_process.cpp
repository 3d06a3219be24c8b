// SPDX-License-Identifier: BSD-2-Clause
#include "child_process.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <system_error>

#if defined(__linux__)
#include <sys/prctl.h>
#endif

#include "pmsp/error.h"

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

double mebibytes(const rusage& usage) {
#ifdef __APPLE__
  return static_cast<double>(usage.ru_maxrss) / (1024.0 * 1024.0);
#else
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
#endif
}

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
  end.peak_memory_mib = mebibytes(usage);
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

}  // namespace pmsp::tool
