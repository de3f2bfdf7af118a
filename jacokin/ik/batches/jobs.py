"""Jobs for the chunks that are left: recipes of rows in a file, or the rows themselves where that does not do."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import jacokin
from jacokin.arrays import Array
from jacokin.chunks.execution import made, workers_of
from jacokin.chunks.keeping import Keeper
from jacokin.errors import InvalidInputError
from jacokin.ik.batches.chunk import ChunkJob, FileStamp, GivenRows, RowsInFile, make
from jacokin.ik.files import formats
from jacokin.ik.files.parts import Part
from jacokin.ik.solver import IKSolver

TOGETHER = 16  # consecutive chunks in one job, at most: some seconds of work that is handed out at once
SHARE = 4  # a job has at most this part of what is left for each worker: towards the end, none waits long for another


@dataclass(frozen=True, slots=True)
class Batch:
    """What all jobs of a file have in common.

    Attributes:
        solver: solves each target.
        targets: the file.
        parts: its rows, chunk by chunk.
        rows: rows of a chunk.
        seed: (dof,) [rad], or None for home.
        closest: see `IKSolver.solve`.
        suffix: format of the answers.
    """

    solver: IKSolver
    targets: Path
    parts: Sequence[Part]
    rows: int
    seed: Array | None
    closest: bool
    suffix: str

    def solved(
        self, missing: Sequence[int], keeper: Keeper, executor: Executor, *, several: bool
    ) -> Iterator[tuple[int, str | bytes]]:
        """Number and what was kept of every missing chunk, in the order in which they finish.

        Args:
            missing: numbers of chunks, rising.
            keeper: where they are kept.
            executor: makes them.
            several: whether a job may have several chunks.

        Raises:
            InvalidInputError: the file has changed, or cannot be read.
            JacokinError: a job failed, or the executor did.
        """
        stamp = FileStamp.of(self.targets.absolute())
        if stamp is not None and self.parts[0].can_be_read:
            runs = list(_runs(missing, SHARE * workers_of(executor) if several else len(missing)))
            unseen = []
            for number, kept in made(make, self._recipes(runs, keeper, stamp), executor):
                if kept is None:
                    unseen += runs[number]
                else:
                    yield from zip(runs[number], kept, strict=True)
            missing = sorted(unseen)
        if missing:
            if FileStamp.of(self.targets.absolute()) != stamp:
                raise InvalidInputError(f"{self.targets}: has changed since the batch began")
            for number, kept in made(make, self._given(frozenset(missing), keeper), executor):
                assert kept is not None  # the rows come with the job
                yield number, kept[0]

    def _recipes(
        self, runs: Sequence[Sequence[int]], keeper: Keeper, stamp: FileStamp
    ) -> Iterator[tuple[int, ChunkJob]]:
        pickled = pickle.dumps(self.solver)
        for number, run in enumerate(runs):
            parts = tuple(self.parts[index] for index in run)
            yield number, self._job(pickled, keeper, run[0], RowsInFile(stamp, self.rows, parts))

    def _given(self, missing: frozenset[int], keeper: Keeper) -> Iterator[tuple[int, ChunkJob]]:
        pickled = pickle.dumps(self.solver)
        for index, block in enumerate(formats.blocks(self.targets, self.rows)):
            if index in missing:
                yield index, self._job(pickled, keeper, index, GivenRows(block.columns, block.values, block.lines))

    def _job(self, pickled: bytes, keeper: Keeper, first: int, rows: RowsInFile | GivenRows) -> ChunkJob:
        return ChunkJob(jacokin.__version__, pickled, self.seed, self.closest, self.suffix, keeper, first, rows)


def _runs(numbers: Sequence[int], shares: int) -> Iterator[list[int]]:
    """Consecutive numbers, in each run at most one of so many shares of those that are left."""
    first = 0
    while first < len(numbers):
        most = min(TOGETHER, max(1, (len(numbers) - first) // shares))
        stop = first + 1
        while stop < min(first + most, len(numbers)) and numbers[stop] == numbers[stop - 1] + 1:
            stop += 1
        yield list(numbers[first:stop])
        first = stop
