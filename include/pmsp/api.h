// SPDX-License-Identifier: BSD-2-Clause
#pragma once

/// Marks what programs may link: a shared library shows nothing else.
#if defined(__GNUC__)
#define PMSP_API __attribute__((visibility("default")))
#else
#define PMSP_API
#endif
