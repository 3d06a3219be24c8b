# SPDX-License-Identifier: BSD-2-Clause
"""Densifier: results, errors, threads, interruption."""
import os
import signal
import threading

import numpy as np
import pmsp
import pytest


def run(densifier, keyframes):
    for keyframe in keyframes:
        densifier.add(keyframe)
    densifier.flush()


def test_depth_maps_and_clouds_have_the_documented_shapes(keyframes, options):
    maps, clouds = [], []
    densifier = pmsp.Densifier(options, filtered_depth=maps.append, cloud=clouds.append)
    run(densifier, keyframes[:5])
    stats = densifier.stats()
    assert len(maps) == len(clouds) == stats.depth_maps > 0
    for depth_map, cloud in zip(maps, clouds):
        assert depth_map.keyframe_id == cloud.keyframe_id
        assert depth_map.depth.shape == depth_map.confidence.shape == (64, 128)
        assert depth_map.normal.shape == (64, 128, 3)
        assert depth_map.depth.dtype == depth_map.normal.dtype == depth_map.confidence.dtype == np.float32
        has_depth = depth_map.depth > 0
        assert np.allclose(np.linalg.norm(depth_map.normal[has_depth], axis=1), 1, atol=1e-5)
        assert not depth_map.normal[~has_depth].any() and not depth_map.confidence[~has_depth].any()
        assert cloud.points.dtype == pmsp.CloudPoint and cloud.points.shape == cloud.pixels.shape == cloud.agree.shape
        assert cloud.pixels.dtype == np.uint32 and (np.diff(cloud.pixels.astype(np.int64)) > 0).all()
        world = pmsp.transform_points(cloud, cloud.pose())
        pose = cloud.cam_from_world
        expected = (cloud.points["position"] - pose.translation) @ pose.rotation
        assert np.allclose(world["position"], expected, atol=1e-4)
        assert np.array_equal(world["confidence"], cloud.points["confidence"])
    assert sum(len(cloud.points) for cloud in clouds) == stats.points > 1000
    assert densifier.options().width == 128 and densifier.backend().startswith("CPU")


def test_errors_have_the_names_and_messages_of_the_library(keyframes, options, image):
    for name in ("InvalidOption", "InvalidInput", "IoError", "OutputError", "DeviceError", "BackendUnavailable"):
        assert issubclass(getattr(pmsp, name), pmsp.Error) and getattr(pmsp, name).__module__ == "pmsp"
    assert issubclass(pmsp.Error, RuntimeError)
    options.advanced.fusion.min_confidence = 2
    with pytest.raises(pmsp.InvalidOption, match=r"fusion\.min_confidence is 2"):
        options.validate()
    with pytest.raises(pmsp.InvalidOption, match=r"fusion\.min_confidence is 2"):
        pmsp.Densifier(options)
    with pytest.raises(pmsp.InvalidOption):
        pmsp.quality_from_name("best")
    options.advanced.fusion.min_confidence = 0.1
    densifier = pmsp.Densifier(options)
    keyframe = keyframes[0]
    for bad, message in ((None, "the image is 0 x 0"), (np.ascontiguousarray(image[:, :31]), "31"), (image[:6], "6")):
        keyframe.image = bad
        with pytest.raises(pmsp.InvalidInput, match=message):
            densifier.add(keyframe)
    keyframe.image = image
    keyframe.mask = np.ones((8, 32), np.uint8)
    with pytest.raises(pmsp.InvalidInput, match="mask"):
        densifier.add(keyframe)
    keyframe.mask = None
    keyframe.cam_from_world.rotation = np.ones((3, 3))
    with pytest.raises(pmsp.InvalidInput, match="rotation"):
        densifier.add(keyframe)
    assert not densifier.cancelled() and densifier.stats().keyframes_added == 0


class Stop(Exception):
    pass


@pytest.mark.parametrize("callback", ["raw_depth", "filtered_depth", "cloud", "progress"])
def test_exceptions_of_callbacks_leave_the_call(keyframes, options, callback):
    def stop(*_):
        raise Stop("here")

    densifier = pmsp.Densifier(options, **{callback: stop})
    with pytest.raises(Stop, match="here"):
        run(densifier, keyframes)
    assert densifier.cancelled()


def test_callbacks_may_use_const_members_and_cancel_but_not_add(keyframes, options):
    seen = []

    def progress():
        seen.append(densifier.stats().keyframes_added)
        with pytest.raises(pmsp.Error, match=r"Densifier\.add: in use"):
            densifier.add(keyframes[0])
        densifier.cancel()

    densifier = pmsp.Densifier(options, progress=progress)
    run(densifier, keyframes)
    assert seen and densifier.cancelled()


def in_use(densifier, action):
    """Thread that calls `action` once the densifier is at work, which it can see only while the GIL is released."""

    def watch():
        while True:
            try:
                densifier.stats()
            except pmsp.Error as error:
                assert "in use" in str(error)
                return action()

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    return thread


def test_another_thread_runs_and_cancels_during_add(keyframes, options):
    options.width, options.height = 1024, 512
    clouds = []
    densifier = pmsp.Densifier(options, cloud=clouds.append)
    thread = in_use(densifier, densifier.cancel)
    run(densifier, keyframes)
    thread.join()
    assert densifier.cancelled() and len(clouds) < len(keyframes)


def test_ctrl_c_ends_a_run(keyframes, options):
    options.width, options.height = 1024, 512
    densifier = pmsp.Densifier(options)
    thread = in_use(densifier, lambda: os.kill(os.getpid(), signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        run(densifier, keyframes)
    thread.join()


def test_two_threads_with_a_densifier_each_give_the_bytes_of_one(keyframes, options):
    def points(results):
        clouds = []
        run(pmsp.Densifier(options, cloud=clouds.append), keyframes[:4])
        results.append(b"".join(cloud.points.tobytes() for cloud in clouds))

    results = []
    threads = [threading.Thread(target=points, args=(results,)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    points(results)
    assert results[0] and results[0] == results[1] == results[2]
