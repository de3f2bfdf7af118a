"""A square that every path test follows."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from jacokin import Robot
from jacokin.motion import Trajectory, track_path


@pytest.fixture(scope="session")
def square(robot: Robot) -> list[pin.SE3]:
    """Corners of a vertical square from home and back."""
    start = robot.forward_kinematics(robot.home)
    corners = np.array([[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0], [0, 0, 0]]) * 0.05  # [m]
    return [pin.SE3(start.rotation, start.translation + corner) for corner in corners]


@pytest.fixture(scope="session")
def result(robot: Robot, square: list[pin.SE3]) -> Trajectory:
    return track_path(robot, square, speed=[0.05, 0.1, 0.05, 0.1], acceleration_limit=np.inf)
