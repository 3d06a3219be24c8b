// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <functional>

#include "arguments.h"

namespace pmsp::tool {

/// Calls `once(true)` whenever the map or the images have changed and have come to rest. A state that cannot be used,
/// such as a map that is half written, is told and waited out. Ends at a signal that comes while it waits, or when
/// nothing has changed for `arguments.until_idle`: then throws what the last state was refused for, if it was, or calls
/// `once(false)`. A signal that comes while `once` works ends it by Interrupted.
void follow(const Arguments& arguments, const std::function<void(bool growing)>& once);

}  // namespace pmsp::tool
