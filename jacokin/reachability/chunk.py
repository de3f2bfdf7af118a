"""One chunk of a map: every orientation at some positions, in whatever process."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import jacokin
from jacokin.arrays import Array
from jacokin.chunks.keeping import Keeper
from jacokin.errors import JacokinError
from jacokin.ik.batches.chunk import unpickled_solver
from jacokin.ik.solver import IKSolver
from jacokin.reachability.samples import Samples

MOST_BRANCHES = 255


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
    branches, margin = reached(unpickled_solver(job.solver), targets.reshape(-1, 4, 4))
    stream = io.BytesIO()
    np.savez_compressed(
        stream, branches=branches.reshape(shape), margin=margin.astype(np.float16).reshape(shape), allow_pickle=False
    )
    return job.keeper.keep(job.index, stream.getvalue())


def reached(solver: IKSolver, targets: Array) -> tuple[NDArray[np.uint8], Array]:
    """How many configurations reach each of n poses (n, 4, 4), and the largest limit margin among them [rad].

    Returns:
        (n,) numbers, and (n,) margins, NaN where there is no configuration.
    """
    if solver.verifier.options.collision == "reject":
        return _one_by_one(solver, targets)
    seeds = np.tile(solver.robot.home, (len(targets), 1))
    rows = solver.closed_form().solve_batch(targets, seeds)
    position_tolerance, orientation_tolerance = solver.tolerances
    good = rows.within_limits & (rows.position_error <= position_tolerance)
    good &= rows.orientation_error <= orientation_tolerance
    counts = np.where(good, np.minimum(rows.branches_within_limits, MOST_BRANCHES), 0).astype(np.uint8)
    return counts, np.where(good, rows.largest_margin, np.nan)


def _one_by_one(solver: IKSolver, targets: Array) -> tuple[NDArray[np.uint8], Array]:
    """The same without the configurations that touch anything."""
    counts, margins = np.zeros(len(targets), dtype=np.uint8), np.full(len(targets), np.nan)
    for row, target in enumerate(targets):
        branches = solver.solve_all(target)
        free = branches.within_limits & np.array([not pairs for pairs in branches.touching or ()], dtype=np.bool_)
        if free.any():
            counts[row] = min(int(free.sum()), MOST_BRANCHES)
            margins[row] = branches.margin[free].min(axis=1).max()
    return counts, margins
