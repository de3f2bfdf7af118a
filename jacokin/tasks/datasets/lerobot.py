"""Data sets of LeRobot, version 3.0: Parquet, videos, and what describes them.

What the robot feels is ``observation.state``, other features are ``observation.environment_state``, pictures are
videos; actions, rewards and success stand beside them. LeRobot computes in single precision, so these are float32. The
exact actions and states, by which episodes are replayed, are kept in ``meta/jacokin``.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, needed, shown
from jacokin.files import parsing
from jacokin.tasks.datasets.recorded import DESCRIPTION_FORM, NOT_OURS, SINGLE, Recorded, placing, read_json
from jacokin.tasks.datasets.video import VideoRecorder, find_ffmpeg
from jacokin.tasks.gym.environment import TaskEnv
from jacokin.tasks.gym.packing import PROPRIOCEPTION

with needed("pyarrow", "data"):
    import pyarrow as pa
    from pyarrow import parquet

STATE, ENVIRONMENT, PICTURES = "observation.state", "observation.environment_state", "observation.images"
ACTION = "action"
REWARD, SUCCESS, DONE = "next.reward", "next.success", "next.done"
FILE_MEGABYTES, CHUNK_FILES = 100, 1000  # LeRobot's own limits
_EXACT = "meta/jacokin"
_FIRST = "chunk-000/file-000"
_FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
_COMPARED = (ACTION, REWARD, SUCCESS, DONE, "frame_index", "episode_index", "index")  # by `read`

Episodes = Callable[[], Iterable[Recorded]]
Series = dict[str, NDArray[Any]]


def write(path: Path, description: Mapping[str, Any], env: TaskEnv, episodes: Episodes) -> None:
    """Write a data set.

    Args:
        path: of its folder, which is not there yet.
        description: of the environment.
        env: the environment.
        episodes: gives all episodes.

    Raises:
        InvalidInputError: it cannot be written.
        MissingExtraError: pictures, and no ffmpeg.
    """
    with placing(path) as folder:
        folder.mkdir()
        _DataSetWriter(folder, description, env).write(episodes())


def read(path: Path) -> tuple[dict[str, Any], Iterator[Recorded]]:
    """The description of the environment, and the episodes, without their observations.

    Nothing outside the data set is read: links in it are refused. Actions, rewards and success in the Parquet files
    must be those of the exact episodes.

    Raises:
        InvalidInputError: no such data set, or it is damaged; also while the episodes are read.
    """
    with parsing(path, NOT_OURS):
        _check_inside(path)
        description = read_json(path / _EXACT / "environment.json", DESCRIPTION_FORM)
        info = read_json(path / "meta" / "info.json", {"total_episodes": int, "total_frames": int})
        episodes = sorted((path / _EXACT).glob("*.npz"))
        total = info["total_episodes"]
        if len(episodes) != total or not episodes:
            raise InvalidInputError(
                f"{path}: is damaged: {len(episodes)} of its {shown(total)} episodes are in {_EXACT}"
            )
        if [each.name for each in episodes] != [_exact_name(number) for number in range(len(episodes))]:
            raise ValueError(f"the names in {_EXACT} are not {_exact_name(0)} and so on")
    return description, _episodes(path, episodes, info["total_frames"])


def _episodes(path: Path, exact: list[Path], frames: int) -> Iterator[Recorded]:
    """The episodes one by one, compared with the tables."""
    rows, before = _rows(path), 0
    for number, file in enumerate(exact):
        each = Recorded.from_file(file)
        with parsing(path, NOT_OURS):
            count = len(each.actions)
            found = next(rows, None)
            wanted = _table({**_numbers(each), **_indices(number, before, count, 1)}).select(_COMPARED)
            if found is None or not found.equals(wanted):
                raise ValueError(f"the Parquet files do not hold what {file.name} does")
        before += count
        yield each
    with parsing(path, NOT_OURS):
        if next(rows, None) is not None or before != frames:
            raise ValueError(f"it does not have the {shown(frames)} steps that it tells of, in the Parquet files too")


def _rows(path: Path) -> Iterator[Any]:
    """The tables of the episodes, one by one."""
    for file in sorted((path / "data").glob("chunk-*/file-*.parquet")):
        table = parquet.read_table(file, columns=list(_COMPARED))
        numbers = table["episode_index"].to_numpy()
        ends = np.flatnonzero(np.diff(numbers)) + 1
        for start, stop in itertools.pairwise((0, *ends.tolist(), len(numbers))):
            yield table.slice(start, stop - start).combine_chunks().replace_schema_metadata(None)


def _check_inside(path: Path) -> None:
    """Check that all is in the folder itself.

    Raises:
        ValueError: it is not.
    """
    for each in path.rglob("*"):
        if each.is_symlink() or not (each.is_file() or each.is_dir()):
            raise ValueError(f"{each} is a link or a device, which is not followed")


def _exact_name(number: int) -> str:
    """Of the file with what an episode is replayed by."""
    return f"{number:06d}.npz"


def _numbers(each: Recorded) -> Series:
    """The columns of what was done, and came of it."""
    done = np.zeros(len(each.actions), dtype=bool)
    done[-1] = True
    columns = {ACTION: each.actions.astype(np.float32), REWARD: each.rewards.astype(np.float32)}
    return {**columns, SUCCESS: each.success, DONE: done}


class _DataSetWriter:
    """Writes one data set, one file of each kind; ``FILE_MEGABYTES`` begins another of the numbers."""

    def __init__(self, folder: Path, description: Mapping[str, Any], env: TaskEnv) -> None:
        self._folder, self._description, self._env = folder, description, env
        self._rate = round(1.0 / env.dt)  # a whole number, as `record` has checked
        for name in ("meta/episodes/chunk-000", "data/chunk-000", _EXACT):
            (folder / name).mkdir(parents=True)

    def write(self, episodes: Iterable[Recorded]) -> None:
        exact, rows, frames, size, file = self._folder / _EXACT, [], 0, 0, 0
        tables: list[Any] = []
        statistics, videos = _Statistics(), dict[str, VideoRecorder]()
        with ExitStack() as stack:
            for number, each in enumerate(episodes):
                columns, pictures = self._columns(each)
                count = len(each.actions)
                if number == 0:
                    videos = {name: self._video(name, stack) for name in pictures}
                    features = _features(columns, pictures, self._names(each), self._rate)
                columns.update(_indices(number, frames, count, self._rate))
                tables.append(_table(columns))
                size += tables[-1].nbytes
                row = {
                    "episode_index": number,
                    "tasks": [self._task()],
                    "length": count,
                    "dataset_from_index": frames,
                    "dataset_to_index": frames + count,
                    "data/chunk_index": file // CHUNK_FILES,
                    "data/file_index": file % CHUNK_FILES,
                    "meta/episodes/chunk_index": 0,
                    "meta/episodes/file_index": 0,
                }
                for name, taken in pictures.items():
                    for picture in taken:
                        videos[name].add(picture)
                    row.update(
                        {
                            f"videos/{name}/chunk_index": 0,
                            f"videos/{name}/file_index": 0,
                            f"videos/{name}/from_timestamp": frames / self._rate,
                            f"videos/{name}/to_timestamp": (frames + count) / self._rate,
                        }
                    )
                shown = {name: taken / 255.0 for name, taken in pictures.items()}
                for name, values in {**columns, **shown}.items():
                    for kind, value in statistics.add(name, values).items():
                        row[f"stats/{name}/{kind}"] = value.tolist()
                rows.append(row)
                plain = Recorded(
                    each.seed, {}, each.actions, each.rewards, each.success, each.states, each.randomization, each.error
                )
                (exact / _exact_name(number)).write_bytes(plain.to_bytes())
                frames += count
                if size > FILE_MEGABYTES * 1e6:
                    self._write_data(tables, file)
                    tables, size, file = [], 0, file + 1
            for video in videos.values():
                video.finish()
        if tables:
            self._write_data(tables, file)
        parquet.write_table(pa.Table.from_pylist(rows), self._folder / f"meta/episodes/{_FIRST}.parquet")
        self._write_meta(features, statistics, len(rows), frames, bool(videos))

    def _columns(self, each: Recorded) -> tuple[Series, Series]:
        """The columns of numbers of an episode, and the pictures (n, height, width, 3)."""
        own = {feature.name for feature in self._env.task.features if feature.is_proprioceptive}
        own |= {SINGLE, PROPRIOCEPTION}
        pictures, states, others = Series(), list[NDArray[Any]](), list[NDArray[Any]]()
        for name, values in each.observations.items():
            before = values[:-1]
            if values.dtype == np.uint8:
                pictures[f"{PICTURES}.{name.replace('/', '_')}"] = before
            else:
                (states if name in own else others).append(before.reshape(len(before), -1))
        columns = {STATE: np.concatenate(states, axis=1)} if states else {}
        if others:
            columns[ENVIRONMENT] = np.concatenate(others, axis=1)
        columns = {name: values.astype(np.float32) for name, values in columns.items()}
        return {**columns, **_numbers(each)}, pictures

    def _names(self, each: Recorded) -> dict[str, list[str]]:
        """The name of each number of the columns that have several."""
        model, own = self._env.model, {feature.name for feature in self._env.task.features if feature.is_proprioceptive}
        own |= {SINGLE, PROPRIOCEPTION}
        found: dict[str, list[str]] = {STATE: [], ENVIRONMENT: []}
        for name, values in each.observations.items():
            if values.dtype != np.uint8:
                found[STATE if name in own else ENVIRONMENT] += self._env._packing.names_of(name)
        size = each.actions.shape[1]
        found[ACTION] = [f"{self._env.options.control}.{index}" for index in range(size)]
        if self._env.options.control == "joint_velocity":
            found[ACTION] = [str(model.actuator(index).name) for index in range(size)]
        return found

    def _task(self) -> str:
        """What is to be done, in words."""
        return (type(self._env.task).__doc__ or self._description["id"]).splitlines()[0]

    def _video(self, name: str, stack: ExitStack) -> VideoRecorder:
        path = self._folder / f"videos/{name}/{_FIRST}.mp4"
        path.parent.mkdir(parents=True)
        # Keys as LeRobot encodes them: any picture is found quickly.
        recorder = VideoRecorder(path, find_ffmpeg(), keys_every=2, rate=self._rate, preset="medium")
        stack.callback(recorder.close)
        return recorder

    def _write_data(self, tables: list[Any], file: int) -> None:
        place = _FILE.format(chunk_index=file // CHUNK_FILES, file_index=file % CHUNK_FILES)
        path = self._folder / f"data/{place}.parquet"
        path.parent.mkdir(exist_ok=True)
        parquet.write_table(pa.concat_tables(tables), path)

    def _write_meta(
        self, features: dict[str, Any], statistics: _Statistics, episodes: int, frames: int, has_videos: bool
    ) -> None:
        meta = self._folder / "meta"
        pandas = {  # says which column is the index, by which LeRobot looks up tasks
            "index_columns": ["__index_level_0__"],
            "column_indexes": [
                {
                    "name": None,
                    "field_name": None,
                    "pandas_type": "unicode",
                    "numpy_type": "object",
                    "metadata": {"encoding": "UTF-8"},
                }
            ],
            "columns": [
                {
                    "name": "task_index",
                    "field_name": "task_index",
                    "pandas_type": "int64",
                    "numpy_type": "int64",
                    "metadata": None,
                },
                {
                    "name": None,
                    "field_name": "__index_level_0__",
                    "pandas_type": "unicode",
                    "numpy_type": "object",
                    "metadata": None,
                },
            ],
        }
        tasks = pa.table({"task_index": pa.array([0], pa.int64()), "__index_level_0__": [self._task()]})
        parquet.write_table(tasks.replace_schema_metadata({"pandas": json.dumps(pandas)}), meta / "tasks.parquet")
        info = {
            "codebase_version": "v3.0",
            "robot_type": self._env.task.arm.robot_name,
            "total_episodes": episodes,
            "total_frames": frames,
            "total_tasks": 1,
            "chunks_size": CHUNK_FILES,
            "data_files_size_in_mb": FILE_MEGABYTES,
            "video_files_size_in_mb": 200,  # LeRobot's own limit
            "fps": self._rate,
            "splits": {"train": f"0:{episodes}"},
            "data_path": f"data/{_FILE}.parquet",
            "video_path": f"videos/{{video_key}}/{_FILE}.mp4" if has_videos else None,
            "features": features,
        }
        (meta / "info.json").write_text(json.dumps(info, indent=4), encoding="utf-8")
        (meta / "stats.json").write_text(json.dumps(statistics.of_all(), indent=4), encoding="utf-8")
        (self._folder / _EXACT / "environment.json").write_text(json.dumps(self._description), encoding="utf-8")


class _Statistics:
    """Least, greatest, mean, deviation and quantiles of each number; of pictures those of each colour, 0..1."""

    def __init__(self) -> None:
        self._episodes: dict[str, list[dict[str, Array]]] = {}

    def add(self, name: str, values: NDArray[Any]) -> dict[str, Array]:
        """Those of the column of an episode, (n, ...), which are remembered."""
        is_picture = values.ndim == 4
        numbers = values.reshape(len(values), -1) if not is_picture else values.reshape(-1, 3)
        numbers = numbers.astype(np.float64)
        shape = (3, 1, 1) if is_picture else (-1,)
        found = {"min": numbers.min(0), "max": numbers.max(0), "mean": numbers.mean(0), "std": numbers.std(0)}
        found.update({f"q{round(100 * q):02d}": np.quantile(numbers, q, axis=0) for q in (0.01, 0.1, 0.5, 0.9, 0.99)})
        found = {kind: value.reshape(shape) for kind, value in found.items()}
        found["count"] = np.array([len(values)])
        self._episodes.setdefault(name, []).append(found)
        return found

    def of_all(self) -> dict[str, dict[str, Any]]:
        """Those of all episodes; quantiles are means of those of the episodes, as LeRobot combines them."""
        found = {}
        for name, episodes in self._episodes.items():
            count = np.array([float(each["count"][0]) for each in episodes])
            stacked = {kind: np.stack([each[kind] for each in episodes]) for kind in episodes[0]}
            mean = np.average(stacked["mean"], axis=0, weights=count)
            spread = stacked["std"] ** 2 + (stacked["mean"] - mean) ** 2
            quantiles = [kind for kind in stacked if kind.startswith("q")]
            combined = {kind: np.average(stacked[kind], axis=0, weights=count) for kind in quantiles}
            combined.update(min=stacked["min"].min(0), max=stacked["max"].max(0), mean=mean)
            combined["std"] = np.sqrt(np.average(spread, axis=0, weights=count))
            found[name] = {kind: value.tolist() for kind, value in combined.items()}
            found[name]["count"] = [int(count.sum())]
        return found


def _features(columns: Series, pictures: Series, names: Mapping[str, list[str]], rate: int) -> dict[str, Any]:
    """What ``info.json`` says of the columns."""
    found: dict[str, Any] = {
        name: {"dtype": str(values.dtype), "shape": list(values.shape[1:]) or [1], "names": names.get(name)}
        for name, values in columns.items()
    }
    for name, values in pictures.items():
        height, width, colours = values.shape[1:]
        look = {
            "video.height": height,
            "video.width": width,
            "video.codec": "h264",
            "video.pix_fmt": "yuv420p",
            "video.is_depth_map": False,
            "video.fps": rate,
            "video.channels": colours,
            "has_audio": False,
        }
        found[name] = {
            "dtype": "video",
            "shape": [height, width, colours],
            "names": ["height", "width", "channels"],
            "info": look,
        }
    for name in ("timestamp", "frame_index", "episode_index", "index", "task_index"):
        found[name] = {"dtype": "float32" if name == "timestamp" else "int64", "shape": [1], "names": None}
    return found


def _indices(number: int, before: int, count: int, rate: int) -> Series:
    """The columns that say where a step is."""
    steps = np.arange(count)
    return {
        "timestamp": (steps / rate).astype(np.float32),
        "frame_index": steps,
        "episode_index": np.full(count, number),
        "index": before + steps,
        "task_index": np.zeros(count, dtype=np.int64),
    }


def _table(columns: Series) -> Any:
    arrays = {}
    for name, values in columns.items():
        flat = pa.array(np.ravel(values))
        arrays[name] = flat if values.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
    return pa.table(arrays)
