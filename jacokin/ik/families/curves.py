"""`CurveProblem`: self-motions of an arm at a target, by the kernels: pieces within the limits, and points on them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.geometry import frame_with_z
from jacokin.ik.targets import TargetPose
from jacokin.kernels.compiled.library import CurveCall
from jacokin.kernels.compiled.loading import KERNELS
from jacokin.kernels.self_motion.arcs import ARCS, FOLD_END, LOST_END, NODES, RANGE_END, SEAM_END
from jacokin.kernels.self_motion.intervals import (
    FIND_AT_PARAMETER,
    FIND_AT_SHARE,
    FIND_INTERVALS,
    FIND_NEAREST,
    FIND_NEAREST_ON_RUN,
    CurveWork,
)
from jacokin.kernels.self_motion.limit_cuts import INTERVALS
from jacokin.kernels.self_motion.slices import SLICES
from jacokin.model.angles import TURN
from jacokin.model.poses import FreeAxis

#: Codes of ends, see `limit_cuts`: 2 j and 2 j + 1 are the limits of joint j.
FOLD, RANGE, SEAM, LOST = -1 - FOLD_END, -1 - RANGE_END, -1 - SEAM_END, -1 - LOST_END
#: [rad] values of the parameter that differ by rounding.
SAME_PARAMETER = 1e-9
#: Index of the parameter among the seven joints of a chain: the free axis comes last, and joint 3 is in the middle.
FREE_AXIS, JOINT_3 = 6, 2
#: Values of the parameter that are solved at, for a full turn.
SLICES_SIX, SLICES_SEVEN = 96, 48
#: [rad] where they begin: no structured pose has a fold or a limit just there, nor a window in the gap before it.
FIRST_SLICE = -math.pi + 1.2345
#: [rad] values nearer to each other are solved at once, and how many there may be: room is left for those of `gaps`.
SAME_SLICE, MOST_SLICES = 1e-3, SLICES - 16


class CurveArm:
    """What the kernels know about an arm with self-motions; may be shared between threads.

    Attributes:
        parameter: index of the parameter among the seven joints, `FREE_AXIS` or `JOINT_3`.
        chain: (7, 3, 4) of six joints, or (8, 3, 4) of seven.
        constants: (39,) or (12,), see `ik.geometry`.
        limits: (2, 7) [rad], infinite where some copy of every angle is within them.
        circular: whether every joint has either no limits, or one copy of an angle at most within them.
    """

    __slots__ = ("_given", "_idle", "chain", "circular", "constants", "limits", "parameter")

    def __init__(self, parameter: int, chain: Array, constants: Array, lower: Array, upper: Array) -> None:
        """Take the constants of an arm and its limits (dof,) [rad], and load compiled kernels if there are any."""
        self._given = parameter, chain, constants, lower, upper
        self.parameter, self.chain, self.constants = parameter, chain, constants
        bounded = upper - lower < TURN  # others have a copy of every angle within their limits: no interval ends there
        self.limits = np.array([np.full(7, -np.inf), np.full(7, np.inf)])
        self.limits[0, : len(lower)][bounded] = lower[bounded]
        self.limits[1, : len(upper)][bounded] = upper[bounded]
        self.circular = bool((bounded | np.isinf(upper - lower)).all())
        self._idle: list[CurveCall] = []  # each thread takes one, or makes one, and puts it back
        KERNELS.prepare()

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

    def take_call(self, poses: int) -> CurveCall:
        """A call of the kernels of one's own, for so many poses."""
        library = KERNELS.for_poses(poses)
        while self._idle:
            try:
                call = self._idle.pop()
            except IndexError:  # another thread was quicker
                break
            if call.library is library:
                return call
        return CurveCall(library)

    def put_back(self, call: CurveCall) -> None:
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

    def find(self, also: Sequence[float] = ()) -> FoundCurves:
        """All pieces of the curves, in the range of the target; `also` are parameters to solve at too."""
        call = self._prepare(also)
        found = read_curves(call.work, call())
        self.arm.put_back(call)
        return found

    def nearest(self, seed: Array) -> Array | None:
        """The point (7,) within the limits nearest to a seed (dof,), joints in the copies nearest to it.

        None where nothing is within the limits, where a curve was lost, or where limits of more than a turn leave a
        choice of copies.
        """
        return self._nearest(self._prepare(), FIND_NEAREST, seed) if self.arm.circular else None

    def nearest_on(self, nodes: Array, seed: Array) -> Array | None:
        """As `nearest`, on a run of nodes (m, 14) alone."""
        if not self.arm.circular:
            return None
        call = self._take(1)
        call.work.arcs.nodes[: len(nodes)] = nodes
        call.work.options[:] = 0, self.arm.parameter, len(nodes), 0
        return self._nearest(call, FIND_NEAREST_ON_RUN, seed)

    def at_share(self, chord: Array, share: float) -> Array | None:
        """The point (7,) of a curve across the chord between two nodes (2, 14), at a share of it."""
        return self._point(chord, share, FIND_AT_SHARE)

    def at_parameter(self, chord: Array, parameter: float) -> Array | None:
        """The point (7,) of a curve between two nodes (2, 14) where the parameter has a value between theirs [rad]."""
        return self._point(chord, parameter, FIND_AT_PARAMETER)

    def _point(self, chord: Array, at: float, task: int) -> Array | None:
        call = self._take(1)
        call.work.chord[:] = chord
        call.work.at[0] = at
        call.work.options[:] = task, self.arm.parameter, 0, 0
        x = call.work.x.copy() if call() else None
        self.arm.put_back(call)
        return x

    def _nearest(self, call: CurveCall, task: int, seed: Array) -> Array | None:
        nearest = call.work.nearest
        nearest.limits[:] = self.arm.limits
        nearest.weights[:] = 1.0
        nearest.weights[len(seed) :] = 0.0
        nearest.seed[: len(seed)] = seed
        nearest.seed[len(seed) :] = 0.0
        call.work.options[0] = task
        x = nearest.x.copy() if call() and nearest.best[0] < np.inf else None
        self.arm.put_back(call)
        return x

    def _take(self, poses: int) -> CurveCall:
        """A call with the chain and the target filled in."""
        call = self.arm.take_call(poses)
        call.work.chain[:], call.work.T[:] = self.chain, self.T
        return call

    def _prepare(self, also: Sequence[float] = ()) -> CurveCall:
        """A call with everything filled in that finding intervals takes."""
        arm, free = self.arm, self.free_axis
        call = self._take(SLICES_SEVEN if free is None else SLICES_SIX)
        work, values = call.work, _add(_slices(free), also)
        if free is not None:
            work.six.chain[:] = arm.chain
            work.six.arm[:] = arm.constants
            work.six.limits[0], work.six.limits[1], work.six.limits[2] = -np.inf, np.inf, 0.0
            work.six.axis[:] = free.axis
            work.six.seed[:] = 0.0
        else:
            work.seven.arm[:] = arm.constants
        work.cuts.limits[:] = arm.limits
        work.slices.p[: len(values)] = values
        work.options[:] = FIND_INTERVALS, arm.parameter, len(values), int(self.closed)
        return call


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


class FoundCurves(NamedTuple):
    """Everything about one target."""

    pieces: list[Piece]
    arcs: list[Array]  # nodes of whole arcs, within the limits or not
    complete: bool


def read_curves(work: CurveWork, count: int) -> FoundCurves:
    """Copy the pieces out of the arrays of a call that found so many intervals."""
    parameter = int(work.options[1])
    size, number = work.arcs.size.tolist()
    nodes = work.arcs.nodes[:size].copy()
    table: NDArray[np.int64] = work.arcs.arcs[:number]
    arcs = [nodes[first:end] for first, end, _, _ in table.tolist()]
    pieces: list[Piece] = []
    by_arc: dict[int, list[Piece]] = {}
    for row in work.cuts.intervals[:count]:
        arc, a, b = int(row[0]), int(row[1]), int(row[2])
        piece = Piece(
            arc, nodes[a : b + 2], row[7:21].reshape(2, 7).copy(), (int(row[3]), int(row[4])), (row[5], row[6])
        )
        by_arc.setdefault(arc, []).append(piece)
    for group in by_arc.values():
        closed = SEAM in (group[0].codes[0], group[-1].codes[1])
        pieces.extend(
            join_closed_curve(group, parameter) if closed else [part for p in group for part in cut_turns(p, parameter)]
        )
    full = size == NODES or number == ARCS or count == INTERVALS
    return FoundCurves(pieces, arcs, not (full or work.counts[1] or work.counts[2]))


def whole_piece(nodes: Array, branch: int) -> Piece:
    """All of an arc, within the limits or not."""
    return Piece(branch, nodes, nodes[[0, -1], :7].copy(), (FOLD, FOLD), (0.0, 1.0))


def join_closed_curve(pieces: list[Piece], parameter: int) -> list[Piece]:
    """The pieces of a curve that closes on itself: joined where it does, and none longer than a turn."""
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
    parts = []
    while piece.ends[1, parameter] - piece.ends[0, parameter] > TURN + SAME_PARAMETER:
        wall = piece.ends[0, parameter] + TURN + SAME_PARAMETER
        cut = int(np.searchsorted(piece.nodes[:, parameter], wall, side="right")) - 1
        point = piece.nodes[cut, :7]
        before, after = np.array([piece.ends[0], point]), np.array([point, piece.ends[1]])
        parts.append(
            Piece(piece.branch, piece.nodes[: cut + 1], before, (piece.codes[0], SEAM), (piece.shares[0], 1.0))
        )
        piece = Piece(piece.branch, piece.nodes[cut:], after, (SEAM, piece.codes[1]), (0.0, piece.shares[1]))
    return [*parts, piece]


def _slices(free: FreeAxis | None) -> Array:
    """Values of the parameter to solve at: an angle about a free axis, or joint 3 where there is none."""
    slices = SLICES_SEVEN if free is None else SLICES_SIX
    if free is None or free.full_turn:
        return np.asarray(FIRST_SLICE + TURN / slices * np.arange(slices))
    low, high = free.range
    return np.linspace(low, high, 2 + math.ceil(slices * (high - low) / TURN))


def _add(values: Array, also: Sequence[float]) -> Array:
    """Rising values with some more between them, in their copies there, as many as there is room for."""
    for p in also:
        moved = p - TURN * math.floor((p - values[0]) / TURN)
        if moved < values[-1] and np.abs(values - moved).min() > SAME_SLICE and len(values) < MOST_SLICES:
            values = np.sort(np.append(values, moved))
    return values
