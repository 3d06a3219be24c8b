// SPDX-License-Identifier: BSD-2-Clause
// Dataset for nerfstudio and other trainers that read transforms.json: images/, masks/, transforms.json, points.ply,
// and depth images.
#include <string>

#include <nlohmann/json.hpp>

#include "export/dataset_folder.h"

namespace pmsp {

std::unique_ptr<CloudWriter> open_ply(const std::filesystem::path& path, const CloudHeader& header);

bool is_nerfstudio_name(const std::string& name) {
  return name == "transforms.json" || name == "images" || name == "masks" || name == "points.ply" ||
         DatasetDepthFiles::is_name(name);
}

namespace {

using Json = nlohmann::ordered_json;

/// Camera to world with OpenGL camera axes: x right, y up, z backward.
Json camera_matrix(const RigidTransform& cam_from_file) {
  const RigidTransform pose = cam_from_file.inverse();
  Json rows = Json::array();
  for (int r = 0; r < 3; ++r) {
    rows.push_back({pose.rotation(r, 0), -pose.rotation(r, 1), -pose.rotation(r, 2), pose.translation[r]});
  }
  rows.push_back({0.0, 0.0, 0.0, 1.0});
  return rows;
}

/// nerfstudio's panorama rays: pi * (x - cx) / fl_x to the right, pi * (y - cy) / fl_y downwards.
void set_size(Json& json, const OutputView& view) {
  json["w"] = view.width;
  json["h"] = view.height;
  json["fl_x"] = 0.5 * view.width;
  json["fl_y"] = view.height;
  json["cx"] = 0.5 * view.width;
  json["cy"] = 0.5 * view.height;
}

class Nerfstudio final : public CloudWriter {
 public:
  Nerfstudio(const std::filesystem::path& path, const CloudHeader& header)
      : dataset_(path, is_nerfstudio_name, header), ply_(open_ply(dataset_.folder() / "points.ply", header)) {}

  void add(const OutputPoint* points, std::size_t count) override { dataset_.add(points, count); }

  void add_depth(const DepthMap& map) override { dataset_.add_depth(map); }
  bool wants_depth() const override { return dataset_.wants_depth(); }

  void finish() override {
    const std::vector<OutputView> views = dataset_.put_images();
    dataset_.finish([this](const OutputPoint* points, std::size_t count) { ply_->add(points, count); });
    ply_->finish();
    Json json{{"camera_model", "EQUIRECTANGULAR"}};
    bool is_one_size = !views.empty();
    for (const OutputView& view : views) {
      is_one_size = is_one_size && view.width == views[0].width && view.height == views[0].height;
    }
    if (is_one_size) set_size(json, views[0]);
    json["ply_file_path"] = "points.ply";
    if (dataset_.depth() != nullptr) json.update(dataset_.depth()->description());
    json["frames"] = Json::array();
    for (const OutputView& view : views) {
      Json frame{{"file_path", "images/" + view.name}};
      if (view.has_mask) frame["mask_path"] = "masks/" + view.name + ".png";
      if (dataset_.depth() != nullptr) frame.update(dataset_.depth()->files_of(view));
      if (!is_one_size) set_size(frame, view);
      frame["transform_matrix"] = camera_matrix(view.cam_from_file);
      frame["timestamp"] = view.timestamp;
      json["frames"].push_back(frame);
    }
    json["comments"] = dataset_.header().comments;
    write_file(dataset_.folder() / "transforms.json", json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
    dataset_.commit(views);
  }

 private:
  DatasetFolder dataset_;
  std::unique_ptr<CloudWriter> ply_;
};

}  // namespace

std::unique_ptr<CloudWriter> open_nerfstudio(const std::filesystem::path& path, const CloudHeader& header) {
  return std::make_unique<Nerfstudio>(path, header);
}

}  // namespace pmsp
