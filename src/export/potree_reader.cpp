// SPDX-License-Identifier: BSD-2-Clause
// Potree 2 with encoding DEFAULT. Each point is in exactly one node, so octree.bin is the whole cloud.
#include <array>
#include <cmath>
#include <memory>
#include <string>

#include <nlohmann/json.hpp>

#include "export/cloud_fields.h"
#include "export/files.h"
#include "pmsp/error.h"

namespace pmsp {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kMostBytes = 65536;  ///< per point

NumberType type_named(const std::string& name) {
  constexpr std::array<std::pair<const char*, NumberType>, 10> kNames{{{"int8", NumberType::kInt8},
                                                                       {"uint8", NumberType::kUint8},
                                                                       {"int16", NumberType::kInt16},
                                                                       {"uint16", NumberType::kUint16},
                                                                       {"int32", NumberType::kInt32},
                                                                       {"uint32", NumberType::kUint32},
                                                                       {"float", NumberType::kFloat},
                                                                       {"double", NumberType::kDouble},
                                                                       {"int64", NumberType::kInt64},
                                                                       {"uint64", NumberType::kUint64}}};
  for (const auto& [known, type] : kNames) {
    if (name == known) return type;
  }
  throw InvalidInput("an attribute has the type \"" + name.substr(0, 40) + "\"; expected one such as uint16 or float");
}

void add_attribute(PointRecords& records, const Json& attribute, const Json& metadata) {
  const NumberType type = type_named(attribute.at("type").get<std::string>());
  const auto elements = attribute.at("numElements").get<std::size_t>();
  if (elements < 1 || elements > kMostBytes)
    throw InvalidInput("an attribute has " + std::to_string(elements) + " elements");
  const auto name = attribute.at("name").get<std::string>();
  const auto put = [&](CloudField field, std::size_t element, double scale, double shift) {
    records.numbers[field] = {records.bytes + element * size_of(type), type, scale, shift, true};
  };
  constexpr std::array<std::pair<const char*, CloudField>, 5> kSingle{
      {{"NormalX", kNx}, {"NormalY", kNy}, {"NormalZ", kNz}, {"confidence", kConfidence}, {"views", kViews}}};
  for (const auto& [known, field] : kSingle) {
    if (name == known && elements == 1) put(field, 0, 1.0, 0.0);
  }
  if (elements == 3 && (name == "position" || name == "rgb")) {
    for (std::size_t i = 0; i < 3; ++i) {
      if (name == "rgb") {
        put(static_cast<CloudField>(kRed + i), i, 1.0, 0.0);
      } else {
        put(static_cast<CloudField>(kX + i), i, metadata.at("scale").at(i).get<double>(),
            metadata.at("offset").at(i).get<double>());
      }
    }
  }
  if (name == "rgb" && size_of(type) == 2) records.color_scale = 1.0 / 257.0;
  records.bytes += elements * size_of(type);
  if (records.bytes > kMostBytes) throw InvalidInput("a point has more than " + std::to_string(kMostBytes) + " bytes");
}

class PotreeReader final : public CloudReader {
 public:
  explicit PotreeReader(const std::filesystem::path& folder) : input_(folder / "octree.bin") {
    info_.format = "Potree";
    const std::filesystem::path path = folder / "metadata.json";
    try {
      read_metadata(Json::parse(read_whole_file(path)));
    } catch (const InvalidInput& error) {
      throw InvalidInput(path.string() + ": " + error.what());
    } catch (const Json::exception& error) {
      throw InvalidInput(path.string() + ": is no metadata of Potree 2 (" + error.what() + ")");
    }
    if (records_.count != input_.size() / records_.bytes || input_.size() % records_.bytes != 0) {
      input_.fail("has " + std::to_string(input_.size()) + " bytes, expected " + std::to_string(records_.count) +
                  " points of " + std::to_string(records_.bytes) + " bytes; is it cut off?");
    }
    records_.describe(info_);
    read_origin(info_);
  }

  void read(const Take& take) override { records_.read(input_, info_, take); }

 private:
  void read_metadata(const Json& json) {
    if (json.at("version").get<std::string>() != "2.0") throw InvalidInput("is not of Potree 2");
    const auto encoding = json.at("encoding").get<std::string>();
    if (encoding != "DEFAULT") {
      throw InvalidInput("is compressed (" + encoding.substr(0, 40) +
                         "), expected no compression; convert it with PotreeConverter --encoding UNCOMPRESSED");
    }
    records_.count = json.at("points").get<std::uint64_t>();
    for (const Json& attribute : json.at("attributes")) add_attribute(records_, attribute, json);
    if (!records_.has(kX, 3)) throw InvalidInput("has no positions");
    info_.wkt = json.value("projection", "");
    if (json.contains("comments")) info_.comments = json.at("comments").get<std::vector<std::string>>();
  }

  BufferedInput input_;
  PointRecords records_;
};

}  // namespace

std::unique_ptr<CloudReader> open_potree_reader(const std::filesystem::path& folder) {
  return std::make_unique<PotreeReader>(folder);
}

}  // namespace pmsp
