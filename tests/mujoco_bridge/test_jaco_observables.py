"""The observables of the Jaco in a simulation."""

from __future__ import annotations

from typing import Any, cast

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError
from jacokin.mujoco_bridge import Arena, JacoArm, JacoHand, Physics, observations
from jacokin.mujoco_bridge.jaco_arm import JacoArmObservables
from jacokin.mujoco_bridge.observables import MJCFFeature, Observable, observable
from jacokin.mujoco_bridge.observations import angles_from_sin_cos
from jacokin.mujoco_bridge.props import Primitive
from jacokin.mujoco_bridge.updater import Updater, observables_of
from tests.mujoco_bridge.scenes import Scene, jaco_scene

CONTROL_STEPS = 20  # physics steps of 2 ms in a control step of 40 ms


def test_names_and_shapes(jaco: Scene) -> None:
    found = observables_of(jaco.arena)
    shapes = {name: each(jaco.physics).shape for name, each in found.items() if each.enabled}
    assert shapes == {
        "jaco_arm/jaco_hand/joints_pos": (3,),
        "jaco_arm/jaco_hand/joints_vel": (3,),
        "jaco_arm/jaco_hand/pinch_site_pos": (3,),
        "jaco_arm/jaco_hand/pinch_site_rmat": (9,),
        "jaco_arm/joints_pos": (6, 2),
        "jaco_arm/joints_torque": (6,),
        "jaco_arm/joints_vel": (6,),
    }
    assert list(found) == list(shapes)
    assert list(jaco.hand.observables.as_dict(fully_qualified=False)) == [
        "joints_pos",
        "joints_vel",
        "pinch_site_pos",
        "pinch_site_rmat",
    ]


def test_plain_entities_start_disabled_and_without_corruptor() -> None:
    for entity in (JacoArm(), JacoHand()):
        for each in entity.observables.as_dict().values():
            assert not each.enabled
            assert each.corruptor is None
            assert (each.update_interval, each.buffer_size, each.delay, each.aggregator) == (1, None, None, None)
    own = JacoArm(observable_options={"joints_pos": {"enabled": True}})
    assert list(own.observables.enabled_observables) == ["joints_pos"]
    with pytest.raises(KeyError, match="joints_pos, joints_torque, joints_vel"):
        JacoArm(observable_options={"joint_pos": {"enabled": True}})


@pytest.mark.parametrize("angle", [0.0, -np.pi / 2, np.pi, 10 * np.pi])
def test_arm_positions_are_sine_and_cosine(jaco: Scene, angle: float) -> None:
    jaco.physics.bind(jaco.arm.joints).qpos = angle
    value = jaco.arm.observables.joints_pos(jaco.physics)
    np.testing.assert_array_equal(value, np.tile([np.sin(angle), np.cos(angle)], (6, 1)))
    np.testing.assert_allclose(angles_from_sin_cos(value, near=np.full(6, angle)), angle, rtol=0, atol=1e-14)


def test_positions_velocities_and_pinch_site(jaco: Scene) -> None:
    rng = np.random.default_rng(0)
    physics, arm, hand = jaco.physics, jaco.arm, jaco.hand
    arm_vel, hand_vel, hand_pos = rng.normal(size=6), rng.normal(size=3), rng.uniform(0.2, 1.3, size=3)
    physics.bind(arm.joints).qvel = arm_vel
    physics.bind(hand.joints).qvel = hand_vel
    physics.bind(hand.joints).qpos = hand_pos
    np.testing.assert_array_equal(arm.observables.joints_vel(physics), arm_vel)
    np.testing.assert_array_equal(hand.observables.joints_vel(physics), hand_vel)
    np.testing.assert_array_equal(hand.observables.joints_pos(physics), hand_pos)
    site = physics.data.site("jaco_arm/jaco_hand/pinchsite")
    moved = jaco.arm.joints[1]
    physics.bind(moved).qpos = 3.3  # [rad]
    value = hand.observables.pinch_site_pos(physics), hand.observables.pinch_site_rmat(physics)
    mujoco.mj_kinematics(physics.model, physics.data)
    np.testing.assert_array_equal(value[0], site.xpos)
    np.testing.assert_array_equal(value[1], site.xmat)


def test_values_do_not_change_under_the_reader(jaco: Scene) -> None:
    enabled = [each for each in observables_of(jaco.arena).values() if each.enabled]
    values = [each(jaco.physics) for each in enabled]
    copies = [value.copy() for value in values]
    jaco.physics.bind(jaco.arm.actuators).ctrl = 0.3  # [rad/s]
    jaco.physics.step(50)
    for value, copy, each in zip(values, copies, enabled, strict=True):
        np.testing.assert_array_equal(value, copy)
        value[...] = 0.0
        assert not np.array_equal(each(jaco.physics), value)


def test_one_arm_can_be_read_in_two_simulations(jaco: Scene) -> None:
    twin = jaco.physics.copy()
    jaco.physics.bind(jaco.arm.joints).qpos = 0.5
    first, second = (jaco.arm.observables.joints_pos(each) for each in (jaco.physics, twin))
    np.testing.assert_array_equal(first[:, 0], np.sin(np.full(6, 0.5)))
    np.testing.assert_allclose(angles_from_sin_cos(second)[1], 2.92482)
    np.testing.assert_array_equal(jaco.arm.observables.joints_pos(jaco.physics), first)


@pytest.mark.parametrize("index", [0, 2, 4])
@pytest.mark.parametrize("torque", [0.0, 5.0, -6.8, 30.5])
def test_torque_is_minus_the_external_torque(index: int, torque: float) -> None:
    arm = JacoArm()
    physics = Physics.from_entity(arm)
    with physics.disable("gravity", "limit", "contact", "actuation"):
        body = arm.joints[index].parent
        axis = physics.bind(arm.joints[index]).xaxis.reshape(3)
        physics.bind(body).xfrc_applied[3:] = torque * axis  # [N m]
        physics.forward()
        observed = arm.observables.joints_torque(physics)
    assert observed[index] == pytest.approx(-torque, abs=0.1)


def test_make_arm_reports_torques_on_a_logarithmic_scale(jaco: Scene) -> None:
    each = jaco.arm.observables.joints_torque
    scaled = each(jaco.physics)
    each.corruptor = None
    plain = each(jaco.physics)
    assert np.abs(plain).max() > 1.0  # [N m], gravity at home
    np.testing.assert_allclose(scaled, np.sign(plain) * np.log(1.0 + np.abs(plain)))


def test_observation_of_the_scene(jaco: Scene) -> None:
    updater = Updater(observables_of(jaco.arena), CONTROL_STEPS, strip_singleton_buffer_dim=True)
    updater.reset(jaco.physics, np.random.RandomState(0))
    jaco.physics.bind(jaco.arm.actuators).ctrl = 0.2  # [rad/s]
    for _ in range(5):
        observation = updater.advance()
    assert float(jaco.physics.time) == pytest.approx(5 * CONTROL_STEPS * 0.002)
    for name, each in observables_of(jaco.arena).items():
        if each.enabled:
            np.testing.assert_array_equal(observation[name], each(jaco.physics))
    assert set(observation) == {name for name, each in observables_of(jaco.arena).items() if each.enabled}


def test_blocks_of_steps_and_single_steps_give_the_same_observations() -> None:
    settings = observations.PERFECT_FEATURES
    settings = settings._replace(
        proprio=settings.proprio._replace(buffer_size=3, update_interval=4, delay=7),
    )
    blocks, singles = jaco_scene(settings), jaco_scene(settings)
    updaters = []
    for jaco in (blocks, singles):
        jaco.physics.bind(jaco.arm.actuators).ctrl = 0.2  # [rad/s]
        updater = Updater(observables_of(jaco.arena), CONTROL_STEPS)
        updater.reset(jaco.physics)
        updaters.append(updater)
    for _ in range(5):
        first = updaters[0].advance()
        for _ in range(CONTROL_STEPS):
            singles.physics.step()
            updaters[1].update()
        second = updaters[1].get_observation()
        for name, value in first.items():
            np.testing.assert_array_equal(value, second[name], err_msg=name)


def test_observables_follow_detaching_and_attaching_again() -> None:
    arm, hand = JacoArm(), JacoHand(observable_options={"enabled": True, "delay": 3})
    arm.attach(hand)
    hand.detach()
    assert "joints_pos" in hand.observables.as_dict()
    arm.attach(hand)
    assert "jaco_hand/joints_pos" in hand.observables.as_dict()
    physics = Physics.from_entity(arm)
    hand.set_grasp(physics, 0.5)
    np.testing.assert_allclose(hand.observables.joints_pos(physics), (0.15 + 1.35) / 2)
    assert hand.observables.joints_pos.delay == 3
    assert hand.observables.joints_pos.enabled


def test_an_element_of_another_model_is_refused(jaco: Scene) -> None:
    with pytest.raises(InvalidInputError, match="not part of this physics"):
        JacoArm().observables.joints_vel(jaco.physics)
    with pytest.raises(InvalidInputError, match="physics must be a Physics"):
        JacoArm().observables.joints_pos(cast(Any, jaco.arena))


def test_declared_and_added_observables_of_an_own_arm() -> None:
    class OwnObservables(JacoArmObservables):
        @observable
        def joints_pos(self) -> Observable:
            return MJCFFeature("qpos", self._entity.joints)

        @observable
        def height(self) -> Observable:
            return MJCFFeature("xpos", self._entity.wrist_site, index=slice(2, 3), enabled=True)

    class OwnArm(JacoArm):
        def _build_observables(self) -> OwnObservables:
            return OwnObservables(self)

    arm = OwnArm(name="own")
    arm.observables.add_observable("time", Observable(lambda physics: physics.time))
    physics = Physics.from_entity(arm)
    arm.set_home(physics)
    physics.step(3)
    assert list(arm.observables.enabled_observables) == ["height", "time"]
    values: dict[str, NDArray[np.float64]] = {
        name: each(physics) for name, each in arm.observables.enabled_observables.items()
    }
    assert values["height"].shape == (1,)
    assert values["height"][0] == physics.bind(arm.wrist_site).xpos[2]
    assert values["time"] == physics.data.time
    np.testing.assert_array_equal(arm.observables.joints_pos(physics), physics.bind(arm.joints).qpos)


def test_free_prop_is_observed_in_the_world() -> None:
    options = observations.make_options(observations.PERFECT_FEATURES, observations.FREEPROP_OBSERVABLES)
    prop = Primitive(observable_options=options, name="cube")
    arena = Arena()
    arena.add_free_entity(prop)
    physics = Physics.from_entity(arena)
    quat_wxyz = np.array([np.cos(0.4), 0.0, np.sin(0.4), 0.0])
    prop.set_pose(physics, position=[0.1, 0.2, 0.9], quaternion=quat_wxyz)
    velocity, spin = np.array([0.3, -0.2, 0.1]), np.array([1.0, 2.0, -0.5])  # [m/s], [rad/s], both in the world
    inverse, in_body = np.empty(4), np.empty(3)
    mujoco.mju_negQuat(inverse, quat_wxyz)
    mujoco.mju_rotVecQuat(in_body, spin, inverse)
    physics.bind(prop.root_body.joints[0]).qvel = [*velocity, *in_body]
    expected = {
        "cube/angular_velocity": spin,
        "cube/linear_velocity": velocity,
        "cube/orientation": quat_wxyz,
        "cube/position": np.array([0.1, 0.2, 0.9]),
    }
    updater = Updater(prop.observables.as_dict(), strip_singleton_buffer_dim=True)
    updater.reset(physics)
    observation = updater.get_observation()
    assert list(observation) == list(expected)
    for name, value in expected.items():
        np.testing.assert_allclose(observation[name], value, atol=1e-12, err_msg=name)
    off = observations.make_options(observations.VISION, observations.FREEPROP_OBSERVABLES)
    assert Primitive(observable_options=off).observables.enabled_observables == {}
