// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/picture_file.h"

#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "export/files.h"
#include "pmsp/error.h"
#include "util/text.h"

namespace pmsp::eval {

void write_png(const std::filesystem::path& path, const cv::Mat& image) {
  std::vector<uchar> bytes;
  if (!cv::imencode(".png", image, bytes)) throw OutputError(path.string() + ": the picture cannot be encoded as PNG");
  write_file(path, bytes);
}

std::string percent(double share) { return number_text(100.0 * share, "%g %%"); }

}  // namespace pmsp::eval
