"""What is not an action, an option or a state of physics: clear errors, for dm_env and for Gymnasium."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

import jacokin.tasks
from jacokin.errors import InvalidInputError, PhysicsError, UnknownNameError, install_command
from jacokin.tasks.gym.registration import IDS
from tests.programs import python

gymnasium.register_envs(jacokin.tasks)
CONTROLS = ("joint_velocity", "joint_position", "joint_delta", "tool_velocity", "tool_pose")
SKINS = ("dm_env", *CONTROLS)


class Skin:
    """One environment of either kind, with the same methods."""

    def __init__(self, kind: str, task: str = "reach_duplo") -> None:
        self.is_dm_env = kind == "dm_env"
        self.environment: Any
        if self.is_dm_env:
            self.environment = jacokin.tasks.load(task, seed=0)
            self.physics = self.environment.physics
            spec = self.environment.action_spec()
            self.low, self.high = spec.minimum, spec.maximum
        else:
            self.environment = jacokin.tasks.TaskEnv(task, control=kind)
            self.physics = self.environment._episode.physics
            space = self.environment.action_space
            self.low, self.high = space.low, space.high
        self.reset()

    def reset(self) -> None:
        self.environment.reset(**({} if self.is_dm_env else {"seed": 0}))

    def step(self, action: Any) -> bytes:
        """The state after a step."""
        self.environment.step(action)
        return bytes(self.physics.get_state().tobytes())

    def middle(self) -> np.ndarray:
        return np.asarray(0.5 * self.low + 0.5 * self.high + 0.1)


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", SKINS)
def test_what_is_not_an_action_changes_nothing(kind: str) -> None:
    one, other = Skin(kind), Skin(kind)
    n = len(one.low)
    one_nan = one.middle()
    one_nan[-1] = np.nan
    wrong: list[Any] = [one_nan, np.full(n, np.nan), np.zeros(n - 1), np.zeros((n, 1)), np.zeros((1, n)), 0.0, None]
    wrong += ["up", ["0"] * n, [None] * n, [True] * n, np.ones(n, dtype=bool), 1j * np.ones(n), [10**400] * n]
    wrong += [np.ma.masked_array(np.zeros(n), mask=True), [np.ma.masked] * n, np.zeros(n, dtype=object)]
    wrong += [np.zeros(n, dtype="datetime64[s]"), {"action": 1}, [[0.0], [0.0, 1.0]], object()]
    for action in wrong:
        with pytest.raises(InvalidInputError, match="action must"):
            one.step(action)
    assert one.step(one.middle()) == other.step(other.middle())


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", SKINS)
def test_actions_beyond_the_limits_are_put_on_them(kind: str) -> None:
    beyond, within = Skin(kind), Skin(kind)
    signs = np.where(np.arange(len(beyond.low)) % 2, 1.0, -1.0)
    bound = np.where(signs > 0.0, within.high, within.low)
    for huge in (np.inf, 1e300, 1e10):
        assert beyond.step(signs * huge) == within.step(bound)


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", SKINS)
def test_other_types_of_numbers_are_actions(kind: str) -> None:
    one, other = Skin(kind), Skin(kind)
    n = len(one.low)
    for action in (np.ones(n, dtype=np.float32), np.ones(n, dtype=np.int8), [1] * n, (1.0,) * n, np.ones(2 * n)[::2]):
        assert one.step(action) == other.step(np.ones(n))


def test_a_step_before_a_reset() -> None:
    environment = jacokin.tasks.load("reach_site", seed=0)
    assert environment.step(np.zeros(9)).first()  # as dm_env's interface says
    with pytest.raises(PhysicsError, match=r"call reset\(\) before step\(\)"):
        jacokin.tasks.TaskEnv("reach_site").step(np.zeros(9))
    with pytest.raises(gymnasium.error.ResetNeeded):  # Gymnasium's wrapper comes first
        gymnasium.make(IDS["reach_site"]).step(np.zeros(9))


@pytest.mark.parametrize(
    ("option", "value", "valid"),
    [
        ("control", "torque", CONTROLS),
        ("reward", "spars", ("dense", "sparse")),
        ("observations", "pixels", ("features", "vision")),
        ("render_mode", "ansi", ("rgb_array", "human", "depth_array")),
        ("contrl", "tool_pose", ("control", "reward", "goal", "observations", "randomization", "render_mode")),
    ],
)
@pytest.mark.filterwarnings("ignore:.*The environment is being initialised with render_mode")  # Gymnasium's own
def test_unknown_options_are_listed(option: str, value: Any, valid: tuple[str, ...]) -> None:
    with pytest.raises(UnknownNameError) as caught:
        gymnasium.make(IDS["reach_site"], **{option: value})
    assert all(name in str(caught.value) for name in valid)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"goal": 1}, "goal"),
        ({"flatten": "yes"}, "flatten"),
        ({"width": 0}, "width"),
        ({"height": 1.5}, "height"),
        ({"width": 1280, "height": 480}, "width must be a whole number <= 640, got 1280"),
        ({"height": 720}, "height must be a whole number <= 480, got 720"),
        ({"randomization": "mass"}, "randomization"),
        ({"randomization": 10**5000}, "randomization"),
        ({"goal": True, "observations": "vision"}, "goal=True needs"),
        ({"goal": True, "flatten": False}, "goal=True needs"),
        ({"task": "stack_3_bricks_random_order", "observations": "vision"}, "which order"),
    ],
)
def test_wrong_options(options: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidInputError, match=words):
        gymnasium.make(IDS["reach_site"], **options)


def test_wrong_arguments_of_reset_change_nothing() -> None:
    one, other = Skin("joint_velocity"), Skin("joint_velocity")
    wrong: list[tuple[Any, str]] = [(seed, "seed") for seed in (-1, 0.5, "0", True, np.timedelta64(5, "s"), [1])]
    for seed, name in wrong:
        with pytest.raises(InvalidInputError, match=name):
            one.environment.reset(seed=seed)
    for options in (1.0, np.ones(3), "speed", NotImplemented):
        with pytest.raises(InvalidInputError, match="options must be a dict or None"):
            one.environment.reset(options=options)
    with pytest.raises(UnknownNameError, match="option of reset"):
        one.environment.reset(options={"speed": 1})
    with pytest.raises(InvalidInputError, match="'randomization' goes with an environment that has one"):
        one.environment.reset(options={"randomization": {"mass": 1.0}})
    assert one.step(one.middle()) == other.step(other.middle())
    first, _ = one.environment.reset(seed=np.int64(7))  # any whole number
    np.testing.assert_array_equal(first, other.environment.reset(seed=7)[0])


def test_wrong_seeds_of_dm_env() -> None:
    for seed in (-1, 0.5, "0", True, np.timedelta64(5, "s"), 10**5000 * -1):
        with pytest.raises(InvalidInputError, match="seed must be"):
            jacokin.tasks.load("reach_site", seed=seed)  # type: ignore[arg-type]  # the mistakes


@pytest.mark.one_quick("field", "value")
@pytest.mark.parametrize("kind", SKINS)
@pytest.mark.parametrize("field", ["qvel", "qpos"])
@pytest.mark.parametrize("value", [1e12, np.nan])
def test_a_diverged_simulation(kind: str, field: str, value: float) -> None:
    """dm_env: an error, and then a new episode. Gymnasium: a truncated step that says why, and then reset is due."""
    skin = Skin(kind)
    if not skin.is_dm_env:
        given, _ = skin.environment.reset(seed=0)
        before = given.copy()
        given[:] = np.nan  # whoever has it may change it
    getattr(skin.physics.data, field)[-5] = value  # of the brick
    if skin.is_dm_env:
        with pytest.raises(PhysicsError):
            skin.step(skin.middle())
        assert skin.environment.step(skin.middle()).first()
        assert skin.environment.step(skin.middle()).mid()
        return
    observation, reward, terminated, truncated, info = skin.environment.step(skin.middle())
    assert (reward, terminated, truncated, info["is_success"]) == (0.0, False, True, False)
    assert info["error"]
    np.testing.assert_array_equal(observation, before)
    with pytest.raises(PhysicsError, match=r"call reset\(\)"):
        skin.step(skin.middle())
    fresh = Skin(kind)
    skin.reset()
    assert skin.step(skin.middle()) == fresh.step(fresh.middle())


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("package", "use"), [("dm_env", "jacokin.tasks.load('reach_site')"), ("gymnasium", "jacokin.tasks.TaskEnv")]
)
def test_without_a_package_its_extra_is_named(package: str, use: str) -> None:
    program = f"""
import importlib.util as util, sys
find = util.find_spec
util.find_spec = lambda name, *rest: None if name == {package!r} else find(name, *rest)
sys.modules[{package!r}] = None
import jacokin.tasks
assert len(jacokin.tasks.names()) == 33
try: {use}
except ImportError as error: print(error)
"""
    done = python("-c", program)
    assert done.stdout.strip() == f"{package} is needed for this. Install it with: {install_command('tasks')}"
