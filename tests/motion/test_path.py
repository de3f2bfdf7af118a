"""Lines between poses, and how the free axis and its range change along them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from jacokin import FreeAxis
from jacokin.arrays import Array
from jacokin.motion.path import CartesianPath


def random_poses(rng: np.random.Generator, count: int) -> list[pin.SE3]:
    return [pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(-0.5, 0.5, 3)) for _ in range(count)]


def test_positions_move_straight_and_orientations_about_one_axis(rng: np.random.Generator) -> None:
    start, end = random_poses(rng, 2)
    path = CartesianPath([start, end], "end_effector")
    turn = pin.log3(start.rotation.T @ end.rotation)
    assert path.lengths[0] == pytest.approx([np.linalg.norm(end.translation - start.translation), np.linalg.norm(turn)])
    for part, T in zip(np.linspace(0.0, 1.0, 21), path.at(np.linspace(0.0, 1.0, 21)), strict=True):
        assert np.allclose(T[:3, 3], start.translation + part * (end.translation - start.translation), atol=1e-15)
        assert np.allclose(pin.log3(start.rotation.T @ T[:3, :3]), part * turn, atol=1e-12)


def test_waypoints_are_met_exactly(rng: np.random.Generator) -> None:
    poses = random_poses(rng, 4)
    for T, pose in zip(CartesianPath(poses, "end_effector").at(np.arange(4.0)), poses, strict=True):
        assert np.array_equal(T[:3, 3], pose.translation)
        assert np.abs(T[:3, :3] - pose.rotation).max() < 1e-15


def test_a_line_takes_the_longer_time_of_position_and_orientation(rng: np.random.Generator) -> None:
    path = CartesianPath(random_poses(rng, 3), "end_effector")
    assert np.allclose(path.durations(0.1, 1e6), path.lengths[:, 0] / 0.1)
    assert np.allclose(path.durations(1e6, [0.2, 0.4]), path.lengths[:, 1] / [0.2, 0.4])


def test_places_belong_to_the_line_that_ends_there(rng: np.random.Generator) -> None:
    path = CartesianPath(random_poses(rng, 3), "end_effector")
    assert path.segments(np.array([0.0, 0.3, 1.0, 1.1, 2.0])).tolist() == [0, 0, 0, 1, 1]


def test_steps_end_at_corners_and_pass_waypoints_of_a_line_that_are_near_to_each_other() -> None:
    along = [pin.SE3(np.eye(3), np.array([x, 0.0, 0.4])) for x in (0.2, 0.203, 0.206, 0.209, 0.212, 0.215, 0.3)]
    up = pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.402]))
    places = CartesianPath([*along, up], "tool").places(0.01, 1000)
    assert places[0] == 0.0
    assert np.isin([6.0, 7.0], places).all()  # the corner and the end
    assert not np.isin([1.0, 2.0], places).any()
    path = CartesianPath([*along, up], "tool")
    steps = np.linalg.norm(np.diff(path.at(places)[:, :3, 3], axis=0), axis=1)
    assert steps.max() <= 0.01 + 1e-12
    narrow = [FreeAxis(T, axis=(0.0, 0.0, 1.0), range=(0.0, 0.1 if k == 2 else 1.0)) for k, T in enumerate(along)]
    assert np.isin([1.0, 2.0, 3.0], CartesianPath(narrow, "tool").places(0.01, 1000)).all()  # the range changes


def test_the_middle_of_a_step_is_half_way_along_lines_of_different_lengths() -> None:
    path = CartesianPath([pin.SE3(np.eye(3), np.array([x, 0.0, 0.4])) for x in (0.2, 0.201, 0.21)], "tool")
    middle = path.middle(np.array([0.0, 0.5]), np.array([2.0, 1.0]))
    np.testing.assert_allclose(path.at(middle)[:, 0, 3], [0.205, 0.20075], atol=1e-8)


def axes_apart(path: CartesianPath, places: Array) -> Array:
    axes = path.axes(places)
    assert np.allclose(np.linalg.norm(axes, axis=1), 1.0, atol=1e-12)
    return np.asarray(np.arccos(np.clip((axes[:-1] * axes[1:]).sum(axis=1), -1.0, 1.0)))


def test_the_free_axis_turns_steadily_and_its_range_opens(rng: np.random.Generator) -> None:
    first, second, third = random_poses(rng, 3)
    path = CartesianPath(
        [FreeAxis(first, axis=(1.0, 0.0, 0.0), range=(-0.4, 0.2)), FreeAxis(second, axis=(0.0, 1.0, 0.0)), third],
        "tool",
    )
    assert path.free
    steps = axes_apart(path, np.linspace(0.0, 1.0, 11))
    assert np.allclose(steps, np.pi / 20, atol=1e-7)  # a quarter turn in ten steps
    low, high, full = path.window(np.array([0.0, 1.0, 2.0]))
    assert (low[0], high[0]) == (-0.4, 0.2)
    assert full.tolist() == [False, True, False]
    assert (low[2], high[2]) == (0.0, 0.0)  # a full pose
    assert isinstance(path.target(0.0), FreeAxis)
    assert isinstance(path.target(2.0), pin.SE3)
