"""`Family`: all configurations that reach a target with one free parameter, as intervals of the parameter.

The parameter p [rad] is the angle about the free axis of a `FreeAxis`, or joint 3 of a seven-joint arm. On a branch,
the configuration is a smooth function of p, from one fold to another (where two branches meet) or all the way round.
What is within the limits of a branch is some intervals of p.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, JacokinError
from jacokin.ik.families.tracks import GUESS_SPACING, Track, last_finite, refine
from jacokin.ik.preferences import Cost, by_distance, by_margin, copies_to_try
from jacokin.ik.seeds import seed_within_limits
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Candidate, Verifier
from jacokin.model import angles, checks
from jacokin.model.angles import TURN
from jacokin.model.robot import Robot

#: [m] and [rad]; members of a family close this well.
MEMBER_CLOSURE = 1e-9
#: Gauss-Newton steps for what closes worse, and the relative size of motions that they leave out. Where joints are on
#: limits and curves meet, each halves what is left.
SETTLING_STEPS, NO_MOTION = 16, 1e-4
#: [m] and [rad] where they end.
SETTLED = 1e-13
#: [rad] joints that nearly pass their limits at once are looked at.
AT_ONCE = 0.01
#: [rad] a value of the parameter this far outside an interval is at its end.
PARAMETER_SLACK = 1e-9


class LostMemberError(JacokinError):
    """A point of a curve that does not reach the target within the limits, though both ends of its piece do."""


@dataclass(frozen=True, slots=True, eq=False)
class Members:
    """One target of one arm."""

    verifier: Verifier
    target: TargetPose
    seed: Array
    """(dof,) unlimited joints take the 2 pi copy nearest to this [rad]."""

    @property
    def robot(self) -> Robot:
        """The arm."""
        return self.verifier.robot

    def parameter(self, q: Array) -> float:
        """The parameter [rad] of a configuration (dof,)."""
        free = self.target.free_axis
        return float(q[2]) if free is None else free.parameter_of(self.verifier.tool_pose(q).rotation)

    def candidate(self, q: Array, parameter: float) -> Candidate:
        """A member (dof,) in the copies that are wanted, with its parameter [rad] in the range of the target."""
        free = self.target.free_axis
        if free is None:
            p = float(q[2])  # joint 3 itself, in its copy
        else:
            p = float(angles.wrap_to_pi(parameter)) if free.full_turn else self.target.nearest_angle(parameter)
        return Candidate(q, self.target.at(p), f"parameter {p:.6g} rad", p)

    def near(self, seed: ArrayLike | None) -> Array:
        """A seed (dof,) moved inside the limits [rad]; None for the seed of the family.

        Raises:
            InvalidInputError: malformed, or more than 1e6 rad from zero.
        """
        return self.seed if seed is None else seed_within_limits(self.robot, seed)[0]

    def copies(self, q: Array, seed: Array) -> Array:
        """(..., dof) the copies within the limits nearest to a seed (dof,)."""
        return angles.into_limits(angles.nearest_copy(q, seed), self.robot.lower, self.robot.upper)

    def on_limits(self, q: Array) -> Array:
        """A configuration (dof,) moved onto the limits it is past by rounding.

        NaN where a joint that has more than a turn of room is farther outside: others end their interval there.
        """
        inside = np.clip(q, self.robot.lower, self.robot.upper)
        far = np.abs(inside - q) > self.verifier.options.limit_snap
        return np.full(len(q), np.nan) if (far & self.wide).any() else inside

    @property
    def wide(self) -> NDArray[np.bool_]:
        """(dof,) limited joints that have several copies of some angles within their limits."""
        room = self.robot.upper - self.robot.lower
        return np.isfinite(room) & (room >= TURN)

    def verified(self, q: Array, parameter: float) -> Array:
        """A configuration (dof,) that reaches the target and is within the limits, exactly.

        Raises:
            LostMemberError: it does not, which is not known to happen but where curves meet on a limit.
        """
        errors = self.verifier.measure(q, self.target.at(parameter))
        if max(errors) > MEMBER_CLOSURE:  # a joint that is near its limit all along, moved onto it
            q = self._settled(q, parameter)
            errors = self.verifier.measure(q, self.target.at(parameter))
        if max(errors) > MEMBER_CLOSURE or not self.robot.within_limits(q):
            raise LostMemberError(
                f"internal error: a member of a family misses its target by {errors[0]:.3g} m and "
                f"{errors[1]:.3g} rad, please report it"
            )
        return q

    def _settled(self, q: Array, parameter: float) -> Array:
        """A configuration (dof,) brought nearer to the target by the joints that are not on a limit."""
        robot, pose = self.robot, self.target.at(parameter)
        held = (q == robot.lower) | (q == robot.upper)
        goal = pin.SE3(pose.rotation, pose.position)
        for _ in range(SETTLING_STEPS):
            error = pin.log6(self.verifier.tool_pose(q).actInv(goal)).vector
            if np.abs(error).max() < SETTLED:
                break
            moving = np.where(held, 0.0, robot.jacobian(q, frame=self.verifier.frame, reference="local"))
            if self.verifier.tool is not None:
                moving = self.verifier.tool.toActionMatrixInverse() @ moving
            q = q + np.linalg.pinv(moving, rcond=NO_MOTION) @ error
        return self.copies(q, q)


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

    @property
    def _is_round(self) -> bool:
        """Whether the end is the start again."""
        return self.ends[1].kind == "circle"

    def contains(self, parameter: float) -> bool:
        """Whether a value of the parameter, or one whole turns away, is in the interval."""
        return self._moved_inside(checks.number("parameter", parameter, "rad")) is not None

    def at(self, parameter: float, seed: ArrayLike | None = None) -> Array:
        """The member (dof,) [rad] where the parameter has a value.

        Where curves meet just as a joint comes to its limit, rounding may leave none there: the one beside it, then.

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
        return self.member(p, self._track.at(p), self._members.near(seed))

    def nearest(self, seed: ArrayLike | None = None) -> Array:
        """The member (dof,) [rad] nearest to a seed; None for the seed of the family."""
        wanted = self._members.near(seed)
        found = None if self._members.wide.any() else self._track.nearest(wanted)
        return choose([self], by_distance(wanted), wanted)[0] if found is None else self.member(*found, wanted)

    def widest(self) -> Array:
        """The member (dof,) [rad] with the largest limit margin."""
        return choose([self], by_margin(self._members.robot), self._members.seed)[0]

    @property
    def margin(self) -> float:
        """The largest limit margin of a member [rad]; inf for an arm without limits."""
        cost = by_margin(self._members.robot)
        return -float(cost(choose([self], cost, self._members.seed)[0][np.newaxis])[0])

    def sample(self, n: int) -> tuple[Array, Array]:
        """Values of the parameter (n,) and members (n, dof) [rad], spread over the interval; the middle for n = 1."""
        if self.start == self.stop:
            p, rows = self._track.polyline()
            places = [0.5 * (len(p) - 1)] if n == 1 else np.linspace(0, len(p) - 1, n, endpoint=not self._is_round)
            chosen = np.round(places).astype(np.intp)
            return p[chosen], np.array([self.member(self.start, q, self._members.seed) for q in rows[chosen]])
        if n == 1:
            p = np.array([0.5 * (self.start + self.stop)])
        else:
            p = np.linspace(self.start, self.stop, n, endpoint=not self._is_round)
        return p, np.array([self.member(value, self._track.at(value), self._members.seed) for value in p.tolist()])

    def spread(self, step: float) -> tuple[Array, Array]:
        """Values of the parameter (n,) and configurations (n, dof) [rad], for callers that refine them.

        The ends exactly, unless nothing ends there; between them, whole multiples of a step, to about 1e-3 rad; at
        least one. Angles are in any 2 pi copy, and not looked at.
        """
        p, rows = self._track.polyline()
        if self.start == self.stop:  # a point, or members among which the parameter stands still
            chosen = np.arange(0, len(p), max(1, int(step / GUESS_SPACING)))
            if not self._is_round:
                chosen = np.unique(np.append(chosen, len(p) - 1))
            return p[chosen], rows[chosen]
        inner = step * np.arange(np.floor(self.start / step) + 1.0, np.ceil(self.stop / step))
        inner = inner if inner.size else np.array([0.5 * (self.start + self.stop)])
        between = np.column_stack([np.interp(inner, p, column) for column in rows.T])
        if self._is_round and self.ends[0].kind == "circle":
            return inner, between
        return np.concatenate([p[:1], inner, p[-1:]]), np.vstack([rows[0], between, rows[-1]])

    def walk(self, step: float) -> tuple[Array, Array]:
        """As `spread`: values of the parameter (n,) and configurations (n, dof), neighbours at most a step apart [rad].

        Where curves turn back, the parameter hardly changes and joints do.
        """
        p, rows = self._track.polyline()
        counts = np.maximum(1, np.ceil(np.linalg.norm(np.diff(rows, axis=0), axis=1) / step).astype(np.intp))
        chord = np.repeat(np.arange(len(counts)), counts)
        within = np.arange(len(chord)) - np.repeat(np.cumsum(counts) - counts, counts)
        places = np.append(chord + within / counts[chord], len(counts))
        nodes = np.arange(len(p))
        return np.interp(places, nodes, p), np.column_stack([np.interp(places, nodes, each) for each in rows.T])

    def member(self, parameter: float, q: Array, seed: Array) -> Array:
        """A configuration (dof,) of the track, in the copies nearest to a seed, verified; or the one beside it."""
        try:
            return self.exact_member(parameter, q, seed)
        except LostMemberError:
            return self._beside(parameter, seed)

    def exact_member(self, parameter: float, q: Array, seed: Array) -> Array:
        """As `member`, or not at all.

        Raises:
            LostMemberError: it misses the target.
        """
        return self._members.verified(self._members.copies(q, seed), parameter)

    def _beside(self, parameter: float, seed: Array) -> Array:
        """The member (dof,) next to where there should be one.

        Raises:
            LostMemberError: there is none anywhere near.
        """
        p, rows = self._track.polyline()
        lost: LostMemberError | None = None
        for index in np.argsort(np.abs(p - parameter), kind="stable").tolist():
            try:
                return self.exact_member(float(p[index]), rows[index], seed)
            except LostMemberError as error:
                lost = error
        assert lost is not None  # a track has points
        raise lost

    def _moved_inside(self, p: float) -> float | None:
        moved = p + TURN * round((0.5 * (self.start + self.stop) - p) / TURN)
        if self.start <= p <= self.stop:
            return p
        if not self.start - PARAMETER_SLACK <= moved <= self.stop + PARAMETER_SLACK:
            return None
        return min(max(moved, self.start), self.stop)


def choose(intervals: Sequence[Interval], cost: Cost, seed: Array) -> tuple[Array, float]:
    """The member (dof,) of the least cost on one or more intervals, and its parameter [rad].

    Guesses all along tell where minima may be; a minimum is looked at unless the change from guess to guess leaves no
    doubt that it is worse than the best one found.
    """
    members = intervals[0]._members
    looks: list[_Look] = []
    for number, interval in enumerate(intervals):
        coordinates, rows = interval._track.guesses()
        for copies in copies_to_try(cost.copies, rows, seed, members.robot):
            looks += _places_to_look(number, coordinates, rows, copies, cost)
        looks += _glances(number, interval, coordinates, rows, seed)
        looks += _corners(number, interval, coordinates, rows, seed)

    def look(place: _Look) -> tuple[float, float]:
        track, turns = intervals[place.interval]._track, TURN * place.turns

        def exact(coordinate: float) -> Array:
            return members.on_limits(track.joints(coordinate) + turns)

        return refine(lambda rows: _cost_or_inf(cost, rows), place.coordinates, place.guess, exact)

    lowest, minimums = math.inf, []
    for place in sorted(looks, key=lambda place: place.bound):
        if place.bound >= lowest:
            break
        value, coordinate = look(place)
        minimums.append((value, coordinate, place))
        lowest = min(lowest, value)
    minimums.sort(key=lambda minimum: minimum[0])
    for _, coordinate, place in minimums:
        p, q = intervals[place.interval]._track.point(coordinate)
        try:
            return members.verified(members.on_limits(q + TURN * place.turns), p), p
        except LostMemberError:
            continue  # the next best one
    _, coordinate, place = minimums[0]  # an interval has a minimum
    p, q = intervals[place.interval]._track.point(coordinate)
    return intervals[place.interval].member(p, q, seed), p


class _Look(NamedTuple):
    """A place where a minimum may be."""

    bound: float
    """What leaves no doubt to be less than the cost near by."""
    interval: int
    guess: int
    """Which one is the least near by."""
    coordinates: Array
    """(m,) of all guesses along the track."""
    turns: Array
    """(dof,) by which the angles differ from those of the track."""


def _places_to_look(number: int, coordinates: Array, rows: Array, copies: Array, cost: Cost) -> list[_Look]:
    """Local minima among the guesses (m, dof) of a track in some copies, NaN where those are outside the limits.

    Where joints go on in other copies, the cost may jump: such runs are looked at one by one.
    """
    turns = np.round((copies - rows) / TURN)
    values = _cost_or_inf(cost, copies)
    apart = (turns[1:] != turns[:-1]).any(axis=1)  # NaN too
    inner = np.where(apart, np.inf, values[:-1]), np.where(apart, np.inf, values[1:])
    left, right = np.concatenate([[np.inf], inner[0]]), np.concatenate([inner[1], [np.inf]])
    chosen = np.flatnonzero(np.isfinite(values) & (values <= left) & (values <= right))
    value, left, right = values[chosen], left[chosen], right[chosen]
    change = np.maximum(np.where(np.isfinite(left), left, value), np.where(np.isfinite(right), right, value)) - value
    alone = np.isinf(left) & np.isinf(right)  # nothing says how the cost changes
    bounds = np.where(alone, -np.inf, value - change)
    return [
        _Look(float(bound), number, int(index), coordinates, turns[index])
        for bound, index in zip(bounds, chosen, strict=True)
    ]


def _glances(number: int, interval: Interval, coordinates: Array, rows: Array, seed: Array) -> Iterator[_Look]:
    """Where a joint with more than a turn of room is within its limits in another copy, between two guesses only."""
    members, track = interval._members, interval._track
    snap = members.verifier.options.limit_snap
    for joint, limit, side in _wide_limits(members):

        def beyond(q: Array, joint: int = joint, limit: float = limit, side: float = side) -> Array:
            return np.asarray(angles.wrap_to_pi(side * (q[:, joint] - limit)))

        here = beyond(rows)
        padded = np.concatenate([here[1:2], here, here[-2:-1]])
        left, right = padded[:-2], padded[2:]
        local = (here > 0.0) & (here <= left) & (here <= right) & (here <= np.maximum(left, right) - here)
        for index in np.flatnonzero(local).tolist():
            excess, coordinate = refine(beyond, coordinates, index, track.joints)
            if excess <= snap:
                around = coordinates[[max(index - 1, 0), 0, min(index + 1, len(rows) - 1)]]
                around[1] = coordinate
                q = track.joints(coordinate)
                copies = _turns(members, q, seed, snap)
                copies[joint] = np.round((limit - q[joint]) / TURN)
                yield _Look(-math.inf, number, 1, around, copies)


def _corners(number: int, interval: Interval, coordinates: Array, rows: Array, seed: Array) -> Iterator[_Look]:
    """Where a joint with more than a turn of room comes in, and another leaves, between two guesses only."""
    members, track = interval._members, interval._track
    wide, snap, limits = np.flatnonzero(members.wide), members.verifier.options.limit_snap, _wide_limits(members)
    if len(wide) < 2:
        return
    lower, upper = members.robot.lower[wide], members.robot.upper[wide]

    def is_seen(chord: int, turns: Array) -> bool:
        q = (rows[chord : chord + 2] + TURN * turns)[:, wide]
        return bool(((lower <= q) & (q <= upper)).all(axis=1).any())

    def on_limits(q: Array, slack: float) -> set[int]:
        return {joint for joint, limit, _ in limits if abs(angles.wrap_to_pi(q[joint] - limit)) <= slack}

    for joint, limit, _ in limits:
        excess = np.asarray(angles.wrap_to_pi(rows[:, joint] - limit))
        passed = (excess[1:] * excess[:-1] <= 0.0) & (np.abs(np.diff(excess)) < math.pi)
        for chord in np.flatnonzero(passed).tolist():
            first, last = excess[chord : chord + 2].tolist()
            q = rows[chord] + (first / (first - last) if first != last else 0.0) * (rows[chord + 1] - rows[chord])
            alone = on_limits(q, AT_ONCE) <= {joint}
            if alone and all(is_seen(chord, _turns(members, q, seed, slack)) for slack in (AT_ONCE, GUESS_SPACING)):
                continue
            around = coordinates[[max(chord - 1, 0), chord, min(chord + 2, len(rows) - 1)]]

            def beyond(coordinate: float, joint: int = joint, limit: float = limit) -> float:
                return float(angles.wrap_to_pi(track.joints(coordinate)[joint] - limit))

            start = beyond(float(around[0]))

            def not_passed(coordinate: float, start: float = start) -> float:
                return 0.0 if beyond(coordinate) * start >= 0.0 else math.inf

            around[1] = last_finite(not_passed, (0.0, float(around[0])), float(around[2]))[1]
            q = track.joints(float(around[1]))
            turns = _turns(members, q, seed, snap)
            if not on_limits(q, snap) <= {joint} or not is_seen(chord, turns):
                yield _Look(-math.inf, number, 1, around, turns)


def _wide_limits(members: Members) -> list[tuple[int, float, float]]:
    """Joints with more than a turn of room: each with its limits [rad], the lower one with -1, the upper one with 1."""
    robot = members.robot
    return [
        (joint, float(limits[joint]), side)
        for joint in np.flatnonzero(members.wide).tolist()
        for limits, side in ((robot.lower, -1.0), (robot.upper, 1.0))
    ]


def _turns(members: Members, q: Array, seed: Array, slack: float) -> Array:
    """Turns (dof,) to add to q (dof,) for the copies nearest to a seed: within the limits, but for a slack [rad].

    Only joints with more than a turn of room are given that slack.
    """
    turns = np.round((members.copies(q, seed) - q) / TURN)
    for joint, limit, _ in _wide_limits(members):
        at_limit = np.round((limit - q[joint]) / TURN)
        if abs(q[joint] + TURN * at_limit - limit) <= slack:
            choices = (at_limit, turns[joint])
            turns[joint] = min(choices, key=lambda turn: abs(q[joint] + TURN * turn - seed[joint]))
    return np.asarray(turns)


def _cost_or_inf(cost: Cost, rows: Array) -> Array:
    """Costs (m,) of rows (m, dof); infinite where rows are NaN."""
    values, there = np.full(len(rows), np.inf), ~np.isnan(rows).any(axis=1)
    if there.any():
        values[there] = cost(rows[there])
    return values


class Family:
    """All configurations within the limits that reach a target with one free parameter. Immutable.

    Attributes:
        intervals: intervals of the parameter, by branch and start; none when nothing within the limits reaches it.
        complete: False when a curve was lost or a table of the kernels was full, so that intervals may be missing.
        branches: how many branches reach the target, within the limits or not; each from fold to fold.
    """

    __slots__ = ("_members", "branches", "complete", "intervals")
    has_parameter = True

    def __init__(
        self,
        intervals: tuple[Interval, ...],
        members: Members,
        *,
        branches: int,
        complete: bool,
    ) -> None:
        """Take intervals of a target."""
        self.intervals, self._members = intervals, members
        self.branches, self.complete = branches, complete

    def __len__(self) -> int:
        """Number of intervals."""
        return len(self.intervals)

    def __iter__(self) -> Iterator[Interval]:
        """The intervals."""
        return iter(self.intervals)

    def __repr__(self) -> str:
        """How many intervals on how many branches."""
        return f"Family({len(self)} intervals within the limits, {self.branches} branches)"

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
    def margin(self) -> Array:
        """(k, dof) distance of those members to the nearer limit [rad]; inf on unlimited joints."""
        q, robot = self.q, self._members.robot
        return checks.read_only(np.minimum(q - robot.lower, robot.upper - q))

    def nearest(self, seed: ArrayLike | None = None) -> Array | None:
        """The member (dof,) [rad] nearest to a seed, None for the seed of the family; None when there is no member.

        Raises:
            InvalidInputError: a malformed seed, or one more than 1e6 rad from zero.
        """
        start = self._members.near(seed)
        members = [interval.nearest(start) for interval in self.intervals]
        return min(members, key=lambda q: float(np.linalg.norm(q - start)), default=None)

    def widest(self) -> Array | None:
        """The member (dof,) [rad] with the largest limit margin; None when there is no member."""
        best = self.choose(by_margin(self._members.robot), self._members.seed)
        return None if best is None else best[0]

    def choose(self, cost: Cost, seed: Array) -> tuple[Array, float] | None:
        """The member (dof,) of the least cost and its parameter [rad]; of equal ones the first in order.

        Args:
            cost: of rows (m, dof), see `preferences`.
            seed: (dof,) unlimited joints take the copies nearest to it.
        """
        return choose(self.intervals, cost, seed) if self.intervals else None

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

    def parameter(self, q: ArrayLike) -> float:
        """The parameter [rad] of a member (dof,): in [-pi, pi] about a free axis; the angle of joint 3 itself.

        Raises:
            InvalidInputError: a malformed q.
        """
        return self._members.parameter(self._members.robot.configuration(q))

    def _shares(self, n: int) -> list[int]:
        """How many samples each interval gets: one each, the rest by length."""
        counts = [1] * len(self.intervals)
        lengths = [interval.length for interval in self.intervals]
        for _ in range(n - len(counts) if counts else 0):
            index = max(range(len(counts)), key=lambda i: lengths[i] / counts[i])
            counts[index] += 1
        return counts
