// SPDX-License-Identifier: BSD-2-Clause
#pragma once

/// Tag of tests that need images large enough for good depths. Under a sanitizer, where PatchMatch takes many
/// times as long, they are hidden; the others run there with tiny images.
#ifdef PMSP_SANITIZED
#define PMSP_ACCURACY "[.accuracy]"
#else
#define PMSP_ACCURACY "[accuracy]"
#endif

namespace pmsp::test {

#ifdef PMSP_SANITIZED
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

}  // namespace pmsp::test
