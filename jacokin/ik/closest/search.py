"""`ClosestSearch`: the configuration within the limits that comes closest to a target that is not reached.

Random configurations are drawn, and the nearest of them descend, together with those that the caller has. After each
stage the worse ones are dropped, and those that have met. Most minima are reached from many starts, so that the least
one is seldom missed; `python -m benchmarks.closest` counts how often.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik import seeds
from jacokin.ik.closest.chain import Chain
from jacokin.ik.closest.descent import Stage, begin, descend
from jacokin.ik.closest.measure import Measure
from jacokin.ik.diagnosis import Outcome, Reach
from jacokin.ik.request import Request
from jacokin.ik.results import IKResult, Status
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Effort, Verifier
from jacokin.model import angles

DRAWN = 1000  # random configurations that are measured
STARTS = 112  # nearest ones that descend
COARSE = 1e-2  # [m] smoothing of the first stage, which only gets near
FINE = 1e-6  # [m] smoothing of the others: as much may be missing in the end
STAGES = (
    Stage(True, COARSE, steps=6, kept=36),
    Stage(False, FINE, steps=10, kept=12),
    Stage(False, FINE, steps=25, kept=3),
    Stage(False, FINE, steps=80, kept=1),
)
SAME = 1e-2  # [rad] descents nearer than this to each other have met


class Closest(NamedTuple):
    """Where a search ended, and what it took."""

    q: Array
    """(dof,) within the limits [rad]."""
    iterations: int
    """Steps of all descents."""
    starts: int
    """Descents."""
    qp_solver: str | None = None
    """The solver that was tried before."""


class ClosestSearch:
    """The search for one robot, frame and tool; immutable, and may be shared between threads.

    Attributes:
        reach: what the tool cannot leave.
    """

    def __init__(self, verifier: Verifier) -> None:
        """Read the joints of the robot."""
        self.reach = Reach(verifier)
        self._verifier = verifier
        self._robot = verifier.robot
        self._circular = verifier.robot.unlimited & ~verifier.robot.sliding
        self._chain = Chain(verifier.robot, verifier.frame_id, verifier.tool)

    def result(
        self, request: Request, outcome: Outcome, nearby: Sequence[Array], before: Effort | None = None
    ) -> IKResult:
        """The closest configuration; a success after all if it meets the tolerances.

        Args:
            request: what was asked for.
            outcome: why it is not reached.
            nearby: configurations (dof,) within the limits to descend from, besides the seed and random ones.
            before: what was tried already; its counts go on.
        """
        verifier, target = self._verifier, request.target
        found = self.find(self.reach.pulled_in(target), [*nearby, request.seed], request.generator())
        if before is not None:
            counts = found.iterations + before.iterations, found.starts + before.starts
            found = Closest(found.q, *counts, before.qp_solver)
        q = angles.nearest_copy(found.q, request.seed, self._circular)
        errors, touching = verifier.measure(q, target), verifier.touching(q)
        result = verifier.result(
            q, outcome.status, errors, request.message(outcome.message), effort=found, touching=touching
        )
        if verifier.reached(q, errors) and not (touching and verifier.rejects_contact):
            message = request.message("found while looking for the closest configuration")
            return replace(result, status=Status.OK, message=message)
        return result

    def find(self, target: TargetPose, first: Sequence[Array], rng: np.random.Generator) -> Closest:
        """The least measure that the descents end in.

        Args:
            target: what to come close to.
            first: configurations (dof,) within the limits to descend from in any case.
            rng: draws the others.
        """
        measure = Measure(self._chain, target)
        drawn = seeds.random_configurations(self._robot, DRAWN, rng)
        state = begin(np.vstack([*first, drawn[np.argsort(measure.exact(drawn))[:STARTS]]]))
        starts, steps = len(state.q), 0
        for stage in STAGES:
            taken, state = descend(measure, state, stage, self._robot.lower, self._robot.upper)
            steps += taken * len(state.q)
            state = state.at(self._nearest(state.q, measure.exact(state.q), stage.kept))
        return Closest(state.q[0], steps, starts)

    def _nearest(self, q: Array, value: Array, most: int) -> NDArray[np.intp]:
        """The configurations with the least measure that differ from each other, the least one first."""
        chosen: list[int] = []
        for index in np.argsort(value).tolist():
            apart = angles.nearest_copy(q[chosen], q[index], self._circular) - q[index]
            if (np.abs(apart).max(axis=1) > SAME).all():
                chosen.append(index)
                if len(chosen) == most:
                    break
        return np.array(chosen)
