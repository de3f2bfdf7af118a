"""Data sets that somebody changed: refused in one sentence, or found to differ; nothing outside them is read."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jacokin.tasks
from jacokin.errors import InvalidInputError
from jacokin.tasks import Task, TaskEnv
from jacokin.tasks.task import CONTROL_TIMESTEP

h5py = pytest.importorskip("h5py", reason="the extra data is not installed")
pa = pytest.importorskip("pyarrow", reason="the extra data is not installed")
parquet = pytest.importorskip("pyarrow.parquet", reason="the extra data is not installed")

STEPS = 4
REFUSED, DIFFERENT, EQUAL = "refused", "different", "equal"


def wave(observation: Any) -> Any:
    """Actions within their bounds that depend on what is seen."""
    return 0.4 * np.sin(np.arange(9.0) + 9.0 * observation["jaco_arm/joints_pos"][0, 0])


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of one data set in each format."""
    folder = tmp_path_factory.mktemp("original")
    before, Task.time_limit = Task.time_limit, STEPS * CONTROL_TIMESTEP
    try:
        env = TaskEnv("reach_site", flatten=False)
        for ending in ("hdf5", "minari", "lerobot"):
            jacokin.tasks.record(env, wave, folder / f"demos.{ending}", episodes=2, seed=3)
    finally:
        Task.time_limit = before
    return folder


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Episodes of a few steps."""
    monkeypatch.setattr(Task, "time_limit", STEPS * CONTROL_TIMESTEP)


Change = Callable[[Any], object]


def replaced(group: str, name: str, make: Callable[[Any], Any]) -> Change:
    """Put other values in the place of an array."""

    def change(file: Any) -> None:
        values = make(file[group][name][()])
        del file[group][name]
        file[group].create_dataset(name, data=values)

    return change


def written(group: str, name: str, value: float) -> Change:
    """Change one number."""

    def change(file: Any) -> None:
        values = file[group][name][()]
        values[tuple(0 for _ in values.shape)] = value
        file[group][name][...] = values

    return change


def removed(name: str) -> Change:
    def change(file: Any) -> None:
        del file[name]

    return change


def attribute(name: str, key: str, value: object) -> Change:
    def change(file: Any) -> None:
        if value is None:
            del file[name].attrs[key]
        else:
            file[name].attrs[key] = value

    return change


def described(name: str, keys: tuple[str, ...], value: object, *also: tuple[str, tuple[str, ...]]) -> Change:
    """Change the JSON of an environment, wherever it is kept."""

    def change(file: Any) -> None:
        for key, path in (("jacokin", keys), *also):
            whole = json.loads(file[name].attrs[key])
            part = whole
            for each in path[:-1]:
                part = part[each]
            part[path[-1]] = value
            file[name].attrs[key] = json.dumps(whole)

    return change


def longer(*names: str) -> Change:
    """The last row of some arrays again."""

    def change(file: Any) -> None:
        for name in names:
            values = file[name][()]
            del file[name]
            file.create_dataset(name, data=np.concatenate((values, values[-1:])))

    return change


def linked(name: str, link: Callable[[Path], Any]) -> Change:
    """A link in the place of an array; to another file with the same content."""

    def change(file: Any) -> None:
        outside = Path(file.filename).parent / "outside.hdf5"
        with h5py.File(outside, "w") as other:
            other.create_dataset("values", data=file[name][()])
        del file[name]
        file[name] = link(outside)

    return change


def stored_outside(name: str) -> Change:
    def change(file: Any) -> None:
        values = file[name][()]
        raw = Path(file.filename).parent / "outside.raw"
        raw.write_bytes(values.tobytes())
        del file[name]
        file.create_dataset(name, values.shape, values.dtype, external=[(str(raw), 0, h5py.h5f.UNLIMITED)])

    return change


def virtual(name: str) -> Change:
    def change(file: Any) -> None:
        values = file[name][()]
        outside = Path(file.filename).parent / "outside.hdf5"
        with h5py.File(outside, "w") as other:
            other.create_dataset("values", data=values)
        layout = h5py.VirtualLayout(values.shape, values.dtype)
        layout[...] = h5py.VirtualSource(str(outside), "values", values.shape)
        del file[name]
        file.create_virtual_dataset(name, layout)

    return change


def enormous(name: str) -> Change:
    """An array that takes no room in the file and all of the memory."""

    def change(file: Any) -> None:
        del file[name]
        file.create_dataset(name, (10**9, 9), np.float64, chunks=(1000, 9))

    return change


def with_objects(name: str) -> Change:
    def change(file: Any) -> None:
        del file[name]
        file.create_dataset(name, data=["a", "b"], dtype=h5py.string_dtype())

    return change


def circular(name: str) -> Change:
    def change(file: Any) -> None:
        file[f"{name}/again"] = file[name]

    return change


D = "data/demo_0"
COLUMNS = ("actions", "rewards", "success")
SURPLUS = [f"{D}/{name}" for name in COLUMNS]
ROBOMIMIC: dict[str, tuple[Change, str]] = {
    "no data": (removed("data"), REFUSED),
    "no first episode": (removed(D), REFUSED),
    "an episode more": (lambda file: file.copy(D, "data/demo_2"), EQUAL),
    "an episode with a strange name": (lambda file: file.copy(D, "data/other"), REFUSED),
    "no episodes": (lambda file: [file["data"].pop(name) for name in list(file["data"])], REFUSED),
    **{
        f"no {name}": (removed(f"{D}/{name}"), REFUSED) for name in ("actions", "rewards", "success", "states", "dones")
    },
    "no obs": (removed(f"{D}/obs"), REFUSED),
    "no next_obs": (removed(f"{D}/next_obs"), REFUSED),
    "a feature less": (removed(f"{D}/obs/target_position"), REFUSED),
    "obs is an array": (lambda file: [removed(f"{D}/obs")(file), file.create_dataset(f"{D}/obs", data=[1.0])], REFUSED),
    "actions are a group": (lambda file: [removed(SURPLUS[0])(file), file.create_group(SURPLUS[0])], REFUSED),
    "float32": (replaced(D, "actions", lambda values: values.astype(np.float32)), REFUSED),
    "whole numbers": (replaced(D, "rewards", lambda values: values.astype(int)), REFUSED),
    "success in numbers": (replaced(D, "success", lambda values: values.astype(float)), REFUSED),
    "complex": (replaced(D, "actions", lambda values: values + 0j), REFUSED),
    "text": (with_objects(f"{D}/actions"), REFUSED),
    "no rows": (replaced(D, "actions", lambda values: values[:0]), REFUSED),
    "one number": (replaced(D, "actions", lambda values: values[0, 0]), REFUSED),
    "flat actions": (replaced(D, "actions", np.ravel), REFUSED),
    "a column less": (replaced(D, "actions", lambda values: values[:, :-1]), REFUSED),
    "a column more": (replaced(D, "actions", lambda values: np.pad(values, ((0, 0), (0, 1)))), REFUSED),
    "surplus actions": (longer(SURPLUS[0]), REFUSED),
    "surplus rows": (longer(*SURPLUS), REFUSED),
    "rewards one shorter": (replaced(D, "rewards", lambda values: values[:-1]), REFUSED),
    "states one shorter": (replaced(D, "states", lambda values: values[:-1]), REFUSED),
    "states flat": (replaced(D, "states", np.ravel), REFUSED),
    "NaN in actions": (written(D, "actions", np.nan), REFUSED),
    "infinite actions": (written(D, "actions", np.inf), REFUSED),
    "NaN in rewards": (written(D, "rewards", np.nan), REFUSED),
    "NaN in states": (written(D, "states", np.nan), DIFFERENT),
    "NaN in an observation": (written(f"{D}/obs", "target_position", np.nan), DIFFERENT),
    "an action": (written(D, "actions", 0.01), DIFFERENT),
    "an action beyond its bounds": (written(D, "actions", 100.0), DIFFERENT),
    "a reward": (written(D, "rewards", 0.5), DIFFERENT),
    "a success": (written(D, "success", True), DIFFERENT),
    "a state": (written(D, "states", 0.5), DIFFERENT),
    "an observation": (written(f"{D}/obs", "target_position", 0.5), DIFFERENT),
    "what is seen next": (written(f"{D}/next_obs", "target_position", 0.5), REFUSED),
    "the next state": (written(D, "next_states", 0.5), REFUSED),
    "an end in the middle": (written(D, "dones", 1), REFUSED),
    "num_samples": (attribute(D, "num_samples", 77), REFUSED),
    "num_samples in words": (attribute(D, "num_samples", "many"), REFUSED),
    "another seed": (attribute(D, "seed", 9), DIFFERENT),
    "a negative seed": (attribute(D, "seed", -1), REFUSED),
    "half a seed": (attribute(D, "seed", 0.5), REFUSED),
    "seeds": (attribute(D, "seed", [1, 2]), REFUSED),
    "a seed in words": (attribute(D, "seed", "three"), REFUSED),
    "no seed": (attribute(D, "seed", None), REFUSED),
    "an error": (attribute(D, "error", "unstable"), DIFFERENT),
    "an error that is a number": (attribute(D, "error", 3), REFUSED),
    "a value that varied": (attribute(D, "randomization/mass", 2.0), DIFFERENT),
    "a value that varied in words": (attribute(D, "randomization/mass", "much"), REFUSED),
    "no environment": (attribute("data", "jacokin", None), REFUSED),
    "an environment that is no JSON": (attribute("data", "jacokin", "{"), REFUSED),
    "an environment that is a list": (attribute("data", "jacokin", "[1, 2]"), REFUSED),
    "an environment that is a number": (attribute("data", "jacokin", 5), REFUSED),
    "deep JSON": (attribute("data", "jacokin", "[" * 30000), REFUSED),
    "another environment for robomimic": (described("data", ("id",), "jacokin/LiftBrick-v0"), REFUSED),
    "an external link": (linked(f"{D}/actions", lambda path: h5py.ExternalLink(path, "values")), REFUSED),
    "an external link to an episode": (
        lambda file: file.__setitem__("data/demo_2", h5py.ExternalLink("other.hdf5", D)),
        REFUSED,
    ),
    "a soft link": (lambda file: file.__setitem__("data/demo_2", h5py.SoftLink(f"/{D}")), REFUSED),
    "a broken link": (lambda file: file.__setitem__("data/demo_2", h5py.SoftLink("/nothing")), REFUSED),
    "external storage": (stored_outside(f"{D}/actions"), REFUSED),
    "virtual": (virtual(f"{D}/actions"), REFUSED),
    "enormous": (enormous(f"{D}/actions"), REFUSED),
    "a circle": (circular("data"), REFUSED),
}
ENVIRONMENT: dict[str, tuple[tuple[str, ...], object, str]] = {
    "another task": (("id",), "jacokin/ReachBrick-v0", DIFFERENT),
    "no such task": (("id",), "jacokin/Nothing-v0", REFUSED),
    "a task that is to be imported": (("id",), "antigravity:mine/Task-v0", REFUSED),
    "a task that is a number": (("id",), 3, REFUSED),
    "another control": (("kwargs", "control"), "tool_velocity", REFUSED),
    "no such control": (("kwargs", "control"), "telepathy", REFUSED),
    "a control that is a list": (("kwargs", "control"), [1], REFUSED),
    "another reward": (("kwargs", "reward"), "sparse", DIFFERENT),
    "a reward that is a dict": (("kwargs", "reward"), {"a": 1}, REFUSED),
    "other observations": (("kwargs", "flatten"), True, DIFFERENT),
    "a flag that is a text": (("kwargs", "flatten"), "yes", REFUSED),
    "another time step": (("kwargs", "control_timestep"), 0.02, DIFFERENT),
    "a negative time step": (("kwargs", "control_timestep"), -1.0, REFUSED),
    "cameras that are a list": (("kwargs", "cameras"), [3], REFUSED),
    "an unknown option": (("kwargs", "speed"), 3, REFUSED),
    "a render mode": (("kwargs", "render_mode"), "human", REFUSED),
    "a task twice": (("kwargs", "task"), "reach_site", REFUSED),
    "randomization that is a number": (("kwargs", "randomization"), 3, REFUSED),
    "a randomization of nothing": (("kwargs", "randomization"), {"colour": 3}, REFUSED),
    "a randomization": (("kwargs", "randomization"), {"mass": 2.0}, DIFFERENT),
    "kwargs that are a list": (("kwargs",), [], REFUSED),
}
E = "episode_0"
MINARI: dict[str, tuple[Change, str]] = {
    "no first episode": (removed(E), REFUSED),
    "an episode more": (lambda file: file.copy(E, "episode_2"), REFUSED),
    **{
        f"no {name}": (removed(f"{E}/{name}"), REFUSED)
        for name in ("actions", "rewards", "observations", "infos", "infos/state", "truncations", "terminations")
    },
    "surplus actions": (longer(f"{E}/actions"), REFUSED),
    "a strange feature": (lambda file: file.create_dataset(f"{E}/observations/new", data=np.zeros(5)), REFUSED),
    "an observation": (written(f"{E}/observations", "target_position", 0.5), DIFFERENT),
    "an observation less": (removed(f"{E}/observations/target_position"), DIFFERENT),
    "a reward": (written(E, "rewards", 0.5), DIFFERENT),
    "a termination": (written(E, "terminations", True), REFUSED),
    "a truncation": (written(E, "truncations", True), REFUSED),
    "solved before it began": (written(f"{E}/infos", "is_success", True), REFUSED),
    "success in numbers": (replaced(f"{E}/infos", "is_success", lambda values: values.astype(float)), REFUSED),
    "total_steps": (attribute(E, "total_steps", 77), REFUSED),
    "names that are a list": (attribute("/", "names", "[]"), REFUSED),
    "names that are numbers": (attribute("/", "names", '{"target_position": 3}'), REFUSED),
    "external storage": (stored_outside(f"{E}/actions"), REFUSED),
    "an external link": (linked(f"{E}/rewards", lambda path: h5py.ExternalLink(path, "values")), REFUSED),
}


def check(path: Path, outcome: str) -> None:
    """What becomes of a data set when it is replayed."""
    if outcome == REFUSED:
        with pytest.raises(InvalidInputError) as refusal:
            jacokin.tasks.replay(path)
        said = str(refusal.value)
        assert len(said) < 1000
        assert "Traceback" not in said
        return
    assert all(each.is_equal for each in jacokin.tasks.replay(path)) == (outcome == EQUAL)


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ROBOMIMIC)
def test_changed_files_of_robomimic(name: str, original: Path, tmp_path: Path) -> None:
    path = Path(shutil.copy(original / "demos.hdf5", tmp_path))
    change, outcome = ROBOMIMIC[name]
    with h5py.File(path, "r+") as file:
        change(file)
    check(path, outcome)


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ENVIRONMENT)
def test_changed_environments(name: str, original: Path, tmp_path: Path) -> None:
    path = Path(shutil.copy(original / "demos.hdf5", tmp_path))
    keys, value, outcome = ENVIRONMENT[name]
    robomimics = ("env_name",) if keys == ("id",) else ("env_kwargs", *keys[1:])
    with h5py.File(path, "r+") as file:
        described("data", keys, value, ("env_args", robomimics))(file)
    check(path, outcome)


@pytest.mark.one_quick
@pytest.mark.parametrize("name", MINARI)
def test_changed_files_of_minari(name: str, original: Path, tmp_path: Path) -> None:
    path = Path(shutil.copytree(original / "demos.minari", tmp_path / "demos.minari"))
    change, outcome = MINARI[name]
    with h5py.File(path / "main_data.hdf5", "r+") as file:
        change(file)
    check(path, outcome)


@pytest.mark.slow
def test_files_that_are_missing_cut_or_something_else(original: Path, tmp_path: Path) -> None:
    """Of each file of each data set: refused without it, where it is empty, half, something else or a link outside."""
    needed = (".npz", ".hdf5", "metadata.json", "environment.json", "info.json", "data/chunk-000/file-000.parquet")
    for source in sorted(original.iterdir()):
        for file in sorted(source.rglob("*")) if source.is_dir() else [source]:
            if not str(file).endswith(needed):
                continue
            for how in ("missing", "empty", "half", "other", "link", "folder", "pipe"):
                path = tmp_path / source.name
                if source.is_dir():
                    shutil.copytree(source, path)
                else:
                    shutil.copy(source, path)
                harmed = path / file.relative_to(source)
                data = harmed.read_bytes()
                harmed.unlink()
                if how == "folder":
                    harmed.mkdir()
                elif how == "pipe":
                    os.mkfifo(harmed)
                elif how == "link" and source.is_dir():
                    harmed.symlink_to(file)
                elif how != "missing":
                    harmed.write_bytes({"empty": b"", "half": data[: len(data) // 2]}.get(how, b"[3]"))
                check(path, REFUSED)
                if path.is_dir():
                    shutil.rmtree(path)
                else:
                    path.unlink(missing_ok=True)


@pytest.mark.parametrize(
    "name", ["action", "next.reward", "next.success", "episode_index", "a row more", "another type"]
)
def test_changed_tables_of_lerobot(name: str, original: Path, tmp_path: Path) -> None:
    path = Path(shutil.copytree(original / "demos.lerobot", tmp_path / "demos.lerobot"))
    file = path / "data/chunk-000/file-000.parquet"
    table = parquet.read_table(file)
    if name == "a row more":
        table = pa.concat_tables([table, table.slice(0, 1)])
    elif name == "another type":
        place = table.column_names.index("next.reward")
        table = table.set_column(place, "next.reward", pa.array(["much"] * len(table)))
    else:
        place = table.column_names.index(name)
        values = table[name].to_pylist()
        values[1] = [0.1] * 9 if name == "action" else True if name == "next.success" else 1
        table = table.set_column(place, name, pa.array(values, table.schema.field(name).type))
    parquet.write_table(table, file)
    check(path, REFUSED)


def test_what_was_not_changed_is_equal(original: Path) -> None:
    for path in original.iterdir():
        check(path, EQUAL)
