"""One chunk of a map, `MapJob`: every orientation at some positions, and how many configurations reach each."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import jacokin
from jacokin.arrays import Array
from jacokin.chunks.folder import Keeper
from jacokin.errors import JacokinError
from jacokin.ik.batches.chunk import unpickled_solver
from jacokin.ik.closed_form import BranchTable
from jacokin.ik.families.family import Interval
from jacokin.ik.preferences import by_margin
from jacokin.ik.solver import IKSolver
from jacokin.model import angles
from jacokin.model.poses import FreeAxis
from jacokin.reachability.orientations import Orientations
from jacokin.reachability.samples import Samples

MOST_BRANCHES = 255
SAMPLES = 16  # members of an interval that are looked at for contact
WALK = 0.1  # [rad] between configurations of an interval that are looked at to count it

POSES_AT_ONCE = 512  # whose branches go to the kernels of contact together


class Answers(NamedTuple):
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
    return free or solver.has_families


def count_reaching(solver: IKSolver, targets: Array, orientations: Orientations | None = None) -> Answers:
    """How many configurations reach each of n poses (n, 4, 4), with what margin, and how many only in contact.

    Where a pose has a family of configurations, because the arm has seven joints or the tool may turn about an axis,
    the number is that of its intervals, and the margin that of its widest member.

    Args:
        solver: of the map.
        targets: poses.
        orientations: what they are made of, again and again in this order, where tools may turn about an axis.
    """
    free = orientations if orientations is not None and orientations.axes is not None else None
    if not one_by_one(solver, free is not None):
        found = _count_compiled(solver, targets)
        return _without_contact(solver, targets, found) if solver.verifier.avoids_contact else found
    counts, touching = np.zeros((2, len(targets)), dtype=np.uint8)
    margins = np.full(len(targets), np.nan)
    for row, matrix in enumerate(targets):
        target = matrix if free is None else free.free_axis(row % len(free), matrix)
        number, margin, touch = _count_intervals(solver, target)
        counts[row], touching[row] = min(number, MOST_BRANCHES), min(touch, MOST_BRANCHES)
        margins[row] = margin if number else np.nan
    return Answers(counts, margins, touching)


def _count_compiled(solver: IKSolver, targets: Array) -> Answers:
    seeds = np.tile(solver.robot.home, (len(targets), 1))
    rows = solver.closed_form().solve_batch(targets, seeds)
    good = solver.verifier.reached_rows(rows) & rows.within_limits
    counts = np.where(good, np.minimum(rows.branches_within_limits, MOST_BRANCHES), 0).astype(np.uint8)
    return Answers(counts, np.where(good, rows.largest_margin, np.nan), np.zeros(len(targets), dtype=np.uint8))


def _without_contact(solver: IKSolver, targets: Array, found: Answers) -> Answers:
    """The same, with branches in contact left out."""
    form, seed, verifier = solver.closed_form(), solver.robot.home, solver.verifier
    counts, margins, touching = np.zeros_like(found.counts), np.full(len(targets), np.nan), found.touching
    reached = np.flatnonzero(found.counts)
    for first in range(0, len(reached), POSES_AT_ONCE):
        some = reached[first : first + POSES_AT_ONCE]
        each = [form.solve_all(targets[row], seed).rows for row in some]
        of = np.repeat(some, [len(rows) for rows in each])
        branches = BranchTable(np.concatenate(each))
        good = verifier.reached_rows(branches) & branches.within_limits
        q, of, margin = np.ascontiguousarray(branches.q[good]), of[good], branches.margin[good].min(axis=1)
        touches = verifier.touching_rows(q)
        np.add.at(touching, of[touches], 1)
        np.add.at(counts, of[~touches], 1)
        np.fmax.at(margins, of[~touches], margin[~touches])
    return Answers(counts, margins, touching)


def _count_intervals(solver: IKSolver, target: Array | FreeAxis) -> tuple[int, float, int]:
    """Intervals of a family, the largest margin, and intervals in contact: those whose members touch, of some."""
    family = solver.family(target)
    cost = by_margin(solver.robot)
    if not solver.verifier.avoids_contact:
        widest = family.widest()
        return len(family), np.nan if widest is None else -float(cost(widest[None])[0]), 0
    found = [-float(cost(rows).min()) for interval in family if len(rows := _clear_on(solver, interval))]
    return len(found), max(found, default=np.nan), len(family) - len(found)


def _clear_on(solver: IKSolver, interval: Interval) -> Array:
    """Some configurations (k, dof) of an interval that touch nothing, to about 1e-3 rad: quick, and enough to count."""
    robot = solver.robot
    rows = interval.walk(WALK)[1]
    rows = np.clip(angles.into_limits(rows, robot.lower, robot.upper), robot.lower, robot.upper)
    return np.asarray(rows[~solver.verifier.touching_rows(rows)])


def _free_members(solver: IKSolver, interval: Interval) -> Array:
    """Of some members (k, dof) of an interval, those that touch nothing, where contact counts."""
    rows = np.vstack([interval.sample(SAMPLES)[1], interval.widest()])
    if not solver.verifier.avoids_contact:
        return rows
    return np.asarray(rows[~solver.verifier.touching_rows(rows)])


def usable_rows(solver: IKSolver, target: Array) -> tuple[Array, Array]:
    """Configurations (k, dof) that reach a pose, of families some, and the limit margin (k,) of each, largest first."""
    if solver.has_families:
        rows = np.vstack(
            [np.empty((0, solver.robot.dof)), *(_free_members(solver, each) for each in solver.family(target))]
        )
    else:
        branches = solver.solve_all(target)
        rows = branches.q_within_limits
        if solver.verifier.avoids_contact:
            rows = rows[~solver.verifier.touching_rows(rows)]
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
