"""One chunk of a map, `MapJob`: every orientation at some positions, and how many configurations reach each."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import jacokin
from jacokin.arrays import Array
from jacokin.chunks.folder import Keeper
from jacokin.errors import JacokinError
from jacokin.ik.batches.chunk import unpickled_solver
from jacokin.ik.families.family import Interval
from jacokin.ik.preferences import by_margin
from jacokin.ik.solver import IKSolver
from jacokin.model.poses import FreeAxis
from jacokin.reachability.orientations import Orientations
from jacokin.reachability.samples import Samples

MOST_BRANCHES = 255
SAMPLES = 16  # members of an interval that are looked at for contact

Answers = tuple[NDArray[np.uint8], Array]


def one_by_one(solver: IKSolver, free: bool) -> bool:
    """Whether each pose is looked at for itself, which takes some hundred times as long as the compiled loop.

    Args:
        solver: of the map.
        free: whether tools may turn about an axis.
    """
    return free or solver.has_families or solver.verifier.rejects_contact


def count_reaching(solver: IKSolver, targets: Array, orientations: Orientations | None = None) -> Answers:
    """How many configurations reach each of n poses (n, 4, 4), and the largest limit margin among them [rad].

    Where a pose has a family of configurations, because the arm has seven joints or the tool may turn about an axis,
    the number is that of its intervals, and the margin that of its widest member.

    Args:
        solver: of the map.
        targets: poses.
        orientations: what they are made of, again and again in this order, where tools may turn about an axis.

    Returns:
        (n,) numbers, and (n,) margins, NaN where there is no configuration.
    """
    free = orientations if orientations is not None and orientations.axes is not None else None
    if not one_by_one(solver, free is not None):
        return _count_compiled(solver, targets)
    counts, margins = np.zeros(len(targets), dtype=np.uint8), np.full(len(targets), np.nan)
    for row, matrix in enumerate(targets):
        if free is not None:
            number, margin = _count_intervals(solver, free.free_axis(row % len(free), matrix))
        elif solver.has_families:
            number, margin = _count_intervals(solver, matrix)
        else:
            number, margin = _count_branches(solver, matrix)
        if number:
            counts[row], margins[row] = min(number, MOST_BRANCHES), margin
    return counts, margins


def _count_compiled(solver: IKSolver, targets: Array) -> Answers:
    seeds = np.tile(solver.robot.home, (len(targets), 1))
    rows = solver.closed_form().solve_batch(targets, seeds)
    good = solver.verifier.reached_rows(rows) & rows.within_limits
    counts = np.where(good, np.minimum(rows.branches_within_limits, MOST_BRANCHES), 0).astype(np.uint8)
    return counts, np.where(good, rows.largest_margin, np.nan)


def _count_branches(solver: IKSolver, target: Array) -> tuple[int, float]:
    """Branches within the limits that touch nothing."""
    branches = solver.solve_all(target)
    free = branches.within_limits & np.array([not pairs for pairs in branches.touching or ()], dtype=np.bool_)
    return int(free.sum()), float(branches.margin[free].min(axis=1).max()) if free.any() else np.nan


def _count_intervals(solver: IKSolver, target: Array | FreeAxis) -> tuple[int, float]:
    """Intervals of a family; where contact counts, those with a member that touches nothing among some of each."""
    family = solver.family(target)
    cost = by_margin(solver.robot)
    if not solver.verifier.rejects_contact:
        widest = family.widest()
        return len(family), np.nan if widest is None else -float(cost(widest[None])[0])
    found = [-float(cost(rows).min()) for interval in family if len(rows := _free_members(solver, interval))]
    return len(found), max(found, default=np.nan)


def _free_members(solver: IKSolver, interval: Interval) -> Array:
    """Of some members (k, dof) of an interval, those that touch nothing, where contact counts."""
    rows = np.vstack([interval.sample(SAMPLES)[1], interval.widest()])
    if not solver.verifier.rejects_contact:
        return rows
    return rows[[not solver.verifier.touching(q) for q in rows]]


def usable_rows(solver: IKSolver, target: Array) -> tuple[Array, Array]:
    """Configurations (k, dof) that reach a pose, of families some, and the limit margin (k,) of each, largest first."""
    if solver.has_families:
        rows = np.vstack(
            [np.empty((0, solver.robot.dof)), *(_free_members(solver, each) for each in solver.family(target))]
        )
    else:
        branches = solver.solve_all(target)
        free = branches.within_limits.copy()
        if solver.verifier.rejects_contact:
            free &= np.array([not pairs for pairs in branches.touching or ()], dtype=np.bool_)
        rows = branches.q[free]
    margins = -by_margin(solver.robot)(rows)
    order = np.argsort(-margins, kind="stable")
    return rows[order], margins[order]


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
    """
    if job.version != jacokin.__version__:
        raise JacokinError(f"the worker has jacokin {jacokin.__version__}, and the map needs {job.version}")
    targets = job.samples.targets(np.arange(job.first, job.stop))
    shape = targets.shape[:2]
    solver = unpickled_solver(job.solver)
    branches, margin = count_reaching(solver, targets.reshape(-1, 4, 4), job.samples.orientations)
    stream = io.BytesIO()
    np.savez_compressed(
        stream, branches=branches.reshape(shape), margin=margin.astype(np.float16).reshape(shape), allow_pickle=False
    )
    return job.keeper.keep(job.index, stream.getvalue())
