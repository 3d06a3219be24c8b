# SPDX-License-Identifier: BSD-2-Clause
"""Builds the wheel of the module pmsp by CMake: pip install --no-build-isolation .

The environment variable CMAKE_ARGS has further options of CMake, such as -DPMSP_CUDA=OFF.
"""
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = Path(__file__).resolve().parent


class CMakeBuild(build_ext):
    def build_extension(self, ext):
        packages = Path(self.get_ext_fullpath(ext.name)).resolve().parent.parent
        build = ROOT / "build-python"
        options = [
            "-DCMAKE_BUILD_TYPE=Release",
            "-DPMSP_BUILD_TOOLS=OFF",
            "-DPMSP_BUILD_TESTS=OFF",
            "-DPMSP_BUILD_IO=ON",
            "-DPMSP_PYTHON=ON",
            "-DPMSP_PYTHON_DESTINATION=.",
            f"-DPython3_EXECUTABLE={sys.executable}",
            *shlex.split(os.environ.get("CMAKE_ARGS", "")),
        ]
        subprocess.run(["cmake", "-S", ROOT, "-B", build, "-G", "Ninja", *options], check=True)
        subprocess.run(["cmake", "--build", build, "--target", "_pmsp"], check=True)
        install = ["cmake", "--install", build, "--component", "python", "--prefix", packages, "--strip"]
        subprocess.run(install, check=True)


setup(
    version=re.search(r"project\(pmsp VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text()).group(1),
    packages=["pmsp"],
    package_dir={"": "python"},
    package_data={"pmsp": ["*.pyi", "py.typed"]},
    ext_modules=[Extension("pmsp._pmsp", [])],
    cmdclass={"build_ext": CMakeBuild},
    options={"build": {"build_base": "build-python/setuptools"}},  # build/ is CMake's
)
