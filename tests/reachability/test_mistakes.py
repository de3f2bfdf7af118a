"""Arguments that are refused, by name."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver, Robot
from jacokin.errors import InvalidInputError, JacokinError
from jacokin.reachability import Grid, Orientations, build, bundled, load, place_base

WRONG = ["z", object(), [[1.0], [1.0, 2.0]], np.zeros((3, 3)), 0.5]  # neither axes nor ranges nor targets
WRONG_FOLDERS = ["a\0b", "\ud800", 3]


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
    with pytest.raises(InvalidInputError, match=r"1e\+12 cells"):
        Grid([0, 0, 0], [1, 1, 1], 1e-4)
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


@pytest.mark.parametrize(
    ("options", "words"),
    [
        *(({"axes": wrong}, "axes") for wrong in WRONG),
        *(({"axes": (0, 0, 1), "ranges": wrong}, "ranges") for wrong in WRONG),
        ({"axes": np.eye(3)}, "one row for each of the 1 orientations"),
        ({"axes": [[0, 0, 0]]}, "axis must have a direction"),
        ({"ranges": [[0, 1]]}, "give axes too"),
    ],
)
def test_orientations(options: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidInputError, match=words):
        Orientations([[0.0, 1.0, 0.0, 0.0]], **options)


@pytest.mark.parametrize("wrong", WRONG)
def test_free_axes(wrong: Any) -> None:
    with pytest.raises(InvalidInputError, match="targets"):
        Orientations.free(wrong)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        *(({"folder": folder}, "folder") for folder in WRONG_FOLDERS),
        ({"progress": "yes"}, "progress must be callable"),
        *(
            ({"orientations": value}, "orientations must be an Orientations, one or")
            for value in ("all", 2.0, True, None)
        ),
        ({"orientations": [FreeAxis(np.eye(4), axis=(0, 0, 1)), 3]}, "a sequence of them"),
        ({"robot": IKSolver(jacokin.load_robot(), collision="report")}, "collision must be 'prefer', 'reject' or"),
        *(({"robot": robot}, "robot must be a Robot") for robot in ("j2n6s300", np.eye(3))),
        *(({"shard": shard}, "shard must be 'i/n'") for shard in ("0/3", "4/3", "a", 3)),
        (
            {"robot": jacokin.load_robot("j2s7s300"), "orientations": FreeAxis(np.eye(4), axis=(1, 0, 0))},
            "for six joints",
        ),
    ],
)
def test_build(options: dict[str, Any], words: str, robot: Robot, tmp_path: Path) -> None:
    with pytest.raises(JacokinError, match=words):
        build(**{"robot": robot, "folder": tmp_path / "map", **options})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("folder", WRONG_FOLDERS)
def test_load(folder: Any) -> None:
    with pytest.raises(InvalidInputError, match="folder"):
        load(folder)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("manifest.json", '{"recipe": "", "sha256": {}}', "is of another recipe.json"),
        ("manifest.json", "[]", "must be a mapping with recipe, sha256"),
        ("manifest.json", "{", "is not the manifest of a map"),
        ("manifest.json", None, "is not a complete map: it has no manifest.json"),
        ("recipe.json", "[]", "must be a mapping with format"),
        ("recipe.json", '{"format": "jacokin reachability map 1"}', "lacks 'robot'"),
        ("recipe.json", '{"format": "jacokin reachability map 2"}', "format must be 'jacokin reachability map 1'"),
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
    with pytest.raises(InvalidInputError, match="sha256 must be a mapping"):
        load(folder)
    with pytest.raises(InvalidInputError, match="there is no such folder$"):
        load(tmp_path / "nowhere")
    with pytest.raises(InvalidInputError, match=r"there is no such folder; `bundled\('gen3_lite'\)` is the map"):
        load("gen3_lite")


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
            place_base(bundled(), [np.eye(4)], **{name: 0})  # type: ignore[arg-type]  # the mistakes
