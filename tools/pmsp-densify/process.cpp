// SPDX-License-Identifier: BSD-2-Clause
#include "process.h"

#include <unistd.h>
#include <atomic>
#include <csignal>

#include "exit_code.h"

namespace pmsp::tool {
namespace {

std::atomic<Densifier*> g_densifier{nullptr};
std::atomic<int> g_signal{0};
int g_guards = 0;
static_assert(std::atomic<Densifier*>::is_always_lock_free && std::atomic<int>::is_always_lock_free,
              "a signal handler may only touch lock-free atomics");

extern "C" void on_signal(int signal) {
  if (g_signal.exchange(signal) != 0) _exit(kExitSignal + signal);
  if (Densifier* densifier = g_densifier.load()) densifier->cancel();
}

void install(void (*handler)(int)) {
  struct sigaction action = {};
  action.sa_handler = handler;
  sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

}  // namespace

InterruptGuard::InterruptGuard(Densifier* densifier) : outer_(g_densifier.exchange(densifier)) {
  if (g_guards++ > 0) return;
  g_signal = 0;
  install(on_signal);
}

InterruptGuard::~InterruptGuard() {
  if (--g_guards == 0) install(SIG_DFL);
  g_densifier = outer_;
}

void InterruptGuard::check() const {
  if (const int signal = g_signal.load()) throw Interrupted(signal);
}

std::string host_name() {
  char name[256] = {};
  return gethostname(name, sizeof(name) - 1) == 0 ? name : "";
}

double peak_memory_mib(const rusage& usage) {
#ifdef __APPLE__
  return static_cast<double>(usage.ru_maxrss) / (1024.0 * 1024.0);
#else
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
#endif
}

double peak_memory_mib() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  return peak_memory_mib(usage);
}

}  // namespace pmsp::tool
