"""Arguments that are refused, by name."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jacokin import Robot
from jacokin.errors import InvalidInputError, JacokinError
from jacokin.reachability import Grid, Orientations, build, bundled, load, place_base


@pytest.mark.parametrize("spacing", ["1", 0.0, -1.0, np.nan, 10**400, 1e-320, np.eye(3), None])
def test_spacings(spacing: Any, robot: Robot) -> None:
    with pytest.raises(InvalidInputError, match=r"spacing|cells"):
        Grid.around(robot, spacing)
    with pytest.raises(InvalidInputError, match=r"spacing|cells"):
        Grid((0, 0, 0), (1, 1, 1), spacing)


def test_grids(robot: Robot) -> None:
    with pytest.raises(InvalidInputError, match="robot must be a Robot"):
        Grid.around("j2n6s300", 0.1)  # type: ignore[arg-type]  # the mistake
    with pytest.raises(InvalidInputError, match="cells"):
        Grid((-1e308, 0, 0), (1e308, 1, 1), 0.1)
    grid = Grid.around(robot, 0.5)
    for index in (3, -1, 0.0, True, [0]):
        with pytest.raises(InvalidInputError, match="index"):
            grid.axis(index)  # type: ignore[arg-type]  # the mistakes


@pytest.mark.parametrize("count", [0, 100_001, 10**400, 1.0, True, "3"])
def test_numbers_of_orientations(count: Any) -> None:
    for make, name in ((Orientations.even, "count"), (Orientations.directions, "count"), (Orientations.down, "yaws")):
        with pytest.raises(InvalidInputError, match=f"{name} must be a whole number"):
            make(count)


@pytest.mark.parametrize("axis", [(0, 0, 0), "z", 1.0, (0, 0, 10**400), [np.ma.masked] * 3])
def test_axes_without_roll(axis: Any) -> None:
    with pytest.raises(InvalidInputError, match="axis"):
        Orientations.even(3).without_roll(axis)


@pytest.mark.parametrize("wrong", ["z", object(), [[1.0], [1.0, 2.0]], np.zeros((3, 3)), 0.5])
def test_axes_and_targets_of_orientations(wrong: Any) -> None:
    for name in ("axes", "ranges"):
        with pytest.raises(InvalidInputError, match=name):
            Orientations([[0.0, 1.0, 0.0, 0.0]], **{"axes": (0, 0, 1), name: wrong})
    with pytest.raises(InvalidInputError, match="targets"):
        Orientations.free(wrong)


def test_folders_and_callbacks(robot: Robot, tmp_path: Path) -> None:
    for folder in ("a\0b", "\ud800"):
        with pytest.raises(InvalidInputError, match="folder"):
            load(folder)
        with pytest.raises(InvalidInputError, match="folder"):
            build(robot, folder=folder)
    with pytest.raises(InvalidInputError, match="progress must be callable"):
        build(robot, folder=tmp_path, progress="yes")  # type: ignore[arg-type]  # the mistake
    for value in ("all", 2.0, True, None):
        with pytest.raises(InvalidInputError, match="orientations must be an Orientations, one or"):
            build(robot, folder=tmp_path, orientations=value)  # type: ignore[arg-type]  # the mistakes
    for collision in ("report", np.eye(3), ["ignore"]):
        with pytest.raises(JacokinError, match="collision"):
            build(robot, folder=tmp_path, collision=collision)  # type: ignore[arg-type]  # the mistakes
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("manifest.json", "{}", "is of another recipe.json"),
        ("manifest.json", "[]", "is not a JSON object"),
        ("manifest.json", "{", "is not JSON"),
        ("manifest.json", None, "is not a complete map: it has no manifest.json"),
        ("recipe.json", "[]", "is not a JSON object"),
        ("recipe.json", '{"format": "jacokin reachability map 1"}', "is of another recipe.json"),
        ("recipe.json", None, "is not a map: it has no recipe.json"),
    ],
)
def test_folders_that_hold_something_else(tmp_path: Path, name: str, content: str | None, words: str) -> None:
    folder = tmp_path / "map"
    shutil.copytree(bundled().folder, folder)
    load(folder)
    (folder / name).unlink()
    if content is not None:
        (folder / name).write_text(content, encoding="utf-8")
    with pytest.raises(InvalidInputError, match=f"map.*{words}"):
        load(folder)


def test_a_manifest_without_chunks(tmp_path: Path) -> None:
    folder = tmp_path / "map"
    shutil.copytree(bundled().folder, folder)
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    (folder / "manifest.json").write_text(json.dumps(manifest | {"sha256": 3}), encoding="utf-8")
    with pytest.raises(InvalidInputError, match="does not list the chunks"):
        load(folder)
    with pytest.raises(InvalidInputError, match="there is no such folder"):
        load(tmp_path / "nowhere")


def test_pictures_in_another_format(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"map.doc: pictures of maps are written as .png, .*told by the ending"):
        bundled().plot(tmp_path / "map.doc")
    with pytest.raises(InvalidInputError, match="path must be a str or a Path"):
        bundled().plot(3)  # type: ignore[arg-type]  # the mistake


def test_names_of_maps_and_heights_of_bases() -> None:
    for name in (["j2n6s300"], "j9", None):
        with pytest.raises(JacokinError, match="robot"):
            bundled(name)  # type: ignore[arg-type]  # the mistakes
    for heights in ("high", [np.nan], [[0.0], [1.0, 2.0]], iter([1.0])):
        with pytest.raises(InvalidInputError, match="heights"):
            place_base(bundled(), [np.eye(4)], heights=heights)  # type: ignore[arg-type]  # the mistakes
    for name in ("yaws", "count"):
        with pytest.raises(InvalidInputError, match=f"{name} must be a whole number"):
            place_base(bundled(), [np.eye(4)], **{name: 0})
