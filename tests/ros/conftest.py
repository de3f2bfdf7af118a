"""ROS 1 of Debian, with a master, and ROS 2 of wheels; tests are skipped without."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from jacokin import Robot
from jacokin.motion import Trajectory, move_joints
from tests.ros.nodes import Master, MissingRosError, Ros, ros1_with_master, ros2_of_wheels


@pytest.fixture
def ros1_and_master() -> Iterator[tuple[Ros, Master]]:
    try:
        with ros1_with_master() as both:
            yield both
    except MissingRosError as why:
        pytest.skip(str(why))


@pytest.fixture
def ros1(ros1_and_master: tuple[Ros, Master]) -> Ros:
    """ROS 1 with a master."""
    return ros1_and_master[0]


@pytest.fixture(scope="module")
def ros2() -> Ros:
    """ROS 2 in a domain of its own."""
    try:
        return ros2_of_wheels()
    except MissingRosError as why:
        pytest.skip(str(why))


@pytest.fixture(scope="module")
def motion(robot: Robot) -> Trajectory:
    """A second and a half of a Jaco, of points 5 ms apart."""
    return move_joints(robot, robot.home, robot.home + np.array([0.4, 0.1, -0.2, 0.5, 0.1, 0.6]), dt=0.005)


@pytest.fixture
def file(motion: Trajectory, tmp_path: Path) -> Path:
    motion.save(tmp_path / "m.json", joint_prefix="j2n6s300_")
    return tmp_path / "m.json"
