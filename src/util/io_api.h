// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/api.h"

/// Exports symbols of pmsp without a public header from shared libraries, for pmsp_io.
#define PMSP_IO_API PMSP_API
