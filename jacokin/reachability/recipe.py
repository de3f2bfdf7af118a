"""The recipe of a map: everything it depends on, as JSON, and the samples that follow from it."""

from __future__ import annotations

from typing import Any

import numpy as np

import jacokin
from jacokin.chunks.folder import digest
from jacokin.errors import InvalidInputError
from jacokin.ik.solver import IKSolver
from jacokin.model.robot import fingerprint
from jacokin.reachability.chunk import one_by_one
from jacokin.reachability.orientations import Orientations, Symmetries
from jacokin.reachability.samples import Grid, Samples

FORMAT = "jacokin reachability map 1"
POSES_IN_A_CHUNK = 20_000  # about a quarter of a second of one core
SINGLE_POSES = 10_000  # of a chunk whose poses are looked at one by one: some ten seconds

TURNS = (
    "joint 1 turns freely about z of the base: positions are (r, 0, z), and a pose is turned about z into y = 0, x >= 0"
)
INTERVALS = "intervals of configurations within the limits, of an angle that is free or of joint 3"
ROLLS = "the last joint turns freely about this axis of the tool, in its frame: orientations stand for its direction"


def recipe_of(solver: IKSolver, samples: Samples) -> dict[str, object]:
    """The recipe."""
    import pickle

    grid, symmetries, tool, options = samples.grid, samples.symmetries, solver.tool, solver.verifier.options
    source = solver.robot.source
    free = samples.orientations.axes is not None and symmetries.tool_axis is None
    single = one_by_one(solver, free)
    counted = INTERVALS if free or solver.has_families else "configurations within the limits"
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
            "last joint": None if symmetries.tool_axis is None else ROLLS,
            "tool axis": None if symmetries.tool_axis is None else symmetries.tool_axis.tolist(),
        },
        "positions": {"axes": "r, z" if symmetries.turns else "x, y, z", "shape": list(samples.shape)},
        "orientations": _orientations(samples.orientations),
        "chunks": {
            "positions": max(1, (SINGLE_POSES if single else POSES_IN_A_CHUNK) // len(samples.orientations)),
            "arrays": f"branches (positions, orientations): {counted}, 0 where none; "
            "margin (positions, orientations): largest distance to the nearest limit [rad], NaN where none; "
            "positions in C order, chunk after chunk",
        },
    }


def _orientations(orientations: Orientations) -> dict[str, object]:
    document = {"name": orientations.name, "quat_wxyz": orientations.quats_wxyz.tolist()}
    if orientations.axes is None or orientations.ranges is None:
        return document
    return document | {"free about": orientations.axes.tolist(), "from and to": orientations.ranges.tolist()}


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
        given = recipe["orientations"]
        orientations = Orientations(
            given["quat_wxyz"], given["name"], axes=given.get("free about"), ranges=given.get("from and to")
        )
    except (KeyError, TypeError) as error:
        raise InvalidInputError(f"{place}: is not the recipe of a map: {error!r} is missing or wrong") from error
    return Samples(grid, orientations, symmetries)
