# SPDX-License-Identifier: BSD-2-Clause
"""Maps, images, clouds and depth maps as files; the example of README.md."""
import json
import os
import re
import shutil
import signal
import subprocess

import numpy as np
import pmsp
import pytest
from conftest import SOURCE


def run_tool(tool, *words):
    subprocess.run([tool, *map(str, words)], check=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def test_the_example_of_the_readme_gives_the_bytes_of_the_tool(tool, data, tmp_path, monkeypatch):
    example = re.search(r"```python\n(.*?)```", (SOURCE / "README.md").read_text(), re.DOTALL).group(1)
    assert len([line for line in example.splitlines() if line.strip()]) <= 10
    (tmp_path / "map.msg").symlink_to(data / "map.msg")
    (tmp_path / "keyframes").symlink_to(data / "images")
    (tmp_path / "masks").mkdir()
    for image in (data / "images").iterdir():
        (tmp_path / "masks" / f"{image.stem}.png").symlink_to(data / "mask.png")
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(example, names)
    run_tool(tool, "map.msg", "--images", "keyframes", "--quality", "online", "-o", "tool.ply")
    assert (tmp_path / "mine.ply").read_bytes() == (tmp_path / "tool.ply").read_bytes()
    points = names["points"]
    stored = pmsp.open_cloud("mine.ply").read()
    assert len(points) == len(stored) > 100000
    for name in ("position", "normal", "color", "confidence", "views"):
        assert np.allclose(points[name], stored[name], atol=1e-4), name


def densify(data, slam_map, options, *args, **kwargs):
    return pmsp.densify(slam_map, pmsp.open_image_folder(slam_map, data / "images"), options, *args, **kwargs)


def test_each_preset_and_format_gives_the_bytes_of_the_tool(tool, data, slam_map, options, tmp_path):
    for quality, extension in (("normal", "las"), ("high", "ply")):
        small = pmsp.preset(pmsp.quality_from_name(quality))
        small.width, small.height = options.width, options.height
        path = tmp_path / f"{quality}.{extension}"
        output = pmsp.CloudOutput(path, pmsp.cloud_header_of(slam_map, small))
        densify(data, slam_map, small, output)
        assert not path.exists()
        output.commit()
        words = ("--quality", quality, "--width", options.width, "--height", options.height)
        run_tool(tool, data / "map.msg", "--images", data / "images", *words, "-o", tmp_path / f"tool.{extension}")
        assert path.read_bytes() == (tmp_path / f"tool.{extension}").read_bytes()


def test_maps_for_robots_give_the_bytes_of_the_tool(tool, data, slam_map, options, tmp_path):
    upright = pmsp.Similarity(1.46, np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]), np.zeros(3))  # z upwards, metres
    header = pmsp.cloud_header_of(slam_map, upright)
    header.generator, header.unit.kind = "pmsp-densify " + pmsp.__version__, pmsp.CloudUnit.Kind.METRES
    header.scratch, header.cell_size, header.least_rays = tmp_path, 0.2, 2
    header.robot_height, header.robot_step, header.robot_slope_deg = 0.8, 0.3, 30.0
    outputs = [pmsp.CloudOutput(tmp_path / name, header) for name in ("mine.bt", "mine.pgm")]

    def take(cloud):
        for output in outputs:
            output.add(cloud)

    densify(data, slam_map, options, cloud=take)
    for output in outputs:
        output.commit()
    matrix = np.eye(4)
    matrix[:3, :3] = upright.rotation
    np.savetxt(tmp_path / "upright.txt", matrix)
    words = ["--width", options.width, "--height", options.height, "--quality", "online", "--scale", upright.scale]
    words += ["--transform", tmp_path / "upright.txt", "--cell-size", 0.2, "--least-rays", 2, "--robot-height", 0.8]
    words += ["--robot-step", 0.3, "--robot-slope", 30, "-o", tmp_path / "tool.bt", "-o", tmp_path / "tool.pgm"]
    run_tool(tool, data / "map.msg", "--images", data / "images", *words)
    for name in (".bt", ".pgm", ".elevation.tif", ".slope.tif"):
        assert (tmp_path / f"mine{name}").read_bytes() == (tmp_path / f"tool{name}").read_bytes(), name
    header.map_units, header.unit.kind = False, pmsp.CloudUnit.Kind.MAP
    with pytest.raises(pmsp.InvalidInput, match="no metres"):
        pmsp.CloudOutput(tmp_path / "mine.bt", header)


def test_datasets_with_depth_are_those_of_the_tool(tool, data, slam_map, options, tmp_path):
    header = pmsp.cloud_header_of(slam_map, options)
    header.dataset_points, header.dataset_depth.png, header.dataset_depth.png_scale = 500, True, 1e-3
    header.scratch = tmp_path

    def export_views(folder):
        views = []
        for keyframe in slam_map.keyframes:
            view = pmsp.OutputView()
            view.keyframe_id, view.timestamp, view.cam_from_file = keyframe.id, keyframe.timestamp, keyframe.cam_from_world
            source = pmsp.open_image_folder(slam_map, data / "images").origin(keyframe.id).file
            view.name, view.width, view.height = source.name, 1920, 960
            shutil.copy(source, folder / "images")
            views.append(view)
        return views

    header.export_views = export_views
    output = pmsp.CloudOutput(tmp_path / "mine.nerfstudio", header)
    assert output.wants_depth()
    densify(data, slam_map, options, output)
    output.commit()
    words = ("--width", options.width, "--height", options.height, "--quality", "online", "--dataset-points", 500)
    words += ("--scale", 1, "--dataset-depth", "png", "-o", tmp_path / "tool.nerfstudio")
    run_tool(tool, data / "map.msg", "--images", data / "images", *words)
    files = sorted(path.relative_to(tmp_path / "tool.nerfstudio") for path in (tmp_path / "tool.nerfstudio").rglob("*.png"))
    assert len(files) == 3 * 14
    for name in files:
        assert (tmp_path / "mine.nerfstudio" / name).read_bytes() == (tmp_path / "tool.nerfstudio" / name).read_bytes(), name
    mine, other = (json.loads((tmp_path / f"{name}.nerfstudio/transforms.json").read_text()) for name in ("mine", "tool"))
    assert len(mine["frames"]) == 14
    for frame, expected in zip(mine["frames"], other["frames"]):
        assert np.allclose(frame.pop("transform_matrix"), expected.pop("transform_matrix")) and frame == expected


def test_progress_cancels_with_false_alone(data, slam_map, options):
    seen = []
    stats = densify(data, slam_map, options, progress=lambda done, all: seen.append((done, all)))
    assert seen == [(done, 14) for done in range(1, 15)] and stats.keyframes_added == 14
    assert densify(data, slam_map, options, progress=lambda done, all: done < 3).keyframes_added == 3


def test_an_interrupted_run_leaves_no_file(data, slam_map, options, tmp_path):
    output = pmsp.CloudOutput(tmp_path / "cloud.ply", pmsp.cloud_header_of(slam_map, options))
    with pytest.raises(KeyboardInterrupt):
        densify(data, slam_map, options, output, cloud=lambda cloud: os.kill(os.getpid(), signal.SIGINT))
    del output
    assert list(tmp_path.iterdir()) == []


def test_masks_and_calibration_may_be_set(data, slam_map, options, tmp_path):
    masks = pmsp.MaskSource(images=data / "images", nadir_deg=60)
    image = pmsp.open_image_folder(slam_map, data / "images").origin(1).file
    mask = masks.mask_for(image, 64, 32)
    assert mask.shape == (32, 64) and mask[0].all() and not mask[-1].any()
    assert pmsp.MaskSource(images=data / "images").mask_for(image, 64, 32) is None
    maps = []
    calibrate = pmsp.CalibrationOptions(lenses=False, rig=False)
    densify(data, slam_map, options, filtered_depth=maps.append, masks=masks, calibrate=calibrate)
    assert not any(each.depth[-16:].any() for each in maps) and any(each.depth[:16].any() for each in maps)


def test_maps_and_images(data, slam_map):
    assert "stella_vslam" in slam_map.format and slam_map.cameras[0].width == 1920
    assert [keyframe.id for keyframe in slam_map.keyframes] == list(range(1, 15))
    assert slam_map.find_keyframe(99) is None and slam_map.find_keyframe(3).id == 3
    keyframe = pmsp.keyframe_of(slam_map, slam_map.find_keyframe(3))
    assert len(keyframe.landmarks) == len(slam_map.find_keyframe(3).observations) and keyframe.pose_error > 0
    images = pmsp.open_image_folder(slam_map, data / "images")
    assert images.keyframe_ids() == list(range(1, 15)) and images.skipped() == []
    item = images.next()
    assert item.keyframe_id == 1 and item.image.shape == (960, 1920, 3) and item.image.dtype == np.uint8
    with pytest.raises(pmsp.InvalidInput):
        images.origin(99)
    with pytest.raises(pmsp.IoError, match="missing"):
        pmsp.open_image_folder(slam_map, data / "missing")


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(pmsp.IoError, match="none.msg"):
        pmsp.read_map(tmp_path / "none.msg")
    (tmp_path / "bad.msg").write_bytes(b"\x85\xa7cameras")
    with pytest.raises(pmsp.InvalidInput, match="bad.msg"):
        pmsp.read_map(str(tmp_path / "bad.msg"))
    with pytest.raises(pmsp.InvalidInput, match="bad.msg"):
        pmsp.open_cloud(tmp_path / "bad.msg")
    with pytest.raises(pmsp.InvalidOption, match="xyz"):
        pmsp.CloudOutput(tmp_path / "cloud.xyz")
    with pytest.raises(TypeError):
        pmsp.read_map(1)


def test_points_of_arrays_are_written_and_read_in_blocks(tmp_path):
    points = np.zeros(100_000, pmsp.OutputPoint)
    points["position"] = np.random.default_rng(2).uniform(-1, 1, (len(points), 3)).astype(np.float32)
    points["normal"] = 0, 0, 1
    points["confidence"], points["views"], points["color"] = 0.5, 3, (1, 2, 3)
    output = pmsp.CloudOutput(tmp_path / "cloud.ply")
    output.add(points, pmsp.Similarity(2.0, np.eye(3), [1, 0, 0]))
    with pytest.raises(TypeError, match="points"):
        output.add(np.zeros((3, 3)), pmsp.Similarity())
    output.commit()
    with pytest.raises(pmsp.OutputError):
        output.add(points, pmsp.Similarity())
    reader = pmsp.open_cloud(tmp_path / "cloud.ply")
    assert reader.info().format == "PLY" and reader.info().points == len(points) and reader.info().has_confidence
    stored = reader.read()
    assert np.allclose(stored["position"], 2 * points["position"] + [1, 0, 0], atol=1e-6)
    assert np.array_equal(stored["color"], points["color"]) and np.array_equal(stored["views"], points["views"])
    blocks = []
    assert reader.read(blocks.append) is None
    assert np.array_equal(np.concatenate(blocks), stored)

    def fail(block):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        reader.read(fail)


def test_depth_maps(tool, data, tmp_path):
    depth = np.random.default_rng(3).uniform(1, 2, (8, 16)).astype(np.float32)
    pmsp.write_pfm(tmp_path / "depth.pfm", depth)
    assert np.array_equal(pmsp.read_pfm(tmp_path / "depth.pfm"), depth)
    normals = np.dstack([depth, depth, depth])
    pmsp.write_pfm(tmp_path / "normals.pfm", normals)
    assert np.array_equal(pmsp.read_pfm3(tmp_path / "normals.pfm"), normals)
    with pytest.raises(TypeError, match="write_pfm"):
        pmsp.write_pfm(tmp_path / "double.pfm", depth.astype(np.float64))
    words = ("--width", 64, "--depth-maps", tmp_path / "depth", "-o", tmp_path / "cloud.ply")
    run_tool(tool, data / "map.msg", "--images", data / "images", *words)
    folder = pmsp.DepthFolder(tmp_path / "depth", data / "images")
    assert folder.is_indexed() and folder.kind() == "filtered"
    stored = folder.read(folder.file_for(3, data / "images" / "000010.jpg"))
    assert stored.shape == (32, 64) and stored.any()
    confidence = folder.read_confidence(3)
    assert confidence.shape == (32, 64) and np.array_equal(confidence > 0, stored > 0)
    assert folder.read_normals(3).shape == (32, 64, 3)
