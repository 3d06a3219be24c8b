// SPDX-License-Identifier: BSD-2-Clause
// Points of a COLMAP model (points3D.bin); cloud metadata from pmsp.txt in models written by libpmsp.
#include <memory>
#include <sstream>
#include <string>
#include <system_error>

#include "export/cloud_fields.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

/// Id, position, colour, error, track length.
constexpr std::size_t kPointBytes = 8 + 3 * 8 + 3 + 8 + 8;
constexpr std::size_t kPositionAt = 8, kColorAt = 32, kTrackAt = 43;
constexpr std::uint64_t kSightingBytes = 8;

class ColmapReader final : public CloudReader {
 public:
  explicit ColmapReader(const std::filesystem::path& folder) : input_(folder / "sparse" / "0" / "points3D.bin") {
    info_.format = "COLMAP";
    info_.has_colors = true;
    const double count = load_number(input_.take(8), NumberType::kUint64, kSwapsLittle);
    if (count > static_cast<double>(input_.remaining()) / kPointBytes) {
      input_.fail("announces more points than its " + std::to_string(input_.size()) + " bytes hold; is it cut off?");
    }
    info_.points = static_cast<std::int64_t>(count);
    std::error_code ignored;
    if (std::filesystem::is_regular_file(folder / "pmsp.txt", ignored)) {
      std::istringstream lines(read_whole_file(folder / "pmsp.txt"));
      for (std::string line; std::getline(lines, line);) info_.comments.push_back(line);
    }
    read_origin(info_);
  }

  void read(const Take& take) override {
    PointBatch batch(info_, 1.0, take);
    input_.seek(8);
    for (std::int64_t i = 0; i < info_.points; ++i) {
      const unsigned char* const at = input_.take(kPointBytes);
      CloudNumbers v{};
      for (std::size_t k = 0; k < 3; ++k) {
        v[kX + k] = load_number(at + kPositionAt + 8 * k, NumberType::kDouble, kSwapsLittle);
        v[kRed + k] = at[kColorAt + k];
      }
      const double track = load_number(at + kTrackAt, NumberType::kUint64, kSwapsLittle);
      if (track > static_cast<double>(input_.remaining()) / static_cast<double>(kSightingBytes)) {
        input_.fail("point " + std::to_string(i) + " has a track that is longer than the file; is it cut off?");
      }
      batch.add(v, input_);
      input_.skip(static_cast<std::uint64_t>(track) * kSightingBytes);
    }
    batch.flush();
  }

 private:
  BufferedInput input_;
};

}  // namespace

std::unique_ptr<CloudReader> open_colmap_reader(const std::filesystem::path& folder) {
  return std::make_unique<ColmapReader>(folder);
}

}  // namespace pmsp
