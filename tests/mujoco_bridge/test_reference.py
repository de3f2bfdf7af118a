"""The arm and hand move as dm_control's do, from the same controls."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

from jacokin.mujoco_bridge import Physics, Primitive, Updater, observables_of, observations
from tests.mujoco_bridge.scenes import HOME, Scene, jaco_parts
from tests.optional import make_dm_control_run, needs_dm_control

SAME = 1e-6  # [m], [rad], [rad/s]; the reference rounds its limits and two of its quaternions to six digits


@pytest.fixture(scope="module")
def reference() -> Any:
    """dm_control's physics, arm and hand in its arena."""
    needs_dm_control()
    make_dm_control_run()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW without a display
        from dm_control import mjcf
        from dm_control.manipulation.shared import arenas
        from dm_control.manipulation.shared import observations as settings
        from dm_control.manipulation.shared import robots as makers
    arm, hand = makers.make_arm(settings.PERFECT_FEATURES), makers.make_hand(settings.PERFECT_FEATURES)
    arm.attach(hand)
    arena = arenas.Standard()
    arena.attach_offset(arm, makers.ARM_OFFSET)
    return mjcf.Physics.from_mjcf_model(arena.mjcf_model), arm, hand


def test_a_seed_gives_the_same_configuration(reference: Any, jaco: Scene) -> None:
    their_physics, their_arm, _ = reference
    physics, _, arm, _ = jaco
    for seed in range(5):
        their_arm.randomize_arm_joints(their_physics, np.random.RandomState(seed))
        arm.randomize_arm_joints(physics, np.random.RandomState(seed))
        theirs = np.array(their_physics.bind(their_arm.joints).qpos)
        np.testing.assert_allclose(physics.bind(arm.joints).qpos, theirs, rtol=0.0, atol=SAME)


def test_the_same_controls_give_the_same_motion_and_observations(reference: Any, jaco: Scene) -> None:
    their_physics, their_arm, their_hand = reference
    physics, _, arm, hand = jaco
    their_physics.reset()
    their_physics.bind(their_arm.joints).qpos = HOME
    their_hand.set_grasp(their_physics, 0.0)
    their_physics.forward()
    arm.set_home(physics)
    rng = np.random.default_rng(0)
    for _ in range(50):
        wanted = rng.uniform(-0.5, 0.5, 9)  # [rad/s]
        their_physics.bind(their_arm.actuators).ctrl = wanted[:6]
        their_physics.bind(their_hand.actuators).ctrl = wanted[6:]
        physics.bind(arm.actuators).ctrl = wanted[:6]
        physics.bind(hand.actuators).ctrl = wanted[6:]
        their_physics.step(20)
        physics.step(20)
    assert physics.time == pytest.approx(2.0)
    for theirs, ours in ((their_arm, arm), (their_hand, hand)):
        mine = ours.observables.as_dict(fully_qualified=False)
        assert sorted(mine) == sorted(theirs.observables.as_dict(fully_qualified=False))
        for name, observable in mine.items():
            expected = np.array(getattr(theirs.observables, name)(their_physics))
            # Of logarithms [1]: dry friction makes torques jump where velocities are near zero.
            band = 0.02 if name == "joints_torque" else SAME
            np.testing.assert_allclose(observable(physics), expected, rtol=0.0, atol=band, err_msg=name)


def test_a_second_of_constant_commands_ends_at_the_same_angles(reference: Any, jaco: Scene) -> None:
    their_physics, their_arm, their_hand = reference
    physics, _, arm, _ = jaco
    their_physics.reset()
    their_physics.bind(their_arm.joints).qpos = HOME
    their_hand.set_grasp(their_physics, 0.0)
    commands = (0.1, -0.2, 0.2, 0.3, -0.3, 0.4)  # [rad/s]
    their_physics.bind(their_arm.actuators).ctrl = commands
    physics.bind(arm.actuators).ctrl = commands
    their_physics.step(500)
    physics.step(500)
    theirs = np.array(their_physics.bind(their_arm.joints).qpos)
    np.testing.assert_allclose(physics.bind(arm.joints).qpos, theirs, rtol=0.0, atol=1e-7)


@pytest.mark.filterwarnings("ignore")  # GLFW without a display
def test_observations_have_the_names_order_and_specifications_of_the_reference(reference: Any) -> None:
    from dm_control import mjcf
    from dm_control.composer.observation.updater import Updater as TheirUpdater
    from dm_control.entities import props
    from dm_control.manipulation.shared import arenas
    from dm_control.manipulation.shared import observations as settings
    from dm_control.manipulation.shared import robots as makers

    their_arm, their_hand = makers.make_arm(settings.PERFECT_FEATURES), makers.make_hand(settings.PERFECT_FEATURES)
    their_arm.attach(their_hand)
    their_arena = arenas.Standard()
    their_arena.attach_offset(their_arm, makers.ARM_OFFSET)
    their_options = settings.make_options(settings.PERFECT_FEATURES, settings.FREEPROP_OBSERVABLES)
    parts = jaco_parts()
    options = observations.make_options(observations.PERFECT_FEATURES, observations.FREEPROP_OBSERVABLES)
    for name in ("second", "first"):  # in the order of attaching, not of the alphabet
        size = (0.02, 0.02, 0.02)
        their_arena.add_free_entity(
            props.Primitive(geom_type="box", size=size, name=name, observable_options=their_options)
        )
        parts.arena.add_free_entity(Primitive("box", size, name=name, observable_options=options))
    their_physics = mjcf.Physics.from_mjcf_model(their_arena.mjcf_model)
    theirs: dict[str, Any] = {}
    for entity in their_arena.iter_entities():
        theirs.update(entity.observables.as_dict())
    their_updater = TheirUpdater(theirs, 20)
    their_updater.reset(their_physics, np.random.RandomState(0))
    updater = Updater(observables_of(parts.arena), 20)
    updater.reset(Physics.from_entity(parts.arena), np.random.RandomState(0))
    expected, specs = their_updater.observation_spec(), updater.observation_spec()
    assert list(specs) == list(expected)
    assert list(updater.get_observation()) == list(expected)
    for name, spec in expected.items():
        assert (specs[name].shape, specs[name].dtype) == (spec.shape, spec.dtype), name
