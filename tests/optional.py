"""Packages that the tests compare with and that not every Python has."""

from __future__ import annotations

import sys
import warnings
from importlib.util import find_spec

import mujoco
import pytest


def needs_dm_control() -> None:
    """Skip a test where dm_control cannot be installed; elsewhere the test extra brings it."""
    if sys.version_info >= (3, 13) and find_spec("dm_control") is None:
        pytest.skip("dm_control is not installed: it has no version for this Python")


def make_dm_control_run() -> None:
    """Let dm_control 1.0.50 run on MuJoCo 4, which has dropped fields that it lists."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW without a display
        from dm_control.mujoco.wrapper.mjbindings import sizes
    for struct, owner in (("mjmodel", mujoco.MjModel), ("mjdata", mujoco.MjData)):
        for name in [name for name in sizes.array_sizes[struct] if not hasattr(owner, name)]:
            sizes.array_sizes[struct].pop(name)
