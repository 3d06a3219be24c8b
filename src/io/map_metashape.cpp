// SPDX-License-Identifier: BSD-2-Clause
//
// Metashape cameras as XML (File > Export > Export Cameras): chunks with sensors, cameras and components. The transform
// of a camera is the 4 x 4 matrix chunk_from_camera with the axes of libpmsp; that of the component (in older files of
// the chunk) is world_from_chunk: rotation, translation, scale. Spherical sensors have the forward direction at the
// image centre and pixel centres at + 0.5 (user manual, appendix "Camera models"). The file contains no points.
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <pugixml.hpp>

#include "export/files.h"
#include "map_file.h"
#include "map_scene.h"
#include "pmsp/io/cloud.h"
#include "text_input.h"

namespace pmsp::map_detail {
namespace {

bool is_metashape(MapFile& file) {
  return file.is_text() && file.begins_with("<") && file.head().find("<document") != std::string::npos;
}

std::string place(const pugi::xml_node& node) {
  const std::string id = node.attribute("id").value();
  return std::string(node.name()) + (id.empty() ? "" : " " + id.substr(0, 40));
}

/// Exactly `count` numbers from a node's text. `may_be_lost`: NaN is allowed.
std::vector<double> numbers(const pugi::xml_node& node, std::size_t count, const std::filesystem::path& path,
                            const std::string& where, bool may_be_lost = false) {
  std::vector<double> values;
  const std::string text = node.child_value();
  bool are_numbers = true;
  for (const std::string& word : words_of(text, " \n\t\r")) {
    const std::optional<double> value = number_from<double>(word);
    are_numbers = are_numbers && value && (may_be_lost || std::isfinite(*value));
    values.push_back(value.value_or(0.0));
  }
  if (!are_numbers || values.size() != count) {
    fail(path, where,
         std::string(node.name()) + " is " + in_quotes(text) + ", expected " + std::to_string(count) +
             " finite numbers");
  }
  return values;
}

std::int64_t whole_number(const pugi::xml_node& node, const char* attribute, const std::filesystem::path& path) {
  const std::string text = node.attribute(attribute).value();
  const std::optional<std::int64_t> value = plain_number_from<std::int64_t>(text);
  if (!value) {
    fail(path, place(node), std::string(attribute) + " is " + in_quotes(text) + ", expected a whole number");
  }
  return *value;
}

Eigen::Matrix3d matrix_of(const std::vector<double>& rows, Eigen::Index stride) {
  Eigen::Matrix3d matrix;
  for (Eigen::Index i = 0; i < 3; ++i) {
    for (Eigen::Index k = 0; k < 3; ++k) matrix(i, k) = rows[static_cast<std::size_t>(i * stride + k)];
  }
  return matrix;
}

Similarity similarity_of(const pugi::xml_node& transform, const std::filesystem::path& path, const std::string& where) {
  Similarity result;
  if (const pugi::xml_node node = transform.child("rotation")) {
    result.rotation = rotation_from_matrix(matrix_of(numbers(node, 9, path, where), 3), path, where + ": rotation");
  }
  if (const pugi::xml_node node = transform.child("translation")) {
    const std::vector<double> t = numbers(node, 3, path, where);
    result.translation = {t[0], t[1], t[2]};
  }
  if (const pugi::xml_node node = transform.child("scale")) result.scale = numbers(node, 1, path, where)[0];
  if (!(result.scale > 1e-9 && result.scale < 1e9)) {
    fail(path, where, "the scale is " + to_message(result.scale) + ", expected 1e-9 to 1e9");
  }
  return result;
}

/// Chunk, or one of its components.
struct Part {
  pugi::xml_node chunk;
  pugi::xml_node component;  ///< none = the whole chunk
};

std::vector<Part> parts_of(const pugi::xml_node& document) {
  std::vector<Part> parts;
  for (const pugi::xml_node chunk : document.children("chunk")) {
    const std::size_t before = parts.size();
    for (const pugi::xml_node component : chunk.child("components").children("component")) {
      parts.push_back({chunk, component});
    }
    if (parts.size() == before) parts.push_back({chunk, {}});
  }
  return parts;
}

class PartReader {
 public:
  PartReader(const Part& part, const std::filesystem::path& path, bool has_image_list)
      : part_(part), has_image_list_(has_image_list) {
    map_.path = path;
    map_.format = std::string("Metashape, chunk ") + in_quotes(part.chunk.attribute("label").value());
  }

  SlamMap read() {
    read_sensors();
    const pugi::xml_node own = part_.component.child("transform");
    world_from_chunk_ = similarity_of(own ? own : part_.chunk.child("transform"), map_.path, "transform");
    const pugi::xml_node cameras = part_.chunk.child("cameras");
    for (const pugi::xml_node camera : cameras.children("camera")) add(camera, "");
    for (const pugi::xml_node group : cameras.children("group")) {
      for (const pugi::xml_node camera : group.children("camera")) add(camera, group.attribute("label").value());
    }
    distinguish_labels();
    if (disabled_ > 0) map_.notes.push_back("cameras left out, disabled in Metashape: " + std::to_string(disabled_));
    if (without_pose_ > 0) map_.notes.push_back("cameras left out, not aligned: " + std::to_string(without_pose_));
    note_others(map_, "cameras left out, of sensors that are not spherical", others_);
    return finalize_map(std::move(map_));
  }

 private:
  void read_sensors() {
    for (const pugi::xml_node sensor : part_.chunk.child("sensors").children("sensor")) {
      const std::int64_t id = whole_number(sensor, "id", map_.path);
      const bool is_panorama = std::string(sensor.attribute("type").value()) == "spherical";
      const int index = is_panorama ? static_cast<int>(map_.cameras.size()) : -1;
      if (!sensors_.emplace(id, index).second) fail(map_.path, place(sensor), "this id appears more than once");
      if (!is_panorama) continue;
      const pugi::xml_node size = sensor.child("resolution");
      if (!size) fail(map_.path, place(sensor), "lacks its resolution");
      map_.cameras.push_back(equirectangular_camera(
          "sensor " + std::to_string(id), static_cast<double>(whole_number(size, "width", map_.path)),
          static_cast<double>(whole_number(size, "height", map_.path)), map_.path, place(sensor)));
    }
  }

  void add(const pugi::xml_node& camera, const std::string& group) {
    if (part_.component &&
        std::string(camera.attribute("component_id").value()) != std::string(part_.component.attribute("id").value())) {
      return;
    }
    if (!camera.attribute("enabled").as_bool(true)) {
      ++disabled_;
      return;
    }
    const pugi::xml_node transform = camera.child("transform");
    if (!transform) {
      ++without_pose_;
      return;
    }
    const auto sensor = sensors_.find(whole_number(camera, "sensor_id", map_.path));
    if (sensor == sensors_.end()) fail(map_.path, place(camera), "names a sensor that the chunk lacks");
    if (sensor->second < 0) {
      ++others_;
      return;
    }
    const std::vector<double> m = numbers(transform, 16, map_.path, place(camera), true);
    const std::string where = place(camera) + ": transform";
    const Eigen::Matrix3d chunk_from_camera = rotation_from_matrix(matrix_of(m, 4), map_.path, where);
    MapKeyframe keyframe;
    keyframe.id = whole_number(camera, "id", map_.path);
    keyframe.camera = sensor->second;
    keyframe.image = image_name(camera.attribute("label").value(), map_.path, place(camera));
    const Eigen::Matrix3d turn =
        rotation_from_matrix((world_from_chunk_.rotation * chunk_from_camera).transpose(), map_.path, where);
    const Eigen::Vector3d center = world_from_chunk_ * Eigen::Vector3d(m[3], m[7], m[11]);
    keyframe.cam_from_world = {turn, -(turn * center)};
    map_.keyframes.push_back(std::move(keyframe));
    groups_.push_back(group);
  }

  /// Files contain photo labels only. For duplicate labels the group of cameras may be the folder; otherwise a list of
  /// images is needed.
  void distinguish_labels() {
    std::map<std::string, std::size_t> labels;
    for (const MapKeyframe& keyframe : map_.keyframes) ++labels[keyframe.image];
    std::map<std::string, std::size_t> names;
    for (std::size_t i = 0; i < map_.keyframes.size(); ++i) {
      std::string& image = map_.keyframes[i].image;
      if (labels[image] > 1 && !groups_[i].empty()) image = image_name(groups_[i] + "/" + image, map_.path, "group");
      ++names[image];
    }
    for (MapKeyframe& keyframe : map_.keyframes) {
      if (names[keyframe.image] == 1) continue;
      if (!has_image_list_) {
        fail(map_.path, "",
             "the image " + in_quotes(keyframe.image) +
                 " appears more than once, and the file contains no directories of the "
                 "photos; give --image-list with one line for each of the " +
                 std::to_string(map_.keyframes.size()) + " cameras in the order of their ids, such as left/" +
                 keyframe.image +
                 ".jpg, or rename the photos so that no two share a label and export the cameras again");
      }
      keyframe.image.clear();
    }
  }

  Part part_;
  bool has_image_list_ = false;
  SlamMap map_;
  Similarity world_from_chunk_;
  std::map<std::int64_t, int> sensors_;  ///< by sensor id; -1 = not a panorama
  std::vector<std::string> groups_;      ///< per keyframe: label of its camera group, or ""
  std::size_t without_pose_ = 0;
  std::size_t disabled_ = 0;
  std::size_t others_ = 0;
};

SlamMap read_metashape(MapFile& file, const ReadMapOptions& options) {
  require_regular_file(file.path());
  pugi::xml_document document;
  const pugi::xml_parse_result result = document.load_file(file.path().c_str());
  if (!result) {
    fail(file.path(), "byte " + std::to_string(result.offset),
         std::string("broken XML (") + result.description() + "): it is truncated or damaged");
  }
  const std::vector<Part> parts = parts_of(document.child("document"));
  if (parts.empty()) fail(file.path(), "", "holds no chunk, expected cameras as Metashape exports them");
  return read_component(parts.size(), file.path(), options, [&](std::size_t i) {
    return PartReader(parts[i], file.path(), !options.image_list.empty()).read();
  });
}

}  // namespace

extern const MapFormat kMetashape;
const MapFormat kMetashape{"Metashape", "cameras of Metashape as XML", is_metashape, read_metashape};

}  // namespace pmsp::map_detail
