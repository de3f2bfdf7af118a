"""Forward kinematics and Jacobians: laws, golden numbers, and agreement of two engines."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

from jacokin import Robot
from jacokin.errors import InvalidInputError, UnknownNameError


def test_home_of_moveit_description(robot: Robot) -> None:
    # Kinova's MoveIt home, position given to 1e-6 m.
    position = robot.forward_kinematics([4.8046852, 2.92482, 1.002, 4.2031852, 1.4458, 1.3233]).translation
    np.testing.assert_allclose(position, [0.212743, -0.256609, 0.506962], atol=1e-6)


def test_samples_are_within_limits_and_fill_the_ranges(robot: Robot, rng: np.random.Generator) -> None:
    q = robot.sample(rng, 4000)
    assert all(robot.within_limits(row) for row in q)
    low, high = np.where(robot.unlimited, -np.pi, robot.lower), np.where(robot.unlimited, np.pi, robot.upper)
    assert (q >= low).all()
    assert (q < high).all()
    np.testing.assert_allclose(q.mean(axis=0), 0.5 * (low + high), atol=0.15)
    np.testing.assert_allclose(q.std(axis=0), (high - low) / math.sqrt(12.0), rtol=0.05)


def test_limits_are_exact(robot: Robot) -> None:
    q = np.array(robot.home)
    q[1] = math.radians(313)
    assert robot.within_limits(q)
    q[1] = np.nextafter(q[1], 10.0)
    assert not robot.within_limits(q)
    assert robot.within_limits(q, tolerance=1e-12)
    q[0] = 1e3  # joint 1 turns freely
    q[1] = math.radians(47)
    assert robot.within_limits(q)


def test_poses_are_copies_and_the_robot_does_not_change(robot: Robot, rng: np.random.Generator) -> None:
    first = robot.forward_kinematics(robot.home)
    before = first.homogeneous.copy()
    robot.forward_kinematics(robot.sample(rng))
    np.testing.assert_array_equal(first.homogeneous, before)
    with pytest.raises(AttributeError):
        robot.lower = np.zeros(6)
    with pytest.raises(ValueError, match="read-only"):
        robot.lower[1] = 0.0


def test_a_pickled_robot_is_the_same(robot: Robot, rng: np.random.Generator) -> None:
    copy = pickle.loads(pickle.dumps(robot))
    q = robot.sample(rng)
    assert (copy.name, copy.frames, copy.joint_names) == (robot.name, robot.frames, robot.joint_names)
    np.testing.assert_array_equal(copy.forward_kinematics(q).homogeneous, robot.forward_kinematics(q).homogeneous)
    np.testing.assert_array_equal(copy.home, robot.home)


@pytest.mark.parametrize(
    ("q", "text"),
    [
        ([0.0] * 5, r"q must have shape \(6,\)"),
        ([[[0.0] * 6]], "shape"),
        ([[0.0] * 5], "shape"),
        ([math.nan] + [1.0] * 5, "finite"),
        ([math.inf] + [1.0] * 5, "finite"),
        ("abcdef", "q must be 6 numbers"),
        (None, "q must"),
    ],
)
def test_malformed_configurations_are_refused(robot: Robot, q: object, text: str) -> None:
    for call in (robot.forward_kinematics, robot.jacobian, robot.within_limits, robot.manipulability):
        with pytest.raises(InvalidInputError, match=text):
            call(q)  # type: ignore[arg-type]  # wrong on purpose


def test_unknown_names_list_the_valid_ones(robot: Robot) -> None:
    with pytest.raises(
        UnknownNameError, match=r"unknown frame 'grip_site'. Did you mean 'gripsite'\?.*link_base"
    ) as error:
        robot.forward_kinematics(robot.home, "grip_site")
    assert error.value.valid == robot.frames
    with pytest.raises(UnknownNameError, match="reference.*local_world_aligned"):
        robot.jacobian(robot.home, reference="body")
    with pytest.raises(UnknownNameError, match="representation.*rotation_vector"):
        robot.analytical_jacobian(robot.home, representation="euler")
    with pytest.raises(UnknownNameError, match="joint_7"):
        robot.joint_index("joint_7")


def test_strided_configurations_become_contiguous(robot: Robot) -> None:
    column = np.tile(robot.home[:, None], (1, 3))[:, 1]
    for view in (column, robot.home[::-1].copy()[::-1], robot.home.astype(">f8")):
        checked = robot.configuration(view)
        assert checked.flags.c_contiguous
        np.testing.assert_array_equal(checked, robot.home)


@pytest.mark.parametrize("tolerance", ["a", np.ones(3), -1.0, math.nan, True])
def test_tolerances_are_one_number(robot: Robot, tolerance: object) -> None:
    with pytest.raises(InvalidInputError, match="tolerance"):
        robot.within_limits(robot.home, tolerance)  # type: ignore[arg-type]  # wrong on purpose
