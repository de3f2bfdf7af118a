"""The arms and hands of the bundled Jacos: whole robots, speeds, torques, grip, travel, inverse kinematics."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pytest

import jacokin
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.model.descriptions import bundled
from jacokin.mujoco_bridge import Arena, JacoArm, JacoHand, ModelWrapperEntity, Physics, observations, robots
from tests.mujoco_bridge.scenes import (
    attach_sideways,
    check_torque_balances_the_joint,
    close_until_still,
    jaco_scene,
)

NAMES = bundled.JACOS
TWO_FINGERS = [name for name in NAMES if name.endswith("200")]
REACHED = 1e-6  # [m] of a success
VELOCITY_BAND = 0.01  # [rad/s]
TRAVEL_TIME = (1.1, 1.3)  # [s] datasheet: 1.2 s
GRIP_FORCE = (20.0, 30.0)  # [N] datasheet of three fingers: 25 N


@pytest.mark.one_quick
@pytest.mark.parametrize("robot", NAMES)
def test_arm_and_hand_are_the_bundled_robot(robot: str) -> None:
    physics, _, arm, hand = jaco_scene(robot=robot)
    whole = jacokin.load_robot(robot)
    assert arm.robot_name == hand.robot_name == robot
    assert arm.name == "jaco_arm"
    assert [joint.name for joint in arm.joints] == [f"jaco_arm/joint_{i}" for i in range(1, whole.dof + 1)]
    joints, actuators = physics.bind(arm.joints), physics.bind(arm.actuators)
    np.testing.assert_array_equal(np.where(joints.limited, joints.range[:, 0], -np.inf), whole.lower)
    np.testing.assert_array_equal(np.where(joints.limited, joints.range[:, 1], np.inf), whole.upper)
    np.testing.assert_allclose(actuators.ctrlrange[:, 1], [math.radians(36)] * (whole.dof - 3) + [math.radians(48)] * 3)
    np.testing.assert_array_equal(actuators.forcerange[:, 1], [30.5] * (whole.dof - 3) + [6.8] * 3)
    rng = np.random.default_rng(0)
    for _ in range(5):
        q = whole.sample(rng)
        joints.qpos = q
        T = whole.forward_kinematics(q, "gripsite")
        np.testing.assert_allclose(physics.bind(hand.grip_site).xpos - robots.ARM_OFFSET, T.translation, atol=1e-12)
        np.testing.assert_allclose(physics.bind(hand.grip_site).xmat.reshape(3, 3), T.rotation, atol=1e-12)


@pytest.mark.one_quick
@pytest.mark.parametrize("robot", NAMES)
def test_home_is_held_at_rest(robot: str) -> None:
    physics, _, arm, _ = jaco_scene(robot=robot)
    whole = jacokin.load_robot(robot)
    np.testing.assert_array_equal(physics.bind(arm.joints).qpos, bundled.variant(robot)["home"])
    assert whole.within_limits(physics.bind(arm.joints).qpos)
    assert physics.data.ncon == 0
    physics.step(100)
    assert np.abs(physics.bind(arm.joints).qpos - bundled.variant(robot)["home"]).max() < 0.01


@pytest.mark.one_quick
@pytest.mark.parametrize("robot", NAMES)
def test_commanded_velocities_are_reached_and_clipped(robot: str) -> None:
    arm = JacoArm(robot=robot)
    physics = Physics.from_entity(arm)
    arm.set_home(physics)
    limit = physics.bind(arm.actuators).ctrlrange[:, 1]
    with physics.disable("contact", "gravity", "limit"):
        for index in range(len(arm.joints)):
            arm.set_home(physics)
            physics.bind(arm.actuators[index]).ctrl = 2.0 * limit[index]
            physics.step(500)
            assert physics.bind(arm.joints[index]).qvel[0] == pytest.approx(limit[index], abs=VELOCITY_BAND)


@pytest.mark.parametrize("has_hand", [False, True])
@pytest.mark.parametrize("robot", NAMES)
def test_torque_observable_balances_the_joint(robot: str, has_hand: bool) -> None:
    arm = JacoArm(robot=robot)
    if has_hand:
        arm.attach(JacoHand(robot=robot))
    check_torque_balances_the_joint(arm, 20 if robot == bundled.DEFAULT_ROBOT else 5)


@pytest.mark.one_quick("robot")
@pytest.mark.parametrize("robot", NAMES)
@pytest.mark.parametrize(("start", "ctrl"), [(0.0, 5.0), (1.0, -5.0)], ids=["closing", "opening"])
def test_finger_travel_time(robot: str, start: float, ctrl: float) -> None:
    hand = JacoHand(robot=robot)
    physics = Physics.from_entity(hand)
    fingers = physics.bind(hand.joints)
    lower, upper = fingers.range.T
    goal = upper if ctrl > 0.0 else lower
    hand.set_grasp(physics, start)
    physics.bind(hand.actuators).ctrl = ctrl
    with physics.disable("gravity"):
        while (np.abs(fingers.qpos - goal) > 1e-3 * (upper - lower)).any():
            physics.step()
            assert physics.time < 2.0
    assert TRAVEL_TIME[0] <= physics.time <= TRAVEL_TIME[1]


def grip_forces(hand: JacoHand) -> Any:
    """Normal force of each finger on a ball of 2 cm in its middle, which may slide sideways [N]."""
    arena = Arena(contact="dm_control")
    arena.attach(hand)
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.worldbody.add_geom(name="ball", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.02, 0.0, 0.0))
    ball = ModelWrapperEntity(spec, name="ball")
    attach_sideways(arena, ball)
    physics = Physics.from_entity(arena)
    height = 0.193  # [m] of the pinch site above the base of the hand
    side = physics.bind(hand.pinch_site).xpos[:2] if len(hand.joints) == 3 else (0.0, 0.0)
    ball.set_pose(physics, position=(*side, height))
    close_until_still(physics, hand)
    forces = np.zeros(len(hand.joints))
    for index, contact in enumerate(physics.data.contact):
        names = [physics.model.geom(geom).name for geom in (contact.geom1, contact.geom2)]
        if "ball/ball" in names:
            wrench = np.empty(6)
            mujoco.mj_contactForce(physics.model, physics.data, index, wrench)
            finger = next(name for name in names if name != "ball/ball").split("_")[-2]
            forces[int(finger) - 1] += wrench[0]
    return forces


@pytest.mark.one_quick
@pytest.mark.parametrize("robot", NAMES)
def test_grip_force(robot: str) -> None:
    hand = JacoHand(robot=robot)
    forces = grip_forces(hand)
    assert GRIP_FORCE[0] <= forces.sum() <= GRIP_FORCE[1]
    if robot == bundled.DEFAULT_ROBOT:  # the second finger is at its limit and only touches
        np.testing.assert_allclose(forces, (11.5, 0.3, 12.2), atol=0.1)
    elif len(forces) == 2:
        np.testing.assert_allclose(forces, (12.2, 12.2), atol=0.1)


@pytest.mark.one_quick
@pytest.mark.parametrize("robot", NAMES)
def test_sites_are_brought_to_poses(robot: str) -> None:
    physics, _, arm, hand = jaco_scene(robot=robot)
    whole = jacokin.load_robot(robot)
    rng = np.random.default_rng(3)
    for _ in range(10):
        T = whole.forward_kinematics(whole.sample(rng), "gripsite")
        position, quat_wxyz = T.translation + robots.ARM_OFFSET, np.empty(4)
        mujoco.mju_mat2Quat(quat_wxyz, np.ascontiguousarray(T.rotation).ravel())
        assert arm.set_site_to_xpos(physics, rng, hand.grip_site, position, quat_wxyz)
        np.testing.assert_allclose(physics.bind(hand.grip_site).xpos, position, rtol=0.0, atol=REACHED)
        assert whole.within_limits(physics.bind(arm.joints).qpos)


@pytest.mark.slow
def test_seven_joints_reach_every_reachable_pose() -> None:
    physics, _, arm, hand = jaco_scene(robot="j2s7s300")
    arm.prepare(physics, hand.grip_site)
    whole, rng = jacokin.load_robot("j2s7s300"), np.random.default_rng(4)
    for q in whole.sample(rng, 200):
        T = whole.forward_kinematics(q, "gripsite")
        quat_wxyz = np.empty(4)
        mujoco.mju_mat2Quat(quat_wxyz, np.ascontiguousarray(T.rotation).ravel())
        assert arm.set_site_to_xpos(physics, rng, hand.grip_site, T.translation + robots.ARM_OFFSET, quat_wxyz)
        assert whole.within_limits(physics.bind(arm.joints).qpos)
        assert np.abs(physics.bind(hand.grip_site).xpos - robots.ARM_OFFSET - T.translation).max() < REACHED


@pytest.mark.parametrize("robot", TWO_FINGERS)
def test_hands_with_two_fingers_have_a_grip_site_and_no_pinch_site(robot: str) -> None:
    physics, _, _, hand = jaco_scene(robot=robot)
    assert hand.tool_center_point is hand.grip_site
    names = sorted(hand.observables.as_dict(fully_qualified=False))
    assert names == ["grip_site_pos", "grip_site_rmat", "joints_pos", "joints_vel"]
    assert all(each.enabled for each in hand.observables.as_dict().values())
    hand.set_grasp(physics, (0.0, 1.0))
    np.testing.assert_allclose(hand.observables.joints_pos(physics), (0.15, 1.35))
    np.testing.assert_array_equal(hand.observables.grip_site_pos(physics), physics.bind(hand.grip_site).xpos)
    with pytest.raises(InvalidInputError, match="no pinch site"):
        _ = hand.pinch_site
    with pytest.raises(InvalidInputError, match="no pinch site"):
        JacoHand(robot=robot, use_pinch_site_as_tcp=True)


def test_robots_and_fingers_are_checked() -> None:
    assert JacoHand(fingers=2).robot_name == "j2n6s200"
    assert JacoHand(fingers=3).robot_name == JacoHand().robot_name == "j2n6s300"
    assert JacoHand(fingers=3, robot="m1n6s300").robot_name == "m1n6s300"
    wrong: list[tuple[Any, type[InvalidInputError], str]] = [
        (lambda: JacoArm(robot="j2n6s400"), UnknownNameError, "Did you mean 'j2n6s300'"),
        (lambda: JacoArm(robot=300), UnknownNameError, "Valid: j2n6s300"),
        (lambda: JacoHand(robot="j3"), UnknownNameError, "unknown robot 'j3'"),
        (lambda: robots.make_hand(observations.VISION, "j3"), UnknownNameError, "unknown robot 'j3'"),
        (lambda: JacoHand(fingers=4), InvalidInputError, "fingers must be 3 or 2"),
        (lambda: JacoHand(fingers=True), InvalidInputError, "fingers must be a whole number"),
        (lambda: JacoHand(fingers=2, robot="j2n6s300"), InvalidInputError, "j2n6s300 has 3 fingers, not 2"),
        (lambda: JacoHand(use_pinch_site_as_tcp="yes"), InvalidInputError, "use_pinch_site_as_tcp must be True or"),
    ]
    for call, error, message in wrong:
        with pytest.raises(error, match=message):
            call()
