// SPDX-License-Identifier: BSD-2-Clause
#include "machine.h"
#include "pmsp/stages.h"

#if defined(__linux__)
#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>
#endif

#include <algorithm>
#include <cerrno>

namespace pmsp {

void run_at_low_priority(int nice) {
#if defined(__linux__)
  const id_t thread = static_cast<id_t>(syscall(SYS_gettid));
  errno = 0;
  const int now = getpriority(PRIO_PROCESS, thread);
  if (errno == 0) setpriority(PRIO_PROCESS, thread, std::min(19, now + nice));  // lower priority needs no privilege
  if (nice < 19) return;
  sched_param none{};
  sched_setscheduler(0, SCHED_IDLE, &none);
#else
  (void)nice;
#endif
}

}  // namespace pmsp
