"""Fixtures of the bridge's tests."""

from __future__ import annotations

import pytest

from tests.mujoco_bridge.scenes import Scene, jaco_scene


@pytest.fixture
def jaco() -> Scene:
    """The arm with its hand in an arena, at home."""
    return jaco_scene()
