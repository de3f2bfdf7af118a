"""Arguments of every kind: what the bridge cannot use it refuses itself, and changes nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from jacokin.errors import InvalidInputError
from jacokin.mujoco_bridge import (
    Arena,
    JacoArm,
    JacoHand,
    Observable,
    Physics,
    TcpInitializer,
    observables_of,
    observations,
    robots,
)
from jacokin.mujoco_bridge.observables import Observables
from tests.mujoco_bridge.scenes import Scene

DIGITS = 10**5000  # more than Python prints
FLAGS = np.eye(3)  # neither true nor false
RNG = np.random.RandomState(0)
NO_UTF8 = "\ud800"
NULL = "a\0b"  # MuJoCo keeps the a
EVERY = [DIGITS, 1e300 + 2j, object(), FLAGS, [[1.0], [2.0, 3.0]], np, True, NO_UTF8, NULL]


@pytest.mark.parametrize(
    "call",
    [
        lambda scene, value: Arena(name=value),
        lambda scene, value: Arena().attach(value),
        lambda scene, value: JacoArm(robot=value),
        lambda scene, value: JacoHand(fingers=value),
        lambda scene, value: robots.make_arm(value),
        lambda scene, value: observables_of(value),
        lambda scene, value: Observables(value),
        lambda scene, value: Observable.check_options(value),
        lambda scene, value: scene.arm.observables.set_options(value),
        lambda scene, value: scene.arm.observables.get_observable(value),
        lambda scene, value: Physics(scene.physics.model, spec=value),
        lambda scene, value: Physics.from_entity(value),
        lambda scene, value: Physics.from_model(value),
        lambda scene, value: scene.physics.bind(value),
        lambda scene, value: scene.physics.reset(value),
        lambda scene, value: scene.physics.set_state(value),
        lambda scene, value: scene.physics.set_qpos(value, [0.0]),
        lambda scene, value: scene.physics.set_qpos([0], value),
        lambda scene, value: scene.arm.get_pose(value),
        lambda scene, value: scene.arm.set_home(value),
        lambda scene, value: scene.arm.randomize_arm_joints(scene.physics, value),
        lambda scene, value: scene.arm.set_site_to_xpos(
            scene.physics, np.random.RandomState(0), value, (0.3, 0.3, 0.3)
        ),
        lambda scene, value: scene.hand.set_grasp(scene.physics, value),
        lambda scene, value: TcpInitializer(value, scene.arm, position=(0.0, 0.0, 0.0)),
    ],
)
def test_values_of_any_kind_are_refused_by_name(jaco: Scene, call: Callable[[Scene, Any], object]) -> None:
    state = jaco.physics.get_state()
    for value in EVERY:
        with pytest.raises(InvalidInputError):
            call(jaco, value)
    assert (jaco.physics.get_state() == state).all()


@pytest.mark.parametrize("value", [2**31, 2**100, np.uint64(2**64 - 1), 0, 1.0, FLAGS, None])
def test_steps_and_pixels_are_numbers_that_mujoco_can_count(jaco: Scene, value: Any) -> None:
    with pytest.raises(InvalidInputError, match="n must be a whole number"):
        jaco.physics.step(value)
    with pytest.raises(InvalidInputError, match="height must be a whole number"):
        jaco.physics.render(height=value)
    assert jaco.physics.time == 0.0


@pytest.mark.parametrize("rows", [[99], [-1], [0.5], [0, 1], 0, [[0]], slice(0, 1), [True], [[0], [1, 2]]])
def test_rows_of_qpos_exist(jaco: Scene, rows: Any) -> None:
    before = jaco.physics.data.qpos.copy()
    with pytest.raises(InvalidInputError, match="rows must be whole numbers|values must have shape"):
        jaco.physics.set_qpos(rows, np.array([0.3]))
    assert (jaco.physics.data.qpos == before).all()


def test_a_flag_that_is_an_array_moves_nothing(jaco: Scene) -> None:
    with pytest.raises(InvalidInputError, match="rotate_velocity must be True or False"):
        jaco.arm.shift_pose(jaco.physics, rotate_velocity=FLAGS)  # type: ignore[arg-type]  # what is tested
    with pytest.raises(InvalidInputError, match="fully_qualified must be True or False"):
        jaco.arm.observables.as_dict(fully_qualified=FLAGS)  # type: ignore[arg-type]  # what is tested


def test_settings_are_of_the_right_class() -> None:
    assert isinstance(observations.PERFECT_FEATURES, observations.ObservationSettings)
    with pytest.raises(InvalidInputError, match="obs_settings must be ObservationSettings, got an unprintable int"):
        robots.make_hand(DIGITS)  # type: ignore[arg-type]  # what is tested
