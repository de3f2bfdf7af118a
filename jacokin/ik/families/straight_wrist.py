"""`StraightWrist`: axes before and after the middle joint of a wrist that are one line turn against each other.

The tool stays, and so does the parameter of the family: these members are a circle with a parameter of its own, the
turn of the joint before the middle one. Curves of the family pass the circle; their determinant changes its sign there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.families.curves import CurveProblem
from jacokin.ik.families.edge import STUCK, Edge, axis_in_base
from jacokin.ik.families.tracks import GUESS_SPACING, Track
from jacokin.kernels.self_motion.slices import SAME_PARAMETER
from jacokin.model import angles
from jacokin.model.angles import TURN
from jacokin.model.poses import FreeAxis

#: Cosine of axes that are square, and [m] and [rad] of those that are one line: rounding.
EXACT = 1e-9
#: Sine of the middle joint's angle from straight, up to which points of curves are brought to a straight wrist.
NEARLY_STRAIGHT = 0.6
#: The same where no curve was lost.
TOUCHING = 0.05
#: [rad] a wrist that is bent by less is so by little more than rounding: how its outer joints turn is uncertain then.
ALMOST_STRAIGHT = 1e-5
#: Starts at most, steps of each, and the longest one [rad].
STARTS, STEPS, LONGEST_STEP = 24, 40, 0.3
#: [m] and [rad]: what is FAR is given up at once, and what is not NEAR after the first steps.
FIRST_STEPS, FAR, NEAR = 6, 1.0, 1e-4
#: [m] and [rad]: rounding. A wrist that is straight but for 1e-9 rad has no circle, but curves that turn quickly there.
CIRCLE_CLOSURE = 1e-12
#: The same where there is nearly a circle.
ALMOST_CIRCLE = 1e-7
#: Relative size of motions that do not move the tool, and [m] and [rad] where steps end.
NO_MOTION, CLOSED = 1e-9, 1e-14
#: [rad] circles that differ by less are one, or curves between them turn too quickly to be seen; and a joint past its
#: limit by no more may be on it.
SAME_CIRCLE, NEARLY_SAME, NEAR_LIMIT = 1e-4, 1e-2, 1e-5


class StraightWrist:
    """Finds the circles of one arm; immutable, and may be shared between threads."""

    __slots__ = ("_edge", "_straight", "_turns")

    def __init__(self, edge: Edge) -> None:
        """Measure at which angle of the joint before the last one the wrist is straight."""
        self._edge = edge
        #: [rad] one of two angles, half a turn apart; None where the wrist is never straight.
        self._straight: float | None = None
        #: How the joints (dof,) turn along the circles at that angle, and at the other one.
        self._turns: list[Array] = []
        q = np.zeros((1, edge.chain.dof))
        before, middle, last = edge.chain.placements(q).angular[0, -3:]
        if max(abs(before @ middle), abs(last @ middle)) > EXACT:
            return
        angle = math.atan2(float(middle @ np.cross(last, before)), float(before @ last))
        for half in range(2):
            q[0, -2] = angle + half * math.pi
            placed = edge.chain.placements(q)
            twists = np.hstack([placed.linear[0], placed.angular[0]])
            sign = math.copysign(1.0, float(twists[-3, 3:] @ twists[-1, 3:]))
            if np.abs(twists[-1] - sign * twists[-3]).max() > EXACT:
                return
            turn = np.zeros(edge.chain.dof)
            turn[-3], turn[-1] = 1.0, -sign
            self._turns.append(turn)
        self._straight = angle

    def turn(self, q: Array, bent: float = EXACT) -> Array | None:
        """How the joints (dof,) turn against each other at a configuration (dof,); None where it is bent more."""
        if self._straight is None:
            return None
        half = round((float(q[-2]) - self._straight) / math.pi)
        straight = abs(float(q[-2]) - self._straight - half * math.pi) < bent
        return self._turns[half % 2] if straight else None

    def starts(self, arcs: Sequence[Array], farthest: float) -> Array:
        """Nodes (k, 7) of curves where they come nearest to straight, to a sine that is no larger than the farthest."""
        rows = [np.empty((0, 8))]
        for nodes in arcs:
            away = self._away(nodes)
            padded = np.concatenate([[np.inf], away, [np.inf]])
            local = (away <= padded[:-2]) & (away <= padded[2:]) & (away < farthest)
            rows.append(np.column_stack([nodes[local, :7], away[local]]))
        nearest = np.vstack(rows)
        return np.asarray(nearest[np.argsort(nearest[:, 7], kind="stable"), :7][:STARTS])

    def circles(self, x: Array, problem: CurveProblem) -> list[WristTrack]:
        """The circles near rows (k, 7), points of curves or near them; within the limits or not."""
        if self._straight is None or not len(x):
            return []
        middle = self._edge.chain.dof - 2
        x, closure = self._straightened(x, problem)
        x = x[(closure <= CIRCLE_CLOSURE) & _in_range(x, problem.free_axis)]
        held = np.zeros(x.shape, dtype=np.bool_)
        held[:, middle] = True
        # Joints that are on a limit all along are so but for rounding, or for what a double root leaves.
        inside = self._edge.inside(x)
        over = np.abs(angles.wrap_to_pi(x - inside))
        over[:, [middle - 1, middle + 1]] = 0.0
        on_limit = (over > 0.0) & (over <= NEAR_LIMIT)
        near = np.flatnonzero(on_limit.any(axis=1))
        if len(near):
            moved, closure = self._close(np.where(on_limit, inside, x)[near], (held | on_limit)[near], problem)
            x[near[closure <= CIRCLE_CLOSURE]] = moved[closure <= CIRCLE_CLOSURE]
        found: list[WristTrack] = []
        for row in x:
            half = round((row[middle] - self._straight) / math.pi) % 2
            p = float(angles.wrap_to_pi(row[problem.arm.parameter]))
            found = with_others(found, [WristTrack(row[: middle + 2], self._turns[half], p, 0.0, TURN)])
        return found

    def hides_any(self, x: Array, problem: CurveProblem) -> bool:
        """Whether members near rows (k, 7) may not be seen: nearly on circles, and the tool can hardly move otherwise.

        Curves turn quickly there, and may do so where no others lead.
        """
        if self._straight is None or not len(x):
            return False
        x, closure = self._straightened(x, problem)
        x = x[(closure > CIRCLE_CLOSURE) & (closure <= ALMOST_CIRCLE)]
        return len(x) > 0 and bool((self._edge.mobility(x, problem) < STUCK).any())

    def _straightened(self, x: Array, problem: CurveProblem) -> tuple[Array, Array]:
        """Rows (k, 7) with straight wrists as near to the target as they come, and their closures (k,)."""
        assert self._straight is not None  # what callers look at
        middle = self._edge.chain.dof - 2
        x = x.copy()  # moved in place
        x[:, middle] = self._straight + math.pi * np.round((x[:, middle] - self._straight) / math.pi)
        held = np.zeros(x.shape, dtype=np.bool_)
        held[:, middle] = True
        return self._close(x, held, problem)

    def _away(self, nodes: Array) -> Array:
        """Sines (m,) of the angles from straight at nodes (m, 14); 1 where the wrist is never straight."""
        if self._straight is None:
            return np.ones(len(nodes))
        return np.abs(np.sin(nodes[:, self._edge.chain.dof - 2] - self._straight))

    def _close(self, x: Array, held: NDArray[np.bool_], problem: CurveProblem) -> tuple[Array, Array]:
        """Rows (k, 7) brought to the target with some joints held, in place; and their closures (k,).

        Where curves touch a circle instead of crossing it, they do so in a double root: each step halves what is left.
        """
        axis = axis_in_base(problem)
        closure, moving = np.full(len(x), np.inf), np.arange(len(x))
        for step in range(STEPS):
            error, jacobian = self._edge.linearised(x[moving], problem.T, axis)
            closure[moving] = np.maximum(np.linalg.norm(error[:, :3], axis=1), np.linalg.norm(error[:, 3:], axis=1))
            on = (closure[moving] > CLOSED) & (closure[moving] < (FAR if step < FIRST_STEPS else NEAR))
            moving, error, jacobian = moving[on], error[on], jacobian[on]
            if not len(moving):
                break
            jacobian = np.where(held[moving, None], 0.0, jacobian)
            change = (np.linalg.pinv(jacobian, rcond=NO_MOTION) @ error[:, :, None])[:, :, 0]
            x[moving] += change / np.maximum(1.0, np.abs(change).max(axis=1) / LONGEST_STEP)[:, None]
        return x, closure


def with_others(circles: list[WristTrack], others: Sequence[WristTrack]) -> list[WristTrack]:
    """Whole circles, and those of some others that are none of them."""
    new = [
        other
        for other in others
        if not any(
            circle.passes(other.at(other.start)) and _apart(other.start, circle.start) < SAME_CIRCLE
            for circle in circles
        )
    ]
    return [*circles, *new]


def nearly_meet(circles: Sequence[WristTrack]) -> bool:
    """Whether two circles are nearly the same: curves that lead from the one to the other may not have been seen."""
    return any(
        circle.distance(other.at(other.start)) < NEARLY_SAME
        for number, circle in enumerate(circles)
        for other in circles[:number]
    )


def _in_range(x: Array, free: FreeAxis | None) -> NDArray[np.bool_]:
    """Which of the rows (k, 7) have an angle about the free axis that its range allows."""
    if free is None or free.full_turn:
        return np.ones(len(x), dtype=np.bool_)
    middle, half = 0.5 * (free.range[0] + free.range[1]), 0.5 * (free.range[1] - free.range[0])
    return np.asarray(np.abs(angles.wrap_to_pi(x[:, 6] - middle)) <= half + SAME_PARAMETER)


def _apart(a: float, b: float) -> float:
    return abs(math.remainder(a - b, TURN))


class WristTrack(Track):
    """Members of one circle; the coordinate is the turn of the joint before the middle one."""

    __slots__ = ("_first", "_last", "_q", "_turn", "start", "stop")

    def __init__(self, q: Array, turn: Array, parameter: float, first: float, last: float) -> None:
        """Take a member (dof,), how joints turn with the coordinate (dof,), and the coordinates of both ends [rad]."""
        self._q, self._turn, self._first, self._last = q, turn, first, last
        self.start = self.stop = parameter

    def passes(self, q: Array) -> bool:
        """Whether a configuration (dof,) is on the circle."""
        return self.distance(q) < SAME_CIRCLE

    def distance(self, q: Array) -> float:
        """How far the joints that do not turn are from those of a configuration (dof,), the farthest one [rad]."""
        return float(np.abs(angles.wrap_to_pi(q - self._q))[self._turn == 0.0].max())

    def within(self, lower: Array, upper: Array) -> list[tuple[WristTrack, tuple[int, int]]]:
        """Its parts within limits (dof,), and what ends them: 2 j and 2 j + 1 for the limits of joint j, or -1."""
        fixed = self._turn == 0.0
        inside = angles.into_limits(self._q, lower, upper)
        if (np.abs(angles.wrap_to_pi(inside - self._q))[fixed] > EXACT).any():
            return []
        parts = [(0.0, TURN, -1, -1)]
        for j in np.flatnonzero(~fixed).tolist():
            if upper[j] - lower[j] < TURN:
                parts = [both for part in parts for both in self._cut(part, j, float(lower[j]), float(upper[j]))]
        return [
            (WristTrack(self._q, self._turn, self.start, first, last), (code, end)) for first, last, code, end in parts
        ]

    def corners(self, lower: Array, upper: Array, past: float = NEAR_LIMIT) -> Array:
        """Rows (k, 7) of a circle that is outside limits (dof,) by so little that it may be known no better.

        One of the joints that turn is on a limit there, and none is farther past its own than so [rad].
        """
        places = [
            float(self._turn[j] * (limits[j] - self._q[j]))
            for j in np.flatnonzero((self._turn != 0.0) & np.isfinite(upper - lower))
            for limits in (lower, upper)
        ]
        rows = self._q + np.array(places).reshape(-1, 1) * self._turn
        over = np.abs(angles.wrap_to_pi(angles.into_limits(rows, lower, upper) - rows)).max(axis=1, initial=0.0)
        return np.column_stack([rows, np.full(len(rows), self.start)])[over <= past, :7]

    def _cut(
        self, part: tuple[float, float, int, int], j: int, lower: float, upper: float
    ) -> list[tuple[float, float, int, int]]:
        """What is left of a part where joint j is within its limits in some copy, if by rounding: a single member."""
        first, last, code, end = part
        sign = float(self._turn[j])
        a, b = sorted((sign * (lower - self._q[j]), sign * (upper - self._q[j])))
        codes = (2 * j, 2 * j + 1) if sign > 0.0 else (2 * j + 1, 2 * j)
        if last - first >= TURN:  # a whole circle has no ends of its own
            return [(a, b, *codes)]
        left = []
        for k in range(math.ceil((first - b - EXACT) / TURN), math.floor((last - a + EXACT) / TURN) + 1):
            low, high = min(a + k * TURN, last), max(b + k * TURN, first)
            left.append(
                (
                    max(low, first),
                    min(high, last),
                    codes[0] if low >= first else code,
                    codes[1] if high <= last else end,
                )
            )
        return left

    def at(self, parameter: float) -> Array:
        """See `Track`."""
        return self._at(0.5 * (self._first + self._last))

    def point(self, coordinate: float) -> tuple[float, Array]:
        """See `Track`."""
        return self.start, self._at(min(max(coordinate, self._first), self._last))

    def nearest(self, seed: Array) -> tuple[float, Array] | None:
        """See `Track`."""
        j, k = np.flatnonzero(self._turn).tolist()
        ahead = 0.5 * (self._turn[j] * (seed[j] - self._q[j]) + self._turn[k] * (seed[k] - self._q[k]))
        middle = 0.5 * (self._first + self._last)
        places = [ahead + turns * math.pi for turns in range(2)]  # the distances to seeds whole turns away alternate
        places = [place + TURN * round((middle - place) / TURN) for place in places]
        places = [min(max(place, self._first), self._last) for place in places]
        rows = np.array([self._at(place) for place in (*places, self._first, self._last)])
        return self.start, rows[
            int(np.argmin((np.mod(rows - seed + math.pi, TURN) - math.pi) ** 2 @ np.ones(len(seed))))
        ]

    def guesses(self) -> tuple[Array, Array]:
        """See `Track`."""
        number = 2 + int((self._last - self._first) / GUESS_SPACING)
        coordinates = np.linspace(self._first, self._last, number)
        return coordinates, self._at(coordinates[:, np.newaxis])

    def polyline(self) -> tuple[Array, Array]:
        """See `Track`."""
        coordinates, rows = self.guesses()
        return np.full(len(coordinates), self.start), rows

    def _at(self, coordinate: float | Array) -> Array:
        row: Array = self._q + coordinate * self._turn
        return row


class SpunWristTrack(Track):
    """Where the free axis is that of the last joint, too: three turns about one line, and two of them are free.

    The coordinate is the parameter; joint 6 takes it up as far as it may turn, and joint 4, unlimited, the rest.
    """

    __slots__ = ("_limits", "_q", "_sign", "_turn", "start", "stop")

    def __init__(
        self, q: Array, turn: Array, sign: float, limits: tuple[float, float], start: float, stop: float
    ) -> None:
        """Take a member (6,) at parameter 0, how joints turn against each other (6,), and as `CircleTrack`.

        Args:
            q: see above.
            turn: see above.
            sign: of joint 6's turn.
            limits: of joint 6 [rad].
            start: least value of the parameter [rad].
            stop: largest one [rad].
        """
        self._q, self._turn, self._sign, self._limits = q, turn, sign, limits
        self.start, self.stop = start, stop

    def at(self, parameter: float) -> Array:
        """See `Track`."""
        q6 = float(self._q[5]) + self._sign * parameter
        return self._with(parameter, q6)

    def point(self, coordinate: float) -> tuple[float, Array]:
        """See `Track`."""
        return coordinate, self.at(coordinate)

    def nearest(self, seed: Array) -> tuple[float, Array] | None:
        """See `Track`."""
        q6 = self._within(float(seed[5]))
        p = self._sign * (q6 - float(self._q[5]) - self._turn[5] * float(seed[3] - self._q[3]))
        middle = 0.5 * (self.start + self.stop)
        p += TURN * round((middle - p) / TURN)
        if self.start <= p <= self.stop:
            return p, self._with(p, q6)
        ends = [(end, math.remainder(end - p, TURN)) for end in (self.start, self.stop)]
        p, rest = min(ends, key=lambda each: abs(each[1]))
        return p, self._with(p, q6 + 0.5 * self._sign * rest)

    def guesses(self) -> tuple[Array, Array]:
        """See `Track`."""
        p = np.linspace(self.start, self.stop, 2 + int((self.stop - self.start) / GUESS_SPACING))
        return p, np.array([self.at(each) for each in p.tolist()])

    def polyline(self) -> tuple[Array, Array]:
        """See `Track`."""
        return self.guesses()

    def _with(self, p: float, q6: float) -> Array:
        """The member (6,) at a parameter with joint 6 at an angle, or as near to it as its limits let it."""
        q = self._q.copy()
        q[5] = self._within(q6)
        q[3] += self._turn[5] * (q[5] - self._q[5] - self._sign * p)
        return q

    def _within(self, q6: float) -> float:
        low, high = self._limits
        if high - low < TURN:
            q6 += TURN * round((0.5 * (low + high) - q6) / TURN)
            q6 = min(max(q6, low), high)
        return q6
