"""Building poses, and refusing what is not one."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin.errors import InvalidInputError
from jacokin.model import pose_from_kinova, pose_to_kinova, poses


def test_orientations_mean_what_the_conventions_say() -> None:
    assert np.array_equal(jacokin.pose([1.0, 2.0, 3.0]).homogeneous[:3, 3], [1.0, 2.0, 3.0])
    assert np.array_equal(jacokin.pose([0, 0, 0]).rotation, np.eye(3))
    roll, pitch, yaw = 0.3, -0.4, 0.5
    by_rpy = jacokin.pose([0, 0, 0], rpy=[roll, pitch, yaw]).rotation
    by_hand = pin.utils.rotate("z", yaw) @ pin.utils.rotate("y", pitch) @ pin.utils.rotate("x", roll)
    np.testing.assert_allclose(by_rpy, by_hand, atol=1e-15)
    half = math.sqrt(0.5)
    quarter_turn_about_x = jacokin.pose([0, 0, 0], quat_wxyz=[half, half, 0, 0]).rotation
    np.testing.assert_allclose(quarter_turn_about_x @ [0, 1, 0], [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(jacokin.pose([0, 0, 0], down=True).rotation @ [0, 0, 1], [0, 0, -1], atol=1e-15)


def test_nearly_unit_quaternions_are_normalised() -> None:
    rotation = jacokin.pose([0, 0, 0], quat_wxyz=[1.009, 0, 0, 0]).rotation
    np.testing.assert_array_equal(rotation, np.eye(3))


@pytest.mark.parametrize(
    "quat", [[0, 0, 0, 0], [1.02, 0, 0, 0], [0.98, 0, 0, 0], [math.nan, 0, 0, 1], [1, 0, 0], [math.inf, 0, 0, 0]]
)
def test_bad_quaternions_are_refused(quat: list[float]) -> None:
    with pytest.raises(InvalidInputError, match="quat_wxyz"):
        jacokin.pose([0, 0, 0], quat_wxyz=quat)


def test_at_most_one_orientation() -> None:
    with pytest.raises(InvalidInputError, match="rpy and down"):
        jacokin.pose([0, 0, 0], rpy=[0, 0, 0], down=True)


def test_quaternions_round_trip(rng: np.random.Generator) -> None:
    for _ in range(100):
        quat = rng.normal(size=4)
        quat /= np.linalg.norm(quat) * (1.0 if quat[0] >= 0 else -1.0)
        np.testing.assert_allclose(poses.quat_wxyz(poses.rotation_from_quat_wxyz(quat)), quat, atol=1e-15)


@pytest.mark.parametrize(
    ("matrix", "text"),
    [
        (np.eye(3), "shape"),
        (np.diag([1, 1, 2, 1.0]), "not a rotation"),
        (np.diag([1, 1, -1, 1.0]), "reflection"),
        (np.diag([1, 1, 1, 2.0]), "last row"),
        (np.full((4, 4), np.nan), "finite"),
        (np.vstack((np.hstack((np.full((3, 3), np.nan), np.zeros((3, 1)))), [0, 0, 0, 1])), "finite"),
        (1e200 * np.eye(4), "last row|not a rotation"),
        ("somewhere", "pin.SE3"),
        (None, "pin.SE3"),
    ],
)
def test_what_is_not_a_pose_is_refused(matrix: object, text: str) -> None:
    with pytest.raises(InvalidInputError, match=text):
        poses.checked_pose(matrix)


def test_single_precision_matrices_are_made_orthonormal() -> None:
    rough = jacokin.pose([0.1, 0.2, 0.3], rpy=[0.3, 0.4, 0.5]).homogeneous.astype(np.float32)
    rotation = poses.checked_pose(rough).rotation
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=3e-16)
    np.testing.assert_allclose(rotation, rough[:3, :3], atol=1e-6)


@pytest.mark.parametrize("value", [[True, False, True], ["1", "2", "3"], [1j, 0, 0], [10**400, 0, 0], [None, 0, 0]])
def test_only_real_numbers_are_numbers(value: list[object]) -> None:
    with pytest.raises(InvalidInputError, match="position must be 3 numbers"):
        jacokin.pose(value)  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InvalidInputError, match="pin.SE3"):
        poses.matrix_of(np.eye(4, dtype=bool))
    with pytest.raises(InvalidInputError, match="pin.SE3"):
        poses.matrix_of(np.eye(4) + 0j)


def test_down_is_yes_or_no() -> None:
    with pytest.raises(InvalidInputError, match="down must be True or False"):
        jacokin.pose([0, 0, 0], down=np.array([1, 0]))  # type: ignore[call-overload]  # wrong on purpose


@pytest.mark.parametrize("approach", [(1.0, 0.0, 0.0), (0.0, -2.0, 0.0), (0.3, 0.4, -0.5), (0.0, 0.0, 1.0)])
def test_an_approach_points_the_tool_and_leaves_its_roll_free(approach: tuple[float, float, float]) -> None:
    target = jacokin.pose((0.4, 0.1, 0.3), approach=approach)
    wanted = np.array(approach) / np.linalg.norm(approach)
    for angle in (0.0, 1.0, -2.0):
        np.testing.assert_allclose(target.at(angle).rotation[:, 2], wanted, atol=1e-15)
        np.testing.assert_array_equal(target.at(angle).translation, (0.4, 0.1, 0.3))
    assert target.full_turn
    x, y = target.pose.rotation[:, 0], target.pose.rotation[:, 1]
    assert abs(x[2]) < 1e-15
    assert y[2] >= -1e-15 or abs(wanted[2]) == 1.0


def test_an_approach_straight_down_is_down() -> None:
    down = jacokin.pose((0.4, 0.1, 0.3), down=True)
    target = jacokin.pose((0.4, 0.1, 0.3), approach=(0.0, 0.0, -1.0))
    np.testing.assert_allclose(target.pose.homogeneous, down.homogeneous, atol=1e-15)


def test_an_approach_is_the_only_orientation() -> None:
    with pytest.raises(InvalidInputError, match="at most one orientation, got down and approach"):
        jacokin.pose((0.4, 0.1, 0.3), down=True, approach=(1.0, 0.0, 0.0))  # type: ignore[call-overload]  # wrong on purpose
    with pytest.raises(InvalidInputError, match="approach must have a direction"):
        jacokin.pose((0.4, 0.1, 0.3), approach=(0.0, 0.0, 0.0))


def test_poses_as_kinova_says_them(rng: np.random.Generator) -> None:
    # Kinova's documentation: the driver's home, in radians there.
    documented = pose_from_kinova(
        [212.322831154, -257.197618484, 509.646713734], np.degrees([1.63771402836, 1.11316478252, 0.134094119072])
    )
    reached = jacokin.load_robot().forward_kinematics(np.radians([275.0, 167.4, 57.4, 241.0, 82.7, 75.5]))
    assert np.linalg.norm(reached.translation - documented.translation) < 0.004
    assert np.linalg.norm(pin.log3(reached.rotation.T @ documented.rotation)) < 0.012
    for angles in rng.uniform(-89.0, 89.0, (20, 3)):
        a, b, c = (jacokin.pose([0, 0, 0], rpy=row).rotation for row in np.diag(np.radians(angles)))
        pose = pose_from_kinova([1.0, 2.0, 3.0], angles)
        np.testing.assert_allclose(pose.rotation, a @ b @ c, atol=1e-14)
        np.testing.assert_allclose(np.concatenate(pose_to_kinova(pose)), [1.0, 2.0, 3.0, *angles], atol=1e-9)
    with pytest.raises(InvalidInputError, match=r"angles_deg must have shape \(3,\) \[deg\]"):
        pose_from_kinova([1.0, 2.0, 3.0], [90.0])


def test_degrees_given_for_radians_are_noticed(caplog: pytest.LogCaptureFixture) -> None:
    jacokin.pose([0.3, 0.0, 0.3], rpy=[1.5, -6.2, 0.0])
    assert not caplog.records
    jacokin.pose([0.3, 0.0, 0.3], rpy=[90, 0, 0])
    assert "rpy is in radians, and an angle of [90, 0, 0] exceeds a full turn" in caplog.text


def test_millimetres_given_for_metres_are_noticed_and_the_other_way_round(caplog: pytest.LogCaptureFixture) -> None:
    pose_from_kinova([350.0, -300.0, 100.0], [90.0, 0.0, 0.0])
    assert not caplog.records
    jacokin.pose([350, -300, 100], down=True)
    assert "position is in metres, and [350, -300, 100] exceeds 10 m; 350 mm are 0.35" in caplog.text
    pose_from_kinova([0.35, -0.3, 0.1], [90.0, 0.0, 0.0])
    assert "position_mm is in millimetres, and [0.35, -0.3, 0.1] is less than 10 mm from the base" in caplog.text
