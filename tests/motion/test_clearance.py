"""Trajectories against a scene: results, joint motions and files, and what happens between their rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import IKSolver, Robot
from jacokin.errors import InvalidInputError
from jacokin.ik import Box, Scene, Sphere
from jacokin.motion import Trajectory, move_joints, path_clearance, plan_path

WALL = Scene([Box("wall", [0.4, 0.002, 0.4], [0.5, -0.1, 0.2])])


@pytest.fixture(scope="module")
def through() -> Trajectory:
    """The tool goes through the wall; only every 5 cm there is a row."""
    down = jacokin.pose([0.4, -0.5, 0.3], down=True)
    corners = [down, pin.SE3(down.rotation, np.array([0.4, 0.1, 0.3]))]
    return plan_path(IKSolver(jacokin.load_robot()), corners, dt=0.5, speed=0.1, timing="slow")


def test_a_wall_between_rows_is_seen(robot: Robot, through: Trajectory) -> None:
    found = path_clearance(robot, through, WALL)
    assert len(found.t) > 5 * len(through)
    assert np.isin(through.t, found.t).all()
    assert (np.diff(found.t) > 0.0).all()
    assert found.least < 0.0
    at, pair = found.nearest
    assert "wall" in pair
    assert 0.0 < at < through.t[-1]
    rows = np.searchsorted(found.t, through.t)
    expected = robot.clearance(through.q, WALL, self_collision=True)
    np.testing.assert_allclose(found.distance[rows], expected, atol=1e-9)


def test_files_and_joint_motions(robot: Robot, through: Trajectory, tmp_path: Path) -> None:
    motion = move_joints(robot, through.q[0], through.q[-1], dt=0.1)
    for name in ("a.csv", "a.npz"):
        for trajectory in (through, motion):
            trajectory.save(tmp_path / name)
            expected = path_clearance(robot, trajectory, WALL, self_collision=False)
            again = path_clearance(robot, tmp_path / name, WALL, self_collision=False)
            np.testing.assert_array_equal(again.distance, expected.distance)
            assert {name for pair in again.pairs for name in pair} & {"wall"}


def test_wrong_arguments(robot: Robot, through: Trajectory, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="scene must be a Scene"):
        path_clearance(robot, through, [Sphere("a", 1.0, [0, 0, 0])])  # type: ignore[arg-type]  # what is tested
    with pytest.raises(InvalidInputError, match="path must be a Trajectory"):
        path_clearance(robot, through.q, WALL)  # type: ignore[arg-type]  # what is tested
    with pytest.raises(InvalidInputError, match="cannot be read"):
        path_clearance(robot, tmp_path / "none.csv", WALL)
    with pytest.raises(InvalidInputError, match="resolution must be"):
        path_clearance(robot, through, WALL, resolution=0.0)
    other = jacokin.load_robot("j2n6s300", tip="link_4")
    with pytest.raises(InvalidInputError, match="the trajectory moves joint_1"):
        path_clearance(other, through, WALL)
