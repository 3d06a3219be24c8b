// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <stdexcept>
#include <string>

#include "pmsp/api.h"

namespace pmsp {

/// Base of all exceptions of libpmsp, which never prints or exits. Messages contain subject, expectation and remedy.
class PMSP_API Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Option with an invalid value. The message contains field, value and range.
class PMSP_API InvalidOption : public Error {
 public:
  using Error::Error;
};

/// Invalid input: a damaged map, an image of the wrong size, a pose that is no rotation.
class PMSP_API InvalidInput : public Error {
 public:
  using Error::Error;
};

/// File that cannot be opened, read or decoded. The message contains the path and, if known, the byte.
class PMSP_API IoError : public Error {
 public:
  using Error::Error;
};

/// File that cannot be written, or network address that is not available. No incomplete file remains.
class PMSP_API OutputError : public Error {
 public:
  using Error::Error;
};

/// Failed GPU call or allocation; message with call and remedy. The object must not be used again.
class PMSP_API DeviceError : public Error {
 public:
  using Error::Error;
};

/// Requested backend that is not built in, not supported by the machine, or has too little memory.
class PMSP_API BackendUnavailable : public Error {
 public:
  using Error::Error;
};

}  // namespace pmsp
