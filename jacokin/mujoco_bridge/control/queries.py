"""Queries of inverse kinematics, answered one by one or, for many scenes of one arm, as one batch."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.solver import IKSolver
from jacokin.model.angles import TURN

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """Which configuration nearest to a start brings a site to a pose?

    Attributes:
        solver: of the arm in its scene.
        target: (4, 4) T_base_site.
        start: (dof,) configuration [rad] to stay near to.
        qpos: (dof,) addresses in qpos of the joints.
        wraps: the joints that are to be in [0, 2 pi).
    """

    solver: IKSolver
    target: Array
    start: Array
    qpos: NDArray[np.intp]
    wraps: tuple[int, ...]

    def answer(self) -> Array | None:
        """The configuration (dof,), or None if there is none within the limits."""
        result = self.solver.solve(self.target, self.start, closest=False)
        return canonical(result.q, self.wraps) if result.success else None


Asking = Generator[Query, "Array | None", Result]
"""A generator that yields queries, is sent their answers, and returns a result."""


def run(asking: Asking[Result]) -> Result:
    """Run a generator of queries, each answered by itself; returns its result."""
    answer = None
    while True:
        try:
            query = asking.send(answer)
        except StopIteration as end:
            result: Result = end.value
            return result
        answer = query.answer()


def run_all(
    askings: Sequence[Asking[Result]],
    switch: Callable[[int], AbstractContextManager[object]] = nullcontext,
) -> list[Result]:
    """Run several generators of queries in turns, each turn's queries solved as one batch; returns their results.

    Args:
        askings: the generators, all of the same arm.
        switch: of the number of a generator: a context in which it goes on, as some share a simulation.
    """
    found: dict[int, Result] = {}
    answers: dict[int, Array | None] = dict.fromkeys(range(len(askings)))
    while answers:
        queries: dict[int, Query] = {}
        for number, answer in answers.items():
            with switch(number):
                try:
                    queries[number] = askings[number].send(answer)
                except StopIteration as end:
                    found[number] = end.value
        answers = dict(zip(queries, _answers(list(queries.values())), strict=True))
    return [found[number] for number in range(len(askings))]


def _answers(queries: Sequence[Query]) -> list[Array | None]:
    """The same as `Query.answer` of each, bit for bit."""
    if not queries:
        return []
    targets, starts = np.array([each.target for each in queries]), np.array([each.start for each in queries])
    batch = queries[0].solver.solve_batch(targets, starts, closest=False)
    return [
        canonical(q, each.wraps) if success else None
        for each, q, success in zip(queries, batch.q, batch.success, strict=True)
    ]


def canonical(q: Array, wraps: Sequence[int]) -> Array:
    """A copy with some joints, the unlimited hinges, in [0, 2 pi)."""
    return wrapped_in_place(q.copy(), wraps)


def wrapped_in_place(q: Array, wraps: Sequence[int]) -> Array:
    """The same array with these joints in [0, 2 pi)."""
    values: list[float] = q.tolist()  # plain numbers are faster than NumPy's
    for joint in wraps:
        if not 0.0 < values[joint] < TURN:
            turned = values[joint] % TURN
            q[joint] = turned if turned < TURN else 0.0  # the remainder of -1e-17 is rounded up to a full turn
    return q
