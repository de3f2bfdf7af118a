"""What the kernels return for one target, copied out of their arrays: pieces of curves within the limits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.closed_form.curves.arcs import ARCS, FOLD_END, LOST_END, NODES, RANGE_END, SEAM_END
from jacokin.ik.closed_form.curves.curve_family import CurveWork
from jacokin.ik.closed_form.curves.limit_cuts import INTERVALS
from jacokin.model.angles import TURN

#: Codes of ends, see `limit_cuts`: 2 j and 2 j + 1 are the limits of joint j.
FOLD, RANGE, SEAM, LOST = -1 - FOLD_END, -1 - RANGE_END, -1 - SEAM_END, -1 - LOST_END
#: [rad] values of the parameter that differ by rounding.
SAME_PARAMETER = 1e-9


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


class Found(NamedTuple):
    """Everything about one target."""

    pieces: list[Piece]
    arcs: list[Array]  # nodes of whole arcs, within the limits or not
    complete: bool


def read(work: CurveWork, count: int) -> Found:
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
            of_closed_curve(group, parameter) if closed else [part for p in group for part in of_one_turn(p, parameter)]
        )
    full = size == NODES or number == ARCS or count == INTERVALS
    return Found(pieces, arcs, not (full or work.counts[1] or work.counts[2]))


def whole(nodes: Array, branch: int) -> Piece:
    """All of an arc, within the limits or not."""
    return Piece(branch, nodes, nodes[[0, -1], :7].copy(), (FOLD, FOLD), (0.0, 1.0))


def of_closed_curve(pieces: list[Piece], parameter: int) -> list[Piece]:
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
    return [part for piece in pieces for part in of_one_turn(piece, parameter)]


def of_one_turn(piece: Piece, parameter: int) -> list[Piece]:
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
