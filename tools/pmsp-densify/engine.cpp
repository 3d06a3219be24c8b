// SPDX-License-Identifier: BSD-2-Clause
#include "engine.h"

#include <opencv2/core.hpp>
#include <sstream>

#include "pmsp/error.h"
#include "workspace/fingerprint.h"

namespace pmsp::tool {
namespace {

/// What OpenCV says of a library that it was built with: "JPEG ver 62"; where it says nothing, the name.
std::string library_text(const std::string& name) {
  std::istringstream lines(cv::getBuildInformation());
  for (std::string line; std::getline(lines, line);) {
    const std::size_t at = line.find(name + ":");
    if (at == std::string::npos || line.find_first_not_of(' ') != at) continue;
    const std::size_t open = line.rfind('('), close = line.rfind(')');
    if (open == std::string::npos || close == std::string::npos || close < open) break;
    return name + " " + line.substr(open + 1, close - open - 1);
  }
  return name;
}

std::string decoder_text(const Arguments& arguments) {
  return "OpenCV " + cv::getVersionString() + " with " + library_text(arguments.video.empty() ? "JPEG" : "avcodec");
}

}  // namespace

std::string engine_text(const DensifierOptions& options, const std::string& backend, const Arguments& arguments) {
  std::string processor = options.simd == Simd::kScalar ? "CPU, plain code" : "CPU, fused multiply-add";
  if (options.backend == Backend::kCuda) processor = backend.substr(backend.find(',') + 2);
  return version_text() + ", " + processor + ", " + decoder_text(arguments);
}

std::string build_text() {
  std::string text = version_text() + ", " + PMSP_BUILD_TYPE;
#if defined(__clang__)
  text += ", Clang " __clang_version__;
#elif defined(__GNUC__)
  text += ", GCC " __VERSION__;
#endif
  try {
    text += ", " + workspace::fingerprint_of_file("/proc/self/exe").substr(0, 16);
  } catch (const IoError&) {  // a system without that name
  }
  return text;
}

}  // namespace pmsp::tool
