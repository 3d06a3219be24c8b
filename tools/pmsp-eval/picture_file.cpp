// SPDX-License-Identifier: BSD-2-Clause
#include "pmsp-eval/picture_file.h"

#include "export/files.h"
#include "io/image_decode.h"
#include "util/text.h"

namespace pmsp::eval {

void write_png(const std::filesystem::path& path, const cv::Mat& image) {
  write_file(path, io::encoded(".png", image, path.string() + ": the picture cannot be encoded as PNG"));
}

std::string percent(double share) { return number_text(100.0 * share, "%g %%"); }

}  // namespace pmsp::eval
