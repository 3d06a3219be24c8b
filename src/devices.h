// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "pmsp/api.h"

namespace pmsp {

/// Releases all resources of the process on CUDA devices (DensifierOptions::devices), contexts included, in about 0.1
/// s. Process exit does the same; a call can overlap it with other waiting, such as for the disk. No Densifier may
/// exist, and resources of other libraries on these devices are lost. Later Densifiers initialise the devices again.
/// Makes one of the devices current in the calling thread. No effect in builds without CUDA.
PMSP_API void close_devices(const std::vector<int>& devices) noexcept;

/// Returns the free memory of a CUDA device [bytes]; 0 if unusable: build without CUDA, no driver, no such device.
/// Initialises the device if needed.
PMSP_API std::size_t free_device_memory(int device);

/// Returns the number of CUDA devices used if `DensifierOptions::devices` is empty, at most 16; 0 in builds without
/// CUDA or without a driver.
PMSP_API int device_count();

}  // namespace pmsp
