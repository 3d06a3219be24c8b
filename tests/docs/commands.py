#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-2-Clause
"""Runs the commands of a document's sh blocks on the sample mission, in the document's order.

    commands.py DOCUMENT PROGRAMS SOURCE WORK

PROGRAMS is the directory of the built tools, SOURCE the checkout, WORK a directory that is replaced. Programs of others are
listed and skipped. Depth maps and images are made small, ports free, waits short; else commands run as written.
"""
import os
import pathlib
import re
import shlex
import shutil
import signal
import subprocess
import struct
import sys
import zipfile

OWN = ("pmsp-densify", "pmsp-synth", "pmsp-eval")
SKIPPED = ("cmake", "colmap", "demo", "ffmpeg", "mission.sh", "mkdir", "ns-train", "pip", "python3", "run_video_slam", "setup", "snakemake", "test")
OUTPUTS = ("-o", "--report", "--depth-maps")
SMALL = (
    (r"(pmsp-densify (run|info|fuse|batch)\b|pmsp-densify(?= \S*(/|\.msg)))", r"\1 --width 64"),
    (r"(pmsp-synth.*?) --width \d+", r"\1"),
    (r"pmsp-synth", "pmsp-synth --width 128"),
    (r"(--port|--live-view) \d+", r"\1 0"),
    (r"--follow( --until-idle \d+)?", "--follow --until-idle 0.1"),
    (r"--slurm=submit", "--slurm=print"),
)
SHARDS = 2

document, programs, source, work = (pathlib.Path(word).resolve() for word in sys.argv[1:])


def commands():
    """(line number, command) of each sh block."""
    block, joined, begun = "", "", 0
    for number, line in enumerate(document.read_text().splitlines(), 1):
        if line.startswith("```"):
            block = "" if block else line[3:] or "text"
        elif block in ("sh", "bash", "console"):
            begun = begun if joined else number
            joined += line.removeprefix("$ ").removesuffix("\\")
            if line.endswith("\\"):
                continue
            if shlex.split(joined, comments=True):
                yield begun, joined.strip()
            joined = ""


def set_up():
    """The names that documents use, for the inputs of the sample mission."""
    shutil.rmtree(work, ignore_errors=True)
    (work / "missions/hall").mkdir(parents=True)
    for place in (work, work / "missions/hall"):
        (place / "map.msg").symlink_to(source / "data/map.msg")
        (place / "keyframes").symlink_to(source / "data/images")
    (work / "data").symlink_to(source / "data")
    (work / "build").symlink_to(programs)
    images = {int(path.stem): path.read_bytes() for path in (source / "data/images").iterdir()}
    with open(work / "original.mp4", "wb") as video:  # Motion JPEG: image after image
        for frame in range(max(images) + 1):
            video.write(images.get(frame, images[min(images)]))
    (work / "mission.mp4").symlink_to("original.mp4")
    write_vipe(work / "vipe_results")
    (work / "control.txt").write_text("a 0 0 0 500 100 10\nb 1 0 0 502 100 10\nc 0 1 0 500 102 10\nd 0 0 1 500 100 12\n")
    (work / "utm32.wkt").write_text('PROJCS["WGS 84 / UTM zone 32N"]')


def write_vipe(folder):
    """Poses of the sample mission as results of ViPE; its video is original.mp4."""
    for name in ("pose", "intrinsics", "rgb"):
        (folder / name).mkdir(parents=True)
    frames = sorted(int(path.stem) for path in (source / "data/images").iterdir())
    poses = (source / "data/gt/traj_tum.txt").read_text().splitlines()
    matrices = []
    for frame in frames:
        x, y, z, i, j, k, w = map(float, poses[frame].split()[1:])
        matrices += [1 - 2 * (j * j + k * k), 2 * (i * j - k * w), 2 * (i * k + j * w), x]
        matrices += [2 * (i * j + k * w), 1 - 2 * (i * i + k * k), 2 * (j * k - i * w), y]
        matrices += [2 * (i * k - j * w), 2 * (j * k + i * w), 1 - 2 * (i * i + j * j), z, 0, 0, 0, 1]
    with zipfile.ZipFile(folder / "pose/original.npz", "w") as archive:
        for name, kind, shape, values in (("data", "f", f"{len(frames)}, 4, 4", matrices), ("inds", "q", f"{len(frames)},", frames)):
            head = f"{{'descr': '<{kind.replace('f', 'f4').replace('q', 'i8')}', 'fortran_order': False, 'shape': ({shape}), }}\n"
            array = b"\x93NUMPY\1\0" + struct.pack("<H", len(head)) + head.encode() + struct.pack(f"<{len(values)}{kind}", *values)
            archive.writestr(name + ".npy", array)
    (folder / "intrinsics/original_camera.txt").write_text("".join(f"{frame}: PANORAMA\n" for frame in frames))
    (folder / "rgb/original.mp4").symlink_to(work / "original.mp4")


def prepare(words):
    """Removes outputs of earlier commands, and creates the prior depth maps."""
    if "batch" in words:
        return
    for flag, name in zip(words, words[1:]):
        path = work / name
        if flag in OUTPUTS and path.exists():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    if "depth/" in words and "--depth-maps" not in words and not (work / "depth").exists():
        run("pmsp-densify --width 64 map.msg --images keyframes -o depth.ply --depth-maps depth")


def run(command):
    """Exit code and output of a command; a server is interrupted once it has printed its address."""
    path = f"{programs}:{os.environ['PATH']}"
    with subprocess.Popen(["bash", "-c", "exec " + command], cwd=work, env={**os.environ, "PATH": path}, text=True,
                          stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        first = process.stdout.readline() if " serve " in command else ""
        if first.startswith("http://"):
            process.send_signal(signal.SIGINT)
        text = first + process.communicate()[0]
    return process.returncode, text


def main():
    failed = 0
    for index, (number, command) in enumerate(commands()):
        if index == 0:
            set_up()
        where = f"{document.relative_to(source)}:{number}: {command}"
        words = shlex.split(command, comments=True)
        program = pathlib.Path(words[0]).name
        if program in SKIPPED:
            print("skipped  " + where)
            continue
        prepare(words)
        for pattern, replacement in SMALL:
            command = re.sub(pattern, replacement, command)
        for shard in range(SHARDS if "--shard" in words else 1):
            small = re.sub(r"--shard \d+/\d+", f"--shard {shard}/{SHARDS}", command)
            status, text = run(small) if program in OWN else (127, f"expected one of {', '.join(OWN + SKIPPED)}\n")
            print(("ran      " if status == 0 else "FAILED   ") + where, flush=True)
            if status != 0:
                print(f"{small}\n{text}exit code {status}")
                failed += 1
    return 1 if failed else 0


sys.exit(main())
