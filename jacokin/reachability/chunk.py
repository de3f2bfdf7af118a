"""One chunk of a map: every orientation at some positions, in whatever process."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np

import jacokin
from jacokin.chunks.keeping import Keeper
from jacokin.errors import JacokinError
from jacokin.ik.batches.chunk import unpickled_solver
from jacokin.reachability.answers import reached
from jacokin.reachability.sampling.samples import Samples


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
    branches, margin = reached(solver, targets.reshape(-1, 4, 4), job.samples.orientations)
    stream = io.BytesIO()
    np.savez_compressed(
        stream, branches=branches.reshape(shape), margin=margin.astype(np.float16).reshape(shape), allow_pickle=False
    )
    return job.keeper.keep(job.index, stream.getvalue())
