// SPDX-License-Identifier: BSD-2-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <functional>
#include <iostream>
#include <map>
#include <string>
#include <vector>

#include "pmsp-densify/exit_code.h"
#include "pmsp-synth/layouts.h"
#include "pmsp-synth/mission_files.h"
#include "pmsp/version.h"
#include "synth/mission.h"

namespace {

using namespace pmsp;
using MakeMission = std::function<synth::Mission(const synth::Recipe&)>;

const std::map<std::string, MakeMission>& scenes() {
  static const std::map<std::string, MakeMission> kScenes = {
      {"room", synth::textured_room},     {"empty", synth::empty_room},
      {"painted", synth::painted_room},   {"sphere", synth::sphere_inside},
      {"plane", synth::slanted_plane},    {"corridor", synth::corridor_across_seam},
      {"floor", synth::floor_at_nadir},   {"gloss", synth::glossy_room},
      {"thin", synth::thin_room},         {"yard", synth::yard},
      {"flat-photos", synth::flat_photos}};
  return kScenes;
}

struct Arguments {
  std::string scene = "room";
  synth::Recipe recipe;
  synth_tool::MissionFilesOptions files;
  bool cheap = false;
  std::string layout;  ///< of a benchmark; "" = a mission
};

constexpr const char* kFooter = R"(
Files in DIR:
  images/%06d.png        the keyframes' images, named by frame index (.jpg with --jpeg)
  map.msg                the map, as stella_vslam stores it (MessagePack); frame f has the timestamp f / 10 s
  gt/traj_tum.txt        true poses, "ts tx ty tz qx qy qz qw", camera to world, metres
  gt/range_mm/%06d.png   16-bit: true distance along the ray of each pixel's centre [mm]; 0 = unknown. Through glass
                         and movers: of the surface behind
  gt/label/%06d.png      for some scenes, 16-bit: 1 thin object, 2 mirroring surface, 3 seen through glass, 4 sky,
                         5 rider, 6 mover, 0 elsewhere; pmsp-eval reports by these labels
  mask.png               with --mask-nadir: 0 = ignore

Examples:
  pmsp-synth --scene room -o room
  pmsp-densify run room/map.msg --images room/images -o room/cloud.ply

  pmsp-synth --scene corridor --keyframes 10 --width 1920 --noise 2 --gain-drift 0.05 --map-scale 0.7 -o corridor
  pmsp-synth --scene floor --mask-nadir 25 --jpeg 92 -o floor
  pmsp-synth --layout ob3d -o ob3d && tools/benchmark ob3d ob3d

Exit codes: 0 done, 2 wrong usage, 6 the mission cannot be written.)";

void add_scene_options(CLI::App& app, Arguments& arguments) {
  std::vector<std::string> names;
  for (const auto& [name, make] : scenes()) {
    names.push_back(name);
  }
  const std::string group = "Scene and flight";
  app.add_option(
         "--scene", arguments.scene,
         "room (with furniture), empty (the same without), painted (with bare walls, a door, pictures), sphere (from "
         "inside), plane (slanted), corridor (a wall across the seam), floor (at the nadir), gloss (long room with a "
         "mirroring floor, a polished column and a glass wall), thin (long room with poles, rails, cables, chairs), "
         "yard (outdoors: houses, trees, wires, sky), flat-photos (12 panoramas of a flat, 1.5 m apart)")
      ->check(CLI::IsMember(names))
      ->capture_default_str()
      ->group(group);
  app.add_option("--keyframes", arguments.recipe.keyframes,
                 "number of keyframes, at most those that fit into the scene: about ten; gloss, thin, yard: 30")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str()
      ->group(group);
  app.add_option("--yaw", arguments.recipe.yaw_deg, "rotation of all cameras to the right [deg]")
      ->check(CLI::Range(-360.0, 360.0))
      ->capture_default_str()
      ->group(group);
  app.add_flag("--weak", arguments.recipe.weak_texture, "plaster: contrast of a few gray levels")->group(group);
  app.add_flag("--overexposed-sky", arguments.recipe.overexposed_sky, "yard: a white sky")->group(group);
  app.add_flag("--rider", arguments.recipe.rider, "a dashboard, a hand, a head and a pole that move with the camera")
      ->group(group);
  app.add_option("--movers", arguments.recipe.movers,
                 "walking figures; from the third on, a bus, too; not with flat-photos")
      ->check(CLI::Range(0, 100))
      ->capture_default_str()
      ->group(group);
  app.add_option("--seed", arguments.recipe.texture_seed,
                 "seed of textures, landmarks and noise; same seed, same bytes")
      ->check(CLI::Range(0, 1000000000))
      ->capture_default_str()
      ->group(group);
}

void add_image_options(CLI::App& app, Arguments& arguments) {
  synth::MissionOptions& mission = arguments.recipe.mission;
  const std::string group = "Images";
  app.add_option("-w,--width", arguments.recipe.width,
                 "width of the images [px], a multiple of 4; the height is half of it")
      ->check(CLI::Range(64, 8192))
      ->capture_default_str()
      ->group(group);
  app.add_option("--samples", mission.render.samples, "colour samples per pixel along each axis")
      ->check(CLI::Range(1, 16))
      ->capture_default_str()
      ->group(group);
  app.add_option("--noise", mission.render.noise_sigma, "standard deviation of the sensor's noise [gray levels]")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str()
      ->group(group);
  app.add_option("--gain-drift", mission.gain_drift, "amplitude of the exposure's drift, relative")
      ->check(CLI::Range(0.0, 0.9))
      ->capture_default_str()
      ->group(group);
  app.add_option_function<std::string>(
         "--camera", [&arguments](const std::string& name) { arguments.cheap = name == "cheap"; },
         "perfect, or cheap: two lenses 24 mm apart, stitched as if they had one centre; vignetting where they meet, "
         "unequal gains; blur, noise, exposure drift, JPEG 75")
      ->check(CLI::IsMember({"perfect", "cheap"}))
      ->default_str("perfect")
      ->group(group);
  app.add_option("--lens-distance", mission.render.lens_distance,
                 "distance of two lenses along the forward axis; the truth stays that of the centre [m]")
      ->check(CLI::Range(-1.0, 1.0))
      ->capture_default_str()
      ->group(group);
  app.add_option("--jpeg", arguments.files.jpeg_quality, "quality of JPEG images, 1 to 100; 0 = PNG")
      ->check(CLI::Range(0, 100))
      ->capture_default_str()
      ->group(group);
  app.add_option("--mask-nadir", arguments.files.mask_nadir_deg,
                 "a dark rig below the camera, of this radius [deg], and a mask that hides it; 0 = none")
      ->check(CLI::Range(0.0, 90.0))
      ->capture_default_str()
      ->group(group);
}

void add_map_options(CLI::App& app, Arguments& arguments) {
  synth::LandmarkOptions& landmarks = arguments.recipe.mission.landmarks;
  const std::string group = "Map";
  app.add_option("--landmarks", landmarks.count, "number of landmarks in the map")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str()
      ->group(group);
  app.add_option("--landmark-noise", landmarks.noise, "error of landmarks, relative to their distance")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str()
      ->group(group);
  app.add_option("--map-scale", arguments.files.map.scale, "map units per metre, as a SLAM with one camera chooses it")
      ->check(CLI::Range(1e-6, 1e6))
      ->capture_default_str()
      ->group(group);
  app.add_option("--frame-step", arguments.files.frame_step, "frames from one keyframe to the next")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str()
      ->group(group);
}

/// Sets the image defects of a cheap camera, unless set by options.
void make_cheap(Arguments& arguments) {
  synth::MissionOptions& mission = arguments.recipe.mission;
  synth::RenderOptions& render = mission.render;
  const auto unless_given = [](auto& value, auto unset, auto cheap) {
    if (value == unset) value = cheap;
  };
  unless_given(render.lens_distance, 0.0, 0.024);
  unless_given(render.noise_sigma, 0.0, 3.0);
  unless_given(mission.gain_drift, 0.0, 0.1);
  unless_given(arguments.files.jpeg_quality, 0, 75);
  render.footprint_px = 2.8;  // Gaussian of 0.8 px
  render.samples = std::max(render.samples, 4);
  render.vignetting = 0.35;
  render.lens_gain = 0.08;
}

void run(Arguments& arguments) {
  synth::Recipe& recipe = arguments.recipe;
  if (recipe.width % 4 != 0) {
    throw InvalidOption("--width is " + std::to_string(recipe.width) + "; expected a multiple of 4");
  }
  recipe.height = recipe.width / 2;
  if (arguments.cheap) make_cheap(arguments);
  recipe.mission.render.seed = recipe.texture_seed;
  recipe.mission.landmarks.seed = recipe.texture_seed + 7;
  arguments.files.map.seed = recipe.texture_seed;
  check_folder(arguments.files);

  synth::Mission mission = scenes().at(arguments.scene)(recipe);
  if (arguments.files.mask_nadir_deg > 0.0) {
    synth_tool::add_rig(mission, arguments.files.mask_nadir_deg);
  }
  const std::string folder = arguments.files.folder.string();
  if (!arguments.layout.empty()) {
    synth_tool::write_layout(arguments.layout, mission, arguments.files);
    std::cout << folder << ": " << mission.frames.size() << " keyframes of " << mission.width << " x " << mission.height
              << "\nnext: tools/benchmark " << arguments.layout << " " << folder << "\n";
    return;
  }
  synth_tool::write_mission(mission, arguments.files);
  std::cout << folder << ": scene \"" << arguments.scene << "\", " << mission.frames.size() << " keyframes of "
            << mission.width << " x " << mission.height << ", " << mission.points.size() << " landmarks\n"
            << "next: pmsp-densify run " << folder << "/map.msg --images " << folder << "/images"
            << (mission.mask.empty() ? "" : " --mask " + folder + "/mask.png") << " -o " << folder << "/cloud.ply\n";
}

}  // namespace

int main(int argc, char** argv) {
  try {
    Arguments arguments;
    arguments.recipe.width = 1280;
    CLI::App app("Writes a synthetic 360-degree mission with known truth: images, a SLAM's map, poses and ranges.",
                 "pmsp-synth");
    app.footer(kFooter);
    app.set_version_flag("--version", "pmsp-synth " PMSP_VERSION_STRING);
    app.add_option("-o,--output", arguments.files.folder, "directory for the mission, made if it does not exist")
        ->required()
        ->option_text("DIR REQUIRED");
    CLI::Option* force = app.add_flag("--force", arguments.files.overwrite, "replace an existing mission");
    app.add_option("--layout", arguments.layout,
                   "instead of these files, those of a published benchmark, for tools/benchmark; without masks")
        ->check(CLI::IsMember(synth_tool::layout_names()))
        ->excludes(force);
    add_scene_options(app, arguments);
    add_image_options(app, arguments);
    add_map_options(app, arguments);
    try {
      app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      return app.exit(error) == 0 ? tool::kExitOk : tool::kExitUsage;
    }
    run(arguments);
  } catch (const std::exception& error) {
    std::cerr << "pmsp-synth: " << error.what() << '\n';
    return tool::exit_code_of(error);
  }
  return tool::kExitOk;
}
