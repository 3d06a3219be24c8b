// SPDX-License-Identifier: BSD-2-Clause
#include "engine_text.h"

#include <chrono>
#include <exception>
#include <set>
#include <sstream>

#include <opencv2/core.hpp>

#include "pmsp/densifier.h"
#include "pmsp/error.h"
#include "workspace/fingerprint.h"

namespace pmsp::tool {
namespace {

/// Version of a library from OpenCV's build information: "JPEG ver 62"; the name if missing.
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

/// Device models without duplicates: "NVIDIA H200" for "CUDA device 0, NVIDIA H200; device 1, NVIDIA H200"; their
/// number does not affect results.
std::string kinds_of_devices(const std::string& backend) {
  std::set<std::string> kinds;
  std::istringstream devices(backend);
  for (std::string device; std::getline(devices, device, ';');) kinds.insert(device.substr(device.find(',') + 2));
  std::string text;
  for (const std::string& kind : kinds) text += (text.empty() ? "" : "; ") + kind;
  return text;
}

std::string decoder_text(const Arguments& arguments) {
  return "OpenCV " + cv::getVersionString() + " with " + library_text(arguments.video.empty() ? "JPEG" : "avcodec");
}

}  // namespace

std::string engine_text(const DensifierOptions& options, const std::string& backend, const Arguments& arguments) {
  std::string processor = options.simd == Simd::kScalar ? "CPU, plain code" : "CPU, fused multiply-add";
  if (options.backend == Backend::kCuda) processor = kinds_of_devices(backend);
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
  } catch (const IoError&) {  // system without that file
  }
  return text;
}

std::future<double> start_device(const DensifierOptions& options) {
  if (options.backend == Backend::kCpu) return {};
  return std::async(std::launch::async, [options] {
    const auto begin = std::chrono::steady_clock::now();
    try {
      const Densifier starts(options, {});
    } catch (const std::exception&) {
    }
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  });
}

}  // namespace pmsp::tool
