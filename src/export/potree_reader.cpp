// SPDX-License-Identifier: BSD-2-Clause
// Potree 2 with encoding DEFAULT. Each point is in exactly one node, so octree.bin is the whole cloud.
#include <array>
#include <memory>
#include <string>

#include <nlohmann/json.hpp>

#include "export/cloud_fields.h"
#include "io/json_input.h"

namespace pmsp {
namespace {

constexpr std::size_t kMostBytes = 65536;  ///< per point

NumberType type_of(const JsonValue& attribute) {
  const JsonValue type = attribute.at("type");
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
  for (const auto& [name, number] : kNames) {
    if (type.text() == name) return number;
  }
  type.refuse("a type such as uint16 or float");
}

void add_attribute(PointRecords& records, const JsonValue& attribute, const JsonValue& metadata) {
  const NumberType type = type_of(attribute);
  const std::int64_t number = attribute.at("numElements").integer();
  const auto elements = static_cast<std::size_t>(number);
  if (number < 1 || elements > kMostBytes) {
    attribute.at("numElements").refuse("1 to " + std::to_string(kMostBytes) + " elements");
  }
  const std::string& name = attribute.at("name").text();
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
        put(static_cast<CloudField>(kX + i), i, metadata.at("scale").element(i).number(),
            metadata.at("offset").element(i).number());
      }
    }
  }
  if (name == "rgb" && size_of(type) == 2) records.color_scale = 1.0 / 257.0;
  records.bytes += elements * size_of(type);
  if (records.bytes > kMostBytes) attribute.refuse("points of at most " + std::to_string(kMostBytes) + " bytes");
}

class PotreeReader final : public CloudReader {
 public:
  explicit PotreeReader(const std::filesystem::path& folder) : input_(folder / "octree.bin") {
    info_.format = "Potree";
    read_metadata(folder / "metadata.json");
    if (records_.count != input_.size() / records_.bytes || input_.size() % records_.bytes != 0) {
      input_.fail("has " + std::to_string(input_.size()) + " bytes, expected " + std::to_string(records_.count) +
                  " points of " + std::to_string(records_.bytes) + " bytes; is it cut off?");
    }
    records_.describe(info_);
    read_origin(info_);
  }

  void read(const Take& take) override { records_.read(input_, info_, take); }

 private:
  void read_metadata(const std::filesystem::path& path) {
    const nlohmann::json json = read_json(path);
    const JsonValue metadata(json, path);
    if (metadata.at("version").text() != "2.0") metadata.at("version").refuse("Potree 2");
    const std::string& encoding = metadata.at("encoding").text();
    if (encoding != "DEFAULT") {
      fail(path, "",
           "is compressed (" + encoding.substr(0, 40) +
               "), expected no compression; convert it with PotreeConverter --encoding UNCOMPRESSED");
    }
    records_.count = static_cast<std::uint64_t>(metadata.at("points").integer());
    metadata.at("attributes").each_element([&](const JsonValue& attribute) {
      add_attribute(records_, attribute, metadata);
    });
    if (!records_.has(kX, 3)) fail(path, "attributes", "has no positions");
    if (metadata.has("projection")) info_.wkt = metadata.at("projection").text();
    if (!metadata.has("comments")) return;
    metadata.at("comments").each_element([&](const JsonValue& line) { info_.comments.push_back(line.text()); });
  }

  BinaryInput input_;
  PointRecords records_;
};

}  // namespace

std::unique_ptr<CloudReader> open_potree_reader(const std::filesystem::path& folder) {
  return std::make_unique<PotreeReader>(folder);
}

}  // namespace pmsp
