"""Kinova's Gen3 arms: poses and torques of Kinova's own description, a pose that a real arm reported, contact."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import Robot
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.model import SelfContact
from jacokin.model.descriptions import bundled
from jacokin.mujoco_bridge import JacoArm, JacoHand, robots
from jacokin.mujoco_bridge.observations import PERFECT_FEATURES

GEN3S = ("gen3", "gen3_6dof", "gen3_lite")
# Kinova writes right angles with five digits: 0.014 mm, 0.028 mrad at most (3000 random configurations).
FIVE_DIGITS = 1.5e-5
TORQUE = 2e-4  # [N m] of the same rounding

# Forward kinematics, by a program of its own, of the numbers in Kinova's kortex_description (ros_kortex 2.5.2) at named
# configurations of its MoveIt descriptions [m].
NAMED_POSES = [
    ("gen3", [0.0, 0.26, 3.14, -2.27, 0.0, 0.96, 1.57], [0.4561002435, 0.0019873495, 0.4341896504]),
    ("gen3_6dof", [0.0, 0.26, -2.27, 0.0, 0.96, 1.57], [0.4533547428, 0.0013521077, 0.4237858933]),
    ("gen3_lite", [0.0, -0.28, 1.309, 0.0, -1.047, 0.0], [0.4388223553, 0.1934914662, 0.4487550448]),
    ("gen3_lite", [-0.0522, 0.3664, 2.53, -1.536, -0.6981, -1.5184], [0.1633006620, -0.0703308696, 0.1403622340]),
]
# Gravity torques at home, by Pinocchio from Kinova's URDF files GEN3-7DOF-VISION_ARM_URDF_V12 and
# GEN3-6DOF_VISION_URDF_ARM_V01 of the same version [N m].
GRAVITY = {
    "gen3": [-6.41e-05, -8.72941454, -0.09178784, 4.48797378, -0.00169434, 0.96910497, 0.00138018],
    "gen3_6dof": [5.92e-05, -8.05998316, 4.49210042, -0.00168953, 0.97455347, 0.00137850],
}
# Share of random configurations in self-contact, 4000 of them, and what may lie around it by chance.
SELF_CONTACT = {"gen3": 0.010, "gen3_6dof": 0.025, "gen3_lite": 0.090}
CHANCE = 0.015
SINGULAR = 0.02  # least to largest singular value of a home


@pytest.mark.parametrize(("name", "q", "position"), NAMED_POSES)
def test_named_poses_of_kinovas_description(
    name: str, q: list[float], position: list[float], bundled: Callable[[str], Robot]
) -> None:
    np.testing.assert_allclose(bundled(name).forward_kinematics(q).translation, position, rtol=0.0, atol=FIVE_DIGITS)


def test_a_real_gen3_lite_reported_this_pose(bundled: Callable[[str], Robot]) -> None:
    published = jacokin.model.descriptions.bundled.robot_table()["published"]["gen3_lite_reported"]
    q = np.radians(published["q_deg"])
    q = (q + math.pi) % (2.0 * math.pi) - math.pi
    reached = bundled("gen3_lite").forward_kinematics(q, published["frame"])
    rotation = pin.rpy.rpyToMatrix(*np.radians(published["rpy_deg"]))
    assert np.linalg.norm(reached.translation - published["xyz"]) < published["position_tolerance"]
    assert np.linalg.norm(pin.log3(rotation.T @ reached.rotation)) < published["orientation_tolerance"]


def test_the_six_joint_arm_upright_is_as_tall_as_the_user_guide_says(bundled: Callable[[str], Robot]) -> None:
    """Its transforms, with four decimals each, give (0, 0.001, 1.1765) m at zero."""
    position = bundled("gen3_6dof").forward_kinematics(np.zeros(6)).translation
    np.testing.assert_allclose(position, [0.0, 0.001, 1.1765], atol=4e-4)


@pytest.mark.parametrize("name", GRAVITY)
def test_gravity_of_kinovas_description(name: str, bundled: Callable[[str], Robot]) -> None:
    robot = bundled(name)
    np.testing.assert_allclose(robot.gravity(robot.home), GRAVITY[name], rtol=0.0, atol=TORQUE)


def test_masses_are_those_of_the_datasheets(bundled: Callable[[str], Robot]) -> None:
    """8.2 kg, 7.2 kg and 5.4 kg; the description of the lite is 0.2 kg short of it."""
    total = {name: sum(body.mass for body in bundled(name).pin_model.inertias) for name in GEN3S}
    assert total == pytest.approx({"gen3": 8.1885, "gen3_6dof": 7.1221, "gen3_lite": 5.1867}, abs=1e-4)


@pytest.mark.parametrize("name", GEN3S)
def test_home_is_documented_and_not_singular(name: str, bundled: Callable[[str], Robot]) -> None:
    robot = bundled(name)
    values = robot.singular_values(robot.home)
    assert values[-1] > SINGULAR * values[0]
    assert robot.home_source.startswith("documented for the gen3")
    assert not robot.notes


@pytest.mark.parametrize("name", GEN3S)
def test_share_of_configurations_in_self_contact(
    name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    contact = SelfContact.of(robot)
    assert contact is not None
    share = np.mean([bool(contact.touching(q)) for q in robot.sample(rng, 1500)])
    assert share == pytest.approx(SELF_CONTACT[name], abs=CHANCE)


@pytest.mark.parametrize("name", ["gen3", "gen3_6dof"])
def test_the_arm_without_a_gripper_ends_at_its_flange(name: str, bundled: Callable[[str], Robot]) -> None:
    robot = bundled(name)
    assert robot.finger_angle is None
    assert not [frame for frame in robot.frames if "hand" in frame or "finger" in frame]
    T_link_tool = robot.forward_kinematics(robot.home, f"link_{robot.dof}").actInv(robot.forward_kinematics(robot.home))
    np.testing.assert_allclose(T_link_tool.translation, [0.0, 0.0, -0.061525], atol=1e-12)
    wrist = robot.forward_kinematics(robot.home, "wristsite")
    np.testing.assert_allclose(wrist.homogeneous, robot.forward_kinematics(robot.home).homogeneous, atol=1e-12)


def tips(finger_angle: float | None) -> tuple[Robot, float]:
    """The Gen3 lite with its fingers at an angle [rad], and how far the joints of their tips are apart [m]."""
    robot = jacokin.load_robot("gen3_lite", finger_angle=finger_angle)
    first, second = (robot.forward_kinematics(robot.home, f"link_finger_tip_{k}").translation for k in (1, 2))
    return robot, float(np.linalg.norm(first - second))


def test_the_gripper_of_the_lite_is_loaded_open_and_closes() -> None:
    robot, opened = tips(None)
    assert robot.finger_angle == -0.96
    _, half = tips(-0.4)
    closed_robot, closed = tips(0.09)
    assert opened > half > closed
    assert opened == pytest.approx(0.1123, abs=2e-4)
    assert closed == pytest.approx(0.0121, abs=2e-4)
    tool = closed_robot.forward_kinematics(closed_robot.home)
    for k in (1, 2):  # the fingers are on both sides of the tool and reach it along its x axis
        tip = tool.actInv(closed_robot.forward_kinematics(closed_robot.home, f"link_finger_tip_{k}")).translation
        assert abs(tip[0]) < 0.02
        assert abs(tip[1]) < 1e-9
    with pytest.raises(InvalidInputError, match=r"the fingers move from -0\.96 to 0\.09 rad"):
        jacokin.load_robot("gen3_lite", finger_angle=0.5)


def test_accelerations_are_those_of_kinovas_driver(bundled: Callable[[str], Robot]) -> None:
    assert bundled("gen3").acceleration_limit.tolist() == [1.0, 1.0, 1.0, 1.0, 10.0, 10.0, 10.0]
    assert bundled("gen3_6dof").acceleration_limit.tolist() == [1.0, 1.0, 1.0, 10.0, 10.0, 10.0]
    assert bundled("gen3_lite").acceleration_limit.tolist() == [1.0, 0.5, 0.4, 1.0, 10.0, 10.0]


@pytest.mark.parametrize("name", GEN3S)
def test_the_simulated_arms_and_hands_are_those_of_the_jacos(name: str) -> None:
    assert name not in bundled.JACOS
    for make in (JacoArm, JacoHand):
        with pytest.raises(UnknownNameError, match=f"unknown robot '{name}'.*j2n6s300"):
            make(robot=name)
    with pytest.raises(UnknownNameError, match=f"unknown robot '{name}'"):
        robots.make_hand(PERFECT_FEATURES, name)
