"""How far from a reached sample the tool can be: the bound, and configurations that try to break it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from jacokin import IKSolver, Robot
from jacokin.arrays import Array
from jacokin.reachability import Grid, Orientations, ReachabilityMap, build, bundled
from jacokin.reachability.building import covering_angle, lever

NAMES = ("j2n6s300", "j2s6s300", "m1n6s300", "j2s7s300")


def farthest(reach: ReachabilityMap, positions: Array) -> float:
    """The largest distance [m] from positions (n, 3) to one that the map reaches with some orientation."""
    from scipy.spatial import cKDTree

    reached = reach.samples.position(np.flatnonzero(((reach.counts > 0) | (reach.touching > 0)).any(axis=1)))
    if reach.samples.symmetries.turns:
        positions = np.column_stack(
            [np.hypot(positions[:, 0], positions[:, 1]), 0.0 * positions[:, 0], positions[:, 2]]
        )
    return float(np.max(cKDTree(reached).query(positions)[0]))


@pytest.mark.one_quick
@pytest.mark.parametrize("name", NAMES)
def test_no_configuration_is_farther_from_a_reached_position(name: str, rng: np.random.Generator) -> None:
    reach = bundled(name)
    assert reach.bound is not None
    robot, half = reach.robot, np.sqrt(0.5) * reach.grid.spacing
    rows = robot.sample(rng, 20_000)
    limited = np.isfinite(robot.lower)
    edges = rng.random((len(rows), robot.dof)) < 0.2  # on limits, where the workspace ends
    rows[edges & limited] = np.where(rng.random(rows.shape) < 0.5, robot.lower, robot.upper)[edges & limited]
    positions = np.array([robot.forward_kinematics(q).translation for q in rows])
    assert half < reach.bound < 6.0 * half
    assert farthest(reach, positions) <= reach.bound


@pytest.mark.slow
def test_the_bound_of_a_map_without_symmetry(robot: Robot, tmp_path: Path, rng: np.random.Generator) -> None:
    reach = build(
        IKSolver(robot, frame="pinchsite"),
        folder=tmp_path / "map",
        grid=Grid.around(robot, 0.15),
        orientations=60,
        use_symmetry=False,
    )
    assert reach is not None
    assert reach.bound is not None
    assert reach.bound == pytest.approx(
        np.sqrt(3.0) * 0.15 + 2.0 * lever(reach.solver) * np.sin(0.5 * covering_angle(reach.orientations, None))  # type: ignore[operator]  # 60 rotations cover all
    )
    positions = np.array([robot.forward_kinematics(q, "pinchsite").translation for q in robot.sample(rng, 5000)])
    assert farthest(reach, positions) <= reach.bound


@pytest.mark.parametrize("count", [30, pytest.param(200, marks=pytest.mark.slow)])
def test_the_covering_angle_is_that_of_the_farthest_orientation(count: int, rng: np.random.Generator) -> None:
    axis = np.array([0.0, 0.6, 0.8])
    directions = Orientations.directions(count, axis)
    random = rng.normal(size=(200_000, 3))
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    sampled = np.arccos((random @ (directions.rotations @ axis).T).max(axis=1).min())
    angle = covering_angle(directions, axis)
    assert angle is not None
    assert sampled <= angle < 1.03 * sampled
    rotations = Orientations.even(count)
    quats = rng.normal(size=(200_000, 4))
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    sampled = 2.0 * np.arccos(np.abs(quats @ rotations.quats_wxyz.T).max(axis=1).min())
    angle = covering_angle(rotations, None)
    assert angle is not None
    assert sampled <= angle < 1.1 * sampled


def test_chosen_orientations_have_no_bound(robot: Robot, tmp_path: Path) -> None:
    for name, orientations in (("down", Orientations.down(4)), ("one", Orientations([[1.0, 0.0, 0.0, 0.0]]))):
        reach = build(
            IKSolver(robot, frame="pinchsite"),
            folder=tmp_path / name,
            grid=Grid([0.2] * 3, [0.6] * 3, 0.2),
            orientations=orientations,
        )
        assert reach is not None
        assert reach.bound is None


@pytest.mark.parametrize(("name", "distance"), [("j2s6s300", 0.10375 + 0.16), ("j2s7s300", 0.10375 + 0.16)])
def test_the_lever_is_the_distance_to_the_wrist(name: str, distance: float, bundled: Callable[[str], Robot]) -> None:
    assert lever(IKSolver(bundled(name))) == pytest.approx(distance)
    tool = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.1]))
    assert lever(IKSolver(bundled(name), tool=tool)) == pytest.approx(distance + 0.1)
