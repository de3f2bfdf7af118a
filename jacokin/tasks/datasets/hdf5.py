"""Data sets in HDF5: a file in the layout of robomimic, or a folder that Minari reads. Numbers are kept bit by bit.

In robomimic's layout an episode is a group ``data/demo_0`` with ``obs`` and ``next_obs`` by name, ``actions``,
``rewards``, ``dones``, ``success``, ``states``. Minari's is ``episode_0`` with ``observations``, one more than actions.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium import spaces

from jacokin import files
from jacokin.errors import InvalidInputError, MissingExtraError
from jacokin.tasks.datasets.recording import FUNCTION, SINGLE, Recorded
from jacokin.tasks.gym.environment import TaskEnv

try:
    import h5py
except ImportError as error:
    raise MissingExtraError("h5py", "data") from error

ROBOMIMIC_GYM = 2  # robomimic's number for environments of Gym
MINARI_FORMAT = "0.5.4"  # of Minari, whose layout this is
MAIN, METADATA = "main_data.hdf5", "metadata.json"  # names of Minari's files
_VARIED = "randomization/"  # begins the attributes of an episode that hold its randomization
_COMPRESSED: Mapping[str, Any] = {"compression": "gzip", "compression_opts": 4, "shuffle": True}

Episodes = Callable[[], Iterable[Recorded]]


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
    if path.suffix == ".minari":
        with files.replacing_folder(path) as unfinished:
            _write_minari(unfinished, description, env, episodes())
        return
    with files.replacing(path) as unfinished, h5py.File(unfinished, "w") as file:
        _write_robomimic(file, description, env, episodes())


def read(path: Path) -> tuple[dict[str, Any], Iterator[Recorded]]:
    """The description of the environment, and the episodes in their order.

    Raises:
        InvalidInputError: no such data set.
    """
    main = path / MAIN if path.is_dir() else path
    try:
        with h5py.File(main) as file:
            top = file if path.is_dir() else file["data"]
            description = json.loads(top.attrs["jacokin"])
    except (OSError, KeyError, ValueError) as error:
        raise InvalidInputError(f"{path}: is not a data set that jacokin wrote: {error}") from error
    return description, _minari_episodes(main) if path.is_dir() else _robomimic_episodes(main)


def _write_robomimic(file: Any, description: Mapping[str, Any], env: TaskEnv, episodes: Iterable[Recorded]) -> None:
    data, solved = file.create_group("data", track_order=True), []
    arguments = {"env_name": description["id"], "type": ROBOMIMIC_GYM, "env_kwargs": description["kwargs"]}
    data.attrs["env_args"] = json.dumps(arguments)
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
        dones = np.zeros(n, dtype=np.int64)
        dones[-1] = 1
        columns = {"actions": each.actions, "rewards": each.rewards, "success": each.success, "dones": dones}
        for name, values in {**columns, "states": each.states[:-1], "next_states": each.states[1:]}.items():
            demo.create_dataset(name, data=values, **_COMPRESSED)
        total += n
        if each.success[-1]:
            solved.append(f"demo_{number - 1}")
    data.attrs["total"] = total
    file.create_dataset("mask/solved", data=np.array(solved, dtype="S"))


def _robomimic_episodes(path: Path) -> Iterator[Recorded]:
    with h5py.File(path) as file:
        data = file["data"]
        for number in range(len(data)):
            demo = data[f"demo_{number}"]
            observations = {
                values.attrs["name"]: np.concatenate((values[:], demo["next_obs"][key][-1:]))
                for key, values in demo["obs"].items()
            }
            states = np.concatenate((demo["states"][:], demo["next_states"][-1:]))
            actions, rewards, success = (demo[name][:] for name in ("actions", "rewards", "success"))
            seed, error = int(demo.attrs["seed"]), str(demo.attrs["error"])
            yield Recorded(seed, observations, actions, rewards, success, states, _varied(demo), error)


def _varied(group: Any) -> dict[str, float]:
    return {name.removeprefix(_VARIED): float(value) for name, value in group.attrs.items() if name.startswith(_VARIED)}


def _write_minari(folder: Path, description: Mapping[str, Any], env: TaskEnv, episodes: Iterable[Recorded]) -> None:
    steps = number = 0
    with h5py.File(folder / MAIN, "w", track_order=True) as file:
        file.attrs["jacokin"] = json.dumps(description)
        names: dict[str, str] = {}
        for number, each in enumerate(episodes, 1):
            group = file.create_group(f"episode_{number - 1}")
            n = len(each.actions)
            group.attrs.update(id=number - 1, seed=each.seed, total_steps=n, error=each.error)
            group.attrs.update({_VARIED + name: value for name, value in each.randomization.items()})
            for name, values in each.observations.items():
                key = name.replace("/", "_")
                names[key] = name
                place = "observations" if name == SINGLE else f"observations/{key}"
                group.create_dataset(place, data=values, **_COMPRESSED)
            truncations = np.zeros(n, dtype=bool)
            truncations[-1] = True
            columns = {
                "actions": each.actions,
                "rewards": each.rewards,
                "terminations": np.zeros(n, dtype=bool),
                "truncations": truncations,
                "infos/is_success": np.concatenate(([False], each.success)),
                "infos/state": each.states,
            }
            for name, values in columns.items():
                group.create_dataset(name, data=values, **_COMPRESSED)
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
        "minari_version": MINARI_FORMAT,
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


def _minari_episodes(path: Path) -> Iterator[Recorded]:
    with h5py.File(path) as file:
        names = json.loads(file.attrs["names"])
        for number in range(len(file)):
            group = file[f"episode_{number}"]
            observed = group["observations"]
            if isinstance(observed, h5py.Dataset):
                observations = {SINGLE: observed[:]}
            else:
                observations = {names[key]: values[:] for key, values in observed.items()}
            yield Recorded(
                int(group.attrs["seed"]),
                observations,
                group["actions"][:],
                group["rewards"][:],
                group["infos/is_success"][1:],
                group["infos/state"][:],
                _varied(group),
                str(group.attrs["error"]),
            )
