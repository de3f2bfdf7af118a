"""The folder of a map: `load` reads it; its recipe, a JSON file, has everything that the map depends on.

`bundled` loads the maps that come with the package.
"""

from __future__ import annotations

import functools
import pickle
from importlib.resources import files as package_files
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

import jacokin
from jacokin.chunks.folder import HASH_DIGITS, RECIPE, digest, file_digest
from jacokin.errors import InvalidInputError, JacokinError
from jacokin.ik.solver import IKSolver
from jacokin.model import checks
from jacokin.model.descriptions.bundled import DEFAULT_ROBOT
from jacokin.model.robot import Robot, checked_robot, fingerprint
from jacokin.model.scene import Scene, checked_scene
from jacokin.reachability.chunk import one_by_one
from jacokin.reachability.map import ReachabilityMap, check_same_robot
from jacokin.reachability.orientations import Orientations, Symmetries
from jacokin.reachability.samples import Grid, Samples

MANIFEST = "manifest.json"
FORMAT = "jacokin reachability map 1"
POSES_IN_A_CHUNK = 20_000  # about a quarter of a second of one core
SINGLE_POSES = 10_000  # of a chunk whose poses are looked at one by one: some ten seconds

TURNS = (
    "joint 1 turns freely about z of the base: positions are (r, 0, z), and a pose is turned about z into y = 0, x >= 0"
)
INTERVALS = "intervals of configurations within the limits, of an angle that is free or of joint 3"
ROLLS = "the last joint turns freely about this axis of the tool, in its frame: orientations stand for its direction"


def load(folder: str | Path, *, robot: Robot | None = None, scene: Scene | None = None) -> ReachabilityMap:
    """Read a map, and check every chunk against its hash.

    Args:
        folder: where it was built.
        robot: the robot, for a map of one that is not bundled; only some questions need it.
        scene: the obstacles that it was built with, if any; only some questions need them.

    Raises:
        InvalidInputError: not a map, not complete, damaged, or of another robot or scene.
    """
    path = Path(checks.text("folder", str(checks.path("folder", folder))))
    recipe = _document(path, RECIPE, f"is not a map: it has no {RECIPE}")
    manifest = _document(path, MANIFEST, f"is not a complete map: it has no {MANIFEST}; build the rest of it")
    if manifest.get("recipe") != file_digest(path / RECIPE):
        raise InvalidInputError(f"{path}: {MANIFEST} is of another {RECIPE} than this one; build the map again")
    if not isinstance(manifest.get("sha256"), dict):
        raise InvalidInputError(f"{path / MANIFEST}: does not list the chunks; build the map again")
    if robot is not None:
        check_same_robot(path, recipe, checked_robot("robot", robot))
    samples = _samples_of(recipe, str(path))
    if scene is not None and digest(pickle.dumps(checked_scene("scene", scene))) != recipe["scene"]:
        raise InvalidInputError(f"{path}: is a map with other obstacles than this scene, or without any")
    counts, touching = np.zeros((2, samples.positions, len(samples.orientations)), dtype=np.uint8)
    margins = np.empty(counts.shape, dtype=np.float16)
    first = 0
    for name, content in manifest["sha256"].items():
        chunk = _chunk(path / name, content)
        stop = first + len(chunk["branches"])
        counts[first:stop], margins[first:stop] = chunk["branches"], chunk["margin"]
        touching[first:stop] = chunk.get("touching", 0)  # maps of versions that did not know contact
        first = stop
    if first != samples.positions:
        raise InvalidInputError(f"{path}: has {first} positions of {samples.positions}; build the rest of it")
    bound = manifest.get("bound")
    return ReachabilityMap(path, recipe, samples, counts, margins, touching, robot, bound=bound, scene=scene)


def bundled(name: str = DEFAULT_ROBOT) -> ReachabilityMap:
    """The coarse map of a bundled robot that comes with the package.

    Raises:
        UnknownNameError: no such robot; lists those that there are.
    """
    folder = Path(str(package_files("jacokin.reachability"))) / "maps"
    known = sorted(path.name for path in folder.iterdir() if path.is_dir())
    return _loaded(folder / checks.choice("robot", name, known))


@functools.cache
def _loaded(folder: Path) -> ReachabilityMap:
    return load(folder)


def _document(path: Path, name: str, missing: str) -> dict[str, Any]:  # Any: JSON
    """A JSON file of a map.

    Raises:
        InvalidInputError: it is not there, cannot be read, or holds something else.
    """
    try:
        document = orjson.loads((path / name).read_bytes())
    except FileNotFoundError as error:
        raise InvalidInputError(f"{path}: {missing if path.exists() else 'there is no such folder'}") from error
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read: {error.strerror}") from error
    except orjson.JSONDecodeError as error:
        raise InvalidInputError(f"{path / name}: is not JSON: {error}") from error
    if not isinstance(document, dict):
        raise InvalidInputError(f"{path / name}: is not a JSON object")
    return document


def _chunk(path: Path, wanted: str) -> dict[str, NDArray[np.generic]]:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise JacokinError(f"{path}: cannot be read: {error.strerror}; build the map again") from error
    if digest(content) != wanted or wanted[:HASH_DIGITS] not in path.name:
        raise InvalidInputError(f"{path}: is damaged: its hash is not that of the manifest; build the map again")
    with np.load(path) as file:
        return {name: file[name] for name in file.files}


def make_recipe(solver: IKSolver, samples: Samples) -> dict[str, object]:
    """The recipe of a map."""
    grid, symmetries, tool, options = samples.grid, samples.symmetries, solver.tool, solver.verifier.options
    source = solver.robot.source
    free = samples.orientations.axes is not None and symmetries.tool_axis is None
    single = one_by_one(solver, free)
    counted = INTERVALS if free or solver.has_families else "configurations within the limits"
    return {
        "format": FORMAT,
        "version": jacokin.__version__,
        "robot": {
            "name": solver.robot.label,
            "bundled": source.bundled,
            "sha256": fingerprint(solver.robot, shapes=options.collision != "ignore"),
        },
        "frame": solver.frame,
        "tool": None if tool is None else tool.homogeneous.tolist(),
        "collision": options.collision,
        "scene": None if options.scene is None else digest(pickle.dumps(options.scene)),
        "clearance": options.clearance,
        "grid": {
            "lower": grid.lower.tolist(),
            "upper": grid.upper.tolist(),
            "spacing": grid.spacing,
            "shape": list(grid.shape),
        },
        "symmetries": {
            "joint 1": TURNS if symmetries.turns else None,
            "last joint": None if symmetries.tool_axis is None else ROLLS,
            "tool axis": None if symmetries.tool_axis is None else symmetries.tool_axis.tolist(),
        },
        "positions": {"axes": "r, z" if symmetries.turns else "x, y, z", "shape": list(samples.shape)},
        "orientations": _orientations(samples.orientations),
        "chunks": {
            "positions": max(1, (SINGLE_POSES if single else POSES_IN_A_CHUNK) // len(samples.orientations)),
            "arrays": f"branches (positions, orientations): {counted}, 0 where none; "
            "margin (positions, orientations): largest distance to the nearest limit [rad], NaN where none; "
            "touching (positions, orientations): how many more there are in contact, where contact is looked for; "
            "positions in C order, chunk after chunk",
        },
    }


def _orientations(orientations: Orientations) -> dict[str, object]:
    document = {"name": orientations.name, "quat_wxyz": orientations.quats_wxyz.tolist()}
    if orientations.axes is None or orientations.ranges is None:
        return document
    return document | {"free about": orientations.axes.tolist(), "from and to": orientations.ranges.tolist()}


def _samples_of(recipe: dict[str, Any], place: str) -> Samples:  # Any: JSON
    """The samples of a recipe.

    Raises:
        InvalidInputError: it is not the recipe of a map.
    """
    if recipe.get("format") != FORMAT:
        raise InvalidInputError(f"{place}: is not the recipe of a map: format {recipe.get('format')!r}, not {FORMAT!r}")
    try:
        grid = Grid(recipe["grid"]["lower"], recipe["grid"]["upper"], recipe["grid"]["spacing"])
        axis = recipe["symmetries"]["tool axis"]
        symmetries = Symmetries(recipe["symmetries"]["joint 1"] is not None, None if axis is None else np.array(axis))
        given = recipe["orientations"]
        orientations = Orientations(
            given["quat_wxyz"], given["name"], axes=given.get("free about"), ranges=given.get("from and to")
        )
    except (KeyError, TypeError) as error:
        raise InvalidInputError(f"{place}: is not the recipe of a map: {error!r} is missing or wrong") from error
    return Samples(grid, orientations, symmetries)
