"""The recipe of a map: everything it depends on, as JSON, and the samples that follow from it."""

from __future__ import annotations

from typing import Any

import numpy as np

import jacokin
from jacokin.chunks.keeping import digest
from jacokin.errors import InvalidInputError
from jacokin.ik.solver import IKSolver
from jacokin.model.fingerprint import fingerprint
from jacokin.reachability.grid import Grid
from jacokin.reachability.orientations import Orientations
from jacokin.reachability.samples import Samples
from jacokin.reachability.symmetries import Symmetries

FORMAT = "jacokin reachability map 1"
POSES_IN_A_CHUNK = 20_000  # about half a second of one core

TURNS = (
    "joint 1 turns freely about z of the base: positions are (r, 0, z), and a pose is turned about z into y = 0, x >= 0"
)
ROLLS = "joint 6 turns freely about this axis of the tool, in its frame: orientations stand for the direction of it"


def recipe_of(solver: IKSolver, samples: Samples) -> dict[str, object]:
    """The recipe."""
    import pickle

    grid, symmetries, tool, options = samples.grid, samples.symmetries, solver.tool, solver.verifier.options
    source = solver.robot.source
    return {
        "format": FORMAT,
        "version": jacokin.__version__,
        "robot": {
            "name": solver.robot.name,
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
            "joint 6": None if symmetries.tool_axis is None else ROLLS,
            "tool axis": None if symmetries.tool_axis is None else symmetries.tool_axis.tolist(),
        },
        "positions": {"axes": "r, z" if symmetries.turns else "x, y, z", "shape": list(samples.shape)},
        "orientations": {"name": samples.orientations.name, "quat_wxyz": samples.orientations.quats_wxyz.tolist()},
        "chunks": {
            "positions": max(1, POSES_IN_A_CHUNK // len(samples.orientations)),
            "arrays": "branches (positions, orientations): configurations within the limits, 0 where none; "
            "margin (positions, orientations): largest distance to the nearest limit [rad], NaN where none; "
            "positions in C order, chunk after chunk",
        },
    }


def samples_of(recipe: dict[str, Any], place: str) -> Samples:  # Any: JSON
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
        orientations = Orientations(recipe["orientations"]["quat_wxyz"], recipe["orientations"]["name"])
    except (KeyError, TypeError) as error:
        raise InvalidInputError(f"{place}: is not the recipe of a map: {error!r} is missing or wrong") from error
    return Samples(grid, orientations, symmetries)
