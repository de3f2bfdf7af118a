"""`record`: episodes of a policy, kept one by one as they end, and put together in the end in a format others read.

The ending of the path decides: ``.hdf5`` (robomimic's layout), ``.minari``, ``.lerobot`` (both folders). `replay` runs
the episodes of a data set again, and compares them with what was recorded.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import pickle
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
import orjson
from gymnasium import spaces
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.chunks.execution import Progress, checked_executor, reporter, run_jobs
from jacokin.chunks.folder import ChunkFolder, Keeper
from jacokin.errors import InvalidInputError, shown
from jacokin.files import parsing
from jacokin.model import checks
from jacokin.mujoco_bridge.arena import DM_CONTROL
from jacokin.tasks import registry
from jacokin.tasks.datasets.recorded import NOT_OURS, SINGLE, Recorded, check_free, episodes_folder
from jacokin.tasks.datasets.video import find_ffmpeg
from jacokin.tasks.episode import clip_action
from jacokin.tasks.gym.environment import TaskEnv
from jacokin.tasks.gym.packing import EnvOptions, Observation
from jacokin.tasks.gym.registration import IDS
from jacokin.tasks.randomization import Randomization

FORMATS = {".hdf5": "hdf5", ".minari": "hdf5", ".lerobot": "lerobot"}  # ending, and the module that writes it
KEPT = (*(name for name in EnvOptions.__slots__ if name != "task"), "randomization")  # options of environments
FUNCTION = "function"  # instead of a reward that cannot be kept

Policy = Callable[[Any], Any]


class EndEpisode(Exception):  # noqa: N818 - a signal of a policy, not an error
    """A policy raises it instead of giving an action: the episode ends there."""


@dataclass(frozen=True, slots=True)
class RecordSummary:
    """What was recorded."""

    path: Path
    """The file or folder."""
    episodes: int
    """How many."""
    solved: int
    """How many of them were solved at their end."""
    steps: int
    """Control steps of all."""
    mean_return: float
    """Mean sum of the rewards of an episode."""


def record(
    env: gymnasium.Env[Any, Any],
    policy: Policy,
    path: str | Path,
    *,
    episodes: int = 1,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> RecordSummary:
    """Record episodes of a policy for other libraries to learn from.

    Each episode is on disk as soon as it ends, in the folder ``NAME.episodes`` beside the path; a run that was killed,
    or found the disk full, goes on where it stopped when it is started again with the same arguments. It first runs an
    episode that is there again, and refuses to mix what another environment or policy made; a policy whose actions do
    not follow from the seed cannot be told from another. In the end the data set is written, as a whole.

    Args:
        env: an environment of a task, of ours or your own. Wrappers around it are left out, and refused if they change
            its spaces: actions are in its units.
        policy: gives an action for an observation; if it has a method ``reset``, that is called before each episode,
            with ``seed=`` of the episode if it takes one. Actions are kept as they are applied: within their bounds.
        path: where to, and nothing may be there yet; ``.hdf5``: a file in robomimic's layout; ``.minari``,
            ``.lerobot``: a folder.
        episodes: how many.
        seed: of the first episode; the others have the following numbers.
        executor: where episodes are run; None for this process. Environment and policy are pickled for others.
        progress: called after each episode.

    Raises:
        InvalidInputError: an argument or an action of the policy is wrong, or a file cannot be written.
        MissingExtraError: the package that writes the format is not installed.
        EpisodeInitializationError: an episode has no initial state.
    """
    inner = checked_environment(env)
    if (env.action_space, env.observation_space) != (inner.action_space, inner.observation_space):
        raise InvalidInputError(
            f"env must have the actions and observations of env.unwrapped, for which policies are recorded, got {env}"
        )
    if not callable(policy):
        raise checks.refusal("policy", "a function of an observation", policy)
    target = checks.path("path", path)
    writer = checked_writer(target, inner)
    count, first = checks.whole_number("episodes", episodes, 1), checks.whole_number("seed", seed)
    checked_executor(executor)
    if progress is not None:
        checks.function("progress", progress)
    description = describe(inner)
    recipe = {"environment": description, "policy": _name(policy), "seed": first, "mujoco": mujoco.__version__}
    folder = ChunkFolder(episodes_folder(target), recipe, count, ".npz")
    with folder.locked():
        folder.remove_unfinished()
        files = folder.finished()
        if files:
            _check_continued(inner, policy, files[min(files)])
        advance = reporter(progress, count, len(files))
        jobs = [(index, first + index) for index in range(count) if index not in files]
        for index, kept in _run(inner, policy, folder, jobs, executor):
            files[index] = folder.put(index, kept)
            advance(1)
        every = [files[index] for index in range(count)]
        summary = _summary(target, map(Recorded.from_file, every))
        writer.write(target, description, inner, lambda: map(Recorded.from_file, every))
        folder.remove()
    return summary


def checked_environment(env: gymnasium.Env[Any, Any]) -> TaskEnv:
    """The environment of a task, without the wrappers around it.

    Raises:
        InvalidInputError: it is something else.
    """
    if not isinstance(env, gymnasium.Env) or not isinstance(env.unwrapped, TaskEnv):
        raise checks.refusal("env", "an environment that gymnasium.make made of a task of jacokin", env)
    return env.unwrapped


def _check_continued(env: TaskEnv, policy: Policy, file: Path) -> None:
    """Check that a finished episode is one of this environment and this policy, by running it again.

    Raises:
        InvalidInputError: it went another way; says in what.
    """
    kept = Recorded.from_file(file)
    found = kept.differences(run_episode(env, policy, kept.seed))
    if "actions" in found and _is_of(env, kept):  # the policy's doing
        again = [run_episode(env, policy, kept.seed) for _ in range(2)]
        if "actions" in again[0].differences(again[1]):
            return  # its actions do not follow from the seed, so that nothing tells it from another
        what = "by another policy: its actions differ"
    elif found:
        what = f"of another environment: {', '.join(found)} differ"
    else:
        return
    raise InvalidInputError(
        f"{file.parent}: holds episodes {what} in the one with seed {kept.seed}. "
        "Use the same again, another path, or remove this folder"
    )


def _is_of(env: TaskEnv, kept: Recorded) -> bool:
    """Whether the actions of an episode lead to the rest of it in an environment, and to the end."""
    if kept.actions.shape[1:] != env.action_space.shape or kept.differences(run_actions(env, kept)):
        return False
    return env._episode.is_over or bool(kept.error)


def checked_writer(path: Path, env: TaskEnv) -> Any:  # a module
    """The module that writes a data set of an environment, which may be written there.

    Raises:
        InvalidInputError: another ending, no such folder, something is there already, or the format does not keep what
            the environment observes.
        MissingExtraError: the package that writes the format is not installed.
    """
    if path.suffix not in FORMATS:
        raise InvalidInputError(f"path must end in {', '.join(FORMATS)}, got {path}")
    check_free(path)
    if not path.absolute().parent.is_dir():
        raise InvalidInputError(f"path: there is no folder {path.absolute().parent}")
    others = [name for name in env.options.sizes if "/" in name]
    if others and path.suffix == ".lerobot":
        raise InvalidInputError(
            f"a .lerobot data set keeps videos of colours, not {', '.join(others)}: use .hdf5 or .minari"
        )
    rate = 1.0 / env.dt
    if abs(rate - round(rate)) > 1e-6 and path.suffix == ".lerobot":
        raise InvalidInputError(
            f"a .lerobot data set has a whole number of steps a second, not {rate:.4g}: use .hdf5 or .minari"
        )
    if path.suffix != ".lerobot":
        _check_names(env)
    if env.options.sizes and path.suffix == ".lerobot":
        find_ffmpeg()  # before episodes are run that it then could not write
    return importlib.import_module(f"jacokin.tasks.datasets.{FORMATS[path.suffix]}")


def _check_names(env: TaskEnv) -> None:
    """Check that names of observations differ in HDF5 too, where their slashes are underscores.

    Raises:
        InvalidInputError: two are the same there.
    """
    kept: dict[str, str] = {}
    space = env.observation_space
    names: list[str] = list(space.spaces) if isinstance(space, spaces.Dict) else []
    for name in names:
        other = kept.setdefault(name.replace("/", "_"), name)
        if other != name:
            raise InvalidInputError(
                f"observations {other!r} and {name!r} have the same name in HDF5, where slashes are underscores: "
                "rename one, or use .lerobot"
            )


def _name(policy: Policy) -> str:
    """What tells a policy from another in a recipe."""
    return str(getattr(policy, "name", None) or getattr(policy, "__qualname__", None) or type(policy).__qualname__)


def describe(env: TaskEnv) -> dict[str, Any]:
    """The id of an environment and its options, as JSON has them.

    Raises:
        InvalidInputError: a randomization with samplers that JSON cannot keep.
    """
    options = env.options
    kwargs: dict[str, Any] = {name: getattr(options, name) for name in KEPT if name != "randomization"}
    if callable(options.reward):
        kwargs["reward"] = FUNCTION
    if env.randomization is not None:
        kwargs["randomization"] = _as_json(env.randomization)
    return {"id": IDS.get(options.task, options.task), "kwargs": kwargs}


def _as_json(randomization: Randomization) -> dict[str, Any]:
    found = {name: value for name, value in asdict(randomization).items() if value is not None}
    for name, value in found.items():
        if not isinstance(value, float | int | tuple | list | dict):
            raise InvalidInputError(f"{name}: data sets keep numbers, Uniform and Normal, not {shown(value)}")
    plain: dict[str, Any] = orjson.loads(orjson.dumps(found, option=orjson.OPT_SERIALIZE_NUMPY))
    return plain


def _run(
    env: TaskEnv, policy: Policy, folder: ChunkFolder, jobs: list[tuple[int, int]], executor: Executor | None
) -> Iterator[tuple[int, str | bytes]]:
    """The number and the file of each episode, as they end."""
    if executor is None:
        for index, seed in jobs:
            yield index, folder.keeper.keep(index, run_episode(env, policy, seed).to_bytes())
        return
    try:
        content = pickle.dumps((env, policy))
    except Exception as error:  # whatever the policy's own pickling raises
        raise InvalidInputError(f"with an executor, env and policy must be pickled: {error}") from error
    make = functools.partial(_in_worker, content, folder.keeper)
    yield from run_jobs(make, ((index, (index, seed)) for index, seed in jobs), executor)


def _in_worker(content: bytes, keeper: Keeper, job: tuple[int, int]) -> str | bytes:
    index, seed = job
    return keeper.keep(index, run_episode(*_WORKER.unpickled(content), seed).to_bytes())


class _Worker(threading.local):
    """What a thread has unpickled last: two threads of a worker cannot share a simulation.

    Attributes:
        content: the bytes.
        made: what they were.
    """

    content = b""
    made: tuple[TaskEnv, Policy]

    def unpickled(self, content: bytes) -> tuple[TaskEnv, Policy]:
        """The environment and the policy of this thread."""
        if content != self.content:
            self.made = pickle.loads(content)
            self.content = content
        return self.made


_WORKER = _Worker()


def run_episode(
    env: TaskEnv, policy: Policy, seed: int, watch: Callable[[], None] = lambda: None, most: int | None = None
) -> Recorded:
    """Run an episode.

    Args:
        env: the environment.
        policy: gives the actions; may raise `EndEpisode` after the first one.
        seed: of the episode.
        watch: called after the reset and after each step.
        most: steps after which it is given up; None to run it to its end.
    """
    observation, info = env.reset(seed=seed)
    _reset(policy, seed)
    seen, states = [_by_name(observation)], [env.task.physics.get_state()]
    actions, rewards, success = list[Array](), list[float](), list[bool]()
    varied = dict(info.get("randomization", {}))
    watch()
    is_over = False
    while not is_over and len(actions) != most:
        try:
            wanted = policy(observation)
        except EndEpisode:
            break
        action = clip_action(wanted, *env._control.bounds)
        observation, reward, _, is_over, info = env.step(action)
        seen.append(_by_name(observation))
        states.append(env.task.physics.get_state())
        actions.append(action)
        rewards.append(reward)
        success.append(info["is_success"])
        watch()
    return Recorded(
        seed,
        {name: np.stack([each[name] for each in seen]) for name in seen[0]},
        np.stack(actions),
        np.array(rewards, dtype=np.float64),
        np.array(success, dtype=bool),
        np.stack(states),
        varied,
        info.get("error", ""),
    )


def run_actions(env: TaskEnv, recorded: Recorded, watch: Callable[[], None] = lambda: None) -> Recorded:
    """Run an episode again: from its seed, by its actions, as far as they or the episode go."""
    actions = iter(recorded.actions)
    return run_episode(env, lambda observation: next(actions), recorded.seed, watch, len(recorded.actions))


def _reset(policy: Policy, seed: int) -> None:
    reset = getattr(policy, "reset", None)
    if reset is None:
        return
    if "seed" in inspect.signature(reset).parameters:
        reset(seed=seed)
    else:
        reset()


def _by_name(observation: Observation) -> dict[str, NDArray[Any]]:
    """Copies of what was observed, by name: a policy may change what it is given."""
    named = observation if isinstance(observation, dict) else {SINGLE: observation}
    return {name: values.copy() for name, values in named.items()}


def _summary(path: Path, episodes: Iterable[Recorded]) -> RecordSummary:
    lengths, returns, solved = [], [], 0
    for each in episodes:
        lengths.append(len(each.actions))
        returns.append(float(each.rewards.sum()))
        solved += bool(each.success[-1])
    return RecordSummary(path, len(returns), solved, sum(lengths), float(np.mean(returns)))


@dataclass(frozen=True, slots=True)
class Replayed:
    """How an episode of a data set went when it was run again."""

    episode: int
    """Its number."""
    seed: int
    """From which it was reset."""
    success: bool
    """Whether it was solved at its end, now."""
    is_equal: bool
    """Whether observations, actions, rewards, success and states are those of the recording, bit by bit."""
    largest_difference: float
    """Of the states; infinite where there are more or fewer of them, or one is not a number."""
    differing: tuple[str, ...]
    """The names of what is not equal."""


def replay(
    path: str | Path,
    *,
    env: gymnasium.Env[Any, Any] | None = None,
    render_mode: str | None = None,
    watch: Callable[[TaskEnv], None] | None = None,
) -> list[Replayed]:
    """Run the episodes of a data set again: from their seeds, by their actions.

    On the version of MuJoCo and of jacokin that recorded them, they are equal bit by bit. An episode that was recorded
    with fewer steps than the environment's are run as far as it goes.

    Args:
        path: what `record` wrote.
        env: the environment; None to make it as the data set says.
        render_mode: of the environment that is made.
        watch: called with the environment after each reset and each step, to render it, for example.

    Raises:
        InvalidInputError: no such data set, or it is damaged; or its environment has a function as its reward, and env
            is None; or its actions are not those of the environment.
        UnknownNameError: the task of the data set is not registered.
    """
    source = checks.path("path", path)
    checks.optional(checks.function, "watch", watch)
    with parsing(source, NOT_OURS):
        is_there = source.exists()
    if source.suffix not in FORMATS or not is_there:
        raise InvalidInputError(f"path must be a data set that is there, ending in {', '.join(FORMATS)}, got {source}")
    description, episodes = importlib.import_module(f"jacokin.tasks.datasets.{FORMATS[source.suffix]}").read(source)
    made = _make(source, description, render_mode) if env is None else checked_environment(env)
    look = (lambda: None) if watch is None else (lambda: watch(made))
    return [_again(f"{source}: episode {number + 1}", number, each, made, look) for number, each in enumerate(episodes)]


def _make(source: Path, description: dict[str, Any], render_mode: str | None) -> TaskEnv:
    kwargs = dict(description["kwargs"])
    if kwargs["reward"] == FUNCTION:
        raise InvalidInputError(f"{source}: its reward is a function, which it does not hold: give env=...")
    task = checks.choice("task", registry.of_id(description["id"]), registry.TASKS)
    for option in kwargs:
        checks.choice(f"option of the environment of {source}", option, KEPT)
    kwargs.setdefault("contact", DM_CONTROL)  # before it was an option
    with parsing(source, NOT_OURS):
        return TaskEnv(task, render_mode=render_mode, **kwargs)


def _again(place: str, number: int, recorded: Recorded, env: TaskEnv, look: Callable[[], None]) -> Replayed:
    shape = env.action_space.shape
    if recorded.actions.shape[1:] != shape:
        raise InvalidInputError(
            f"{place} has actions of {recorded.actions.shape[1]} numbers, and the environment takes actions of shape "
            f"{shape} (control={env.options.control!r})"
        )
    try:
        now = run_actions(env, recorded, look)
    except InvalidInputError as error:
        raise InvalidInputError(f"{place} cannot be run again: {error}") from error
    found = recorded.differences(now)
    difference = np.inf
    if recorded.states.shape == now.states.shape:
        difference = float(np.nan_to_num(np.abs(recorded.states - now.states), nan=np.inf, posinf=np.inf).max())
    if "states" not in found:
        difference = 0.0
    return Replayed(number, recorded.seed, bool(now.success[-1]), not found, difference, tuple(found))
