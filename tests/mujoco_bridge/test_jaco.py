"""The arm and the hand behave like the physical ones: forces, speeds and times of their datasheets."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError
from jacokin.mujoco_bridge import Arena, JacoArm, JacoHand, ModelWrapperEntity, Physics
from tests.mujoco_bridge.scenes import (
    HOME,
    attach_sideways,
    close_until_still,
    jaco_scene,
)

LARGE, SMALL = math.radians(36), math.radians(48)  # [rad/s] datasheet
GRIP_FORCE = (20.0, 30.0)  # [N] datasheet: 25 N
VELOCITY_BAND = 0.01  # [rad/s]


def ball_with_touch_sensor() -> tuple[ModelWrapperEntity, Any]:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.worldbody.add_geom(name="ball", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.02, 0.0, 0.0))
    spec.worldbody.add_site(name="skin", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.025, 0.0, 0.0))
    touch = spec.add_sensor(
        name="touch", type=mujoco.mjtSensor.mjSENS_TOUCH, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="skin"
    )
    return ModelWrapperEntity(spec, name="ball"), touch


def test_grip_force() -> None:
    arena, hand = Arena(), JacoHand()
    arena.attach(hand)
    ball, touch = ball_with_touch_sensor()
    attach_sideways(arena, ball)
    physics = Physics.from_entity(arena)
    ball.set_pose(physics, position=physics.bind(hand.pinch_site).xpos)
    close_until_still(physics, hand)
    assert GRIP_FORCE[0] <= physics.bind(touch).sensordata[0] <= GRIP_FORCE[1]


@pytest.mark.parametrize(("joint", "least", "most"), [(0, 1.7, 5.2), (5, 0.8, 7.0)])
def test_back_driving_torque(joint: int, least: float, most: float) -> None:
    """The least torque that brings a joint at rest at home to 0.1 rpm within 1 s."""
    arm = JacoArm()
    physics = Physics.from_entity(arm)
    bound = physics.bind(arm.joints[joint])
    for torque in np.arange(0.8 * least, 1.1 * most, 0.02):
        with physics.disable("gravity", "contact", "actuation"):
            physics.reset()
            arm.set_home(physics)
            bound.qfrc_applied = torque
            physics.step(500)
            fast_enough = bound.qvel[0] >= 0.1 * 2.0 * np.pi / 60.0
        if fast_enough:
            assert least <= torque <= most
            return
    pytest.fail("no torque in the band drives the joint")


@pytest.mark.parametrize(
    ("index", "ctrl", "velocity"),
    [
        (0, 0.0, 0.0),
        (0, LARGE, LARGE),
        (4, SMALL, SMALL),
        (0, -LARGE, -LARGE),
        (0, 2.0 * LARGE, LARGE),
        (5, -2.0 * SMALL, -SMALL),
    ],
)
def test_commanded_velocities_are_reached_and_clipped(index: int, ctrl: float, velocity: float) -> None:
    arm = JacoArm()
    physics = Physics.from_entity(arm)
    joint = physics.bind(arm.joints[index])
    with physics.disable("contact", "gravity"):
        physics.bind(arm.actuators[index]).ctrl = ctrl
        physics.step()
        while abs(joint.qacc[0]) > 1e-6:
            physics.step()
            assert physics.time < 5.0
    assert joint.qvel[0] == pytest.approx(velocity, abs=VELOCITY_BAND)


def test_numbers_of_the_model() -> None:
    physics, _, arm, hand = jaco_scene()
    joints, actuators = physics.bind(arm.joints), physics.bind(arm.actuators)
    np.testing.assert_array_equal(joints.limited, (0, 1, 1, 0, 0, 0))
    np.testing.assert_array_equal(joints.range[1], (math.radians(47), math.radians(313)))
    np.testing.assert_array_equal(joints.range[2], (math.radians(19), math.radians(341)))
    np.testing.assert_array_equal(joints.armature, (4.0, 4.0, 4.0, 2.0, 2.0, 2.0))
    np.testing.assert_array_equal(joints.frictionloss, (2.0, 2.0, 2.0, 1.0, 1.0, 1.0))
    np.testing.assert_array_equal(joints.damping, 0.01)
    np.testing.assert_array_equal(actuators.ctrlrange[:, 1], [LARGE] * 3 + [SMALL] * 3)
    np.testing.assert_array_equal(actuators.ctrlrange[:, 0], -actuators.ctrlrange[:, 1])
    np.testing.assert_array_equal(actuators.forcerange[:, 1], [30.5] * 3 + [6.8] * 3)
    np.testing.assert_array_equal(actuators.gainprm[:, 0], 500.0)
    np.testing.assert_array_equal(actuators.biasprm[:, 2], -500.0)
    fingers, squeezing = physics.bind(hand.joints), physics.bind(hand.actuators)
    np.testing.assert_array_equal(fingers.range, np.tile((0.15, 1.35), (3, 1)))
    np.testing.assert_array_equal(squeezing.ctrlrange, np.tile((-5.0, 5.0), (3, 1)))
    np.testing.assert_array_equal(squeezing.forcerange, np.tile((-1.0, 1.0), (3, 1)))
    np.testing.assert_array_equal(squeezing.gainprm[:, 0], 10.0)


def test_parts_of_the_hand() -> None:
    hand, pinching = JacoHand(), JacoHand(use_pinch_site_as_tcp=True)
    assert hand.tool_center_point is hand.grip_site
    assert pinching.tool_center_point is pinching.pinch_site
    assert [geom.name for geom in hand.hand_geom] == [g.name for g in hand.mjcf_model.body("hand").geoms]
    assert hand.hand_geom
    bodies = {geom.parent.name for geom in hand.finger_geoms}
    assert bodies == {f"link_finger{tip}_{i}" for tip in ("", "_tip") for i in (1, 2, 3)}
    arm = JacoArm()
    assert arm.attachment_site is arm.wrist_site
    assert arm.wrist_site.name == "wristsite"


def test_home_is_within_limits_at_rest_and_free_of_contact() -> None:
    physics, _, arm, hand = jaco_scene()
    physics.bind(arm.joints).qvel = 1.0
    physics.bind(hand.joints).qvel = 1.0
    physics.bind(arm.actuators).ctrl = 0.3
    arm.set_home(physics)
    np.testing.assert_array_equal(physics.bind(arm.joints).qpos, HOME)
    np.testing.assert_array_equal(physics.data.qvel, 0.0)
    np.testing.assert_array_equal(physics.bind(hand.joints).qpos, 0.15)
    np.testing.assert_array_equal(physics.data.ctrl, 0.0)
    assert physics.data.ncon == 0
    physics.step(100)
    assert np.abs(physics.bind(arm.joints).qpos - HOME).max() < 0.01
    hand.set_home(physics)
    np.testing.assert_array_equal(physics.bind(hand.joints).qvel, 0.0)


@pytest.mark.parametrize(
    ("factors", "angles"),
    [
        (0, (0.15, 0.15, 0.15)),
        (1.0, (1.35, 1.35, 1.35)),
        (0.5, (0.75, 0.75, 0.75)),
        ((0.0, 0.5, 1.0), (0.15, 0.75, 1.35)),
        (np.array([1.0, 1.0, 0.0]), (1.35, 1.35, 0.15)),
    ],
)
def test_set_grasp(factors: Any, angles: tuple[float, ...]) -> None:
    physics, _, _, hand = jaco_scene()
    rng = np.random.default_rng(0)
    physics.data.qvel[:] = velocities = rng.uniform(-0.1, 0.1, 9)
    physics.data.ctrl[:] = rng.uniform(-0.1, 0.1, 9)
    ctrl = physics.data.ctrl[:6].copy()
    hand.set_grasp(physics, factors)
    np.testing.assert_allclose(physics.bind(hand.joints).qpos, angles, rtol=0.0, atol=1e-15)
    assert (physics.bind(hand.joints).qpos <= 1.35).all()
    np.testing.assert_array_equal(physics.bind(hand.actuators).ctrl, 0.0)
    np.testing.assert_array_equal(physics.data.ctrl[:6], ctrl)
    np.testing.assert_array_equal(physics.data.qvel, velocities)
    np.testing.assert_array_equal(physics.data.actuator_force, 0.0)  # the pass was without actuation
    fresh = mujoco.MjData(physics.model)
    fresh.qpos[:] = physics.data.qpos
    mujoco.mj_kinematics(physics.model, fresh)
    np.testing.assert_array_equal(physics.data.xpos, fresh.xpos)


@pytest.mark.parametrize("factors", [-0.1, 1.1, (0.5, 0.5), (0.5,) * 4, np.nan, (0.0, 0.0, 2.0), "shut", None, [[0.5]]])
def test_wrong_grasps_change_nothing(factors: Any) -> None:
    physics, _, _, hand = jaco_scene()
    before = physics.get_state()
    with pytest.raises(InvalidInputError, match="close_factors"):
        hand.set_grasp(physics, factors)
    np.testing.assert_array_equal(physics.get_state(), before)


@pytest.mark.slow
def test_randomized_joints_lie_in_their_ranges_and_repeat_the_reference() -> None:
    physics, _, arm, _ = jaco_scene()
    lower = np.array([0.0, math.radians(47), math.radians(19), 0.0, 0.0, 0.0])
    upper = np.array([2 * np.pi, math.radians(313), math.radians(341), 2 * np.pi, 2 * np.pi, 2 * np.pi])
    for kind in (np.random.RandomState, np.random.default_rng):
        drawn: list[NDArray[np.float64]] = []
        rng, twin = kind(7), kind(7)
        for _ in range(2000):
            arm.randomize_arm_joints(physics, rng)
            drawn.append(physics.bind(arm.joints).qpos.copy())
            np.testing.assert_array_equal(drawn[-1], twin.uniform(lower, upper))
        q = np.array(drawn)
        assert (q >= lower).all()
        assert (q <= upper).all()
        assert (q[:, [0, 3, 4, 5]] < 2.0 * np.pi).all()
        # Kolmogorov-Smirnov distance to the uniform distribution: 1.95 / sqrt(n) is exceeded once in 1000 times.
        scaled = np.sort((q - lower) / (upper - lower), axis=0)
        steps = np.arange(1, 2001)[:, None] / 2000.0
        assert np.abs(scaled - steps).max() < 1.95 / math.sqrt(2000.0)


def test_random_states_of_the_wrong_kind() -> None:
    physics, _, arm, _ = jaco_scene()
    for wrong in (None, 0, np.random):
        with pytest.raises(InvalidInputError, match="random_state must be"):
            arm.randomize_arm_joints(physics, wrong)  # type: ignore[arg-type]
