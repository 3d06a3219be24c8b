// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "pmsp/api.h"

/// Marks what pmsp_io needs of pmsp though it is in no public header: shared libraries show it.
#define PMSP_IO_API PMSP_API
