# SPDX-License-Identifier: BSD-2-Clause
"""Dense 3D from 360-degree video: the interface of libpmsp in Python. Its stub file documents it."""
from ._pmsp import *
from ._pmsp import __version__
