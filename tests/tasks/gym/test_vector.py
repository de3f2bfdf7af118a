"""Vectors of environments: each is what a single one is, bit for bit; ends, seeds, mistakes."""

from __future__ import annotations

import copy
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import jacokin.tasks
from jacokin.errors import EpisodeInitializationError, InvalidInputError, PhysicsError, UnknownNameError
from jacokin.mujoco_bridge.distributions import Uniform
from jacokin.tasks import Randomization, TaskEnv
from jacokin.tasks.gym.controls import CONTROLS
from jacokin.tasks.gym.vector import Simulations, VectorTaskEnv
from jacokin.tasks.task import CONTROL_TIMESTEP, Task
from tests.programs import run_drawing
from tests.tasks.families_sample import ONE_OF_EACH_FAMILY
from tests.tasks.gym.randomizations import ALL

gymnasium.register_envs(jacokin.tasks)
COUNT = 4


def flat(observation: Any) -> np.ndarray:
    """The observation of one environment in one array."""
    values = (
        [observation] if isinstance(observation, np.ndarray) else [value for _, value in sorted(observation.items())]
    )
    return np.concatenate([np.ravel(value) for value in values])


def rows(observations: Any) -> np.ndarray:
    """The observations of many, one row each."""
    if isinstance(observations, np.ndarray):
        return observations
    values = [value for _, value in sorted(observations.items())]
    return np.concatenate([value.reshape(len(value), -1) for value in values], axis=1)


def assert_same(found: Any, wanted: Any) -> None:
    """Nested dictionaries of arrays, of the same types."""
    if isinstance(wanted, dict):
        assert set(found) == set(wanted)
        for name, value in wanted.items():
            assert_same(found[name], value)
    elif wanted.dtype == object:
        for one, other in zip(found, wanted, strict=True):
            assert (one is None) == (other is None)
            if other is not None:
                assert_same(one, other)
    else:
        assert found.dtype == wanted.dtype
        np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize(
    ("task", "options", "steps"),
    [
        ("reach_site", {}, 255),  # beyond the end of an episode
        ("place_cradle", {"goal": True, "reward": "sparse"}, 12),
        ("stack_3_bricks_random_order", {}, 12),
        ("reach_site", {"control": "tool_velocity", "randomization": ALL}, 12),
        ("reach_site", {"control": "joint_position", "randomization": ALL}, 12),
        ("reach_site", {"control": "joint_delta"}, 12),
        ("reach_duplo", {"control": "tool_pose", "randomization": Randomization(base_pose=0.1)}, 12),
    ],
)
@pytest.mark.slow
def test_environments_equal_single_ones(task: str, options: dict[str, Any], steps: int) -> None:
    check_equal_to_single_ones(task, options, steps)


@pytest.mark.slow
@pytest.mark.parametrize("task", ONE_OF_EACH_FAMILY)
def test_environments_of_every_family_equal_single_ones(task: str) -> None:
    check_equal_to_single_ones(task, {"flatten": False, "randomization": ALL}, 8)


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("task", "options"),
    [
        ("lift_brick", {"randomization": ALL}),
        ("place_brick", {"randomization": ALL, "goal": True}),
        ("reach_site", {"randomization": Randomization(latency=Uniform(0.0, 1.0))}),
    ],
)
def test_randomized_environments_equal_single_ones(task: str, options: dict[str, Any]) -> None:
    check_equal_to_single_ones(task, options, 30)


def check_equal_to_single_ones(task: str, options: dict[str, Any], steps: int) -> None:
    vector: Any = VectorTaskEnv(COUNT, task=task, threads=2, **options)
    singles = [TaskEnv(task, **options) for _ in range(COUNT)]
    observations, _ = vector.reset(seed=10)
    wanted = [flat(each.reset(seed=10 + index)[0]) for index, each in enumerate(singles)]
    np.testing.assert_array_equal(rows(observations), wanted)
    space, rng = vector.single_action_space, np.random.default_rng(0)
    is_over = [False] * COUNT
    for _ in range(steps):
        action = rng.uniform(space.low, space.high, (COUNT, *space.shape))
        observations, rewards, terminated, truncated, infos = vector.step(action)
        assert not terminated.any()
        for index, single in enumerate(singles):
            if is_over[index]:
                (observation, info), reward, ends = single.reset(), 0.0, False
            else:
                observation, reward, _, ends, info = single.step(action[index])
            np.testing.assert_array_equal(rows(observations)[index], flat(observation))
            assert (rewards[index], truncated[index], infos["is_success"][index]) == (reward, ends, info["is_success"])
            is_over[index] = ends
    vector.close()


@pytest.mark.one_quick
@pytest.mark.parametrize("control", CONTROLS)
def test_other_control_steps_are_those_of_single_environments(control: str) -> None:
    """Delays of fractions of a control step, and noise, included."""
    check_equal_to_single_ones("reach_site", {"control": control, "control_timestep": 0.03, "randomization": ALL}, 5)


@pytest.mark.one_quick
@pytest.mark.parametrize("mode", AutoresetMode)
def test_resets_are_those_of_gymnasium(mode: AutoresetMode, monkeypatch: pytest.MonkeyPatch) -> None:
    """With every mode all that is returned is what Gymnasium's own vector returns, types of infos included."""
    monkeypatch.setattr(Task, "time_limit", 5 * CONTROL_TIMESTEP)
    options: dict[str, Any] = {"goal": True, "randomization": Randomization(mass=Uniform(0.5, 2.0), camera=0.1)}
    theirs: Any = SyncVectorEnv([lambda: TaskEnv("lift_brick", **options)] * 3, autoreset_mode=mode)
    ours: Any = VectorTaskEnv(3, threads=2, task="lift_brick", autoreset_mode=mode, **options)
    assert ours.metadata["autoreset_mode"] is mode

    def both(call: str, *args: Any, **kwargs: Any) -> Any:
        found, wanted = (getattr(each, call)(*args, **copy.deepcopy(kwargs)) for each in (ours, theirs))
        for one, other in zip(found, wanted, strict=True):
            assert_same(one, other)
        return found

    both("reset", seed=3)
    both("step", np.full((3, 9), 0.1))
    both("reset", options={"reset_mask": np.array([False, True, False])})  # the second falls behind
    for _ in range(4):
        *_, truncated, infos = both("step", np.full((3, 9), 0.2))
    np.testing.assert_array_equal(truncated, [True, False, True])
    assert ("final_obs" in infos) == (mode is AutoresetMode.SAME_STEP)
    if mode is AutoresetMode.DISABLED:
        with pytest.raises(PhysicsError, match=r"environments \[0, 2\] have ended"):
            ours.step(np.zeros((3, 9)))
        both("reset", options={"reset_mask": np.array([True, False, True])})
        both("step", np.full((3, 9), -0.2))
        return
    for _ in range(6):
        both("step", np.full((3, 9), -0.2))


def test_gymnasium_makes_vectors() -> None:
    vector: Any = gymnasium.make_vec(
        "jacokin/ReachSite-v0",
        num_envs=3,
        vectorization_mode="vector_entry_point",
        vector_kwargs={"threads": 2},
        reward="sparse",
    )
    assert vector._simulations._batch.nthread == 2
    observations, _ = vector.reset(seed=[1, 2, 1])
    np.testing.assert_array_equal(observations[0], observations[2])
    assert not np.array_equal(observations[0], observations[1])
    assert vector.observation_space.contains(observations)
    kept = observations.copy()
    vector.step(vector.action_space.sample())
    np.testing.assert_array_equal(observations, kept)
    again: Any = gymnasium.make_vec(vector.spec)
    assert again.num_envs == 3
    assert again._first.options.reward == "sparse"
    mode = gymnasium.VectorizeMode.VECTOR_ENTRY_POINT
    assert gymnasium.make_vec("jacokin/ReachSite-v0", 2, mode, threads=2).num_envs == 2
    with pytest.raises(UnknownNameError, match="Did you mean 'threads'"):
        gymnasium.make_vec("jacokin/ReachSite-v0", 2, vector_kwargs={"thread": 2})


def test_vectors_keep_a_number_of_steps() -> None:
    for steps, wanted in ((2, [False, True]), (-1, [False, False]), (1000, [False, False])):
        vector: Any = gymnasium.make_vec(
            "jacokin/ReachSite-v0", 1, gymnasium.VectorizeMode.VECTOR_ENTRY_POINT, max_episode_steps=steps
        )
        vector.reset(seed=0)
        assert [bool(vector.step(np.zeros((1, 9)))[3][0]) for _ in range(2)] == wanted
    with pytest.raises(InvalidInputError, match="max_episode_steps must be a whole number >= 1"):
        VectorTaskEnv(1, task="reach_site", max_episode_steps=0)


@pytest.mark.parametrize("method", ["_simulate", "begin"])
def test_what_is_interrupted_ends_the_episodes(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As of single environments, see `test_environment`."""

    def interrupted(*args: object) -> None:
        raise KeyboardInterrupt

    vector: Any = VectorTaskEnv(2, task="reach_site")
    vector.reset(seed=0)
    with monkeypatch.context() as patch:
        patch.setattr(Simulations, method, interrupted)
        with pytest.raises(KeyboardInterrupt):
            vector.step(np.zeros((2, 9))) if method == "_simulate" else vector.reset()
    with pytest.raises(PhysicsError, match=r"not completed: call reset\(\) before step\(\)"):
        vector.step(np.zeros((2, 9)))
    vector.reset()
    vector.step(np.zeros((2, 9)))


def test_arguments_of_other_vectors_reach_them() -> None:
    vector: Any = gymnasium.make_vec(
        "jacokin/ReachSite-v0", num_envs=2, vectorization_mode="sync", vector_kwargs={"copy": False}
    )
    assert isinstance(vector, SyncVectorEnv)
    assert not vector.copy
    assert gymnasium.spec("jacokin/ReachSite-v0").kwargs == {"task": "reach_site"}


def test_values_are_replayed() -> None:
    vector: Any = VectorTaskEnv(3, threads=2, task="lift_brick", randomization=ALL)
    _, infos = vector.reset(seed=[1, 2, 3])
    drawn = infos["randomization"]
    assert len(set(drawn["mass"])) == 3
    first = rows(vector.step(np.ones((3, 9)))[0])
    _, infos = vector.reset(seed=[1, 2, 3], options={"randomization": drawn})
    assert_same(infos["randomization"], drawn)
    np.testing.assert_array_equal(rows(vector.step(np.ones((3, 9)))[0]), first)
    changed = {**drawn, "mass": drawn["mass"] * 1.5}
    _, infos = vector.reset(seed=[1, 2, 3], options={"randomization": changed})
    np.testing.assert_array_equal(infos["randomization"]["mass"], changed["mass"])
    with pytest.raises(InvalidInputError, match=r"mass must have shape \(3,\)"):
        vector.reset(options={"randomization": {**drawn, "mass": np.ones(2)}})
    with pytest.raises(InvalidInputError, match="mass must be a factor"):
        vector.reset(options={"randomization": {**drawn, "mass": -drawn["mass"]}})


def test_a_diverged_simulation_leaves_the_others_alone() -> None:
    vector: Any = VectorTaskEnv(3, threads=2, task="reach_site")
    single = TaskEnv("reach_site")
    before, _ = vector.reset(seed=0)
    single.reset(seed=2)
    vector._simulations._batch.bind("qvel")[1] = 1e12
    observations, rewards, _, truncated, infos = vector.step(np.zeros((3, 9)))
    np.testing.assert_array_equal(truncated, [False, True, False])
    np.testing.assert_array_equal(infos["_error"], truncated)
    assert infos["error"][1]
    assert not infos["is_success"][1]
    assert rewards[1] == 0.0
    np.testing.assert_array_equal(observations[1], before[1])  # the last one there was
    np.testing.assert_array_equal(observations[2], single.step(np.zeros(9))[0])
    observations, _, _, truncated, infos = vector.step(np.zeros((3, 9)))
    assert not truncated.any()
    assert "error" not in infos
    assert np.isfinite(observations).all()
    again = TaskEnv("reach_site")
    again.reset(seed=1)
    np.testing.assert_array_equal(observations[1], again.reset()[0])
    np.testing.assert_array_equal(observations[2], single.step(np.zeros(9))[0])


def test_props_that_rest_sleep_until_something_touches_them() -> None:
    awake: Any = VectorTaskEnv(2, task="lift_brick", flatten=False)
    asleep: Any = VectorTaskEnv(2, task="lift_brick", flatten=False, sleep=True)
    found, wanted = asleep.reset(seed=0)[0], awake.reset(seed=0)[0]
    assert_same(found, wanted)
    for _ in range(5):
        found, wanted = (each.step(np.full((2, 9), 0.1))[0] for each in (asleep, awake))
    trees = asleep._simulations._batch.bind("tree_asleep")
    np.testing.assert_array_equal(trees >= 0, [[False, True]] * 2)  # the arm, the brick
    for name, values in found.items():
        if not name.startswith("duplo2x4/"):
            np.testing.assert_array_equal(values, wanted[name])
    np.testing.assert_allclose(found["duplo2x4/position"], wanted["duplo2x4/position"], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found["duplo2x4/linear_velocity"], 0.0, rtol=0.0, atol=1e-4)
    asleep._simulations._batch.bind("xfrc_applied")[0, -1, 2] = 1.0  # upwards, and a brick weighs 0.12 N
    after = asleep.step(np.zeros((2, 9)))[0]["duplo2x4/position"][:, 2]
    assert after[0] > found["duplo2x4/position"][0, 2] + 0.001
    assert after[1] == found["duplo2x4/position"][1, 2]
    assert_same(asleep.reset(seed=0)[0], awake.reset(seed=0)[0])


def test_mistakes() -> None:
    vector: Any = VectorTaskEnv(2, threads=2, task="reach_site")
    with pytest.raises(PhysicsError, match=r"call reset\(\) before step\(\)"):
        vector.step(np.zeros((2, 9)))
    observations, _ = vector.reset(seed=0)
    with pytest.raises(InvalidInputError, match="shape"):
        vector.step(np.zeros((3, 9)))
    with pytest.raises(InvalidInputError, match="NaN"):
        vector.step(np.full((2, 9), np.nan))
    with pytest.raises(InvalidInputError, match="seed must be one number, or 2"):
        vector.reset(seed=[1])
    with pytest.raises(InvalidInputError, match="seed must be a whole number >= 0"):
        vector.reset(seed=[5, -1])
    with pytest.raises(InvalidInputError, match="reset_mask must be a bool array"):
        vector.reset(options={"reset_mask": [True, False]})
    with pytest.raises(InvalidInputError, match="options must be a dict or None"):
        vector.reset(options=3)
    with pytest.raises(UnknownNameError, match="option of reset"):
        vector.reset(options={"speed": 1})
    single = TaskEnv("reach_site")
    np.testing.assert_array_equal(single.reset(seed=0)[0], observations[0])
    np.testing.assert_array_equal(vector.step(np.ones((2, 9)))[0][0], single.step(np.ones(9))[0])  # nothing had changed


def test_a_wrong_pose_moves_nothing() -> None:
    vector: Any = VectorTaskEnv(2, task="reach_site", control="tool_pose")
    vector.reset(seed=0)
    before = vector._simulations._batch.state.copy()
    with pytest.raises(InvalidInputError, match="quaternion of a pose must not be 0"):
        vector.step(np.array([[0.0, 0.0, 0.3, 0.0, 1.0, 0.0, 0.0, 0.0], np.zeros(8)]))
    np.testing.assert_array_equal(vector._simulations._batch.state, before)


@pytest.mark.slow
def test_pictures_of_many() -> None:
    code = (
        "import numpy as np; from jacokin.tasks import Randomization, TaskEnv\n"
        "from jacokin.mujoco_bridge.distributions import Uniform\n"
        "from jacokin.tasks.gym.vector import VectorTaskEnv\n"
        "varied = Randomization(camera=0.05, lights=Uniform(0.5, 1.5), base_pose=0.01, observation_noise=0.1)\n"
        "for task, more in (('place_brick', {'randomization': varied}), ('reassemble_3_bricks_fixed_order', {}),\n"
        "    ('lift_brick', {'cameras': {'wrist': (32, 48), 'front_close': (24, 24),\n"
        "    'wrist/depth': (24, 32), 'front_close/segmentation': (40, 24)}})):\n"
        "    v = VectorTaskEnv(2, task=task, threads=2, observations='vision', **more); f = v.reset(seed=0)[0]\n"
        "    e = TaskEnv(task, observations='vision', **more); g = e.reset(seed=1)[0]; assert list(f) == list(g)\n"
        "    o, p = v.step(np.ones((2, 9)))[0], e.step(np.ones(9))[0]; assert v.observation_space.contains(o)\n"
        "    assert all(np.array_equal(f[key][1], g[key]) for key in g), task\n"
        "    assert all(np.array_equal(o[key][1], p[key]) for key in p), task; v.close(); print('closed')"
    )
    assert run_drawing("-W", "ignore", "-c", code) == 3 * "closed\n"


def test_mistakes_in_options() -> None:
    with pytest.raises(InvalidInputError, match="does not render"):
        VectorTaskEnv(2, task="reach_site", render_mode="rgb_array")
    with pytest.raises(InvalidInputError, match="threads"):
        VectorTaskEnv(2, task="reach_site", threads=0)
    with pytest.raises(InvalidInputError, match="sleep must be True or False"):
        VectorTaskEnv(2, task="reach_site", sleep="deep")  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match="Valid: NextStep, SameStep, Disabled"):
        VectorTaskEnv(2, task="reach_site", autoreset_mode="Never")
    vector: Any = VectorTaskEnv(2, task="reach_site", randomization=Randomization(base_pose=(0.5, 0.5, 0.5, 0.0)))
    with pytest.raises(EpisodeInitializationError):  # the arm stands too far away
        vector.reset(seed=0)


def test_names_and_order_of_flat_observations() -> None:
    flat, named = VectorTaskEnv(2, task="lift_brick"), VectorTaskEnv(2, task="lift_brick", flatten=False)
    wrapped: Any = gymnasium.wrappers.vector.FlattenObservation(named)
    assert flat.observation_names == named.observation_names == TaskEnv("lift_brick").observation_names
    (found, _), (wanted, _) = flat.reset(seed=[1, 2]), wrapped.reset(seed=[1, 2])
    np.testing.assert_array_equal(found, wanted)
    action = np.full((2, 9), 0.2)
    np.testing.assert_array_equal(flat.step(action)[0], wrapped.step(action)[0])
