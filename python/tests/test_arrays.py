# SPDX-License-Identifier: BSD-2-Clause
"""Arrays of the module: records, images without copies, lifetimes, refused arrays."""
import gc
import weakref

import numpy as np
import pmsp
import pytest


def test_records_have_the_members_of_the_structs():
    assert pmsp.CloudPoint.names == ("position", "normal", "color", "views", "confidence")
    assert [pmsp.CloudPoint[name].base for name in pmsp.CloudPoint.names] == ["f4", "f4", "u1", "u1", "f4"]
    assert [pmsp.CloudPoint[name].shape for name in pmsp.CloudPoint.names] == [(3,), (3,), (3,), (), ()]
    assert pmsp.CloudPoint.itemsize == 32
    assert pmsp.OutputPoint["position"].base == "f8" and pmsp.OutputPoint["keyframe_id"] == "i8"
    assert pmsp.Landmark == pmsp.MapLandmark and pmsp.Landmark.itemsize == 32
    assert pmsp.MapObservation["pixel"].shape == (2,)


def test_a_keyframe_refers_to_its_arrays_and_keeps_them_alive(image):
    keyframe = pmsp.Keyframe()
    array = image.copy()
    alive = weakref.ref(array)
    keyframe.image = array
    assert keyframe.image is array
    del array
    gc.collect()
    assert alive() is keyframe.image
    keyframe.image = None
    gc.collect()
    assert alive() is None and keyframe.image is None


BAD_IMAGES = [
    (TypeError, "of type list", [[[1, 2, 3]]]),
    (TypeError, "float64", np.zeros((16, 32, 3))),
    (TypeError, "int8", np.zeros((16, 32, 3), np.int8)),
    (ValueError, r"shape \(16, 32\)", np.zeros((16, 32), np.uint8)),
    (ValueError, r"shape \(16, 32, 4\)", np.zeros((16, 32, 4), np.uint8)),
    (ValueError, r"shape \(0, 32, 3\)", np.zeros((0, 32, 3), np.uint8)),
    (ValueError, "contiguous", np.zeros((16, 64, 3), np.uint8)[:, ::2]),
    (ValueError, "contiguous", np.zeros((16, 32, 3), np.uint8)[..., ::-1]),
    (ValueError, "contiguous", np.zeros((16, 32, 3), np.uint8)[::-1]),
    (ValueError, "contiguous", np.zeros((3, 16, 32), np.uint8).transpose(1, 2, 0)),
    (ValueError, "contiguous", np.broadcast_to(np.zeros((1, 32, 3), np.uint8), (16, 32, 3))),
    (ValueError, "contiguous", np.zeros((16, 32, 4), np.uint8)[..., :3]),
]


@pytest.mark.parametrize("error, message, array", BAD_IMAGES)
def test_images_of_other_types_shapes_and_layouts_are_refused(error, message, array):
    keyframe = pmsp.Keyframe()
    with pytest.raises(error, match=r"Keyframe\.image is .*" + message):
        keyframe.image = array
    assert keyframe.image is None
    with pytest.raises(error, match=message):
        pmsp.LiveImage(array)


def test_depths_of_another_byte_order_or_alignment_are_refused():
    keyframe = pmsp.Keyframe()
    with pytest.raises(TypeError, match="prior_depth"):
        keyframe.prior_depth = np.zeros((16, 32), ">f4")
    unaligned = np.zeros(16 * 32 * 4 + 1, np.uint8)[1:].view(np.float32).reshape(16, 32)
    with pytest.raises(TypeError, match="prior_depth"):
        keyframe.prior_depth = unaligned


def test_landmarks_are_records_or_tuples():
    keyframe = pmsp.Keyframe()
    keyframe.landmarks = [(1, (0.0, 0.0, 2.0)), (7, (1.0, 2.0, 3.0))]
    assert keyframe.landmarks["id"].tolist() == [1, 7]
    assert keyframe.landmarks["position_world"].tolist() == [[0, 0, 2], [1, 2, 3]]
    records = np.zeros(8, pmsp.Landmark)
    records["id"] = range(8)
    keyframe.landmarks = records[::2]
    assert keyframe.landmarks["id"].tolist() == [0, 2, 4, 6]
    kept = keyframe.landmarks
    keyframe.landmarks = []
    assert kept["id"].tolist() == [0, 2, 4, 6] and len(keyframe.landmarks) == 0
    with pytest.raises(TypeError, match=r"Keyframe\.landmarks .*position_world"):
        keyframe.landmarks = np.zeros((4, 3))
    with pytest.raises(ValueError, match=r"shape \(2, 2\)"):
        keyframe.landmarks = np.zeros((2, 2), pmsp.Landmark)
    with pytest.raises(TypeError, match="str"):
        keyframe.landmarks = "none"


def test_images_with_padded_rows_give_the_depths_of_packed_ones(keyframes, options):
    def depths(change):
        maps = []
        densifier = pmsp.Densifier(options, filtered_depth=maps.append)
        for keyframe in keyframes[:3]:
            keyframe.image = change(keyframe.image)
            densifier.add(keyframe)
        densifier.flush()
        return np.stack([each.depth for each in maps])

    def padded(image):
        wide = np.zeros((image.shape[0], image.shape[1] + 5, 3), np.uint8)
        wide[:, : image.shape[1]] = image
        return wide[:, : image.shape[1]]

    packed = depths(lambda image: image)
    assert packed.any() and np.array_equal(packed, depths(padded))


def test_results_are_read_only_views_that_outlive_their_owners(keyframes, options):
    maps, clouds = [], []
    densifier = pmsp.Densifier(options, filtered_depth=maps.append, cloud=clouds.append)
    for keyframe in keyframes[:4]:
        densifier.add(keyframe)
    densifier.flush()
    cloud, depth_map = clouds.pop(1), maps.pop(1)
    arrays = [cloud.points, cloud.pixels, depth_map.depth, depth_map.normal, depth_map.confidence]
    assert np.shares_memory(cloud.points, cloud.points)
    assert np.shares_memory(cloud.points["position"], cloud.points)
    copies = [array.copy() for array in arrays]
    del cloud, depth_map, densifier, clouds, maps
    gc.collect()
    for array, copy in zip(arrays, copies):
        assert len(array) > 0 and np.array_equal(array, copy)
        with pytest.raises(ValueError, match="read-only"):
            array[0] = copy[0]


def test_the_arrays_of_a_map_outlive_it(data):
    slam_map = pmsp.read_map(data / "map.msg")
    assert slam_map.landmarks.dtype == pmsp.MapLandmark and len(slam_map.landmarks) == 1411
    landmarks, keyframe = slam_map.landmarks, slam_map.keyframes[3]
    observations = keyframe.observations
    total = landmarks["id"].sum(), observations["landmark_id"].sum()
    del slam_map
    gc.collect()
    assert keyframe.id == 4 and observations.dtype == pmsp.MapObservation
    del keyframe
    gc.collect()
    assert (landmarks["id"].sum(), observations["landmark_id"].sum()) == total


def test_poses():
    pose = pmsp.RigidTransform([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [1, 2, 3])
    assert (pose * np.array([1.0, 0.0, 0.0])).tolist() == [1, 3, 3]
    assert pose * pose.inverse() == pmsp.RigidTransform()
    assert (pose * pose.center()).tolist() == [0, 0, 0]
    with pytest.raises(ValueError, match="read-only"):
        pose.translation[1] = 5
    pose.translation = [1, 5, 3]
    assert pose.translation.tolist() == [1, 5, 3] and "translation=[1, 5, 3]" in repr(pose)
    matrix = np.eye(4)
    matrix[:3, 3] = 1, 5, 3
    assert pmsp.rigid_transform(matrix).translation.tolist() == [1, 5, 3]
    with pytest.raises(TypeError):
        pmsp.rigid_transform(np.eye(3))
    with pytest.raises(TypeError):
        pmsp.RigidTransform(np.eye(3), [1, 2])
    bearings = pmsp.bearing_from_pixel([[16.0, 8.0], [24.0, 8.0]], 32, 16)
    assert np.allclose(bearings, [[0, 0, 1], [1, 0, 0]])
    assert np.allclose(pmsp.pixel_from_bearing(bearings, 32, 16), [[16, 8], [24, 8]])
