// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <functional>

#include "arguments.h"

namespace pmsp::tool {

/// Calls `once(true)` whenever map or images have changed and are stable. Unusable states, such as a partially written
/// map, are reported and skipped. Returns false at a signal while idle, true after `arguments.until_idle` without
/// change: then throws the error of the last state, if any, or calls `once(false)`. A signal during `once` ends it with
/// Interrupted.
bool follow(const Arguments& arguments, const std::function<void(bool growing)>& once);

}  // namespace pmsp::tool
