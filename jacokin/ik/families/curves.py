"""`CurveProblem`: self-motions of an arm at a target, by the kernels: pieces within the limits, and points on them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.geometry import frame_with_z
from jacokin.ik.targets import TargetPose
from jacokin.kernels.chain import linearise7
from jacokin.kernels.closed_form.arm import unpack_arm
from jacokin.kernels.library import Call
from jacokin.kernels.self_motion.arcs import ARCS, FOLD_END, LOST_END, NODES, RANGE_END, SEAM_END
from jacokin.kernels.self_motion.follow import POINT_CLOSURE, WORST_CLOSURE
from jacokin.kernels.self_motion.intervals import (
    FILL_SLICES,
    FIND_AT_PARAMETER,
    FIND_AT_SHARE,
    FIND_INTERVALS,
    FIND_NEAREST,
    FIND_NEAREST_ON_RUN,
    FIRST_SLICE,
    SAME_SLICE,
    SCATTER,
    CurveWork,
    make_curve_work,
    run_curves,
)
from jacokin.kernels.self_motion.limit_cuts import INTERVALS
from jacokin.kernels.self_motion.members import GUESSED
from jacokin.kernels.self_motion.slices import SAME_PARAMETER, SINGULAR, SLICES, SLICES_SEVEN, SLICES_SIX
from jacokin.model import angles, checks
from jacokin.model.angles import TURN
from jacokin.model.poses import FreeAxis

#: Codes of ends, see `limit_cuts`: 2 j and 2 j + 1 are the limits of joint j.
FOLD, RANGE, SEAM, LOST = -1 - FOLD_END, -1 - RANGE_END, -1 - SEAM_END, -1 - LOST_END
#: [rad] angles about a free axis that are solved at too: what is singular in a structured target is so there.
QUARTER_TURNS = (-0.5 * math.pi, 0.0, 0.5 * math.pi, math.pi)
#: [rad] a curve that was lost this near to where curves meet ends there.
FARTHEST_END = 0.6
#: Gauss-Newton steps where curves meet, the relative size of motions that they leave out, and the farthest way [rad].
SETTLING_STEPS, NO_MOTION, FARTHEST_WAY = 20, 1e-6, 0.3
#: Index of the parameter among the seven joints of a chain: the free axis comes last, and joint 3 is in the middle.
FREE_AXIS, JOINT_3 = 6, 2
#: [rad] a joint that stays on its limit while others turn is past it by rounding, here and there.
ON_LIMIT = 1e-12
#: [rad] the same on a piece that is within the limits: its points are put on limits, and nearly singular curves are
#: known no better.
PAST_LIMIT = 3e-10
#: How many values of the parameter there may be: room is left for those of `gaps`.
MOST_SLICES = SLICES - 16


class CurveArm:
    """What the kernels know about an arm with self-motions; may be shared between threads.

    Attributes:
        parameter: index of the parameter among the seven joints, `FREE_AXIS` or `JOINT_3`.
        chain: (7, 3, 4) of six joints, or (8, 3, 4) of seven.
        constants: (46,) or (12,), see `ik.geometry`.
        limits: (2, 7) [rad], infinite where some copy of every angle is within them.
        sees_straight_wrists: whether the kernels find the targets' straight wrists: not of six joints that are not
            built like a Jaco's.
    """

    __slots__ = ("_given", "_idle", "chain", "constants", "limits", "parameter", "sees_straight_wrists")

    def __init__(self, parameter: int, chain: Array, constants: Array, lower: Array, upper: Array) -> None:
        """Take the constants of an arm and its limits (dof,) [rad], and load the compiled kernels."""
        self._given = parameter, chain, constants, lower, upper
        self.parameter, self.chain, self.constants = parameter, chain, constants
        bounded = upper - lower < TURN  # others have a copy of every angle within their limits: no interval ends there
        self.limits = np.array([np.full(7, -np.inf), np.full(7, np.inf)])
        self.limits[0, : len(lower)][bounded] = lower[bounded]
        self.limits[1, : len(upper)][bounded] = upper[bounded]
        self.sees_straight_wrists = parameter == JOINT_3 or unpack_arm(constants).six.scale == 0.0
        self._idle: list[Call[CurveWork]] = [Call(run_curves, make_curve_work())]  # each thread takes one or makes one

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Working memory is made anew."""
        return CurveArm, self._given

    def problem(self, target: TargetPose) -> CurveProblem:
        """A target for the kernels: a pose of seven joints, or a free axis of six."""
        free = target.free_axis
        if free is None:
            return CurveProblem(self, self.chain, target.matrix, None)
        # Turning the tool about the axis by p is turning it back by a seventh joint of angle p about minus the axis.
        align = frame_with_z(-free.axis)
        chain = np.zeros((8, 3, 4))
        chain[:7] = self.chain
        chain[6, :, :3] = chain[6, :, :3] @ align
        chain[7, :, :3] = align.T
        return CurveProblem(self, chain, target.matrix, free)

    def take_call(self) -> Call[CurveWork]:
        """A call of the kernels of one's own."""
        try:
            return self._idle.pop()
        except IndexError:
            return Call(run_curves, make_curve_work())

    def put_back(self, call: Call[CurveWork]) -> None:
        """Let others use a call, once its arrays are read."""
        self._idle.append(call)


class CurveProblem(NamedTuple):
    """The self-motions of one arm at one target: curves in the space of seven angles."""

    arm: CurveArm
    chain: Array  # (8, 3, 4)
    T: Array  # (4, 4)
    free_axis: FreeAxis | None  # of six joints

    @property
    def closed(self) -> bool:
        """Whether the parameter goes round a circle."""
        return self.free_axis is None or self.free_axis.full_turn

    def find(
        self,
        also: Sequence[float] = (),
        crossings: Sequence[float] = (),
        room: float = 0.0,
        *,
        quarters: bool = True,
    ) -> FoundCurves:
        """All pieces of the curves, in the range of the target.

        Args:
            also: parameters to solve at too [rad].
            crossings: parameters at which curves meet [rad].
            room: how far from there they are solved for, at both sides [rad].
            quarters: about a free axis, solve at QUARTER_TURNS too.
        """
        call, heeded = self._prepare(also, crossings, room, quarters=quarters)
        found = read_curves(call.work, call())
        self.arm.put_back(call)
        return found if heeded == len(crossings) else found._replace(full=True, complete=False)

    def points_at(self, parameters: Array) -> tuple[Array, NDArray[np.int64]]:
        """Points (k, 7) of all curves at values (m,) of the parameter [rad], and at which one each of them is (k,)."""
        (call, _), points, numbers = self._prepare(), [np.empty((0, 7))], [np.empty(0, np.int64)]
        call.work.options[0] = FILL_SLICES
        for first in range(0, len(parameters), SLICES):
            some = parameters[first : first + SLICES]
            call.work.slices.p[: len(some)] = some
            call.work.options[2] = len(some)
            call()
            filled = call.work.slices.filled[: len(some)]
            points += [call.work.slices.x[i, :count] for i, count in enumerate(filled.tolist())]
            numbers.append(np.repeat(np.arange(first, first + len(some)), filled))
            points = [np.vstack(points)]  # copied
        self.arm.put_back(call)
        return points[0], np.concatenate(numbers)

    def scatter(self, parameters: Array) -> tuple[Array, NDArray[np.bool_], bool]:
        """Points within the limits for a first look: all at rising values of the parameter, and guesses between them.

        Args:
            parameters: (m,) at most SLICES values [rad]; all round if the parameter goes round.

        Returns:
            Points (k, 7) [rad]; which (k,) are guesses, of limits that are passed and of folds; and whether there is
            any point at the values, within the limits or not.
        """
        (call, _), n = self._prepare(), len(parameters)
        call.work.slices.p[:n] = parameters
        call.work.options[0], call.work.options[2] = SCATTER, n
        rows = call.work.arcs.nodes[: call()].copy()
        reached = bool(call.work.slices.filled[:n].any())
        self.arm.put_back(call)
        return rows[:, :7], rows[:, GUESSED] > 0.0, reached

    def nearest(self, seed: Array) -> Array | None:
        """The point (7,) within the limits nearest to a seed (dof,), joints in the copies nearest to it.

        Joints with more than a turn of room may be in copies past their limits. None where nothing is within the
        limits, or where a curve was lost.
        """
        return self._nearest(self._prepare(quarters=self.free_axis is not None)[0], FIND_NEAREST, seed)

    def nearest_on(self, nodes: Array, seed: Array) -> Array | None:
        """As `nearest`, on a run of nodes (m, 14) alone."""
        call = self._take()
        call.work.arcs.nodes[: len(nodes)] = nodes
        call.work.options[:] = 0, self.arm.parameter, len(nodes), 0
        return self._nearest(call, FIND_NEAREST_ON_RUN, seed, slack=PAST_LIMIT)

    def at_share(self, chord: Array, share: float) -> Array | None:
        """The point (7,) of a curve across the chord between two nodes (2, 14), at a share of it."""
        return self._point(chord, share, FIND_AT_SHARE)

    def at_parameter(self, chord: Array, parameter: float) -> Array | None:
        """The point (7,) of a curve between two nodes (2, 14) where the parameter has a value between theirs [rad]."""
        return self._point(chord, parameter, FIND_AT_PARAMETER)

    def _point(self, chord: Array, at: float, task: int) -> Array | None:
        call = self._take()
        call.work.chord[:] = chord
        call.work.at[0] = at
        call.work.options[:] = task, self.arm.parameter, 0, 0
        x = call.work.x.copy() if call() else None
        self.arm.put_back(call)
        return self._least_squares(chord, at, held=task == FIND_AT_PARAMETER) if x is None else x

    def _least_squares(self, chord: Array, at: float, *, held: bool) -> Array | None:
        """A point (7,) that closes, near a share of a chord or with the parameter held; None where there is none.

        Where two curves meet, no condition tells them apart: Gauss-Newton steps leave out what does not move the tool.
        """
        parameter = self.arm.parameter
        first, last = chord[:, parameter].tolist()
        share = at
        if held:
            share = (at - first) / (last - first) if last != first else 0.5
        x: Array = chord[0, :7] + share * (chord[1, :7] - chord[0, :7])
        if held:
            x[parameter] = at
        return self.settled(x, parameter if held else None)

    def settled(self, x: Array, held: int | None) -> Array | None:
        """A point (7,) that closes, near one that nearly does, with one joint held; None where there is none."""
        start, x, system = x, x.copy(), np.empty((7, 8))
        for _ in range(SETTLING_STEPS):
            if linearise7(self.chain, self.T, x, system) <= POINT_CLOSURE:
                break
            if held is not None:
                system[:6, held] = 0.0
            x += np.linalg.pinv(system[:6, :7], rcond=NO_MOTION) @ system[:6, 7]
        near = np.abs(x - start).max() <= FARTHEST_WAY
        return x if near and linearise7(self.chain, self.T, x, system) <= WORST_CLOSURE else None

    def _nearest(self, call: Call[CurveWork], task: int, seed: Array, slack: float = 0.0) -> Array | None:
        nearest = call.work.nearest
        nearest.limits[0], nearest.limits[1] = self.arm.limits[0] - slack, self.arm.limits[1] + slack
        nearest.weights[:] = 1.0
        nearest.weights[len(seed) :] = 0.0
        nearest.seed[: len(seed)] = seed
        nearest.seed[len(seed) :] = 0.0
        call.work.options[0] = task
        call.work.counts[:] = 0
        whole = call() and not call.work.counts[1:].any()
        x = nearest.x.copy() if whole and nearest.best[0] < np.inf else None
        self.arm.put_back(call)
        return x

    def _take(self) -> Call[CurveWork]:
        """A call with the chain and the target filled in."""
        call = self.arm.take_call()
        call.work.chain[:], call.work.T[:] = self.chain, self.T
        return call

    def _prepare(
        self, also: Sequence[float] = (), crossings: Sequence[float] = (), room: float = 0.0, *, quarters: bool = False
    ) -> tuple[Call[CurveWork], int]:
        """A call with everything filled in that finding intervals takes, and how many crossings there was room for."""
        arm, free = self.arm, self.free_axis
        call = self._take()
        work = call.work
        limits = None if free is None or self.closed else free.range
        number = SLICES_SEVEN if free is None else SLICES_SIX
        values = _add(_slices(number, limits, quarters=quarters), also, self.closed)
        values, crossed, heeded = _make_room(values, self.closed, crossings, room)
        if free is not None:
            work.six.chain[:] = arm.chain
            work.six.arm[:] = arm.constants
            work.six.limits[0], work.six.limits[1], work.six.limits[2] = -np.inf, np.inf, 0.0
            work.six.axis[:] = free.axis
            work.six.seed[:] = 0.0
        else:
            work.seven.arm[:] = arm.constants
        work.cuts.limits[0], work.cuts.limits[1] = arm.limits[0] - ON_LIMIT, arm.limits[1] + ON_LIMIT
        work.slices.p[: len(values)] = values
        work.slices.crossed[: len(values)] = crossed
        work.options[:] = FIND_INTERVALS, arm.parameter, len(values), int(self.closed)
        return call, heeded


class Piece(NamedTuple):
    """A run of nodes along which the parameter rises; what lies between its ends is within the limits."""

    branch: int
    nodes: Array  # (m, 14) points, unwrapped, and tangents; the ends lie on the first and the last chord
    ends: Array  # (2, 7) both end points
    codes: tuple[int, int]
    shares: tuple[float, float]  # where on those chords

    def moved(self, turns: Array) -> Piece:
        """The same piece with (7,) angles added to every point."""
        nodes = self.nodes.copy()
        nodes[:, :7] += turns
        return self._replace(nodes=nodes, ends=self.ends + turns)

    def is_lost(self, branch: int, side: int) -> bool:
        """Whether it ends at the start or at the stop of a branch that was lost there."""
        return self.branch == branch and self.codes[side] == LOST

    def extended(self, more: Array, side: int) -> Piece:
        """The same piece with nodes (k, 14) more, before its first one or after its last one, up to a fold."""
        nodes = np.vstack([self.nodes, more] if side else [more, self.nodes])
        ends = np.array([self.ends[0], more[-1, :7]] if side else [more[0, :7], self.ends[1]])
        codes = (self.codes[0], FOLD) if side else (FOLD, self.codes[1])
        shares = (self.shares[0], 1.0) if side else (0.0, self.shares[1])
        return self._replace(nodes=nodes, ends=ends, codes=codes, shares=shares)


class FoundCurves(NamedTuple):
    """Everything about one target."""

    pieces: list[Piece]
    arcs: list[Array]  # nodes of whole arcs, within the limits or not
    ends: list[tuple[int, int]]  # what each of them ends at, see `arcs`
    singular: Array  # (k, 7) points without a tangent: where curves meet, or all alone
    at_quarters: Array  # (k, 7) points at QUARTER_TURNS
    motion_at_quarters: Array  # (k,) a lower bound of how far the tool moves there, see `slices.least_motion`
    straight: Array  # (k, 7) points near which the wrist may be straight, on curves or not
    full: bool  # whether a table was, so that something is missing
    cut: bool  # whether the places were found where limits are passed
    complete: bool

    @property
    def lost_ends(self) -> Array:
        """Nodes (k, 7) at which curves were lost."""
        rows = [np.empty((0, 7))]
        for nodes, ends in zip(self.arcs, self.ends, strict=True):
            rows.extend(nodes[[place], :7] for place, end in zip((0, -1), ends, strict=True) if end == LOST_END)
        return np.vstack(rows)

    def ended_at(self, points: Array, parameter: int) -> FoundCurves:
        """The same, but that curves which were lost near points (k, 7) end there: where curves meet, each ends."""
        arcs, ends, pieces = list(self.arcs), list(self.ends), list(self.pieces)
        for i, both in enumerate(self.ends if len(points) else ()):
            for side, end in enumerate(both):
                if end != LOST_END:
                    continue
                node = arcs[i][-side, :7]
                ways = np.mod(points - node + math.pi, TURN) - math.pi
                way = ways[np.abs(ways).max(axis=1).argmin()]
                length = float(np.linalg.norm(way))
                ahead = way[parameter] if side else -way[parameter]
                if not 0.0 < length < FARTHEST_END or ahead <= 0.0:
                    continue
                last = np.concatenate([node + way, way / length if side else -way / length])
                arcs[i] = np.vstack([arcs[i], last] if side else [last, arcs[i]])
                ends[i] = (ends[i][0], FOLD_END) if side else (FOLD_END, ends[i][1])
                pieces = [
                    piece.extended(last[np.newaxis], side) if piece.is_lost(i, side) else piece for piece in pieces
                ]
        complete = not self.full and not any(LOST_END in both for both in ends)
        return self._replace(arcs=arcs, ends=ends, pieces=pieces, complete=complete)


def read_curves(work: CurveWork, count: int) -> FoundCurves:
    """Copy the pieces out of the arrays of a call that found so many intervals."""
    parameter = int(work.options[1])
    size, number = work.arcs.size.tolist()
    nodes = work.arcs.nodes[:size].copy()
    table: NDArray[np.int64] = work.arcs.arcs[:number]
    arcs = [nodes[first:end] for first, end, _, _ in table.tolist()]
    ends = [(left, right) for _, _, left, right in table.tolist()]
    by_arc: dict[int, list[Piece]] = {}
    rows = work.cuts.intervals[:count]
    for (arc, a, b, *codes, start, stop), both in zip(
        rows[:, :7].tolist(), rows[:, 7:21].copy().reshape(count, 2, 7), strict=True
    ):
        piece = Piece(int(arc), nodes[int(a) : int(b) + 2], both, (int(codes[0]), int(codes[1])), (start, stop))
        by_arc.setdefault(piece.branch, []).append(piece)
    pieces = [part for group in by_arc.values() for part in join_parts(group, parameter)]
    full = size == NODES or number == ARCS or count == INTERVALS
    singular = work.slices.singular[: min(int(work.counts[2]), SINGULAR)].copy()
    at_quarters = work.quarters.rows[: int(work.quarters.filled[0])].copy()
    straight = work.straight.rows[: int(work.straight.filled[0])].copy()
    complete = not (full or work.counts[1] or work.counts[2])
    points, motion, cut = at_quarters[:, :7], at_quarters[:, 7], not work.counts[3]
    return FoundCurves(pieces, arcs, ends, singular, points, motion, straight, full, cut, complete)


def whole_piece(nodes: Array, branch: int, ends: tuple[int, int] = (FOLD_END, FOLD_END)) -> Piece:
    """All of an arc, within the limits or not; what it ends at as in `arcs`."""
    return Piece(branch, nodes, nodes[[0, -1], :7].copy(), (-1 - ends[0], -1 - ends[1]), (0.0, 1.0))


def join_parts(pieces: list[Piece], parameter: int) -> list[Piece]:
    """The pieces of an arc: joined where it closes on itself, and none longer than a turn."""
    if not pieces:
        return []
    first, last = pieces[0], pieces[-1]
    if len(pieces) > 1 and first.codes[0] == SEAM and last.codes[1] == SEAM:
        turns = TURN * np.round((last.nodes[-1, :7] - first.nodes[0, :7]) / TURN)
        on = first.moved(turns)
        nodes = np.concatenate([last.nodes, on.nodes[1:]])
        ends = np.array([last.ends[0], on.ends[1]])
        pieces = [
            *pieces[1:-1],
            Piece(first.branch, nodes, ends, (last.codes[0], first.codes[1]), (last.shares[0], first.shares[1])),
        ]
    return [part for piece in pieces for part in cut_turns(piece, parameter)]


def cut_turns(piece: Piece, parameter: int) -> list[Piece]:
    """A piece of a curve that goes round several times, cut at nodes into pieces of a turn at most."""
    parts: list[Piece] = []
    while piece.ends.item(1, parameter) - piece.ends.item(0, parameter) > TURN + SAME_PARAMETER:
        wall = piece.ends[0, parameter] + TURN + SAME_PARAMETER
        cut = int(np.searchsorted(piece.nodes[:, parameter], wall, side="right")) - 1
        point = piece.nodes[cut, :7]
        before, after = np.array([piece.ends[0], point]), np.array([point, piece.ends[1]])
        parts.append(
            Piece(piece.branch, piece.nodes[: cut + 1], before, (piece.codes[0], SEAM), (piece.shares[0], 1.0))
        )
        piece = Piece(piece.branch, piece.nodes[cut:], after, (SEAM, piece.codes[1]), (0.0, piece.shares[1]))
    return [*parts, piece]


@lru_cache(maxsize=8)
def _slices(number: int, limits: tuple[float, float] | None, *, quarters: bool) -> Array:
    """Values of the parameter to solve at: `number` for a full turn; all round without limits."""
    if limits is None:
        values = np.asarray(FIRST_SLICE + TURN / number * np.arange(number))
    else:
        values = np.linspace(*limits, 2 + math.ceil(number * (limits[1] - limits[0]) / TURN))
    return checks.read_only(_add(values, QUARTER_TURNS if quarters else (), limits is None))


def _add(values: Array, also: Sequence[float], closed: bool) -> Array:
    """Rising values with some more between them, or on the circle, in their copies there, as far as there is room."""
    for p in also:
        moved = p - TURN * math.floor((p - values[0]) / TURN)
        fits = (closed or moved < values[-1]) and len(values) < MOST_SLICES
        if fits and np.abs(angles.wrap_to_pi(values - moved)).min() > SAME_SLICE:
            values = np.sort(np.append(values, moved))
    return values


def _make_room(
    values: Array, closed: bool, crossings: Sequence[float], room: float
) -> tuple[Array, NDArray[np.int64], int]:
    """Rising values with one at either side of each crossing, 1 for each that a crossing follows, and how many fit."""
    crossed = np.zeros(len(values), np.int64)
    for heeded, p in enumerate(crossings):
        moved = p - TURN * math.floor((p - values[0]) / TURN)
        if not closed and not values[0] < moved < values[-1]:
            continue
        near = np.abs(values - moved) < 2.0 * room
        near |= closed & (np.abs(values + TURN - moved) < 2.0 * room)
        if len(values) - near.sum() + 2 > SLICES:
            return values, crossed, heeded
        values, crossed = values[~near], crossed[~near]
        pair = np.array([moved - room, moved + room])
        if closed:
            pair = np.where(pair >= values[0] + TURN, pair - TURN, np.where(pair < values[0], pair + TURN, pair))
        values, crossed = np.concatenate([values, pair]), np.concatenate([crossed, [1, 0]])
        order = np.argsort(values)
        values, crossed = values[order], crossed[order]
    return values, crossed, len(crossings)
