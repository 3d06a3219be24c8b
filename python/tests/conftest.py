# SPDX-License-Identifier: BSD-2-Clause
import os
import pathlib

import numpy as np
import pmsp
import pytest

SOURCE = pathlib.Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def data():
    """Directory of the sample mission."""
    return SOURCE / "data"


@pytest.fixture(scope="session")
def slam_map(data):
    return pmsp.read_map(data / "map.msg")


@pytest.fixture(scope="session")
def pictures(data, slam_map):
    """Images of 240 x 120 by keyframe id."""
    images = pmsp.open_image_folder(slam_map, data / "images")
    return {item.keyframe_id: item.image[::8, ::8].copy() for item in iter(images.next, None)}


@pytest.fixture
def keyframes(slam_map, pictures):
    """Keyframes of the sample mission with small images."""
    result = []
    for in_map in slam_map.keyframes:
        keyframe = pmsp.keyframe_of(slam_map, in_map)
        keyframe.image = pictures[in_map.id]
        result.append(keyframe)
    return result


@pytest.fixture
def options():
    """The online preset with small depth maps, on the CPU."""
    options = pmsp.preset(pmsp.Quality.ONLINE)
    options.width, options.height = 128, 64
    options.backend = pmsp.Backend.CPU
    return options


@pytest.fixture
def tool():
    """Path of pmsp-densify."""
    if "PMSP_DENSIFY" not in os.environ:
        pytest.skip("PMSP_DENSIFY, the path of pmsp-densify, is not set")
    return os.environ["PMSP_DENSIFY"]


@pytest.fixture(scope="session")
def image():
    """Random image of 32 x 16."""
    return np.random.default_rng(1).integers(0, 256, (16, 32, 3), np.uint8)
