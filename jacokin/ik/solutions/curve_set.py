"""`CurveSet`: all configurations that reach a target with one free parameter, as intervals of the parameter.

The parameter p [rad] is the angle about the free axis of a `FreeAxis`, or one joint of seven. On a branch,
the configuration is a smooth function of p, from one fold to another (where two branches meet) or all the way round.
What is within the limits of a branch is some intervals of p.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import preferences
from jacokin.ik.preferences import Cost, Prefer, by_distance, by_margin, least_margins
from jacokin.ik.solutions import picture
from jacokin.ik.solutions.least import least_member
from jacokin.ik.solutions.members import (
    GUESS_SPACING,
    CurveTrack,
    LostMemberError,
    Members,
    places_along,
    polylines,
)
from jacokin.ik.solutions.solution_set import Interval, IntervalEnd, SolutionSet, Touching
from jacokin.kernels.tolerances import LIMIT_SNAP
from jacokin.model import angles, checks
from jacokin.model.angles import TURN
from jacokin.model.robot import limit_margins

#: [rad] between members of which some are chosen.
LOOKED_AT = 0.1


class TrackInterval(Interval):
    """An interval that runs along a track."""

    __slots__ = ("_members", "_track")

    def __init__(self, members: Members, track: CurveTrack, branch: int, ends: tuple[IntervalEnd, IntervalEnd]) -> None:
        """Take a track within the limits."""
        super().__init__(branch, track.start, track.stop, ends)
        self._members, self._track = members, track

    def at(self, parameter: float, seed: ArrayLike | None = None) -> Array:
        """The member (dof,) [rad] where the parameter has a value, its unlimited joints near to a seed."""
        p = self._moved_inside(checks.number("parameter", parameter, "rad"))
        if p is None:
            raise InvalidInputError(
                f"parameter must be from {self.start:.17g} to {self.stop:.17g} rad, got {parameter!r}"
            )
        q = self._member(p, self._track.at(p), self._members.near(seed))
        for end, at_end in zip(self.ends, (p <= self.start, p >= self.stop), strict=True):
            if at_end and end.joint is not None and end.limit is not None:
                joint = self._members.robot.joint_index(end.joint)
                if abs(q[joint] - end.limit) < LIMIT_SNAP:  # exactly
                    q[joint] = end.limit
        return q

    def nearest(self, seed: ArrayLike | None = None) -> Array:
        """The member (dof,) [rad] nearest to a seed; None for the seed of the set."""
        wanted = self._members.near(seed)
        robot = self._members.robot
        found = self._track.nearest(wanted, robot.lower, robot.upper)
        if found is None:
            return self._least(by_distance(wanted), wanted)
        try:
            return self._members.verified(found[1], found[0])
        except LostMemberError:
            return self._member(*found, wanted)

    def best(self, prefer: Prefer = "nearest") -> Array:
        """The preferred member (dof,) [rad]; see `SolutionSet.best`."""
        members = self._members
        cost = preferences.cost_of(prefer, members.robot, members.verifier.frame)
        return self.nearest() if cost is None else self._least(preferences.with_ties(cost, members.seed), members.seed)

    @property
    def margin(self) -> float:
        """The largest limit margin of a member [rad]; inf for an arm without limits."""
        robot = self._members.robot
        return float(least_margins(robot, self._least(by_margin(robot), self._members.seed)[np.newaxis])[0])

    def sample(self, n: int) -> tuple[Array, Array]:
        """Values of the parameter (n,) and members (n, dof) [rad], spread over the interval; the middle for n = 1.

        Raises:
            InvalidInputError: n is not a positive whole number.
        """
        n = checks.whole_number("n", n, lowest=1)
        if self.start == self.stop:
            p, rows = self._track.polyline()
            places = [0.5 * (len(p) - 1)] if n == 1 else np.linspace(0, len(p) - 1, n, endpoint=not self._is_round)
            chosen = np.round(places).astype(np.intp)
            return p[chosen], np.array([self._member(self.start, q, self._members.seed) for q in rows[chosen]])
        if n == 1:
            p = np.array([0.5 * (self.start + self.stop)])
        else:
            p = np.linspace(self.start, self.stop, n, endpoint=not self._is_round)
        return p, np.array([self._member(value, self._track.at(value), self._members.seed) for value in p.tolist()])

    def places_at_steps(self, p: Array, step: float) -> Array:
        """Where (n,) among values of the parameter (m,) in order its ends and the multiples of a step are, in parts.

        Where the parameter stands still, so many as make about a step of the joints.
        """
        last = float(len(p) - 1)
        if self.start == self.stop:  # a point, or members among which the parameter stands still
            chosen = np.arange(0.0, len(p), max(1, int(step / GUESS_SPACING)))
            return chosen if self._is_round or chosen[-1] == last else np.append(chosen, last)
        inner = step * np.arange(np.floor(self.start / step) + 1.0, np.ceil(self.stop / step))
        inner = inner if inner.size else np.array([0.5 * (self.start + self.stop)])
        between = np.interp(inner, p, np.arange(len(p)))
        whole = self._is_round and self.ends[0].kind == "circle"
        return between if whole else np.concatenate([[0.0], between, [last]])

    def walk(self, step: float) -> tuple[Array, Array]:
        """Values of the parameter (n,) and configurations (n, dof), neighbours at most a step apart [rad].

        Raises:
            InvalidInputError: the step is not positive.
        """
        step = checks.positive("step", step, "rad")
        p, rows = self._track.polyline()
        places = np.append(places_along(np.linalg.norm(np.diff(rows, axis=0), axis=1), step), len(rows) - 1.0)
        nodes = np.arange(len(p))
        return np.interp(places, nodes, p), np.column_stack([np.interp(places, nodes, each) for each in rows.T])

    def drawn(self, step: float) -> tuple[Array, Array]:
        """What `walk` gives, to be drawn: within the limits to about 1e-3 rad, unlimited joints without jumps."""
        p, q = self.walk(step)
        robot, free = self._members.robot, self._members.robot.unlimited
        q = angles.into_limits(q, robot.lower, robot.upper)
        q[:, free] = np.unwrap(q[:, free], axis=0)
        q[:, free] += TURN * np.round((self._members.seed[free] - q[0, free]) / TURN)
        return p, q

    def _member(self, parameter: float, q: Array, seed: Array) -> Array:
        """A configuration (dof,) of the track, in the copies nearest to a seed, verified; or the one beside it."""
        return self._members.on_track(self._track, parameter, q, seed)

    def _least(self, cost: Cost, seed: Array) -> Array:
        """The member (dof,) of the least cost."""
        return least_member(self._members, [self._track], cost, seed)[0]


class CurveSet(SolutionSet):
    """All configurations within the limits that reach a target with one free parameter.

    Attributes:
        intervals: intervals of the parameter, by branch and start; none when nothing within the limits reaches it.
        complete: False when a curve was lost or a table of the kernels was full, so that intervals may be missing.
        branches: how many branches reach the target, within the limits or not; each from fold to fold.
        parameter: what is free: the name of a joint, or "angle" for that about a free axis.
    """

    __slots__ = ("_members", "branches", "complete", "intervals", "parameter")
    dimension = 1
    intervals: tuple[TrackInterval, ...]
    complete: bool
    branches: int
    parameter: str

    def __init__(
        self, intervals: tuple[TrackInterval, ...], members: Members, *, parameter: str, branches: int, complete: bool
    ) -> None:
        """Take intervals of a target."""
        self.intervals, self._members, self.parameter = intervals, members, parameter
        self.branches, self.complete = branches, complete

    def __len__(self) -> int:
        """Number of intervals."""
        return len(self.intervals)

    @property
    def _said(self) -> str:
        """How many intervals on how many branches."""
        return f"{len(self)} intervals of {self.parameter} within the limits, on {self.branches} branches"

    @property
    def q(self) -> Array:
        """(k, dof) the member of each interval nearest to the seed [rad]."""
        rows = [interval.nearest() for interval in self.intervals]
        return checks.read_only(np.array(rows).reshape(len(rows), self._members.robot.dof))

    @property
    def within_limits(self) -> NDArray[np.bool_]:
        """(k,) True: every member is within the limits."""
        return checks.sealed(np.ones(len(self.intervals), dtype=np.bool_))

    @property
    def q_within_limits(self) -> Array:
        """(k, dof) the member of each interval nearest to the seed [rad], all of which are within the limits."""
        return self.q

    @property
    def distance(self) -> Array:
        """(k,) distance of those members to the seed [rad], Euclidean."""
        return checks.sealed(np.linalg.norm(self.q - self._members.seed, axis=1))

    @property
    def position_error(self) -> Array:
        """(k,) of those members [m]."""
        return self._errors[:, 0]

    @property
    def orientation_error(self) -> Array:
        """(k,) of those members [rad]."""
        return self._errors[:, 1]

    @property
    def angle(self) -> Array | None:
        """(k,) angle of those members about the free axis of the target [rad]; None where it has none."""
        if self._members.target.free_axis is None:
            return None
        return checks.sealed(np.array([self._members.parameter(q) for q in self.q]))

    @property
    def singular(self) -> NDArray[np.bool_]:
        """(k,) False: intervals are whole."""
        return checks.sealed(np.zeros(len(self.intervals), dtype=np.bool_))

    @property
    def touching(self) -> Touching | None:
        """Pairs of shapes that touch at each of those members; None when the solver does not look."""
        verifier = self._members.verifier
        return tuple(tuple(verifier.touching(q)) for q in self.q) if verifier.looks_for_contact else None

    @property
    def _errors(self) -> Array:
        """(k, 2) position [m] and orientation [rad] errors of those members."""
        members = self._members
        found = [members.verifier.measure(q, members.target.at(members.parameter(q))) for q in self.q]
        return checks.sealed(np.array(found, dtype=np.float64).reshape(-1, 2))

    @property
    def margin(self) -> Array:
        """(k, dof) distance of those members to the nearer limit [rad]; inf on unlimited joints."""
        return checks.read_only(limit_margins(self._members.robot, self.q))

    def nearest(self, seed: ArrayLike | None = None) -> Array | None:
        """The member (dof,) [rad] nearest to a seed, None for the seed of the set; None when there is no member.

        Raises:
            InvalidInputError: a malformed seed, or one more than 1e6 rad from zero.
        """
        start = self._members.near(seed)
        members = [interval.nearest(start) for interval in self.intervals]
        return min(members, key=lambda q: float(np.linalg.norm(q - start)), default=None)

    def best(self, prefer: Prefer = "nearest") -> Array | None:
        """The preferred member (dof,) [rad]; see `SolutionSet.best`."""
        members = self._members
        cost = preferences.cost_of(prefer, members.robot, members.verifier.frame)
        if cost is None:
            return self.nearest()
        best = self.choose(preferences.with_ties(cost, members.seed), members.seed)
        return None if best is None else best[0]

    def choose(self, cost: Cost, seed: Array) -> tuple[Array, float] | None:
        """The member (dof,) of the least cost and its parameter [rad]; of equal ones the first in order.

        Args:
            cost: of rows (m, dof), see `preferences`.
            seed: (dof,) unlimited joints take the copies nearest to it.
        """
        tracks = [interval._track for interval in self.intervals]
        return least_member(self._members, tracks, cost, seed) if tracks else None

    def sample(self, n: int) -> Array:
        """Members (k, dof) [rad] spread over all intervals in proportion to their lengths.

        Args:
            n: how many; k is n, or the number of intervals if that is more (each has one at least); 0 without members.

        Raises:
            InvalidInputError: n is not a positive whole number.
        """
        n = checks.whole_number("n", n, lowest=1)
        rows = [interval.sample(count)[1] for interval, count in zip(self.intervals, self._shares(n), strict=True)]
        return np.concatenate(rows) if rows else np.empty((0, self._members.robot.dof))

    def spread(self, step: float) -> tuple[Array, Array]:
        """Values of the parameter (k,) and configurations (k, dof) [rad] of all intervals, for who refines them.

        The ends of each, unless nothing ends there; between them, whole multiples of a step, to about 1e-3 rad; at
        least one. Angles are in any 2 pi copy, and not looked at.
        """
        if not self.intervals:
            return np.empty(0), np.empty((0, self._members.robot.dof))
        p, rows, begins = polylines([interval._track for interval in self.intervals])
        places = [
            start + interval.places_at_steps(p[start:end], step)
            for interval, start, end in zip(self.intervals, begins[:-1].tolist(), begins[1:].tolist(), strict=True)
        ]
        place = np.concatenate(places)
        before = np.minimum(place.astype(np.intp), len(p) - 1)
        part, after = place - before, np.minimum(before + 1, len(p) - 1)
        return (1.0 - part) * p[before] + part * p[after], rows[before] + part[:, None] * (rows[after] - rows[before])

    def least_and_others(self, cost: Callable[[Array], Array], step: float = np.inf) -> tuple[Array, Array]:
        """Values of the parameter (k,) and members (k, dof) [rad]: of each interval one of least cost, and some others.

        Args:
            cost: (m,) of rows (m, dof), in the copies nearest to the seed; looked at `LOOKED_AT` apart.
            step: the others are about so far apart along each interval, both ends among them; infinite for none [rad].
        """
        members, tracks = self._members, [interval._track for interval in self.intervals]
        if not tracks:
            return np.empty(0), np.empty((0, members.robot.dof))
        p, rows, begins = polylines(tracks, LOOKED_AT)
        rows = members.copies(rows, members.seed)
        costs, chosen = cost(rows), list[Array]()
        for first, end in itertools.pairwise(begins.tolist()):
            others = np.linspace(first, end - 1, 1 + math.ceil((end - first) * LOOKED_AT / step))
            others = others[: 0 if math.isinf(step) else None]
            chosen.append(np.unique(np.append(np.round(others), first + np.argmin(costs[first:end]))))
        place = np.concatenate(chosen).astype(np.intp)
        on = [tracks[number] for number in np.repeat(np.arange(len(tracks)), list(map(len, chosen))).tolist()]
        return members.led_to(on, p[place], rows[place])

    def parameter_of(self, q: ArrayLike) -> float:
        """The parameter [rad] of a member (dof,): in [-pi, pi] about a free axis; else the angle of that joint.

        Raises:
            InvalidInputError: a malformed q.
        """
        return self._members.parameter(self._members.robot.configuration(q))

    def plot(self, path: str | Path) -> None:
        """Draw the other joints over the parameter; see `SolutionSet.plot`."""
        robot = self._members.robot
        runs = [(interval, *interval.drawn(picture.STEP)) for interval in self.intervals]
        picture.write(path, lambda: picture.draw_curves(runs, self.parameter, robot, self._said))

    def _shares(self, n: int) -> list[int]:
        """How many samples each interval gets: one each, the rest by length."""
        counts = [1] * len(self.intervals)
        lengths = [interval.length for interval in self.intervals]
        for _ in range(n - len(counts) if counts else 0):
            index = max(range(len(counts)), key=lambda i: lengths[i] / counts[i])
            counts[index] += 1
        return counts
