"""Tasks of your own: everything that ours can do, with tasks that are composed or subclassed outside the package."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence

import jacokin.tasks
from examples.make_mug import write_mug
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, PhysicsError, UnknownNameError
from jacokin.mujoco_bridge import Primitive, large_box, robots
from jacokin.mujoco_bridge.distributions import Uniform
from jacokin.mujoco_bridge.observations import PERFECT_FEATURES
from jacokin.mujoco_bridge.props import Mesh
from jacokin.mujoco_bridge.rewards import tolerance
from jacokin.tasks import Feature, Lift, Place, Randomization, State, Task, TaskEnv, registry
from jacokin.tasks.gym.vector import VectorTaskEnv
from tests.cli.run import leave
from tests.model.measured_arms import perturbed
from tests.tasks.gym.randomizations import ALL
from tests.tasks.gym.test_vector import check_equal_to_single_ones

MUG = "mine/LiftMug-v0"
LIMIT = 2.0  # [s]
ROOT = Path(jacokin.__file__).parents[1]


def near_and_high(state: State) -> Any:
    hand, mug = state["jaco_arm/jaco_hand/pinch_site_pos"], state["mug/position"]
    near = tolerance(np.linalg.norm(hand - mug, axis=-1), margin=0.2)
    return 0.5 * near + 0.5 * tolerance(mug[..., 2], (0.2, np.inf), margin=0.2) - 0.01 * (state.action**2).sum(axis=-1)


def is_high(state: State) -> Any:
    return state["mug/position"][..., 2] > 0.2


class HoldMug(Task):
    """Hold a mug where it is told: the goal of an episode is a place."""

    goal_size = 3

    def __init__(self, mug: Mesh) -> None:
        super().__init__(props=[mug], time_limit=LIMIT)

    def place_things(self, random_state: Any) -> Array:
        super().place_things(random_state)
        return np.asarray(random_state.uniform((-0.1, -0.1, 0.1), (0.1, 0.1, 0.3)))

    def achieved(self, view: Any, goal: Array) -> Array:
        return State(self, view, goal, goal)["mug/position"]

    def desired(self, view: Any, goal: Array) -> Array:
        return goal

    def success(self, achieved: Array, desired: Array) -> Array:
        return np.asarray(np.linalg.norm(achieved - desired, axis=-1) < 0.05)


@pytest.fixture(scope="module")
def mug_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_mug(tmp_path_factory.mktemp("mug") / "mug.obj")


@pytest.fixture
def lift_mug(mug_file: Path, own_tasks: None) -> Task:
    """A composed task, registered."""
    mug = Mesh(mug_file, density=600.0, name="mug", decomposed=False)
    task = Task(props=[mug], reward=near_and_high, success=is_high, time_limit=LIMIT)
    jacokin.tasks.register(task, id=MUG)
    jacokin.tasks.register(HoldMug(Mesh(mug_file, name="mug", decomposed=False)), id="mine/HoldMug-v0")
    return task


OPTIONS: list[tuple[str, dict[str, Any]]] = [
    (MUG, {}),
    (MUG, {"control": "tool_velocity", "flatten": False, "randomization": ALL}),
    ("mine/HoldMug-v0", {"goal": True, "control": "tool_pose"}),
    ("mine/HoldMug-v0", {"reward": near_and_high}),
]


@pytest.mark.one_quick
@pytest.mark.usefixtures("lift_mug")
@pytest.mark.parametrize(("name", "options"), OPTIONS)
def test_an_own_task_is_an_environment_like_ours(name: str, options: dict[str, Any]) -> None:
    env = gymnasium.make(name, **options)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*infinity|.*symmetric and normalized")
        check_env(env.unwrapped, skip_render_check=True)
    env.reset(seed=3)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(3)]
    env.step(actions[0])
    copies = [pickle.loads(pickle.dumps(env)), copy.deepcopy(env)]

    def results(each: Any) -> list[Any]:
        return [*(each.step(action) for action in actions), each.reset(), each.step(actions[0])]

    wanted = results(env)
    for each in copies:
        assert data_equivalence(results(each), wanted, exact=True)
    check_equal_to_single_ones(name, options, 4)


def test_rewards_are_those_of_the_function(lift_mug: Task) -> None:
    env = TaskEnv(MUG, flatten=False)
    observation, info = env.reset(seed=0)
    assert not info["is_success"]
    assert isinstance(observation, dict)
    assert observation["mug/position"][2] == pytest.approx(0.0, abs=1e-3)  # it stands
    hand = env.task.physics.bind(env.task.hand.tool_center_point).xpos
    env.step(np.full(9, 0.1))
    mug = env.task.props[0]
    mug.set_pose(env.task.physics, hand + np.array((0.0, 0.0, 0.3)))  # somewhere high
    observation, reward, _, _, info = env.step(np.full(9, 0.1))
    assert isinstance(observation, dict)
    position = observation["mug/position"]
    near = 0.1 ** ((np.linalg.norm(observation["jaco_arm/jaco_hand/pinch_site_pos"] - position) / 0.2) ** 2)
    assert position[2] > 0.2
    assert info["is_success"]
    assert reward == pytest.approx(0.5 * near + 0.5 - 0.01 * 9 * 0.01)
    # dm_env gives the same rewards
    theirs = jacokin.tasks.load(MUG, seed=5)
    ours: Any = gymnasium.make(MUG)
    theirs.reset()
    ours.unwrapped._np_random = np.random.default_rng(5)
    ours.reset()
    for _ in range(3):
        assert theirs.step(np.ones(9)).reward == ours.step(np.ones(9))[1]
    assert lift_mug.steps == 50


@pytest.mark.usefixtures("lift_mug")
def test_the_time_limit_is_that_of_the_task() -> None:
    env = gymnasium.make(MUG)
    env.reset(seed=0)
    ends = [env.step(np.zeros(9))[3] for _ in range(50)]
    assert ends == [False] * 49 + [True]
    theirs = jacokin.tasks.load(MUG, seed=0)
    theirs.reset()
    assert [theirs.step(np.zeros(9)).last() for _ in range(50)] == ends


def test_names_are_listed_and_found(lift_mug: Task) -> None:
    assert jacokin.tasks.names()[-4:-2] == (f"{MUG}_features", f"{MUG}_vision")
    with pytest.raises(UnknownNameError, match=f"Did you mean '{MUG}"):
        jacokin.tasks.load("mine/LiftMug-v1")
    assert lift_mug.again().props[0].name == "mug"


def test_goals_of_hindsight() -> None:
    def reward(state: State) -> Any:
        return -np.linalg.norm(state.achieved - state.desired, axis=-1)

    env: Any = gymnasium.make("jacokin/ReachSite-v0", reward=reward, goal=True)
    observation, _ = env.reset(seed=0)
    observation, value, *_ = env.step(np.zeros(9))
    achieved, desired = observation["achieved_goal"], observation["desired_goal"]
    assert value == pytest.approx(-float(np.linalg.norm(achieved - desired)))
    found = env.unwrapped.compute_reward(np.tile(achieved, (3, 1)), desired, {})
    np.testing.assert_allclose(found, [value] * 3)

    def of_the_state(state: State) -> Any:
        return state["target_position"][..., 0]

    other: Any = gymnasium.make("jacokin/ReachSite-v0", reward=of_the_state, goal=True)
    observation, _ = other.reset(seed=0)
    with pytest.raises(InvalidInputError, match=r"state.achieved and state.desired only, not 'target_position'"):
        other.unwrapped.compute_reward(achieved, desired)
    with pytest.raises(InvalidInputError, match="not 'view'"):
        _ = State.of_goals(achieved, desired).view


@pytest.mark.parametrize("vector", [False, True])
def test_a_specification_with_a_function_is_not_json(vector: bool) -> None:
    def reward(state: State) -> Any:
        return state["target_position"][..., 2]

    env: Any = gymnasium.make("jacokin/ReachSite-v0", reward=reward)
    if vector:
        mode = "vector_entry_point"
        env = gymnasium.make_vec("jacokin/ReachSite-v0", num_envs=2, reward=reward, vectorization_mode=mode)
    observation, _ = env.reset(seed=0)
    _, rewards, *_ = env.step(np.zeros(env.action_space.shape))
    np.testing.assert_array_equal(rewards, observation[..., 2])
    with pytest.raises(InvalidInputError, match="which JSON cannot keep: register a task"):
        env.spec.to_json()


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda state: 1.0, r"must give numbers of shape \(2,\), got shape \(\)"),
        (lambda state: 1.0 if state["target_position"][2] > 0 else 0.0, "np.where for if"),
        (lambda state: state["target_positio"], "Did you mean 'target_position'"),
    ],
)
def test_a_function_of_one_state_is_refused_for_many(wrong: Callable[[State], Any], words: str) -> None:
    env: Any = gymnasium.make_vec(
        "jacokin/ReachSite-v0", num_envs=2, reward=wrong, vectorization_mode="vector_entry_point"
    )

    def use() -> None:
        env.reset(seed=0)
        env.step(np.zeros((2, 9)))

    with pytest.raises(InvalidInputError, match=words):
        use()


@pytest.mark.usefixtures("lift_mug")
@pytest.mark.parametrize(("robot", "actuators"), [("j2s7s300", 10), ("j2s7s200", 9), ("j2n6s200", 8)])
def test_controls_of_the_tool_are_for_six_joints_and_three_fingers(robot: str, actuators: int) -> None:
    task = Task(
        robots.make_arm(PERFECT_FEATURES, robot),
        robots.make_hand(PERFECT_FEATURES, robot),
        props=[Primitive("sphere", (0.02,), name="ball")],
        reward=lambda state: 0.0,
        success=lambda state: state["ball/position"][..., 2] > 1.0,
    )
    jacokin.tasks.register(task, id=f"mine/{robot}-v0")
    with pytest.raises(InvalidInputError, match=f"{actuators} actuators take 'joint_velocity'"):
        TaskEnv(f"mine/{robot}-v0", control="tool_velocity")
    env = TaskEnv(f"mine/{robot}-v0")
    env.reset(seed=0)
    env.step(np.full(actuators, 0.1))
    assert (env.data.qvel[: actuators - 1] > 0.0).all()


def of_arm(name: str, **options: Any) -> Task:
    """A task with another arm, and its hand."""
    return Task(
        robots.make_arm(PERFECT_FEATURES, name, **options),
        robots.make_hand(PERFECT_FEATURES, name),
        props=[Primitive("sphere", (0.02,), name="ball")],
        success=lambda state: state["ball/position"][..., 2] > 1.0,
    )


@pytest.mark.parametrize(("name", "measured"), [("j2s6s300", False), ("m1n6s300", False), ("j2n6s300", True)])
def test_controls_of_the_tool_are_those_of_the_arm(name: str, measured: bool) -> None:
    moved = perturbed(jacokin.load_robot(name), np.random.default_rng(1)).calibration if measured else None
    jacokin.tasks.register(of_arm(name, calibration=moved), id="mine/OtherArm-v0")
    env = TaskEnv("mine/OtherArm-v0", control="tool_velocity")
    env.reset(seed=0)
    site = env.task.physics.bind(env.task.hand.tool_center_point)
    before = site.xpos.copy()
    for _ in range(15):
        env.step((0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))  # [m/s]
    np.testing.assert_allclose(site.xpos, before + np.array((0.06, 0.0, 0.0)), atol=2e-3)
    env = TaskEnv("mine/OtherArm-v0", control="tool_pose")
    env.reset(seed=0)
    site = env.task.physics.bind(env.task.hand.tool_center_point)
    wanted, quat_wxyz = site.xpos + np.array((0.05, 0.0, 0.05)), np.empty(4)
    mujoco.mju_mat2Quat(quat_wxyz, site.xmat.ravel())
    for _ in range(40):
        env.step((*wanted, *quat_wxyz, 0.5))
    np.testing.assert_allclose(site.xpos, wanted, atol=2e-3)


def test_arms_of_seven_joints_vary_too() -> None:
    jacokin.tasks.register(of_arm("j2s7s300"), id="mine/Seven-v0")
    env = TaskEnv("mine/Seven-v0")
    before = env.model.actuator_gainprm[:, 0].copy()
    varied = TaskEnv("mine/Seven-v0", randomization=Randomization(joint_gains=1.5))
    varied.reset(seed=0)
    np.testing.assert_allclose(varied.model.actuator_gainprm[:, 0] / before, [1.5] * 9 + [1.0])


def test_an_arm_that_takes_positions_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="arm must take velocities or torques"):
        of_arm("j2n6s300", actuation="position")


def test_more_of_a_scene_is_observed_and_placed() -> None:
    """A fixture, an observation of its own, a reset that returns the goal, and an arm of another robot."""

    def reset(task: Task, random_state: Any) -> Array:
        x = random_state.uniform(-0.1, 0.1)
        task.fixtures[0].set_pose(task.physics, (x, 0.1, 0.05))
        task.props[0].set_pose(task.physics, (x, -0.1, 0.02))
        return np.array([x])

    height = Feature("height", (1,), lambda view, goal: view.qpos[..., [-5]])
    task = Task(
        robots.make_arm(PERFECT_FEATURES, "j2s6s300"),
        robots.make_hand(PERFECT_FEATURES, "j2s6s300"),
        props=[Primitive("sphere", (0.02,), name="ball")],
        fixtures=[large_box("wall")],
        success=lambda state: abs(state.achieved - state.desired)[..., 0] < 0.01,
        achieved=lambda state: state["ball/position"][..., :1],
        desired=lambda state: state["wall/position"][..., :1],
        reset=reset,
        goal_size=1,
        observables=[height],
        tool_box=((-0.1, -0.1, 0.3), (0.1, 0.1, 0.4)),
    )
    rng = np.random.default_rng(0)
    goal = task.start(rng)
    assert list(task.features_by_name)[-2:] == ["wall/position", "height"]
    state = State(task, jacokin.tasks.features.StateView.of(task.physics.data), goal, np.zeros(9))
    np.testing.assert_allclose(state["wall/position"], (goal[0], 0.1, 0.05))
    np.testing.assert_allclose(state["height"], 0.02)
    assert task.is_solved(state)
    assert task.score(state) == 1.0
    tool = task.tool(state.view)
    assert (tool > (-0.1, -0.1, 0.3)).all()
    assert (tool < (0.1, 0.1, 0.4)).all()


def observing(*observables: Feature) -> Task:
    """A task with a ball and observations of one's own."""
    ball = Primitive("sphere", (0.02,), name="ball")
    return Task(props=[ball], success=lambda state: state["ball/position"][..., 2] > 0.3, observables=observables)


@pytest.mark.usefixtures("own_tasks")
@pytest.mark.parametrize("flatten", [False, True])
def test_an_observation_of_another_shape_is_refused(flatten: bool) -> None:
    jacokin.tasks.register(observing(Feature("q", (3,), lambda view, goal: view.qpos[..., :1])), id="mine/Odd-v0")
    with pytest.raises(InvalidInputError, match=r"observation 'q' must read shape \(3,\), got \(1,\)"):
        TaskEnv("mine/Odd-v0", flatten=flatten).reset(seed=0)
    with pytest.raises(InvalidInputError, match="observation 'q' must read shape"):
        jacokin.tasks.load("mine/Odd-v0").reset()


def test_observations_have_names_of_their_own() -> None:
    first, second = (Feature("q", (size,), lambda view, goal: view.qpos[..., :2]) for size in (1, 2))
    with pytest.raises(InvalidInputError, match="two observations have the name 'q'"):
        observing(first, second)
    with pytest.raises(InvalidInputError, match="two observations have the name 'ball/position'"):
        observing(Feature("ball/position", (2,), first.read))
    read: Any = first.read
    for wrong in (("", (2,), read), (3, (2,), read), ("q", (1.5,), read), ("q", 2, read), ("q", (2,), None)):
        with pytest.raises(InvalidInputError, match="name|shape|read"):
            Feature(*wrong)


def test_what_is_true_or_false_is_observed_as_numbers() -> None:
    is_high = Feature("is_high", (1,), lambda view, goal: view.qpos[..., [-5]] > 0.5)
    jacokin.tasks.register(observing(is_high), id="mine/High-v0")
    noise = Randomization(feature_noise={"is_high": 0.1})
    env = TaskEnv("mine/High-v0", flatten=False, randomization=noise)
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert env.observation_space.contains(env.step(np.zeros(9))[0])
    seen = jacokin.tasks.load("mine/High-v0", seed=0).reset().observation["is_high"]
    assert seen.dtype == np.float64


@pytest.mark.usefixtures("lift_mug")
def test_lift_and_place_take_any_prop(mug_file: Path) -> None:
    jacokin.tasks.register(Lift(Mesh(mug_file, name="mug", decomposed=False)), id="mine/LiftAny-v0")
    jacokin.tasks.register(Place(Primitive("cylinder", (0.02, 0.03), name="can")), id="mine/PlaceCan-v0")
    lift = TaskEnv("mine/LiftAny-v0")
    lift.reset(seed=1)
    prop = lift.task.props[0]
    before, _ = prop.get_pose(lift.task.physics)
    assert not lift.step(np.zeros(9))[4]["is_success"]
    prop.set_pose(lift.task.physics, before + np.array((0.0, 0.0, 0.32)))
    assert lift.step(np.zeros(9))[4]["is_success"]
    place = TaskEnv("mine/PlaceCan-v0", flatten=False)
    observation, _ = place.reset(seed=1)
    assert isinstance(observation, dict)
    assert observation["can/position"][2] == pytest.approx(0.03, abs=1e-3)


def test_a_policy_and_the_command_line(lift_mug: Task, capsys: pytest.CaptureFixture[str]) -> None:
    def script(arm: Any) -> Iterator[Array]:
        yield from arm.stay(0.0)

    jacokin.tasks.register(lift_mug, id=MUG, expert=script)
    assert leave("task", MUG, "--expert") == 1
    assert "0 of 1 solved" in capsys.readouterr().out


@pytest.mark.slow
def test_a_module_is_imported_by_the_name_of_a_task(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_lifting.py").write_text(
        "from jacokin import tasks\nfrom jacokin.mujoco_bridge import Primitive\n"
        "def make():\n    return tasks.Lift(Primitive('box', name='cube'))\n"
        "tasks.register(make, id='mine/Cube-v0')\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    assert leave("task", "my_lifting:mine/Cube-v0") == 0
    program = "import pickle,sys; env=pickle.load(sys.stdin.buffer); print(env.reset(seed=0)[0].sum())"
    env = TaskEnv("mine/Cube-v0")
    done = subprocess.run(
        [sys.executable, "-P", "-c", program],
        input=pickle.dumps(env),
        capture_output=True,
        check=False,
        env={"PYTHONPATH": f"{tmp_path}:{ROOT}"},
    )
    assert float(done.stdout) == pytest.approx(float(np.asarray(env.reset(seed=0)[0]).sum())), done.stderr
    with pytest.raises(InvalidInputError, match="the module 'no_such' before ':' cannot be imported"):
        jacokin.tasks.load("no_such:mine/Cube-v0")
    with pytest.raises(InvalidInputError, match="the module '.relative' before ':' cannot be imported"):
        jacokin.tasks.load(".relative:mine/Cube-v0")
    del registry.TASKS["mine/Cube-v0"]
    gymnasium.registry.pop("mine/Cube-v0")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({}, "needs success="),
        ({"success": 1}, "success must be a function"),
        ({"success": is_high, "achieved": is_high}, "belong together"),
        ({"success": is_high, "props": ["mug"]}, "props must be a list of FreeProp"),
        ({"success": is_high, "arm": "j2s7s300"}, "arm must be a JacoArm"),
        ({"success": is_high, "hand": 3}, "hand must be a JacoHand"),
        ({"success": is_high, "time_limit": 0.0}, "time_limit"),
        ({"success": is_high, "tool_box": (1, 2)}, "tool_box must be"),
        ({"success": is_high, "goal_size": -1}, "goal_size"),
    ],
)
def test_mistakes_in_a_task(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidInputError, match=words):
        Task(**arguments)


@pytest.mark.parametrize("family", [Lift, Place])
def test_what_is_lifted_or_placed_is_a_prop(family: type[Lift | Place]) -> None:
    with pytest.raises(InvalidInputError, match="prop must be a prop, such as a Mesh"):
        family("mug.obj")  # type: ignore[arg-type]


def test_mistakes_in_registering(lift_mug: Task) -> None:
    for name in ("jacokin/Mine-v0", "no version", 3):
        with pytest.raises(InvalidInputError, match="id must be"):
            jacokin.tasks.register(lift_mug, id=name)  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match="task must be"):
        jacokin.tasks.register("mug", id=MUG)  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match="goal=True needs a task with achieved"):
        TaskEnv(MUG, goal=True)
    jacokin.tasks.register(lambda: 3, id="mine/Three-v0")  # type: ignore[arg-type, return-value]
    with pytest.raises(InvalidInputError, match="must make a Task, and made 3"):
        jacokin.tasks.load("mine/Three-v0")
    wrong = Task(success=is_high, reset=lambda task, rng: 3.0)  # type: ignore[arg-type, return-value]
    with pytest.raises(InvalidInputError, match="a goal of 0 numbers"):
        wrong.start(np.random.default_rng(0))
    varied = Randomization(mass=Uniform(0.5, 2.0))
    one, other = TaskEnv(MUG, randomization=varied), TaskEnv(MUG)
    one.reset(seed=2)
    other.reset(seed=2)
    body = one.task.props[0].root_body.id
    assert one.model.body_mass[body] == pytest.approx(one._values["mass"] * other.model.body_mass[body])


def test_a_calibrated_arm_places_its_tool_exactly(robot: jacokin.Robot) -> None:
    calibrated = perturbed(robot, np.random.default_rng(1))
    arm = robots.make_arm(PERFECT_FEATURES, calibration=calibrated.calibration)
    task = Task(arm=arm, success=lambda state: state["jaco_arm/jaco_hand/pinch_site_pos"][..., 2] > 0.3)
    base = np.array(robots.ARM_OFFSET)
    for seed in range(3):
        task.place_robot(np.random.RandomState(seed))
        q, tool = task.physics.data.qpos[:6], task.physics.bind(task.hand.pinch_site).xpos
        assert np.linalg.norm(base + calibrated.forward_kinematics(q, "pinchsite").translation - tool) < 1e-12
        assert np.linalg.norm(base + robot.forward_kinematics(q, "pinchsite").translation - tool) > 1e-3
        wanted = task.physics.bind(task.hand.tool_center_point).xpos
        assert np.all((task.tool_box.lower <= wanted + 1e-9) & (wanted - 1e-9 <= task.tool_box.upper))


def test_a_reward_that_is_not_a_number_names_the_task_and_the_step() -> None:
    """A mistake in an own reward must not end in a network full of NaN."""

    def make(start: float, end: float) -> Callable[[State], Any]:
        def reward(state: State) -> Any:
            speed = state.action[..., 0]
            return np.where((speed >= start) & (speed < end), np.nan, 1.0)

        return reward

    action = np.zeros(9)
    env = TaskEnv("reach_site", reward=make(0.5, np.inf))
    env.reset(seed=0)
    env.step(action)
    action[0] = 0.6
    with pytest.raises(InvalidInputError, match=r"reward of reach_site after step 2 must be a finite number, got nan"):
        env.step(action)
    with pytest.raises(PhysicsError, match="call reset"):
        env.step(action)
    with pytest.raises(InvalidInputError, match=r"reward of reach_site at the start of an episode .* got nan"):
        TaskEnv("reach_site", reward=make(-1.0, 0.5)).reset(seed=0)
    envs = VectorTaskEnv(3, task="reach_site", reward=make(0.5, np.inf))
    envs.reset(seed=0)
    actions = np.zeros((3, 9))
    envs.step(actions)
    actions[1, 0] = 0.6
    with pytest.raises(InvalidInputError, match=r"reward of reach_site after step 2 of environment 1 must be a finite"):
        envs.step(actions)
    goal_env = TaskEnv("reach_site", goal=True, reward=lambda state: state.achieved[..., 0] * np.nan)
    with pytest.raises(InvalidInputError, match="reward of reach_site must be a finite number, got nan"):
        goal_env.compute_reward(np.ones((2, 3)), np.ones(3))


@pytest.mark.usefixtures("lift_mug")
def test_so_does_that_of_a_dm_env_environment(mug_file: Path) -> None:
    mug = Mesh(mug_file, name="mug", decomposed=False)
    reward = lambda state: np.where(state.action[..., 0] > 0.5, np.inf, 0.0)  # noqa: E731 - as a user writes it
    jacokin.tasks.register(Task(props=[mug], reward=reward, success=is_high), id="mine/Infinite-v0")
    env = jacokin.tasks.load("mine/Infinite-v0", seed=0)
    env.reset()
    with pytest.raises(InvalidInputError, match=r"reward of mine/Infinite-v0 after step 1 must be a finite .* got inf"):
        env.step(np.full(9, 0.6))


def test_arguments_that_cannot_be_copied_are_refused() -> None:
    module: Any = np
    with pytest.raises(InvalidInputError, match="cannot pickle 'module' object"):
        Lift(Primitive("box", name="cube"), height=module)


def test_a_task_without_a_name_is_told_how_to_get_one() -> None:
    task = Task(success=lambda state: False)
    for make in (TaskEnv, jacokin.tasks.load):
        with pytest.raises(InvalidInputError, match=r"task must be a name, got a Task: register\(task, id="):
            make(task)  # type: ignore[arg-type]  # a user's mistake


@pytest.mark.usefixtures("own_tasks")
@pytest.mark.parametrize(("told", "said"), [(np.nan, "nan"), (0.5, "0.5"), (-1.0, "-1")])
def test_what_is_neither_success_nor_failure_is_refused(told: float, said: str) -> None:
    task = Task(success=lambda state: np.full(state.desired.shape[:-1], told), reward=lambda state: 0.0)
    jacokin.tasks.register(task, id="mine/Neither-v0")
    with pytest.raises(InvalidInputError, match=f"success must give True or False, got {said}$"):
        TaskEnv("mine/Neither-v0").reset(seed=0)
