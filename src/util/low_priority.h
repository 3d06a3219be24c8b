// SPDX-License-Identifier: BSD-2-Clause
#pragma once

namespace pmsp {

/// Lowers the priority of the calling thread, and of those that it starts from now on: `nice` 0 to 19, as of the
/// command; at 19 they run only when nobody else wants to (SCHED_IDLE). Elsewhere than on Linux, where a thread has
/// none of its own, nothing happens.
void run_at_low_priority(int nice);

}  // namespace pmsp
