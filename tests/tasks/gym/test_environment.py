"""Tasks as environments of Gymnasium: seeds, goals, controls, mistakes; see `test_checks` for Gymnasium's own."""

from __future__ import annotations

import copy
import pickle
import sys
import warnings
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

import jacokin.tasks
from jacokin.errors import InvalidInputError, PhysicsError, UnknownNameError
from jacokin.ik.closest import ClosestSearch
from jacokin.model.angles import nearest_copy
from jacokin.tasks import Environment, TaskEnv
from jacokin.tasks.episode import STEPS, Episode
from jacokin.tasks.gym.controls import CONTROLS
from jacokin.tasks.gym.environment import RENDER_MODES
from jacokin.tasks.gym.packing import Packing
from jacokin.tasks.gym.registration import EPISODE_STEPS, IDS
from jacokin.tasks.registry import OURS, TASKS
from jacokin.tasks.task import WHOLE
from tests.programs import run_drawing
from tests.tasks.gym.checking import make


def test_ids() -> None:
    ids = [name for name in gymnasium.registry if name.startswith("jacokin/")]
    assert len(ids) == len(OURS) == 17
    assert set(IDS) == OURS
    assert {"jacokin/ReachSite-v0", "jacokin/ReachBrick-v0", "jacokin/LiftBrick-v0", "jacokin/LiftBox-v0"} <= set(ids)
    assert {"jacokin/PlaceBrick-v0", "jacokin/PlaceCradle-v0", "jacokin/Stack2-v0", "jacokin/Stack3-v0"} <= set(ids)


def test_a_seed_gives_the_episode_of_dm_env() -> None:
    ours, theirs = make("lift_brick", flatten=False), jacokin.tasks.load("lift_brick", seed=7)
    observation, _ = ours.reset(seed=7)
    step = theirs.reset()
    action = np.full(9, 0.2)
    for _ in range(3):
        assert list(observation) == list(step.observation)
        for key, value in observation.items():
            np.testing.assert_array_equal(value, step.observation[key][0])
        observation, reward, *_ = ours.step(action)
        step = theirs.step(action)
        assert reward == step.reward


@pytest.mark.parametrize("contact", ["firm", "dm_control"])
def test_options_of_contact_are_kept(contact: str) -> None:
    """By both kinds of environments, and by copies of them."""
    for made in (TaskEnv("lift_brick", contact=contact), jacokin.tasks.load("lift_brick", contact=contact)):
        made.reset()
        for each in (made, copy.copy(made), pickle.loads(pickle.dumps(made))):
            option = each.task.physics.model.opt
            assert (option.impratio, option.noslip_iterations) == ((3.0, 50) if contact == "firm" else (1.0, 5))
    for refused in (jacokin.tasks.load, TaskEnv):
        with pytest.raises(UnknownNameError, match="Valid: firm, dm_control"):
            refused("lift_brick", contact="soft")


@pytest.mark.one_quick
@pytest.mark.parametrize("task", ["reach_site", "lift_brick", "place_cradle", "stack_3_bricks_random_order"])
def test_flat_observations_are_those_that_gymnasium_flattens(task: str) -> None:
    flat, named = TaskEnv(task), TaskEnv(task, flatten=False)
    wrapped: Any = gymnasium.wrappers.FlattenObservation(named)
    names = flat.observation_names
    assert names == named.observation_names
    assert flat.observation_space.shape == wrapped.observation_space.shape == (len(names),)
    assert len(set(names)) == len(names)
    (found, _), (wanted, _) = flat.reset(seed=3), wrapped.reset(seed=3)
    for _ in range(3):
        np.testing.assert_array_equal(found, wanted)
        by_name: Any = named._last
        for name, value in zip(names, found, strict=True):
            key, *index = name.split(".")
            assert by_name[key][tuple(map(int, index))] == value
        found, wanted = flat.step(np.full(9, 0.2))[0], wrapped.step(np.full(9, 0.2))[0]


def seen_by(env: TaskEnv, camera: str) -> bool:
    """Whether a camera has all of the arm, the hand and what is to be handled in a square picture, by projection."""
    model, data = env.model, env.data
    number = model.camera(camera).id
    half = np.tan(np.radians(0.5 * model.cam_fovy[number]))
    is_solid = (model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE) & (data.geom_xpos[:, 2] > 0.0)
    in_camera = (data.geom_xpos[is_solid] - data.cam_xpos[number]) @ data.cam_xmat[number].reshape(3, 3)
    return bool((np.abs(in_camera[:, :2]) < half * -in_camera[:, 2:]).all())


@pytest.mark.one_quick
@pytest.mark.parametrize("task", TASKS)
def test_what_is_rendered_shows_the_whole_arm(task: str) -> None:
    if task not in OURS:
        return
    env = TaskEnv(task)
    for seed in range(3):
        env.reset(seed=seed)
        assert seen_by(env, WHOLE)
    assert env._render_camera == WHOLE


def test_front_close_cuts_the_arm_off() -> None:
    env = TaskEnv("lift_brick", render_camera="front_close")
    env.reset(seed=0)
    assert not seen_by(env, "front_close")
    assert copy.copy(env)._render_camera == "front_close"
    with pytest.raises(UnknownNameError, match="Valid: front_close, wrist, whole"):
        TaskEnv("lift_brick", render_camera="above")


def test_names_of_observations_with_goals() -> None:
    env, name = TaskEnv("lift_brick", goal=True), "duplo2x4/position"
    observation, _ = env.reset(seed=0)
    numbers: Any = gymnasium.spaces.flatten(env.observation_space, observation)
    names = env.observation_names
    assert len(names) == len(numbers)
    assert names[:2] == ("achieved_goal.0", "desired_goal.0")
    position = env.task.features_by_name[name].read(env._episode.view, env._episode.goal)
    assert numbers[names.index(f"{name}.2")] == position[2]


def test_names_of_observations_with_pictures() -> None:
    env = TaskEnv("lift_brick", observations="vision", cameras={"wrist": (2, 3)})
    assert len(env.observation_names) == gymnasium.spaces.flatdim(env.observation_space)
    assert env.observation_names[:4] == ("wrist.0.0.0", "wrist.0.0.1", "wrist.0.0.2", "wrist.0.1.0")
    assert env.observation_names[18:20] == ("jaco_arm/joints_pos.0.0", "jaco_arm/joints_pos.0.1")


@pytest.mark.one_quick("task")
@pytest.mark.parametrize("task", ["reach_duplo", "lift_brick", "place_brick", "stack_3_bricks_random_order"])
@pytest.mark.parametrize("reward", ["dense", "sparse"])
def test_rewards_of_goals_are_those_of_steps(task: str, reward: str) -> None:
    environment = make(task, goal=True, reward=reward)
    environment.reset(seed=0)
    environment.action_space.seed(0)
    achieved, desired, rewards = [], [], []
    for _ in range(6):
        observation, value, *_ = environment.step(environment.action_space.sample())
        achieved.append(observation["achieved_goal"])
        desired.append(observation["desired_goal"])
        rewards.append(value)
        compute = environment.unwrapped.compute_reward  # type: ignore[attr-defined]  # of goal environments
        assert compute(achieved[-1], desired[-1], {}) == value
    np.testing.assert_array_equal(compute(np.array(achieved), np.array(desired), [{}] * 6), rewards)
    with pytest.raises(InvalidInputError, match="achieved_goal must have shape"):
        compute(np.zeros(0), desired[0])
    with pytest.raises(InvalidInputError, match="achieved_goal and desired_goal must be as many"):
        compute(np.array(achieved[:2]), np.array(desired[:3]))


def test_success_is_what_the_task_asks_for() -> None:
    reach = TASKS["reach_site"].make()
    at = np.array([[0.0, 0.0, 0.05], [0.0, 0.0, 0.0501]])
    np.testing.assert_array_equal(reach.success(at, np.zeros(3)), [True, False])
    lift = TASKS["lift_brick"].make()
    np.testing.assert_array_equal(lift.success(np.array([[0.3], [0.299]]), np.array([0.3])), [True, False])
    place = TASKS["place_cradle"].make()
    brick_and_tool = np.array(
        [[0.0, 0.0, 0.04, 0.0, 0.0, 0.2], [0.0, 0.0, 0.04, 0.0, 0.0, 0.19], [0.06, 0, 0, 0, 0, 1]]
    )
    np.testing.assert_array_equal(place.success(brick_and_tool, np.zeros(3)), [True, False, False])
    np.testing.assert_allclose(place.reward(brick_and_tool[0], np.zeros(3)), 1.0, rtol=0.0, atol=1e-12)


def test_the_time_limit_truncates() -> None:
    environment = make("reach_site")
    environment.reset(seed=0)
    ends = [environment.step(np.zeros(9))[2:4] for _ in range(252)]
    assert ends == [(False, False)] * 249 + [(False, True)] * 3
    assert gymnasium.spec(IDS["reach_site"]).max_episode_steps == EPISODE_STEPS == STEPS


def test_only_environments_with_goals_compute_rewards_of_goals() -> None:
    """Stable-Baselines3 takes whatever has `compute_reward` for an environment with goals."""
    assert not hasattr(TaskEnv("reach_site"), "compute_reward")
    assert not make("reach_site").has_wrapper_attr("compute_reward")
    assert make("reach_site", goal=True).has_wrapper_attr("compute_reward")


@pytest.mark.parametrize("where", ["simulation", "observation"])
def test_a_step_that_is_interrupted_ends_the_episode(where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of vectors too, see `test_vector`."""
    environment, other = TaskEnv("reach_site"), jacokin.tasks.load("reach_site", seed=0)
    environment.reset(seed=0)
    other.reset()
    with monkeypatch.context() as patch:
        if where == "simulation":
            patch.setattr(Episode, "advance", interrupted)
        else:
            patch.setattr(Packing, "pack", interrupted)
            patch.setattr(Environment, "_observation", interrupted)
        for each in (environment, other):
            with pytest.raises(KeyboardInterrupt):
                each.step(np.zeros(9))
    with pytest.raises(PhysicsError, match=r"not completed: call reset\(\) before step\(\)"):
        environment.step(np.zeros(9))
    assert other.step(np.zeros(9)).first()
    environment.reset()
    environment.step(np.zeros(9))


def interrupted(*args: object, **kwargs: object) -> None:
    raise KeyboardInterrupt


def test_render_modes_are_those_that_work_here(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    assert TaskEnv("reach_site").metadata["render_modes"] == []
    monkeypatch.setenv("MUJOCO_GL", "egl")
    assert TaskEnv("reach_site").metadata["render_modes"] == ["rgb_array", "depth_array"]
    monkeypatch.setenv("DISPLAY", ":0")
    assert TaskEnv("reach_site").metadata["render_modes"] == list(RENDER_MODES)


def test_gymnasium_checks_without_a_display(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*infinity|.*symmetric and normalized")
        check_env(make("reach_site").unwrapped)


@pytest.mark.one_quick
@pytest.mark.parametrize("control", ["joint_position", "joint_delta", "tool_velocity", "tool_pose"])
def test_the_arm_keeps_its_limits_under_control_of_the_tool(control: str) -> None:
    environment: Any = make("reach_site", control=control).unwrapped
    environment.reset(seed=1)
    environment.action_space.seed(1)
    lower, upper = environment.model.jnt_range[:6].T
    limited = environment.model.jnt_limited[:6].astype(bool)
    for number in range(60):
        if number % 20 == 0:
            action = environment.action_space.sample()
        environment.step(action)
        q = environment.data.qpos[:6]
        assert (np.abs(environment.data.ctrl) <= environment.model.actuator_ctrlrange[:, 1]).all()
        assert (q[limited] > lower[limited] - 0.02).all()  # MuJoCo's limits are soft
        assert (q[limited] < upper[limited] + 0.02).all()


def test_the_tool_moves_as_it_is_told() -> None:
    environment: Any = make("reach_site", control="tool_velocity").unwrapped
    environment.reset(seed=0)
    tool = environment.task.tool
    view = environment._episode.view
    before = tool(view).copy()
    for _ in range(25):
        environment.step(np.array([0.0, 0.05, 0.05, 0.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(tool(view) - before, (0.0, 0.05, 0.05), rtol=0.0, atol=0.005)
    environment = make("reach_site", control="tool_pose").unwrapped
    environment.reset(seed=0)
    view = environment._episode.view
    goal = np.array([0.05, 0.1, 0.3, *jacokin.mujoco_bridge.DOWN_QUATERNION, 0.5])
    for _ in range(200):
        environment.step(goal)
    np.testing.assert_allclose(environment.task.tool(view), goal[:3], rtol=0.0, atol=0.003)
    fingers = environment.model.jnt_range[6:9]
    np.testing.assert_allclose(environment.data.qpos[6:9], fingers.mean(axis=1), rtol=0.0, atol=0.02)


@pytest.mark.parametrize("control", CONTROLS)
def test_an_arm_that_is_moved_between_two_steps_goes_on_from_fresh_data(control: str) -> None:
    observations = []
    for forward in (False, True):
        environment: Any = make("reach_site", control=control).unwrapped
        environment.reset(seed=0)
        task = environment.task
        assert task.arm.set_site_to_xpos(task.physics, np.random.default_rng(0), task.hand.pinch_site, (0.1, 0.1, 0.2))
        if forward:
            task.physics.forward()
        environment.action_space.seed(0)
        observations.append(environment.step(environment.action_space.sample())[0])
    np.testing.assert_array_equal(*observations)


def test_joints_go_where_they_are_told() -> None:
    environment: Any = make("reach_site", control="joint_position").unwrapped
    environment.reset(seed=0)
    goal = np.concatenate((jacokin.load_robot().home, (0.4, 0.8, 1.2)))
    start = environment.data.qpos[:6].copy()
    way = nearest_copy(goal[:6], start, jacokin.load_robot().unlimited) - start
    steps = int(np.ceil(np.abs(way / (jacokin.load_robot().velocity_limit * 0.04)).max()))
    for number in range(steps + 25):
        environment.step(goal)
        if number == steps // 2:  # all joints together: halfway they are on the line between start and goal
            half = environment.data.qpos[:6] - start
            np.testing.assert_allclose(half, way * (half @ way) / (way @ way), atol=0.06)
    np.testing.assert_allclose(environment.data.qpos[:6] - start, way, rtol=0.0, atol=4e-3)
    np.testing.assert_allclose(environment.data.qpos[6:9], goal[6:], atol=0.02)
    np.testing.assert_allclose(environment.action_space.low[6:], environment.model.jnt_range[6:9, 0], atol=1e-9)
    np.testing.assert_allclose(environment.action_space.high[6:], environment.model.jnt_range[6:9, 1], atol=1e-9)


def test_changes_of_joints_add_up() -> None:
    environment: Any = make("reach_site", control="joint_delta").unwrapped
    environment.reset(seed=0)
    start = environment.data.qpos[:6].copy()
    change = np.array([0.01, -0.005, 0.004, 0.02, -0.02, 0.01, 0.0, 0.0, 0.0])
    for _ in range(20):
        environment.step(change)
    for _ in range(25):
        environment.step(np.zeros(9))  # stays, against gravity too
    np.testing.assert_allclose(environment.data.qpos[:6] - start, 20 * change[:6], rtol=0.0, atol=4e-3)


def test_the_wrist_camera_sees_what_the_hand_reaches_for() -> None:
    """It moves with the hand; the pinch point is in the upper half of its picture, what lies below it in the lower."""
    physics = TaskEnv("lift_brick").task.physics
    model, data = physics.model, physics.data
    (camera,) = [number for number in range(model.ncam) if model.camera(number).name.endswith("wrist")]
    site, rng, seen = model.site("jaco_arm/jaco_hand/pinchsite").id, np.random.default_rng(0), []
    for _ in range(5):
        data.qpos[:6] = rng.uniform(-3.0, 3.0, 6)
        physics.forward()
        seen.append(data.cam_xmat[camera].reshape(3, 3).T @ (data.site_xpos[site] - data.cam_xpos[camera]))
    np.testing.assert_allclose(seen, seen[:1] * 5, atol=1e-12)
    right, up, backwards = seen[0]
    half = np.tan(np.deg2rad(model.cam_fovy[camera] / 2.0))
    assert abs(right) < 1e-9
    assert 0.0 < up / -backwards < half  # the fingers close in the upper half, things lie below
    assert 0.1 < -backwards < 0.25


@pytest.mark.one_quick
@pytest.mark.parametrize("control", CONTROLS)
def test_actions_mean_the_same_motion_at_every_frequency(control: str) -> None:
    """An arm that is told for 0.4 s to go with a velocity, or to a place, is then nearly where other steps lead it."""
    ends = []
    for dt in (0.02, 0.04, 0.08):
        environment = TaskEnv("reach_site", control=control, control_timestep=dt)
        assert environment.dt == dt
        environment.reset(seed=5)
        q = np.append(environment.data.qpos[:6], np.full(3, 0.5))
        pose = np.append(
            environment.task.tool(environment._episode.view) + np.array((0.0, 0.0, 0.05)), (0.0, 1.0, 0.0, 0.0, 0.5)
        )
        action = {
            "joint_velocity": np.full(9, 0.2),
            "joint_delta": np.full(9, 0.2 * dt),
            "joint_position": q + np.append(np.full(6, 0.06), np.zeros(3)),
            "tool_velocity": np.full(7, 0.05),
            "tool_pose": pose,
        }[control]
        before = environment.data.qpos[:6].copy()
        for _ in range(round(0.4 / dt)):
            environment.step(action)
        assert environment.data.time == pytest.approx(0.4)
        ends.append(environment.data.qpos[:6] - before)
    assert np.linalg.norm(ends[1]) > 0.03
    for end in ends:
        assert np.linalg.norm(end - ends[1]) < 0.2 * np.linalg.norm(ends[1])


def test_episodes_last_as_long_at_every_frequency() -> None:
    environment: Any = gymnasium.make("jacokin/ReachSite-v0", control_timestep=0.5, max_episode_steps=-1)
    environment.reset(seed=0)
    ends = [environment.step(np.zeros(9))[3] for _ in range(20)]
    assert ends == 19 * [False] + [True]
    assert environment.metadata["render_fps"] == 2
    again: Any = gymnasium.make(EnvSpec.from_json(environment.spec.to_json()))
    assert again.unwrapped.dt == 0.5
    assert pickle.loads(pickle.dumps(environment.unwrapped)).dt == 0.5
    wrong: Any
    for wrong in (0.0, 0.003, -0.04, 2.0, np.nan, "fast"):
        with pytest.raises(InvalidInputError, match="control_timestep must be"):
            TaskEnv("reach_site", control_timestep=wrong)


def test_cameras_are_chosen_by_name_and_size() -> None:
    sizes = {"wrist": (32, 48), "front_close": (24, 24), "wrist/depth": (8, 9), "front_close/segmentation": (7, 8)}
    made: Any = gymnasium.make("jacokin/LiftBrick-v0", observations="vision", cameras=sizes)
    shapes = {name: made.observation_space[name].shape for name in sizes}
    assert shapes == {
        "wrist": (32, 48, 3),
        "front_close": (24, 24, 3),
        "wrist/depth": (8, 9, 1),
        "front_close/segmentation": (7, 8, 1),
    }
    again: Any = gymnasium.make(EnvSpec.from_json(made.spec.to_json()))
    assert again.observation_space == made.observation_space
    for wrong, words in (
        ({"cameras": sizes}, "cameras need observations='vision'"),
        ({"observations": "vision", "cameras": {"behind": (8, 8)}}, "Valid: front_close, wrist"),
        ({"observations": "vision", "cameras": {"wrist/heat": (8, 8)}}, "unknown camera 'wrist/heat'"),
        ({"observations": "vision", "cameras": {"wrist": 84}}, "the size of camera 'wrist' must be"),
        ({"observations": "vision", "cameras": {"wrist": (84, 1000)}}, "the size of camera 'wrist'"),
    ):
        with pytest.raises(InvalidInputError, match=words):
            TaskEnv("lift_brick", **wrong)


def test_poses_out_of_reach_are_followed_without_a_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tracker goes as near as it can; looking for the closest configuration at each step takes too long."""

    def searched(self: ClosestSearch, *args: Any, **kwargs: Any) -> Any:
        raise AssertionError("a search was started")

    environment: Any = make("reach_site", control="tool_pose").unwrapped
    environment.reset(seed=0)
    monkeypatch.setattr(ClosestSearch, "find", searched)
    far = np.array([0.6, -0.6, 0.0, *jacokin.mujoco_bridge.DOWN_QUATERNION, 0.5])
    view, tool = environment._episode.view, environment.task.tool
    before = np.linalg.norm(tool(view) - far[:3])
    for _ in range(25):
        environment.step(far)
    assert np.linalg.norm(tool(view) - far[:3]) < before - 0.1


def test_a_quaternion_of_zeros_is_refused() -> None:
    tool: Any = make("reach_site", control="tool_pose").unwrapped
    tool.reset(seed=0)
    with pytest.raises(InvalidInputError, match="quaternion"):
        tool.step(np.zeros(8))


RAYS = """
import mujoco, numpy as np
from jacokin.tasks import TaskEnv
rows, columns = 30, 40
cameras = {"wrist": (8, 8), "wrist/depth": (rows, columns), "wrist/segmentation": (rows, columns)}
env = TaskEnv("lift_brick", observations="vision", cameras=cameras)
seen, _ = env.reset(seed=2)
assert env.observation_space.contains(seen)
model, data = env.model, env.data
camera = next(k for k in range(model.ncam) if model.camera(k).name.endswith("wrist"))
height = np.tan(np.deg2rad(model.cam_fovy[camera]) / 2.0)
axes, equal = data.cam_xmat[camera].reshape(3, 3), []
shown = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
shown[:3] = 1  # the groups that are drawn
for row in range(1, rows, 3):
    for column in range(1, columns, 3):
        y, x = height * (1.0 - 2.0 * (row + 0.5) / rows), height * (2.0 * (column + 0.5) - columns) / rows
        ray, geom = axes @ (x, y, -1.0), np.full(1, -1, dtype=np.int32)
        length = mujoco.mj_ray(model, data, data.cam_xpos[camera], ray, shown, 1, -1, geom)
        depth, number = seen["wrist/depth"][row, column, 0], seen["wrist/segmentation"][row, column, 0]
        equal.append(number == geom[0] and (length < 0.0 or abs(depth - length) < 0.01 * length))
bodies = {int(model.geom_bodyid[k]) for k in np.unique(seen["wrist/segmentation"]) if k >= 0}
print(len(equal), sum(equal), sorted(model.body(k).name for k in bodies)[:3])
assert sum(equal) > 0.93 * len(equal)  # but for pixels on edges
"""


@pytest.mark.slow
def test_depth_and_segmentation_are_what_rays_meet() -> None:
    """A ray through the middle of a pixel, by MuJoCo's collision geometry instead of OpenGL."""
    run_drawing("-W", "ignore", "-c", RAYS)
