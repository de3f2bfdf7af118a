"""One interval of the parameter: a run of configurations that all reach the target within the limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.answers.choosing import Cost, by_distance, by_margin, minima, refined
from jacokin.ik.families.members import Members
from jacokin.ik.families.tracks import Track
from jacokin.model import checks
from jacokin.model.angles import TURN

#: [rad] a value of the parameter this far outside an interval is at its end.
PARAMETER_SLACK = 1e-9


@dataclass(frozen=True, slots=True)
class IntervalEnd:
    """Why an interval ends."""

    kind: str
    """"limit"; "fold", where two branches meet and exist no further; "range", of the target; "circle", where nothing
    ends; "lost", where the curve could not be followed any further."""
    joint: str | None = None
    """The joint on its limit."""
    limit: float | None = None
    """That limit [rad]."""

    def __str__(self) -> str:
        """In words."""
        return self.kind if self.joint is None else f"{self.joint} at its limit {self.limit:.6g} rad"


class Interval:
    """Configurations on one branch for start <= p <= stop; each reaches the target and is within the limits.

    Attributes:
        branch: number of the branch; two intervals on one branch are parts of one curve.
        start: least value of the parameter [rad]; in [-pi, pi) when the parameter may go full circle.
        stop: largest value of the parameter [rad]; at most start + 2 pi.
        ends: why it ends at start and at stop.
    """

    __slots__ = ("_members", "_track", "branch", "ends", "start", "stop")

    def __init__(self, members: Members, track: Track, branch: int, ends: tuple[IntervalEnd, IntervalEnd]) -> None:
        """Take a track within the limits."""
        self._members, self._track = members, track
        self.branch, self.ends = branch, ends
        self.start, self.stop = track.start, track.stop

    def __repr__(self) -> str:
        """Ends and their reasons."""
        return f"Interval(branch {self.branch}, {self.start:.6f} ({self.ends[0]}) to {self.stop:.6f} ({self.ends[1]}))"

    @property
    def length(self) -> float:
        """Stop - start [rad]."""
        return self.stop - self.start

    def contains(self, parameter: float) -> bool:
        """Whether a value of the parameter, or one whole turns away, is in the interval."""
        return self._moved_inside(checks.number("parameter", parameter, "rad")) is not None

    def at(self, parameter: float, seed: ArrayLike | None = None) -> Array:
        """The member (dof,) [rad] where the parameter has a value.

        Args:
            parameter: [rad] from start to stop, or whole turns away from there.
            seed: (dof,) unlimited joints take the copy nearest to it [rad]; None for the seed of the family.

        Raises:
            InvalidInputError: the parameter is outside the interval.
        """
        p = self._moved_inside(checks.number("parameter", parameter, "rad"))
        if p is None:
            raise InvalidInputError(
                f"parameter must be from {self.start:.17g} to {self.stop:.17g} rad, got {parameter!r}"
            )
        return self.member(p, self._track.at(p), self._seed(seed))

    def nearest(self, seed: ArrayLike | None = None) -> Array:
        """The member (dof,) [rad] nearest to a seed; None for the seed of the family."""
        wanted = self._seed(seed)
        found = self._track.nearest(wanted)
        return choose([self], by_distance(wanted), wanted)[0] if found is None else self.member(*found, wanted)

    def widest(self) -> Array:
        """The member (dof,) [rad] with the largest limit margin."""
        return choose([self], by_margin(self._members.robot), self._members.seed)[0]

    @property
    def margin(self) -> float:
        """The largest limit margin of a member [rad]; inf for an arm without limits."""
        cost = by_margin(self._members.robot)
        return -float(cost(choose([self], cost, self._members.seed)[0][np.newaxis])[0])

    def guesses(self, cost: Cost, seed: Array) -> Guesses:
        """Members all along, roughly, and their costs; unlimited joints in the copies nearest to a seed (dof,)."""
        coordinates, rows = self._track.guesses()
        return Guesses(self, coordinates, cost(self._members.copies(rows, seed)))

    def near(self, guesses: Guesses, index: int, cost: Cost, seed: Array) -> tuple[float, float]:
        """The least cost between the neighbours of a guess, and its coordinate."""
        return refined(cost, guesses.coordinates, index, lambda c: self._members.copies(self._track.joints(c), seed))

    def at_coordinate(self, coordinate: float, seed: Array) -> tuple[Array, float]:
        """The member (dof,) at a coordinate of the track, and its parameter [rad]."""
        p, q = self._track.point(coordinate)
        return self.member(p, q, seed), p

    def sample(self, n: int) -> tuple[Array, Array]:
        """Values of the parameter (n,) and members (n, dof) [rad], spread over the interval; the middle for n = 1."""
        if n == 1:
            p = np.array([0.5 * (self.start + self.stop)])
        else:
            p = np.linspace(self.start, self.stop, n, endpoint=self.ends[1].kind != "circle")
        return p, np.array([self.member(value, self._track.at(value), self._members.seed) for value in p.tolist()])

    def spread(self, step: float) -> tuple[Array, Array]:
        """Values of the parameter (n,) and configurations (n, dof) [rad], for callers that refine them.

        The ends exactly, unless nothing ends there; between them, whole multiples of a step, to about 1e-3 rad; at
        least one. Angles are in any 2 pi copy, and not looked at.
        """
        p, rows = self._track.polyline()
        inner = step * np.arange(np.floor(self.start / step) + 1.0, np.ceil(self.stop / step))
        inner = inner if inner.size else np.array([0.5 * (self.start + self.stop)])
        between = np.column_stack([np.interp(inner, p, column) for column in rows.T])
        if self.ends[0].kind == self.ends[1].kind == "circle":
            return inner, between
        return np.concatenate([p[:1], inner, p[-1:]]), np.vstack([rows[0], between, rows[-1]])

    def member(self, parameter: float, q: Array, seed: Array) -> Array:
        """A configuration (dof,) of the track, in the copies nearest to a seed, verified."""
        return self._members.verified(self._members.copies(q, seed), parameter)

    def _seed(self, seed: ArrayLike | None) -> Array:
        return self._members.seed if seed is None else self._members.robot.configuration(seed, "seed")

    def _moved_inside(self, p: float) -> float | None:
        moved = p + TURN * round((0.5 * (self.start + self.stop) - p) / TURN)
        if self.start <= p <= self.stop:
            return p
        if not self.start - PARAMETER_SLACK <= moved <= self.stop + PARAMETER_SLACK:
            return None
        return min(max(moved, self.start), self.stop)


class Guesses(NamedTuple):
    """Costs along an interval."""

    interval: Interval
    coordinates: Array
    values: Array


def choose(intervals: Sequence[Interval], cost: Cost, seed: Array) -> tuple[Array, float]:
    """The member (dof,) of the least cost on one or more intervals, and its parameter [rad].

    Guesses all along tell where minima may be; a minimum is looked at unless the change from guess to guess leaves no
    doubt that it is worse than the best one found.
    """
    doubts: list[tuple[float, int, int, Guesses]] = []
    for number, interval in enumerate(intervals):
        guesses = interval.guesses(cost, seed)
        change = np.abs(np.diff(guesses.values, prepend=guesses.values[0], append=guesses.values[-1]))
        for index in minima(guesses.values).tolist():
            bound = float(guesses.values[index] - max(change[index], change[index + 1]))
            doubts.append((bound, number, index, guesses))
    best = (math.inf, 0.0, intervals[0])
    for bound, _, index, guesses in sorted(doubts, key=lambda doubt: doubt[:3]):
        if bound >= best[0]:
            break
        value, coordinate = guesses.interval.near(guesses, index, cost, seed)
        if value < best[0]:
            best = (value, coordinate, guesses.interval)
    return best[2].at_coordinate(best[1], seed)
