"""The folder of a map: `load` reads it; its recipe, a JSON file, has everything that the map depends on.

`bundled` loads the maps that come with the package. A chunk is what is kept of each pose.
"""

from __future__ import annotations

import functools
import io
import pickle
from collections.abc import Callable
from concurrent.futures import CancelledError
from dataclasses import dataclass
from importlib.resources import files as package_files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import jacokin
from jacokin import files
from jacokin.arrays import Array
from jacokin.chunks.execution import is_stopped
from jacokin.chunks.folder import HASH_DIGITS, RECIPE, Keeper, digest, file_digest
from jacokin.documents import read_json
from jacokin.errors import InvalidInputError, JacokinError
from jacokin.ik.batches.chunk import unpickled_solver
from jacokin.ik.preferences import least_margins
from jacokin.ik.solutions.points import BranchTable
from jacokin.ik.solutions.solution_set import Interval
from jacokin.ik.solver import IKSolver
from jacokin.model import angles, checks
from jacokin.model.descriptions.bundled import DEFAULT_ROBOT
from jacokin.model.poses import FreeAxis
from jacokin.model.robot import Robot, checked_robot, fingerprint
from jacokin.model.scene import Scene, checked_scene
from jacokin.reachability.map import ReachabilityMap, check_same_robot
from jacokin.reachability.samples import Grid, Orientations, Samples, Symmetries

MANIFEST = "manifest.json"
FORMAT = "jacokin reachability map 1"
NOT_A_RECIPE, NOT_A_MANIFEST = "is not the recipe of a map", "is not the manifest of a map"
VECTORS = [[float]]
RECIPE_FORM = {
    "format": FORMAT,
    "robot": {"name": str, "bundled": (str, None), "sha256": str},
    "frame": str,
    "tool": (None, VECTORS),
    "collision": str,
    "scene": (str, None),
    "clearance?": float,  # maps of versions that did not know it
    "grid": {"lower": [float], "upper": [float], "spacing": float},
    "symmetries": {"joint 1": (str, None), "tool axis": ([float], None)},
    "orientations": {"name": str, "quat_wxyz": VECTORS, "free about?": VECTORS, "from and to?": VECTORS},
}
POSES_IN_A_CHUNK = 20_000

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
    if str(folder) in _bundled_names() and not path.exists():
        raise InvalidInputError(f"{path}: there is no such folder; `bundled({path.name!r})` is the map of that robot")
    recipe = _document(path, RECIPE, RECIPE_FORM, f"is not a map: it has no {RECIPE}")
    missing = f"is not a complete map: it has no {MANIFEST}; build the rest of it"
    manifest = _document(path, MANIFEST, {"recipe": str, "sha256": {str: str}, "bound?": (float, None)}, missing)
    if manifest["recipe"] != file_digest(path / RECIPE):
        raise InvalidInputError(f"{path}: {MANIFEST} is of another {RECIPE} than this one; build the map again")
    if robot is not None:
        check_same_robot(path, recipe, checked_robot("robot", robot))
    with files.parsing(path / RECIPE, NOT_A_RECIPE):
        samples = _samples_of(recipe)
    if scene is not None and recipe["scene"] not in (
        checked_scene("scene", scene).surroundings.fingerprint,
        digest(pickle.dumps(scene)),  # as earlier versions wrote it
    ):
        raise InvalidInputError(f"{path}: is a map with other obstacles than this scene, or without any")
    counts, touching = np.zeros((2, samples.positions, len(samples.orientations)), dtype=np.uint8)
    margins = np.empty(counts.shape, dtype=np.float16)
    first = 0
    for name, content in manifest["sha256"].items():
        chunk = _chunk(path / name, content)
        with files.parsing(path / name, "is not of this map"):
            stop = first + len(chunk["branches"])
            shape = (min(stop, len(counts)) - first, *counts.shape[1:])
            if not chunk["branches"].shape == chunk["margin"].shape == shape:
                raise ValueError(f"its arrays have other shapes than {shape}")
            counts[first:stop], margins[first:stop] = chunk["branches"], chunk["margin"]
            touching[first:stop] = chunk.get("touching", 0)  # maps of versions that did not know contact
        first = stop
    if first != samples.positions:
        raise InvalidInputError(f"{path}: has {first} positions of {samples.positions}; build the rest of it")
    bound = manifest.get("bound")
    return ReachabilityMap(path, recipe, samples, (counts, margins, touching), robot, bound=bound, scene=scene)


def bundled(name: str = DEFAULT_ROBOT) -> ReachabilityMap:
    """The coarse map of a bundled robot that comes with the package.

    Raises:
        UnknownNameError: no such robot; lists those that there are.
    """
    return _loaded(_maps() / checks.choice("robot", name, _bundled_names()))


def _maps() -> Path:
    """Where the bundled maps are."""
    return Path(str(package_files("jacokin.reachability"))) / "maps"


def _bundled_names() -> list[str]:
    """The robots with a bundled map."""
    return sorted(path.name for path in _maps().iterdir() if path.is_dir())


@functools.cache
def _loaded(folder: Path) -> ReachabilityMap:
    return load(folder)


def _document(path: Path, name: str, form: object, missing: str) -> dict[str, Any]:  # Any: JSON
    """A JSON file of a map.

    Raises:
        InvalidInputError: it is not there, cannot be read, or holds something else.
    """
    try:
        document: dict[str, Any] = read_json(path / name, NOT_A_RECIPE if name == RECIPE else NOT_A_MANIFEST, form)
    except InvalidInputError as error:
        if isinstance(error.__cause__, FileNotFoundError):
            raise InvalidInputError(f"{path}: {missing if path.exists() else 'there is no such folder'}") from error
        raise
    return document


def _chunk(path: Path, wanted: str) -> dict[str, NDArray[np.generic]]:
    try:
        content = files.read_bytes(path, files.TABLE)
    except InvalidInputError as error:
        raise InvalidInputError(f"{error}; build the map again") from error
    if digest(content) != wanted or wanted[:HASH_DIGITS] not in path.name:
        raise InvalidInputError(f"{path}: is damaged: its hash is not that of the manifest; build the map again")
    return files.read_arrays(path, "is not a chunk of a map; build the map again", ("branches", "margin"))


def make_recipe(solver: IKSolver, samples: Samples) -> dict[str, object]:
    """The recipe of a map."""
    grid, symmetries, tool, options = samples.grid, samples.symmetries, solver.tool, solver.verifier.options
    source = solver.robot.source
    free = samples.orientations.axes is not None and symmetries.tool_axis is None
    single = one_by_one(solver, free)
    counted = INTERVALS if single else "configurations within the limits"
    # One by one, 10,000 poses take some ten seconds; else 20,000 a quarter of a second of one core.
    poses = 10_000 if single else POSES_IN_A_CHUNK
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
        "scene": None if options.scene is None else options.scene.surroundings.fingerprint,
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
            "positions": max(1, poses // len(samples.orientations)),
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


def _samples_of(recipe: dict[str, Any]) -> Samples:  # Any: JSON
    """The samples of a recipe.

    Raises:
        InvalidInputError: its numbers are not those of a map.
    """
    grid = Grid(recipe["grid"]["lower"], recipe["grid"]["upper"], recipe["grid"]["spacing"])
    axis, given = recipe["symmetries"]["tool axis"], recipe["orientations"]
    tool_axis = checks.optional(checks.vector, "tool axis", axis, 3, "")
    symmetries = Symmetries(recipe["symmetries"]["joint 1"] is not None, tool_axis)
    axes, ranges = given.get("free about"), given.get("from and to")
    return Samples(grid, Orientations(given["quat_wxyz"], given["name"], axes=axes, ranges=ranges), symmetries)


MOST_BRANCHES = 255

POSES_AT_ONCE = 512  # whose branches go to the kernels of contact together


class PoseCounts(NamedTuple):
    """What reaches each of n poses."""

    counts: NDArray[np.uint8]
    """(n,) configurations that count."""
    margins: Array
    """(n,) largest limit margin among them [rad]; NaN where there is none."""
    touching: NDArray[np.uint8]
    """(n,) configurations within the limits that do not count because they are in contact."""


def one_by_one(solver: IKSolver, free: bool) -> bool:
    """Whether each pose is looked at for itself, which takes some hundred times as long as the compiled loop.

    Args:
        solver: of the map.
        free: whether tools may turn about an axis.
    """
    return free or solver.dimension() == 1


def count_reaching(
    solver: IKSolver,
    targets: Array,
    orientations: Orientations | None = None,
) -> PoseCounts:
    """How many configurations reach each of n poses (n, 4, 4), with what margin, and how many only in contact.

    Where a pose has curves of configurations, because the arm has seven joints or the tool may turn about an axis,
    the number is that of its intervals, and the margin the largest of a member.

    Args:
        solver: of the map.
        targets: poses.
        orientations: what they are made of, again and again in this order, where tools may turn about an axis.

    Raises:
        CancelledError: nobody waits for it, which is seen before each pose that is looked at for itself.
    """
    free = orientations if orientations is not None and orientations.axes is not None else None
    if not one_by_one(solver, free is not None):
        found = count_in_contact_or_not(solver, targets)
        if not solver.verifier.avoids_contact:
            return found
        return _without_contact(found, _clear_branches(solver, targets, found.counts))
    counts, touching = np.zeros((2, len(targets)), dtype=np.uint8)
    margins = np.full(len(targets), np.nan)
    for row, matrix in enumerate(targets):
        if is_stopped():
            raise CancelledError
        target = matrix if free is None else free.free_axis(row % len(free), matrix)
        number, margin, touch = _count_intervals(solver, target)
        counts[row], touching[row] = min(number, MOST_BRANCHES), min(touch, MOST_BRANCHES)
        margins[row] = margin if number else np.nan
    return PoseCounts(counts, margins, touching)


def count_in_contact_or_not(solver: IKSolver, targets: Array) -> PoseCounts:
    """How many configurations reach each of n poses (n, 4, 4), whether they touch something or not, and their margin.

    By the compiled loop alone, where `one_by_one` does not hold.
    """
    seeds = np.tile(solver.robot.home, (len(targets), 1))
    rows = solver.closed_form().solve_batch(targets, seeds)
    good = solver.verifier.reached_rows(rows) & rows.within_limits
    counts = np.where(good, np.minimum(rows.branches_within_limits, MOST_BRANCHES), 0).astype(np.uint8)
    return PoseCounts(counts, np.where(good, rows.largest_margin, np.nan), np.zeros(len(targets), dtype=np.uint8))


class _Branches(NamedTuple):
    """Branches within the limits that reach some of n poses, and do not touch anything where contact counts."""

    of: NDArray[np.intp]
    """(k,) the pose of each."""
    q: Array
    """(k, dof) [rad]"""
    margins: Array
    """(k,) least distance to a limit [rad]."""
    touching: NDArray[np.uint8]
    """(n,) how many more of each pose touch something."""


def _clear_branches(solver: IKSolver, targets: Array, counts: NDArray[np.uint8]) -> _Branches:
    """Those of the poses (n, 4, 4) with a count."""
    form, seed, verifier = solver.closed_form(), solver.robot.home, solver.verifier
    of, q, margins = [np.empty(0, np.intp)], [np.empty((0, solver.robot.dof))], [np.empty(0)]
    touching, reached = np.zeros(len(targets), dtype=np.uint8), np.flatnonzero(counts)
    for first in range(0, len(reached), POSES_AT_ONCE):
        some = reached[first : first + POSES_AT_ONCE]
        each = [form.solve_all(targets[row], seed).rows for row in some]
        numbers = np.repeat(some, [len(rows) for rows in each])
        branches = BranchTable(np.concatenate(each))
        good = verifier.reached_rows(branches) & branches.within_limits
        rows, numbers = np.ascontiguousarray(branches.q[good]), numbers[good]
        clear = np.ones(len(rows), dtype=np.bool_)
        if verifier.avoids_contact:
            clear = ~verifier.touching_rows(rows)
            np.add.at(touching, numbers[~clear], 1)
        of.append(numbers[clear])
        q.append(rows[clear])
        margins.append(branches.margin[good].min(axis=1)[clear])
    return _Branches(np.concatenate(of), np.concatenate(q), np.concatenate(margins), touching)


def _without_contact(found: PoseCounts, clear: _Branches) -> PoseCounts:
    """Counts in which branches in contact do not count."""
    counts, margins = np.zeros_like(found.counts), np.full(len(found.counts), np.nan)
    np.add.at(counts, clear.of, 1)
    np.fmax.at(margins, clear.of, clear.margins)
    return PoseCounts(counts, margins, clear.touching)


def _count_intervals(solver: IKSolver, target: Array | FreeAxis) -> tuple[int, float, int]:
    """Intervals of curves, the largest margin, and intervals in contact: those whose members touch, of some."""
    found, robot = solver.solve_all(target), solver.robot
    if not solver.verifier.avoids_contact:
        best = found.best("margin")
        return len(found), np.nan if best is None else float(least_margins(robot, best[None])[0]), 0
    intervals = (_clear_on(solver, interval) for interval in found.intervals)
    clear = [float(least_margins(robot, rows).max()) for rows in intervals if len(rows)]
    return len(clear), max(clear, default=np.nan), len(found) - len(clear)


def _clear_on(solver: IKSolver, interval: Interval) -> Array:
    """Some configurations (k, dof) of an interval that touch nothing, to about 1e-3 rad: quick, and enough to count."""
    robot = solver.robot
    rows = interval.walk(0.1)[1]  # [rad]
    rows = np.clip(angles.into_limits(rows, robot.lower, robot.upper), robot.lower, robot.upper)
    return np.asarray(rows[~solver.verifier.touching_rows(rows)])


def _free_members(solver: IKSolver, interval: Interval) -> Array:
    """Of some members (k, dof) of an interval, those that touch nothing, where contact counts."""
    rows = np.vstack([interval.sample(16)[1], interval.best("margin")])
    if not solver.verifier.avoids_contact:
        return rows
    return np.asarray(rows[~solver.verifier.touching_rows(rows)])


def usable_rows(solver: IKSolver, target: Array) -> tuple[Array, Array]:
    """Configurations (k, dof) that reach a pose, of curves some, and the limit margin (k,) of each, largest first."""
    found = solver.solve_all(target)
    if found.dimension == 1:
        rows = np.vstack([np.empty((0, solver.robot.dof)), *(_free_members(solver, each) for each in found.intervals)])
    else:
        rows = found.q_within_limits
        if solver.verifier.avoids_contact:
            rows = rows[~solver.verifier.touching_rows(rows)]
    margins = least_margins(solver.robot, rows)
    order = np.argsort(-margins, kind="stable")
    return rows[order], margins[order]


#: Of a pose, by its number: what `usable_rows` gives.
RowsOf = Callable[[int], tuple[Array, Array]]


def count_with_rows(solver: IKSolver, targets: Array) -> tuple[PoseCounts, RowsOf]:
    """What `count_reaching` gives for poses (n, 4, 4), and the `usable_rows` of those with a count, solved once."""
    if one_by_one(solver, False):
        return count_reaching(solver, targets), lambda number: usable_rows(solver, targets[number])
    found = count_in_contact_or_not(solver, targets)
    clear = _clear_branches(solver, targets, found.counts)
    if solver.verifier.avoids_contact:
        found = _without_contact(found, clear)
    order = np.lexsort((-clear.margins, clear.of))
    q, margins = clear.q[order], clear.margins[order]
    ends = np.searchsorted(clear.of[order], np.arange(len(targets) + 1))

    def rows_of(number: int) -> tuple[Array, Array]:
        part = slice(ends[number], ends[number + 1])
        return q[part], margins[part]

    return found, rows_of


@dataclass(frozen=True, slots=True)
class MapJob:
    """All that a chunk depends on; can be sent to other machines.

    Attributes:
        version: of jacokin, which has to be that of the worker.
        solver: an `IKSolver`, pickled.
        samples: the poses of the map.
        first: the first position of the chunk.
        stop: the position after the last.
        index: number of the chunk.
        keeper: where it is kept.
    """

    version: str
    solver: bytes
    samples: Samples
    first: int
    stop: int
    index: int
    keeper: Keeper


def make(job: MapJob) -> str | bytes:
    """Keep an NPZ file with the arrays that the recipe names; returns what `Keeper.keep` does.

    Raises:
        JacokinError: this process has another version of jacokin.
        CancelledError: nobody waits for it any more.
    """
    if job.version != jacokin.__version__:
        raise JacokinError(f"the worker has jacokin {jacokin.__version__}, and the map needs {job.version}")
    targets = job.samples.targets(np.arange(job.first, job.stop))
    shape = targets.shape[:2]
    solver = unpickled_solver(job.solver)
    found = count_reaching(solver, targets.reshape(-1, 4, 4), job.samples.orientations)
    stream = io.BytesIO()
    np.savez_compressed(
        stream,
        branches=found.counts.reshape(shape),
        margin=found.margins.astype(np.float16).reshape(shape),
        touching=found.touching.reshape(shape),
        allow_pickle=False,
    )
    return job.keeper.keep(job.index, stream.getvalue())
