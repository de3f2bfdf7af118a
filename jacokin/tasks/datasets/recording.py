"""`record`: episodes of a policy, kept one by one as they end, and put together in the end in a format others read.

The ending of the path decides: ``.hdf5`` (robomimic's layout), ``.minari``, ``.lerobot`` (both folders).
"""

from __future__ import annotations

import functools
import importlib
import inspect
import io
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
import orjson
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.chunks.execution import Progress, checked_executor, reporter, run_jobs
from jacokin.chunks.folder import ChunkFolder, Keeper
from jacokin.errors import InvalidInputError, shown
from jacokin.files import read_arrays
from jacokin.model import checks
from jacokin.tasks.episode import clip_action
from jacokin.tasks.gym.environment import TaskEnv
from jacokin.tasks.gym.packing import Observation
from jacokin.tasks.gym.registration import IDS
from jacokin.tasks.randomization import Randomization

FORMATS = {".hdf5": "hdf5", ".minari": "hdf5", ".lerobot": "lerobot"}  # ending, and the module that writes it
FUNCTION = "function"  # instead of a reward that cannot be kept
_OBSERVED = "observed "  # begins the names of observations among those of arrays
SINGLE = "observation"  # name of an observation that has none

Policy = Callable[[Any], Any]


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """An episode of n control steps.

    Attributes:
        seed: from which it was reset.
        observations: (n + 1, ...) by name: before each action, and after the last.
        actions: (n, k) in the units of the control.
        rewards: (n,).
        success: (n,) bool, after each step.
        states: (n + 1, m) of the simulation, as `Physics.set_state` takes them.
        randomization: values of the episode by name.
        error: why the simulation diverged; "" if it did not.
    """

    seed: int
    observations: Mapping[str, NDArray[Any]]
    actions: Array
    rewards: Array
    success: NDArray[np.bool_]
    states: Array
    randomization: Mapping[str, float]
    error: str = ""

    def to_bytes(self) -> bytes:
        """As an .npz file."""
        names = ("actions", "rewards", "success", "states")
        arrays: dict[str, Any] = {name: getattr(self, name) for name in names}
        arrays.update({_OBSERVED + name: values for name, values in self.observations.items()})
        arrays.update(seed=self.seed, error=self.error)
        arrays["varied"] = np.array(list(self.randomization), dtype=str)
        arrays["values"] = np.array(list(self.randomization.values()), dtype=np.float64)
        file = io.BytesIO()
        np.savez(file, **arrays)
        return file.getvalue()

    @classmethod
    def from_file(cls, path: Path) -> Recorded:
        """Of what `to_bytes` gave.

        Raises:
            InvalidInputError: the file is damaged.
        """
        arrays: dict[str, Any] = dict(read_arrays(path, "is not an episode, or damaged"))
        observations = {
            name.removeprefix(_OBSERVED): each for name, each in arrays.items() if name.startswith(_OBSERVED)
        }
        try:
            varied = dict(zip(arrays["varied"].tolist(), arrays["values"].tolist(), strict=True))
            plain = {name: arrays[name] for name in ("actions", "rewards", "success", "states")}
            return cls(int(arrays["seed"]), observations, **plain, randomization=varied, error=str(arrays["error"]))
        except (KeyError, TypeError, ValueError) as error:
            raise InvalidInputError(f"{path}: is not an episode, or damaged: {error}") from error


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

    Each episode is on disk as soon as it ends, in a folder beside the path; a run that was killed goes on where it
    stopped when it is started again with the same arguments. In the end the data set is written, as a whole.

    Args:
        env: an environment of a task, of ours or your own. Wrappers around it are left out: actions are in its units.
        policy: gives an action for an observation; if it has a method ``reset``, that is called before each episode,
            with ``seed=`` of the episode if it takes one. Actions are kept as they are applied: within their bounds.
        path: where to, and nothing may be there yet; ``.hdf5``: a file in robomimic's layout; ``.minari``,
            ``.lerobot``: a folder.
        episodes: how many.
        seed: of the first episode; the others have the following numbers.
        executor: where episodes are run; None for this process. Environment and policy are pickled for others.
        progress: called after each episode.

    Raises:
        InvalidInputError: an argument is wrong, or a file cannot be written.
        MissingExtraError: the package that writes the format is not installed.
        EpisodeInitializationError: an episode has no initial state.
    """
    if not isinstance(env, gymnasium.Env) or not isinstance(env.unwrapped, TaskEnv):
        raise checks.refusal("env", "an environment that gymnasium.make made of a task of jacokin", env)
    if not callable(policy):
        raise checks.refusal("policy", "a function of an observation", policy)
    target = checks.path("path", path)
    writer = _writer(target)
    count, first = checks.whole_number("episodes", episodes, 1), checks.whole_number("seed", seed)
    checked_executor(executor)
    if progress is not None:
        checks.function("progress", progress)
    others = [name for name in env.unwrapped.options.sizes if "/" in name]
    if others and target.suffix == ".lerobot":
        raise InvalidInputError(
            f"a .lerobot data set keeps videos of colours, not {', '.join(others)}: use .hdf5 or .minari"
        )
    rate = 1.0 / env.unwrapped.dt
    if abs(rate - round(rate)) > 1e-6 and target.suffix == ".lerobot":
        raise InvalidInputError(
            f"a .lerobot data set has a whole number of steps a second, not {rate:.4g}: use .hdf5 or .minari"
        )
    description = describe(env.unwrapped)
    recipe = {"environment": description, "policy": _name(policy), "seed": first, "mujoco": mujoco.__version__}
    folder = ChunkFolder(target.with_name(f"{target.name}.episodes"), recipe, count, ".npz")
    files = folder.finished()
    advance = reporter(progress, count, len(files))
    jobs = [(index, first + index) for index in range(count) if index not in files]
    for index, kept in _run(env.unwrapped, policy, folder, jobs, executor):
        files[index] = folder.put(index, kept)
        advance(1)
    every = [files[index] for index in range(count)]
    summary = _summary(target, map(Recorded.from_file, every))
    writer.write(target, description, env.unwrapped, lambda: map(Recorded.from_file, every))
    folder.remove()
    return summary


def _writer(path: Path) -> Any:  # a module
    if path.suffix not in FORMATS:
        raise InvalidInputError(f"path must end in {', '.join(FORMATS)}, got {path}")
    if not path.absolute().parent.is_dir():
        raise InvalidInputError(f"path: there is no folder {path.absolute().parent}")
    if path.exists():
        raise InvalidInputError(f"path: {path} is there already; data sets are never changed")
    return importlib.import_module(f"jacokin.tasks.datasets.{FORMATS[path.suffix]}")


def _name(policy: Policy) -> str:
    """What tells a policy from another in a recipe."""
    return str(getattr(policy, "name", None) or getattr(policy, "__qualname__", None) or type(policy).__qualname__)


def describe(env: TaskEnv) -> dict[str, Any]:
    """The id of an environment and its options, as JSON has them.

    Raises:
        InvalidInputError: a randomization with samplers that JSON cannot keep.
    """
    options = env.options
    kwargs: dict[str, Any] = {name: getattr(options, name) for name in options.__slots__ if name != "task"}
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
    return keeper.keep(index, run_episode(*_unpickled(content), seed).to_bytes())


@functools.lru_cache(maxsize=1)
def _unpickled(content: bytes) -> tuple[TaskEnv, Policy]:
    found: tuple[TaskEnv, Policy] = pickle.loads(content)
    return found


def run_episode(env: TaskEnv, policy: Policy, seed: int, watch: Callable[[], None] = lambda: None) -> Recorded:
    """Run an episode.

    Args:
        env: the environment.
        policy: gives the actions.
        seed: of the episode.
        watch: called after the reset and after each step.
    """
    observation, info = env.reset(seed=seed)
    _reset(policy, seed)
    seen, states, actions, rewards, success = [_by_name(observation)], [env.task.physics.get_state()], [], [], []
    varied = dict(info.get("randomization", {}))
    watch()
    is_over = False
    while not is_over:
        action = clip_action(np.asarray(policy(observation), dtype=np.float64), *env._control.bounds)
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


def _reset(policy: Policy, seed: int) -> None:
    reset = getattr(policy, "reset", None)
    if reset is None:
        return
    if "seed" in inspect.signature(reset).parameters:
        reset(seed=seed)
    else:
        reset()


def _by_name(observation: Observation) -> dict[str, NDArray[Any]]:
    return dict(observation) if isinstance(observation, dict) else {SINGLE: observation}


def _summary(path: Path, episodes: Iterable[Recorded]) -> RecordSummary:
    lengths, returns, solved = [], [], 0
    for each in episodes:
        lengths.append(len(each.actions))
        returns.append(float(each.rewards.sum()))
        solved += bool(each.success[-1])
    return RecordSummary(path, len(returns), solved, sum(lengths), float(np.mean(returns)))
