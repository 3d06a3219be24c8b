// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/stages.h"

namespace pmsp {

/// Access to implementations of public classes, for stages. They are complete if cpu/executor_impl.h or
/// sphere/panorama_data.h is included.
struct ImplAccess {
  static auto& of(const Executor& executor) { return *executor.impl_; }
  static const PanoramaData& of(const Panorama& panorama) { return *panorama.data_; }
};

template <class Public>
decltype(auto) impl_of(const Public& object) {
  return ImplAccess::of(object);
}

class ThreadPool;
ThreadPool& pool_of(const Executor& executor);

}  // namespace pmsp
