"""Data sets in HDF5: a file in the layout of robomimic, or a folder that Minari reads. Numbers are kept bit by bit.

In robomimic's layout an episode is a group ``data/demo_0`` with ``obs`` and ``next_obs`` by name, ``actions``,
``rewards``, ``dones``, ``success``, ``states``. Minari's is ``episode_0`` with ``observations``, one more than actions.
"""

from __future__ import annotations

import contextlib
import copy
import io
import json
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import FrameType
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from jacokin.documents import parsed_json
from jacokin.errors import InvalidInputError, needed
from jacokin.files import ARRAYS, DEFLATION, parsing
from jacokin.tasks.datasets.recorded import DESCRIPTION_FORM, NOT_OURS, SINGLE, Recorded, count, placing, read_json
from jacokin.tasks.datasets.recording import FUNCTION
from jacokin.tasks.gym.environment import TaskEnv

with needed("h5py", "data"):
    import h5py

MAIN, METADATA = "main_data.hdf5", "metadata.json"  # names of Minari's files
_VARIED = "randomization/"  # begins the attributes of an episode that hold its randomization
_COMPRESSED: Mapping[str, Any] = {"compression": "gzip", "compression_opts": 4, "shuffle": True}

Episodes = Callable[[], Iterable[Recorded]]


class _Sink(io.RawIOBase):
    """A file for HDF5, which crashes where a write fails: it is told that all went well, and the error is kept.

    Attributes:
        error: the first error; what was to be written after it is dropped.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("w+b", buffering=0)
        self.error: OSError | None = None

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()

    def readinto(self, buffer: Any) -> int:
        return self._file.readinto(buffer)

    def write(self, data: Any) -> int:
        left = memoryview(data).cast("B")
        size = len(left)
        try:
            while left and self.error is None:
                left = left[self._file.write(left) :]
        except OSError as error:
            self.error = error
        return size

    def truncate(self, size: int | None = None) -> int:
        try:
            return self._file.truncate(size) if self.error is None else size or 0
        except OSError as error:
            self.error = error
            return size or 0

    def close(self) -> None:
        try:
            if not self.closed and self.error is None:
                os.fsync(self._file.fileno())  # a disk may find out late that it is full
            self._file.close()
        except OSError as error:
            self.error = self.error or error
        super().close()

    def raise_for_error(self) -> None:
        if self.error is not None:
            raise self.error


@contextlib.contextmanager
def _without_signals() -> Iterator[Callable[[], None]]:
    """Hold signals such as Ctrl-C back, whose exceptions would make HDF5 crash in a call of `_Sink`.

    What is given lets those come that have come meanwhile, and so does the end of the block.
    """
    held = list[tuple[int, FrameType | None]]()
    before = dict[int, Any]()

    def let_come() -> None:
        while held:
            number, frame = held.pop(0)
            before[number](number, frame)

    if threading.current_thread() is threading.main_thread():  # where Python handles them
        before = {number: handler for number in signal.valid_signals() if callable(handler := signal.getsignal(number))}
    for number in before:
        signal.signal(number, lambda *given: held.append(given))
    try:
        yield let_come
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        let_come()


@contextlib.contextmanager
def _new_file(path: Path) -> Iterator[tuple[Any, Callable[[], None]]]:
    """A new HDF5 file, and what raises OSError if it could not be written so far, as the end of the block does.

    Signals are only handled there.
    """
    sink = _Sink(path)

    def check() -> None:
        sink.raise_for_error()
        let_signals_come()

    with (
        contextlib.closing(sink),
        _without_signals() as let_signals_come,
        h5py.File(sink, "w", track_order=True) as file,
    ):
        yield file, check
    sink.raise_for_error()


def write(path: Path, description: Mapping[str, Any], env: TaskEnv, episodes: Episodes) -> None:
    """Write a data set: a file, or the folder of Minari.

    Args:
        path: of the file or the folder.
        description: of the environment.
        env: the environment.
        episodes: gives all episodes.

    Raises:
        InvalidInputError: it cannot be written.
    """
    with placing(path) as unfinished:
        if path.suffix == ".minari":
            unfinished.mkdir()
            _write_minari(unfinished, description, env, episodes())
        else:
            _write_robomimic(unfinished, description, env, episodes())


def read(path: Path) -> tuple[dict[str, Any], Iterator[Recorded]]:
    """The description of the environment, and the episodes in their order.

    Nothing outside the data set is read: links are refused. What is kept twice must be the same.

    Raises:
        InvalidInputError: no such data set, or it is damaged; also while the episodes are read.
    """
    main = path / MAIN if path.is_dir() else path
    if main.is_symlink() or not main.is_file():
        raise InvalidInputError(f"{path}: is not a data set that jacokin wrote: there is no file {main}")
    with parsing(path, NOT_OURS), h5py.File(main) as file:
        _check_inside(file)
        top = file if path.is_dir() else file["data"]
        description = parsed_json(top.attrs["jacokin"], DESCRIPTION_FORM)
        names = sorted(top, key=lambda name: (len(name), name))
        if names != [f"{'episode' if path.is_dir() else 'demo'}_{number}" for number in range(len(names))] or not names:
            raise ValueError(f"its episodes are {names[:10]}")
        if path.is_dir():
            metadata = read_json(path / METADATA, {"total_episodes": int})
            count("total_episodes", metadata["total_episodes"], len(names))
        elif parsed_json(top.attrs["env_args"]) != _arguments(description):
            raise ValueError("env_args and jacokin are not the same environment")
    return description, _episodes(path, main, names)


def _episodes(path: Path, main: Path, names: list[str]) -> Iterator[Recorded]:
    """The episodes one by one, checked."""
    with parsing(path, NOT_OURS), h5py.File(main) as file:
        for number, name in enumerate(names):
            found = _minari_episode(file, file[name]) if path.is_dir() else _robomimic_episode(file["data"][name])
            yield found.checked(f"{path}: episode {number + 1}")


def _check_inside(group: Any, depth: int = 0) -> None:
    """Check that all is in the file itself, and no larger than the file can hold.

    Raises:
        ValueError: it is not.
    """
    for name in group:
        place = f"{group.name.rstrip('/')}/{name}"
        link = group.get(name, getlink=True)
        if not isinstance(link, h5py.HardLink):
            raise ValueError(f"{place} is a link, and links are not followed")
        each = group[name]
        if isinstance(each, h5py.Group) and depth < 4:
            _check_inside(each, depth + 1)
        elif not isinstance(each, h5py.Dataset):
            raise ValueError(f"{place} is not a group or an array")
        elif each.external or each.is_virtual:
            raise ValueError(f"{place} is kept outside the file, which is not read")
        elif each.shape is None or each.nbytes > min(ARRAYS, DEFLATION * each.id.get_storage_size() + 1000):
            raise ValueError(f"{place} claims {each.nbytes} bytes")


def _arguments(description: Mapping[str, Any]) -> dict[str, Any]:
    """What robomimic makes the environment of."""
    # To robomimic, 2 is an environment of Gym.
    return {"env_name": description["id"], "type": 2, "env_kwargs": description["kwargs"]}


def _write_robomimic(path: Path, description: Mapping[str, Any], env: TaskEnv, episodes: Iterable[Recorded]) -> None:
    with _new_file(path) as (file, check):
        _fill_robomimic(file, check, description, env, episodes)


def _fill_robomimic(
    file: Any, check: Callable[[], None], description: Mapping[str, Any], env: TaskEnv, episodes: Iterable[Recorded]
) -> None:
    data, solved = file.create_group("data", track_order=True), []
    data.attrs["env_args"] = json.dumps(_arguments(description))
    data.attrs["jacokin"] = json.dumps(description)
    data.attrs["mujoco"] = mujoco.__version__
    lower, upper = env._control.bounds
    data.attrs["action_low"], data.attrs["action_high"] = lower, upper
    total = number = 0
    for number, each in enumerate(episodes, 1):
        demo = data.create_group(f"demo_{number - 1}")
        n = len(each.actions)
        demo.attrs.update(num_samples=n, seed=each.seed, error=each.error, solved=bool(each.success[-1]))
        demo.attrs.update({_VARIED + name: value for name, value in each.randomization.items()})
        for name, values in each.observations.items():
            key = name.replace("/", "_")
            demo.create_dataset(f"obs/{key}", data=values[:-1], **_COMPRESSED).attrs["name"] = name
            demo.create_dataset(f"next_obs/{key}", data=values[1:], **_COMPRESSED)
        columns = {"actions": each.actions, "rewards": each.rewards, "success": each.success, "dones": _dones(n)}
        for name, values in {**columns, "states": each.states[:-1], "next_states": each.states[1:]}.items():
            demo.create_dataset(name, data=values, **_COMPRESSED)
        check()
        total += n
        if each.success[-1]:
            solved.append(f"demo_{number - 1}")
    data.attrs["total"] = total
    file.create_dataset("mask/solved", data=np.array(solved, dtype="S"))


def _dones(steps: int) -> NDArray[np.int64]:
    dones = np.zeros(steps, dtype=np.int64)
    dones[-1:] = 1
    return dones


def _robomimic_episode(demo: Any) -> Recorded:
    observations = {}
    if sorted(demo["obs"]) != sorted(demo["next_obs"]):
        raise ValueError(f"{demo.name}/obs and next_obs have not the same names")
    for key, values in demo["obs"].items():
        observations[str(values.attrs["name"])] = _joined(values, demo["next_obs"][key])
    actions, rewards, success = (demo[name][()] for name in ("actions", "rewards", "success"))
    states = _joined(demo["states"], demo["next_states"])
    count(f"{demo.name} num_samples", demo.attrs["num_samples"], len(actions))
    if not np.array_equal(demo["dones"][()], _dones(len(actions))):
        raise ValueError(f"{demo.name}/dones is not 1 at the end alone")
    seed, error = demo.attrs["seed"].item(), demo.attrs["error"]
    return Recorded(seed, observations, actions, rewards, success, states, _varied(demo), error)


def _joined(before: Any, after: Any) -> NDArray[Any]:
    """What was before each action and after the last, of what was before and after each.

    Raises:
        ValueError: what is in both differs.
    """
    first, second = before[()], after[()]
    if first.dtype != second.dtype or first[1:].tobytes() != second[:-1].tobytes() or first.shape != second.shape:
        raise ValueError(f"{after.name} does not follow {before.name} by one step")
    return np.concatenate((first, second[-1:]))


def _varied(group: Any) -> dict[str, float]:
    return {name.removeprefix(_VARIED): float(value) for name, value in group.attrs.items() if name.startswith(_VARIED)}


def _write_minari(folder: Path, description: Mapping[str, Any], env: TaskEnv, episodes: Iterable[Recorded]) -> None:
    steps = number = 0
    with _new_file(folder / MAIN) as (file, check):
        file.attrs["jacokin"] = json.dumps(description)
        names: dict[str, str] = {}
        is_one = not isinstance(env.observation_space, spaces.Dict)  # of several, one may be called as one alone is
        for number, each in enumerate(episodes, 1):
            group = file.create_group(f"episode_{number - 1}")
            n = len(each.actions)
            group.attrs.update(id=number - 1, seed=each.seed, total_steps=n, error=each.error)
            group.attrs.update({_VARIED + name: value for name, value in each.randomization.items()})
            for name, values in each.observations.items():
                key = name.replace("/", "_")
                names[key] = name
                place = "observations" if is_one else f"observations/{key}"
                group.create_dataset(place, data=values, **_COMPRESSED)
            columns = {
                "actions": each.actions,
                "rewards": each.rewards,
                "terminations": np.zeros(n, dtype=bool),
                "truncations": _dones(n).astype(bool),
                "infos/is_success": np.concatenate(([False], each.success)),
                "infos/state": each.states,
            }
            for name, values in columns.items():
                group.create_dataset(name, data=values, **_COMPRESSED)
            check()
            steps += n
        file.attrs["names"] = json.dumps(names)
    metadata = {
        "total_episodes": number,
        "total_steps": steps,
        "data_format": "hdf5",
        "jpeg_encoding": False,
        "observation_space": json.dumps(_serialized(_minari_space(env.observation_space))),
        "action_space": json.dumps(_serialized(env.action_space)),
        "dataset_id": f"{description['id'].rpartition('-v')[0]}-v0",
        "minari_version": "0.5.4",  # whose layout this is
        "dataset_size": round((folder / MAIN).stat().st_size / 1e6, 1),
    }
    if description["kwargs"]["reward"] != FUNCTION:
        spec = copy.deepcopy(gymnasium.spec(description["id"]))
        spec.kwargs.update(description["kwargs"])
        metadata["env_spec"] = spec.to_json()
    (folder / METADATA).write_text(json.dumps(metadata), encoding="utf-8")


def _minari_space(space: spaces.Space[Any]) -> spaces.Space[Any]:
    """The space with names without slashes, which HDF5 takes for groups."""
    if not isinstance(space, spaces.Dict):
        return space
    return spaces.Dict({name.replace("/", "_"): each for name, each in space.spaces.items()})


def _serialized(space: spaces.Space[Any]) -> dict[str, Any]:
    """A space as Minari writes it."""
    if isinstance(space, spaces.Dict):
        return {"type": "Dict", "subspaces": {name: _serialized(each) for name, each in space.spaces.items()}}
    assert isinstance(space, spaces.Box)
    bounds = {"low": space.low.tolist(), "high": space.high.tolist()}
    return {"type": "Box", "dtype": str(space.dtype), "shape": list(space.shape), **bounds}


def _minari_episode(file: Any, group: Any) -> Recorded:
    names = parsed_json(file.attrs["names"], {str: str})
    observed = group["observations"]
    if isinstance(observed, h5py.Dataset):
        observations = {SINGLE: observed[()]}
    else:
        observations = {names[key]: values[()] for key, values in observed.items()}
    actions, success = group["actions"][()], group["infos/is_success"][()]
    count(f"{group.name} total_steps", group.attrs["total_steps"], len(actions))
    ends = group["terminations"][()], group["truncations"][()]
    if ends[0].any() or not np.array_equal(ends[1], _dones(len(actions))) or success[0]:
        raise ValueError(f"{group.name} does not begin unsolved and end at its last step")
    seed, error = group.attrs["seed"].item(), group.attrs["error"]
    states = group["infos/state"][()]
    return Recorded(seed, observations, actions, group["rewards"][()], success[1:], states, _varied(group), error)
