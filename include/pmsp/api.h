// SPDX-License-Identifier: BSD-2-Clause
#pragma once

/// Exported symbol; shared libraries hide all others.
#if defined(__GNUC__)
#define PMSP_API __attribute__((visibility("default")))
#else
#define PMSP_API
#endif
