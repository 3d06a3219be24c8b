// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "pmsp/api.h"

namespace pmsp {

/// Gives back all that this process holds of CUDA devices (DensifierOptions::devices), their contexts included, which
/// takes about a tenth of a second. The end of a process does the same: this is for programs that have something else
/// to wait for meanwhile, such as a disk. No Densifier may exist, and what anybody else in the process has on these
/// devices is lost. Later Densifiers start the devices anew. The calling thread's current CUDA device is one of these
/// afterwards. Nothing happens in builds without CUDA.
PMSP_API void close_devices(const std::vector<int>& devices) noexcept;

/// Bytes of a CUDA device's memory that are free now; 0 where it cannot be used: in builds without CUDA, without a
/// driver, and where there is no such device. Starts the device where this process has not done so.
PMSP_API std::size_t free_device_memory(int device);

/// Number of CUDA devices that `DensifierOptions::devices` stands for where it is empty, 16 at most; 0 in builds
/// without CUDA and without a driver.
PMSP_API int device_count();

}  // namespace pmsp
