// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <stdexcept>
#include <string>

#include "pmsp/api.h"

namespace pmsp {

/// Base of everything that libpmsp throws. The library never prints and never exits; `what()` is one or two sentences
/// that name what is wrong, where, what was expected and, where it helps, what to do.
class PMSP_API Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// An option has a value outside its range. The message names the field, the value and the bound.
class PMSP_API InvalidOption : public Error {
 public:
  using Error::Error;
};

/// Input that was read but makes no sense: a broken map, an image of the wrong size, a pose that is no rotation.
class PMSP_API InvalidInput : public Error {
 public:
  using Error::Error;
};

/// A file that cannot be opened, read or decoded. The message names the path and, where known, the byte.
class PMSP_API IoError : public Error {
 public:
  using Error::Error;
};

/// A file that cannot be written. Nothing half-written is left behind.
class PMSP_API OutputError : public Error {
 public:
  using Error::Error;
};

/// A call to the GPU failed while it worked, or its memory ran out. The message names the call and what to do. Whoever
/// threw it must not be used any further.
class PMSP_API DeviceError : public Error {
 public:
  using Error::Error;
};

/// The requested backend was not built in, or this machine cannot run it.
class PMSP_API BackendUnavailable : public Error {
 public:
  using Error::Error;
};

}  // namespace pmsp
