// SPDX-License-Identifier: BSD-2-Clause
// Points of a COLMAP model (points3D.bin); cloud metadata from pmsp.txt in models written by libpmsp.
#include <memory>
#include <string>

#include "export/cloud_fields.h"
#include "export/files.h"

namespace pmsp {
namespace {

/// Id, position, colour, error, track length.
constexpr std::size_t kMinPointBytes = 8 + 3 * 8 + 3 + 8 + 8;
constexpr std::uint64_t kSightingBytes = 8;

class ColmapReader final : public CloudReader {
 public:
  explicit ColmapReader(const std::filesystem::path& folder) : input_(folder / "sparse" / "0" / "points3D.bin") {
    info_.format = "COLMAP";
    info_.has_colors = true;
    info_.points = static_cast<std::int64_t>(input_.count("points", kMinPointBytes));
    if (is_file(folder / "pmsp.txt")) {
      BinaryInput lines(folder / "pmsp.txt");
      for (std::string line; lines.line(line);) info_.comments.push_back(line);
    }
    read_origin(info_);
  }

  void read(const Take& take) override {
    PointBatch batch(info_, 1.0, take);
    input_.seek(8);
    for (std::int64_t i = 0; i < info_.points; ++i) {
      CloudNumbers v{};
      input_.skip(8);
      for (std::size_t k = kX; k <= kZ; ++k) v[k] = input_.number<double>();
      for (std::size_t k = kRed; k <= kBlue; ++k) v[k] = input_.number<std::uint8_t>();
      input_.skip(8);
      const auto track = input_.number<std::uint64_t>();
      if (track > input_.remaining() / kSightingBytes) {
        input_.fail("point " + std::to_string(i) + " has a track that is longer than the file; is it cut off?");
      }
      batch.add(v, input_);
      input_.skip(track * kSightingBytes);
    }
    batch.flush();
  }

 private:
  BinaryInput input_;
};

}  // namespace

std::unique_ptr<CloudReader> open_colmap_reader(const std::filesystem::path& folder) {
  return std::make_unique<ColmapReader>(folder);
}

}  // namespace pmsp
