# SPDX-License-Identifier: BSD-2-Clause
"""LiveDensifier: a small mission, images without copies, callbacks on workers, the end."""
import gc
import os
import signal
import subprocess
import sys
import threading
import weakref

import numpy as np
import pmsp
import pytest


@pytest.fixture
def live_options(options):
    result = pmsp.LiveOptions()
    result.densifier = options
    result.nice = 0
    result.stable_after = 0
    return result


@pytest.fixture
def live_keyframes(keyframes):
    result = []
    for keyframe in keyframes:
        live = pmsp.LiveKeyframe()
        live.id = keyframe.id
        live.cam_from_world = keyframe.cam_from_world
        live.landmarks = keyframe.landmarks
        live.image = pmsp.LiveImage(keyframe.image.copy())
        result.append(live)
    return result


def test_a_mission_becomes_clouds_that_follow_their_poses(live_keyframes, live_options):
    versions, errors = [], []
    with pmsp.LiveDensifier(live_options, changed=versions.append, on_error=errors.append) as live:
        for keyframe in live_keyframes:
            live.add(keyframe)
        live.finish()
        assert live.wait(600) and live.backlog().idle
        stats = live.stats()
        assert errors == [] and stats.errors == 0 and stats.added == len(live_keyframes)
        snapshot = live.snapshot()
        assert max(versions) <= snapshot.version and len(snapshot.clouds) == stats.used > 3
        for cloud in snapshot.clouds:
            assert not cloud.preliminary and cloud.cloud.points.dtype == pmsp.CloudPoint and len(cloud.cloud.points) > 0

        moved = live_keyframes[0]
        moved.cam_from_world.translation = moved.cam_from_world.translation + [0, 0, 1e-4]
        live.update([moved])
        changes = live.changes_since(snapshot.version)
        assert [cloud.keyframe_id for cloud in changes.moved] == [moved.id]
        assert changes.from_ == snapshot.version and not changes.empty()
        assert changes.moved[0].pose.cam_from_world == moved.cam_from_world
        old = snapshot.clouds[0]
        assert changes.moved[0].cloud is old.cloud and old.pose.cam_from_world != moved.cam_from_world

        live.erase([moved.id])
        assert moved.id in live.changes_since(snapshot.version).removed
        assert live.stats().erased == 1


def test_images_are_shared_kept_alive_and_released_at_the_end(live_keyframes, live_options, pictures):
    arrays = [picture.copy() for picture in pictures.values()]
    alive = [weakref.ref(array) for array in arrays]
    live = pmsp.LiveDensifier(live_options)
    live.pause()
    for keyframe, array in zip(live_keyframes, arrays):
        keyframe.image = pmsp.LiveImage(array, pmsp.PixelFormat.BGR)
        live.add(keyframe)
        keyframe.image = None
    del arrays, array
    gc.collect()
    assert all(reference() is not None for reference in alive)
    del live
    gc.collect()
    assert all(reference() is None for reference in alive)


def test_gray_images_have_two_axes(live_keyframes, live_options):
    gray = np.zeros((120, 240), np.uint8)
    image = pmsp.LiveImage(gray, pmsp.PixelFormat.GRAY)
    assert (image.width, image.height, image.format) == (240, 120, pmsp.PixelFormat.GRAY)
    for bad, pixel_format in ((gray, pmsp.PixelFormat.RGB), (np.dstack([gray] * 3), pmsp.PixelFormat.GRAY)):
        with pytest.raises(ValueError, match=r"LiveImage\.pixels"):
            pmsp.LiveImage(bad, pixel_format)
    with pytest.raises(TypeError):
        pmsp.LiveImage(None)


def test_copied_images(live_options):
    depth = np.arange(16 * 32, dtype=np.float32).reshape(16, 32)
    keyframe = pmsp.LiveKeyframe()
    keyframe.prior_depth = depth
    depth_of_keyframe = keyframe.prior_depth
    del keyframe
    assert np.array_equal(depth_of_keyframe, depth) and not np.shares_memory(depth_of_keyframe, depth)
    live_options.mask = np.ones((8, 16), np.uint8)
    assert live_options.mask.all()
    with pytest.raises(TypeError, match=r"LiveOptions\.mask"):
        live_options.mask = np.ones((8, 16), bool)
    live_options.mask = None
    assert live_options.mask is None


def test_errors(live_keyframes, live_options):
    live_options.memory_mib = 0
    with pytest.raises(pmsp.InvalidOption, match="memory_mib"):
        pmsp.LiveDensifier(live_options)
    live_options.memory_mib = 2048
    live = pmsp.LiveDensifier(live_options)
    live_keyframes[0].image = None
    with pytest.raises(pmsp.InvalidInput):
        live.add(live_keyframes[0])
    with live:
        pass
    with pytest.raises(pmsp.Error, match="closed"):
        live.stats()


def test_exceptions_of_callbacks_are_errors_of_the_map(live_keyframes, live_options):
    def fail(version):
        raise ValueError(f"no viewer for version {version}")

    with pmsp.LiveDensifier(live_options, changed=fail) as live:
        for keyframe in live_keyframes[:6]:
            live.add(keyframe)
        live.finish()
        assert live.wait(600)
        assert live.stats().errors > 0 and "no viewer for version" in live.stats().last_error
        assert len(live.snapshot().clouds) > 0


def test_calls_of_a_callback_end_before_the_worker(live_keyframes, live_options):
    for _ in range(3):
        called = threading.Event()
        errors = []

        def changed(version):
            called.set()
            try:
                while True:
                    live.changes_since(0)
            except pmsp.Error as error:
                errors.append(str(error))

        with pmsp.LiveDensifier(live_options, changed=changed) as live:
            for keyframe in live_keyframes[:6]:
                live.add(keyframe)
            live.finish()
            assert called.wait(600)
        assert "closed" in errors[0]


def test_a_callback_cannot_close_the_worker_that_runs_it(live_keyframes, live_options):
    with pmsp.LiveDensifier(live_options, changed=lambda version: live.__exit__()) as live:
        for keyframe in live_keyframes[:6]:
            live.add(keyframe)
        live.finish()
        assert live.wait(600)
        assert "closed by a callback" in live.stats().last_error
        assert len(live.snapshot().clouds) > 0


def test_a_callback_may_drop_the_last_reference(live_keyframes, live_options):
    held, added, ended = [], threading.Event(), threading.Event()

    def changed(version):
        if added.wait(600):
            held.clear()

    held.append(pmsp.LiveDensifier(live_options, changed=changed))
    weakref.finalize(changed, ended.set)
    del changed
    for keyframe in live_keyframes[:6]:
        held[0].add(keyframe)
    held[0].finish()
    added.set()
    assert ended.wait(600) and held == []


def test_other_threads_run_during_wait(live_keyframes, live_options):
    with pmsp.LiveDensifier(live_options) as live:
        live.pause()
        live.add(live_keyframes[0])
        results = []
        waiting = threading.Thread(target=lambda: results.append(live.wait(600)))
        waiting.start()
        assert live.wait(0) is False  # paused
        live.resume()
        live.finish()
        waiting.join()
        assert results == [True]


def test_ctrl_c_ends_wait(live_keyframes, live_options):
    with pmsp.LiveDensifier(live_options) as live:
        live.pause()
        live.add(live_keyframes[0])
        with pytest.raises(KeyboardInterrupt):
            threading.Thread(target=os.kill, args=(os.getpid(), signal.SIGINT)).start()
            live.wait(600)


PROGRAM = """
import sys, numpy as np, pmsp
live = pmsp.LiveDensifier(pmsp.LiveOptions(), changed=lambda version: None, on_error=print)
keyframe = pmsp.LiveKeyframe()
image = np.random.default_rng(1).integers(0, 256, (512, 1024, 3), np.uint8)
for keyframe.id in range(6):
    keyframe.image = pmsp.LiveImage(image)
    keyframe.cam_from_world.translation = [0.3 * keyframe.id, 0, 0]
    keyframe.landmarks = [(i, (3 * np.cos(i), np.sin(7 * i), 3 * np.sin(i))) for i in range(100)]
    live.add(keyframe)
print(live.stats().added)
"""


def test_a_program_may_end_while_the_worker_is_busy():
    done = subprocess.run([sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert (done.returncode, done.stdout) == (0, "6\n")
