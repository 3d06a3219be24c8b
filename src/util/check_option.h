// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <sstream>

#include "pmsp/error.h"

namespace pmsp {

/// Throws InvalidOption, naming field, value and bounds, if the value is out of bounds.
template <class T>
void check_option(const char* field, T value, T low, T high) {
  if (value >= low && value <= high) return;  // false for NaN
  std::ostringstream text;
  text << field << " is " << value << "; expected " << low << " to " << high;
  throw InvalidOption(text.str());
}

}  // namespace pmsp
