"""The tasks are those of dm_control: specifications, rewards, observations, and where episodes start."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from scipy import stats

import jacokin.tasks
from jacokin.arrays import Array
from jacokin.mujoco_bridge import Entity
from jacokin.tasks import Environment
from jacokin.tasks.families.bricks import BrickTask
from jacokin.tasks.families.lift import _Lift
from jacokin.tasks.families.place import _Place
from jacokin.tasks.families.reach import ReachBrick, ReachSite
from tests.optional import make_dm_control_run, needs_dm_control

NAMES = [name for name in jacokin.tasks.names() if not name.startswith(("reach_top", "reach_bottom"))]
FEATURES = [name for name in NAMES if name.endswith("features")]
SAME = 1e-6  # the reference rounds its limits and two of its quaternions to six digits
LIKELY = 1e-3  # p-value below which two samples are from different distributions


@pytest.fixture(scope="module")
def manipulation() -> Any:
    needs_dm_control()
    make_dm_control_run()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW without a display
        from dm_control import manipulation
    return manipulation


def theirs(manipulation: Any, name: str, seed: int = 0) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return manipulation.load(name, seed=seed)


def test_all_names_are_there(manipulation: Any) -> None:
    assert sorted(manipulation.ALL) == sorted(NAMES)
    for tag in ("features", "vision", "easy"):
        of_tag = set(jacokin.tasks.names(tag)) & set(NAMES)
        assert of_tag == set(manipulation.get_environments_by_tag(tag))


@pytest.mark.parametrize("name", FEATURES)
def test_specifications_are_equal(manipulation: Any, name: str) -> None:
    reference, ours = theirs(manipulation, name), jacokin.tasks.load(name)
    pairs = [
        (reference.action_spec(), ours.action_spec()),
        (reference.reward_spec(), ours.reward_spec()),
        (reference.discount_spec(), ours.discount_spec()),
    ]
    wanted, found = reference.observation_spec(), ours.observation_spec()
    assert list(wanted) == list(found)
    pairs.extend(zip(wanted.values(), found.values(), strict=True))
    for one, other in pairs:
        assert (type(one), one.name, one.shape, one.dtype) == (type(other), other.name, other.shape, other.dtype)
        if hasattr(one, "minimum"):
            np.testing.assert_array_equal(one.minimum, other.minimum)
            np.testing.assert_array_equal(one.maximum, other.maximum)
    assert reference.control_timestep() == ours.control_timestep()


def test_specifications_of_pictures_are_equal(manipulation: Any) -> None:
    # Loading makes dm_control render; what differs from the features is the same in all tasks.
    spec = jacokin.tasks.load("reach_site_vision").observation_spec()
    first = spec["front_close"]
    assert (first.shape, first.dtype, first.minimum, first.maximum) == ((1, 84, 84, 3), np.uint8, 0, 255)
    kept = [key for key in jacokin.tasks.load("reach_site_features").observation_spec() if key != "target_position"]
    assert list(spec) == ["front_close", *kept]


def take_over(reference: Any, ours: Environment) -> Array:
    """Put our simulation into the state of the reference; returns our goal."""
    from dm_control import mjcf

    their_physics, their_task, task = reference.physics, reference.task, ours.task
    physics = ours.physics
    data, goal = physics.data, np.empty(task.goal_size)
    data.qpos[:9], data.qvel[:9] = their_physics.data.qpos[:9], their_physics.data.qvel[:9]

    def move(own: Entity, other: Any) -> None:
        own.set_pose(physics, *other.get_pose(their_physics))
        if own.freejoint is not None:
            joint = mjcf.get_frame_freejoint(other.mjcf_model)
            physics.bind(own.freejoint).qvel = np.array(their_physics.bind(joint).qvel)

    if isinstance(task, ReachSite):
        data.mocap_pos[0] = their_physics.bind(their_task._target).pos
    elif isinstance(task, ReachBrick | _Place):
        move(task.brick, their_task._prop)
        if isinstance(task, _Place):
            move(task.pedestal, their_task._pedestal)
    elif isinstance(task, _Lift):
        move(task.prop, their_task._prop)
        goal = np.array([their_task._target_height])
    elif isinstance(task, BrickTask):
        order = np.array(their_task._desired_order)
        goal, slots = task._goal(order, int(order[0]))
        for slot, other in zip(slots, their_task._bricks, strict=True):
            move(task.bricks[slot], other)
    physics.forward()
    return goal


@pytest.mark.parametrize("name", FEATURES)
def test_the_same_states_have_the_same_rewards_and_observations(manipulation: Any, name: str) -> None:
    """Over an episode; but for torques, which are those of the step before."""
    reference, ours = theirs(manipulation, name, seed=5), jacokin.tasks.load(name, seed=0)
    ours.reset()
    spec, rng = reference.action_spec(), np.random.default_rng(1)
    reference.reset()
    is_slow = name.startswith("reassemble")
    for number in range(20 if is_slow else 60):
        if number % 10 == 0:
            action = rng.uniform(spec.minimum, spec.maximum)
        step = reference.step(action)
        goal = take_over(reference, ours)
        episode = ours._episode
        task, view = ours.task, episode.view
        reward = float(task.reward(task.achieved(view, goal), task.desired(view, goal)))
        assert reward == pytest.approx(step.reward, abs=SAME)
        for feature in task.features:
            if not feature.name.endswith("torque"):
                wanted = step.observation[feature.name][0]
                np.testing.assert_allclose(feature.read(view, goal), wanted, rtol=SAME, atol=SAME, err_msg=feature.name)


@pytest.mark.parametrize("name", ["reach_duplo_features", "lift_brick_features", "stack_2_bricks_features"])
def test_the_same_actions_give_the_same_observations(manipulation: Any, name: str) -> None:
    """Torques too, as long as the hand, whose shapes differ, touches nothing."""
    reference, ours = theirs(manipulation, name, seed=6), jacokin.tasks.load(name, seed=0)
    ours.reset()
    spec, rng = reference.action_spec(), np.random.default_rng(2)
    reference.reset()
    for number in range(30):
        if number % 10 == 0:
            action = 0.5 * rng.uniform(spec.minimum, spec.maximum)
        ours._episode.goal = take_over(reference, ours)
        wanted, found = reference.step(action), ours.step(action)
        assert found.reward == pytest.approx(wanted.reward, abs=SAME)
        for key, value in wanted.observation.items():
            np.testing.assert_allclose(found.observation[key], value, rtol=0.0, atol=2e-6, err_msg=key)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["reach_site_features", "lift_brick_features", "place_cradle_features"])
def test_episodes_start_from_the_same_distribution(manipulation: Any, name: str) -> None:
    count = 100
    samples = []
    for environment in (theirs(manipulation, name, seed=1), jacokin.tasks.load(name, seed=2)):
        rows = []
        for _ in range(count):
            observation = environment.reset().observation
            rows.append(
                np.concatenate(
                    [
                        np.ravel(value)
                        for key, value in observation.items()
                        if not key.endswith(("_vel", "velocity", "torque", "rmat"))
                    ]
                )
            )
        samples.append(np.array(rows))
    one, other = samples
    assert one.shape == other.shape
    for column in range(one.shape[1]):
        pair = one[:, column], other[:, column]
        if max(np.ptp(pair[0]), np.ptp(pair[1])) > 1e-4:  # others are equal but for rounding and settling
            assert stats.ks_2samp(*pair).pvalue > LIKELY / one.shape[1], column
        else:
            assert pair[0].mean() == pytest.approx(pair[1].mean(), abs=1e-4)
