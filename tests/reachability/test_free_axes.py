"""Maps of tools that may turn about an axis: against scans of the angle, with and without symmetry."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

import jacokin
from jacokin import FreeAxis, IKSolver, Robot
from jacokin.arrays import Array
from jacokin.reachability import Grid, Orientations, ReachabilityMap, build, load
from jacokin.reachability.samples import turn_about_z

SCANNED = 1500
GRID = Grid([-0.9, -0.9, -0.3], [0.9, 0.9, 1.2], 0.3)
UPRIGHT = FreeAxis(np.eye(4), axis=(0.0, 0.0, 1.0))
LEVEL = FreeAxis(jacokin.pose([0, 0, 0], approach=[1.0, 0.0, 0.0]).pose, axis=(0.0, 1.0, 0.0))  # y is up


def some_axes(rng: np.random.Generator, count: int) -> list[FreeAxis]:
    """Random orientations and axes, every second with a range."""
    found = []
    for number in range(count):
        rotation = pin.Quaternion(rng.normal(size=4)).normalized().matrix()
        low = rng.uniform(-4.0, 2.0)
        limits = (low, low + rng.uniform(0.3, 3.0)) if number % 2 else (-np.pi, np.pi)
        found.append(FreeAxis(pin.SE3(rotation, np.zeros(3)), axis=rng.normal(size=3), range=limits))
    return found


def targets_of(reach: ReachabilityMap, rng: np.random.Generator, count: int) -> list[tuple[FreeAxis, int, float]]:
    """Some samples, turned to anywhere about the base, with the number and the margin that the map has for them."""
    samples, sets = reach.samples, reach.orientations
    assert sets.axes is not None
    assert sets.ranges is not None
    found = []
    for _ in range(count):
        cell, index = int(rng.integers(samples.positions)), int(rng.integers(len(sets)))
        angle = rng.uniform(-np.pi, np.pi) if samples.symmetries.turns else 0.0
        turn = turn_about_z(angle)
        pose = pin.SE3(turn @ sets.rotations[index], turn @ samples.position(np.array([cell]))[0])
        target = FreeAxis(pose, axis=sets.axes[index], range=sets.ranges[index])
        found.append((target, int(reach.counts[cell, index]), float(reach.margins[cell, index])))
    return found


def scan(solver: IKSolver, target: FreeAxis) -> tuple[NDArray[np.int64], Array]:
    """Branches within the limits at many angles, and the largest margin at each, by the closed form of one pose."""
    poses = np.array([target.matrix_at(p) for p in np.linspace(*target.range, SCANNED)])
    rows = solver.closed_form().solve_batch(poses, np.tile(solver.robot.home, (SCANNED, 1)))
    return rows.branches_within_limits, rows.largest_margin


def of_some_axes(robot: Robot, folder: Path, *, symmetry: bool) -> ReachabilityMap:
    """The map of an upright tool, a level one, and four others."""
    axes = [UPRIGHT, LEVEL, *some_axes(np.random.default_rng(3), 4)]
    found = build(
        IKSolver(robot, collision="ignore"), folder=folder, grid=GRID, orientations=axes, use_symmetry=symmetry
    )
    assert found is not None
    return found


@pytest.fixture(scope="module")
def reach(robot: Robot, tmp_path_factory: pytest.TempPathFactory) -> ReachabilityMap:
    return of_some_axes(robot, tmp_path_factory.mktemp("free axes") / "map", symmetry=True)


@pytest.mark.parametrize("symmetry", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_a_cell_is_reached_when_any_member_is(
    robot: Robot, reach: ReachabilityMap, tmp_path: Path, rng: np.random.Generator, symmetry: bool
) -> None:
    reach = reach if symmetry else of_some_axes(robot, tmp_path / "map", symmetry=False)
    assert reach.samples.symmetries.turns is symmetry
    assert reach.samples.symmetries.tool_axis is None
    assert reach.bound is None
    solver = IKSolver(robot, collision="ignore")
    seen = {True: 0, False: 0}
    for target, count, margin in targets_of(reach, rng, 40):
        branches, margins = scan(solver, target)
        found = bool((branches > 0).any())
        if found != (count > 0):  # between two angles of the scan
            assert not found
            lengths = [interval.length for interval in solver.solve_all(target).intervals]
            assert max(lengths) < 2.0 * np.pi / SCANNED
            continue
        seen[found] += 1
        if found:
            assert count == len(solver.solve_all(target))
            best = float(margins[branches > 0].max())
            assert best - 2e-3 <= margin < best + 2e-2
    assert min(seen.values()) > 5


@pytest.mark.slow
def test_about_the_axis_of_the_last_joint_a_map_is_one_of_directions(
    robot: Robot, tmp_path: Path, reach_axis: Array, rng: np.random.Generator
) -> None:
    plain = build(
        IKSolver(robot, collision="ignore"),
        folder=tmp_path / "a",
        grid=GRID,
        orientations=Orientations.directions(6, reach_axis),
    )
    free = Orientations.directions(6, reach_axis, free_roll=True)
    rolled = build(IKSolver(robot, collision="ignore"), folder=tmp_path / "b", grid=GRID, orientations=free)
    full = build(
        IKSolver(robot, collision="ignore"), folder=tmp_path / "c", grid=GRID, orientations=free, use_symmetry=False
    )
    assert plain is not None
    assert rolled is not None
    assert full is not None
    np.testing.assert_array_equal(plain.counts, rolled.counts)
    assert rolled.bound == plain.bound
    for target, branches, _ in targets_of(full, rng, 100):  # a full turn of joint 6 on each branch is one interval
        assert (
            int(IKSolver(robot, collision="ignore").solve_all(target.at(rng.uniform(-3.0, 3.0))).within_limits.sum())
            == branches
        )


@pytest.fixture
def reach_axis(robot: Robot) -> Array:
    """The axis of the last joint in the frame of the tool."""
    pose = robot.forward_kinematics(robot.home)
    return np.asarray(pose.rotation.T @ robot.jacobian(robot.home)[3:, -1])


@pytest.mark.slow
def test_the_nearest_orientation_is_that_of_the_nearest_member(
    robot: Robot, tmp_path: Path, rng: np.random.Generator
) -> None:
    axes = some_axes(rng, 9)
    reach = build(
        IKSolver(robot, collision="ignore"),
        folder=tmp_path / "map",
        grid=Grid([0.3] * 3, [0.5] * 3, 0.2),
        orientations=axes,
    )
    assert reach is not None
    rotations = np.array([pin.Quaternion(rng.normal(size=4)).normalized().matrix() for _ in range(20)])
    cosines = reach.samples.cosines(rotations)
    for column, axis in enumerate(axes):
        members = np.array([axis.matrix_at(p)[:3, :3] for p in np.linspace(*axis.range, 1000)])
        for row, rotation in enumerate(rotations):
            best = (np.einsum("nij,ij->n", members, rotation).max() - 1.0) / 2.0
            assert cosines[row, column] == pytest.approx(best, abs=2e-5)


def test_the_nearest_pose_of_a_map_with_free_axes_is_reached(
    robot: Robot, reach: ReachabilityMap, rng: np.random.Generator
) -> None:
    reach, solver = load(reach.folder), IKSolver(robot, collision="ignore")
    for q in robot.sample(rng, 10):
        wanted = robot.forward_kinematics(q)
        found = reach.nearest_reachable(wanted)
        assert solver.solve(found).success
        assert reach.reached(found.homogeneous[None])[0]
        assert np.linalg.norm(found.translation - wanted.translation) < 2.0 * GRID.spacing


def test_axes_of_any_length_are_directions() -> None:
    wanted = Orientations.directions(5, [1.0, 1.0, 1.0]).quats_wxyz
    for length in (1e-300, 1e308):
        np.testing.assert_allclose(Orientations.directions(5, [length] * 3).quats_wxyz, wanted, atol=1e-15)
