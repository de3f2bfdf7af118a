"""Randomization: drawn from the environment's numbers, reported, replayed, refused where it is impossible."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.mujoco.utils import check_mujoco_reset_state
from gymnasium.envs.registration import EnvSpec

import jacokin
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.mujoco_bridge.distributions import Normal, Uniform
from jacokin.tasks import Randomization, TaskEnv
from tests.tasks.gym.randomizations import ALL


def episode(environment: TaskEnv, **reset: Any) -> tuple[list[Any], dict[str, float]]:
    observation, info = environment.reset(**reset)
    observations = [observation, *(environment.step(np.full(9, 0.2))[0] for _ in range(4))]
    return observations, info["randomization"]


def test_values_are_drawn_reported_and_replayed() -> None:
    environment = TaskEnv("lift_brick", randomization=ALL)
    first, values = episode(environment, seed=1)
    _, others = episode(environment)
    assert all(values[name] != others[name] for name in values)
    model = environment.model
    before = model.body_mass.copy(), model.geom_friction.copy()
    again, same = episode(environment, seed=1)
    assert same == values
    np.testing.assert_array_equal(again, first)
    assert not np.array_equal(model.body_mass, before[0])
    assert not np.array_equal(model.geom_friction, before[1])
    _, replayed = episode(environment, seed=5, options={"randomization": values})
    assert replayed == values
    plain = TaskEnv("lift_brick").model
    brick = int(np.flatnonzero(model.jnt_type == 0)[0])
    body = model.jnt_bodyid[brick]
    assert model.body_mass[body] == pytest.approx(values["mass"] * plain.body_mass[body])
    assert model.actuator_gainprm[0, 0] == pytest.approx(values["gains"] * 500.0)
    np.testing.assert_allclose(model.dof_damping[:6], values["damping"] * plain.dof_damping[:6])
    np.testing.assert_array_equal(model.body_mass[:body], plain.body_mass[:body])


def test_copies_keep_the_values() -> None:
    environment = TaskEnv("place_cradle", randomization=ALL)
    episode(environment, seed=2)
    copies = [pickle.loads(pickle.dumps(environment)), copy.deepcopy(environment)]
    for _ in range(4):
        observation, _, _, _, info = environment.step(np.full(9, -0.3))
        for each in copies:
            other, _, _, _, others = each.step(np.full(9, -0.3))
            np.testing.assert_array_equal(other, observation)
            assert others == info
    check_mujoco_reset_state(environment)  # type: ignore[arg-type]  # has `model` and `data` as a MujocoEnv


def test_actions_come_late() -> None:
    late, prompt = TaskEnv("reach_site", randomization=Randomization(latency=0.08)), TaskEnv("reach_site")
    late.reset(seed=0)
    prompt.reset(seed=0)
    for _ in range(2):
        late.step(np.ones(9))
        prompt.step(np.zeros(9))
    for _ in range(2):
        np.testing.assert_array_equal(late.step(np.zeros(9))[0], prompt.step(np.ones(9))[0])


def test_noise_is_on_all_that_is_observed() -> None:
    noisy = TaskEnv("reach_site", goal=True, randomization=Randomization(observation_noise=0.1))
    clean = TaskEnv("reach_site", goal=True)
    one: Any = noisy.reset(seed=0)[0]
    other: Any = clean.reset(seed=0)[0]
    for key in ("observation", "achieved_goal"):
        assert 0.01 < np.abs(one[key] - other[key]).mean() < 0.3
    np.testing.assert_array_equal(one["desired_goal"], other["desired_goal"])
    assert noisy.step(np.ones(9))[1] == clean.step(np.ones(9))[1]


@pytest.mark.parametrize(
    "varied",
    [
        Randomization(mass=Uniform(0.5, 2.0), gains=Uniform(0.8, 1.2)),
        Randomization(latency=0.04, observation_noise=0.1, camera=0.05, lights=Uniform(0.5, 1.5)),
    ],
)
def test_initial_states_are_those_without_randomization(varied: Randomization) -> None:
    with_it, without = TaskEnv("reach_site", randomization=varied), TaskEnv("reach_site")
    for seed in (7, None):
        with_it.reset(seed=seed)
        without.reset(seed=seed)
        np.testing.assert_array_equal(with_it.data.qpos, without.data.qpos)
        np.testing.assert_array_equal(with_it.data.mocap_pos, without.data.mocap_pos)
        with_it.step(np.ones(9))  # noise is drawn


def test_specifications_with_randomization_survive_json() -> None:
    noise = Normal(0.01, 0.001)
    varied = Randomization(mass=Uniform(0.5, 2.0), observation_noise=noise, base_pose=np.full(4, 0.01), camera=0.1)
    environment = gymnasium.make("jacokin/ReachSite-v0", randomization=varied, goal=True)
    assert environment.spec is not None
    again: Any = gymnasium.make(EnvSpec.from_json(environment.spec.to_json()))
    assert again.unwrapped.randomization == varied
    np.testing.assert_equal(again.reset(seed=3), environment.reset(seed=3))
    environment.close()
    again.close()


def test_the_base_is_where_it_was_drawn() -> None:
    environment = TaskEnv("reach_site", control="tool_pose", randomization=Randomization(base_pose=Uniform(-0.1, 0.1)))
    data, base = environment.data, environment.model.body("jaco_arm/link_base").id
    angles = []
    for seed in range(3):
        _, info = environment.reset(seed=seed)
        values = info["randomization"]
        x, y, z, yaw = (values[f"base_{name}"] for name in ("x", "y", "z", "yaw"))
        np.testing.assert_allclose(data.xpos[base], (x, 0.4 + y, z), rtol=0.0, atol=1e-12)
        turn = [[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]]
        np.testing.assert_allclose(data.xmat[base].reshape(3, 3), turn, rtol=0.0, atol=1e-12)
        angles.append(yaw)
        # The tool starts where it would with the arm in its place: within its box, pointing down.
        tool = environment._episode.task._tool
        assert (np.abs(data.site_xpos[tool] - (0.0, 0.0, 0.21)) <= (0.2, 0.2, 0.19)).all()
        np.testing.assert_allclose(data.site_xmat[tool].reshape(3, 3)[:, 2], (0.0, 0.0, -1.0), rtol=0.0, atol=1e-5)
    assert len(set(angles)) == 3
    # Poses of the tool are meant in the world, wherever the arm stands.
    goal = np.array([0.05, 0.1, 0.3, *jacokin.mujoco_bridge.DOWN_QUATERNION, 0.5])
    for _ in range(200):
        environment.step(goal)
    np.testing.assert_allclose(data.site_xpos[tool], goal[:3], rtol=0.0, atol=0.003)
    moved = TaskEnv("reach_site", randomization=Randomization(base_pose=(0.01, 0.02, 0.0, 0.1)))
    assert moved.reset(seed=0)[1]["randomization"] == {"base_x": 0.01, "base_y": 0.02, "base_z": 0.0, "base_yaw": 0.1}


def test_velocities_of_the_tool_are_meant_in_the_world() -> None:
    turned = Randomization(base_pose=(0.0, 0.0, 0.0, 0.3))
    environment = TaskEnv("reach_site", control="tool_velocity", randomization=turned)
    environment.reset(seed=0)
    view, tool = environment._episode.view, environment.task.tool
    before = tool(view).copy()
    for _ in range(25):
        environment.step(np.array([0.0, 0.05, 0.05, 0.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(tool(view) - before, (0.0, 0.05, 0.05), rtol=0.0, atol=0.005)


def test_what_physics_does_not_allow_is_refused() -> None:
    for wrong in (
        *({"mass": 0.0}, {"friction": -1.0}, {"latency": 2.0}, {"observation_noise": np.nan}, {"gains": "big"}),
        *({"base_pose": 0.6}, {"base_pose": (0.0, 0.0, 0.0, 4.0)}, {"base_pose": (0.0, 0.0)}, {"base_pose": "left"}),
        *({"base_pose": np.full(4, np.inf)}, {"mass": ((1.0,), (1.0, 1.0))}, {"camera": -0.1}, {"lights": np.inf}),
        {"camera": 5.0},
    ):
        with pytest.raises(InvalidInputError):
            Randomization(**wrong)
    environment = TaskEnv("reach_site", randomization=Randomization(mass=Uniform(-2.0, -1.0)))
    with pytest.raises(InvalidInputError, match="mass must be a factor above 0"):
        environment.reset(seed=0)
    environment = TaskEnv("reach_site", randomization=Randomization(mass=2.0))
    with pytest.raises(UnknownNameError, match="Valid: mass"):
        environment.reset(options={"randomization": {"weight": 1.0}})
    with pytest.raises(InvalidInputError, match="lacks mass"):
        environment.reset(options={"randomization": {}})
    with pytest.raises(InvalidInputError, match="must be a Randomization"):
        TaskEnv("reach_site", randomization=2.0)  # type: ignore[arg-type]  # the mistake
    with pytest.raises(UnknownNameError, match="Valid: friction"):
        TaskEnv("reach_site", randomization={"weight": 2.0})
    with pytest.raises(InvalidInputError, match="mass must be a number, a sampler, or its arguments"):
        Randomization(mass={"low": 1.0, "scale": 2.0})
