"""What of the curves is within the limits: pieces along which the parameter rises."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.chain import linearise7, solve_normal
from jacokin.kernels.limits import TURN, nearest_copy
from jacokin.kernels.solution_set.curve import (
    COLUMNS,
    LARGEST_RESIDUAL,
    LONGEST_STEP,
    MOST_HALVED,
    PARTS,
    RESOLUTION,
    STATIONARY,
    Walk,
    chord_length,
    cubic,
    cubic_root,
    halve_chord,
    point_at,
    point_where_still,
    still_shares,
    to_curve,
    wrapped,
)
from jacokin.kernels.solution_set.starts import fill_steps
from jacokin.kernels.solution_set.trace import CurveEnd, Loops
from jacokin.kernels.tolerances import LIMIT_SNAP, SMALLEST_PIVOT

ROWS, PIECES = 24576, 512
#: Why a piece ends, besides 2 j and 2 j + 1 for the lower and upper limit of angle j: a fold, or nothing ends.
FOLD, CIRCLE, LOST = -1, -2, -3
#: [rad] an angle passes its limit where it is past it by what rounding leaves of an angle: one that comes to its limit
#: and hardly moves there stays within it.
ROUNDING = 1e-12
#: [rad] a place where a limit is passed is nearer to it.
AT_LIMIT = 10.0 * LIMIT_SNAP
#: [rad] what is missing of a pose moves joints by less; as near to its limit one may stand there.
NEAR_LIMIT = 1e-4
#: Steps to where angles stand on their limits: fewer than two digits each are none to there.
STEPS_ON_LIMIT = 6
#: Share of the square of a chord by which the cubic through its ends may be off, or of what an angle moves along it,
#: where that is less: one that goes as the fourth power of the way is off by a sixteenth.
DOUBT, MOVES = 3e-3, 0.1
#: Places where limits are passed on one part of a chord: each limit at one.
EVENTS = 14


class Pieces(NamedTuple):
    """Pieces within the limits as runs of nodes, and the chord at hand."""

    limits: Array  # (2, 7) lower and upper limits [rad], infinite for none
    nodes: Array  # (ROWS, 14) tangents with dp/ds >= 0
    ends: NDArray[np.int64]  # (PIECES, 6) first node, node after the last, codes of both ends, branch, curve
    size: NDArray[np.int64]  # (5,) nodes, pieces, branches, what went wrong, 1 while a piece is open
    parts: Array  # (PARTS, 28) parts of a chord still to be looked at, by their two nodes, the first one last
    events: Array  # (EVENTS, 16) share, code and node of the places on a part where limits are passed


def make_pieces() -> Pieces:
    """Fresh arrays."""
    return Pieces(
        np.empty((2, 7)),
        np.empty((ROWS, COLUMNS)),
        np.zeros((PIECES, 6), np.int64),
        np.zeros(5, np.int64),
        np.empty((PARTS, 2 * COLUMNS)),
        np.empty((EVENTS, COLUMNS + 2)),
    )


def past(angle: float, j: int, limits: Array) -> float:
    """How far an angle is past the limits of joint j [rad]: negative within them, -inf without any."""
    if not limits[0, j] > -math.inf:
        return -math.inf
    middle, half = 0.5 * (limits[0, j] + limits[1, j]), 0.5 * (limits[1, j] - limits[0, j])
    return float(abs(wrapped(angle - middle)) - half)


def excess(x: Array, limits: Array) -> float:
    """How far angles are past their limits [rad]: negative within them, -inf without any."""
    most = -math.inf
    for j in range(7):
        most = max(most, past(x[j], j, limits))
    return most


def nearest_limit(x: Array, limits: Array) -> int:
    """The code of the limit that a point is nearest to, or farthest past."""
    most, code = -math.inf, LOST
    for j in range(7):
        over = past(x[j], j, limits)
        if over > most:
            most, code = over, 2 * j + (wrapped(x[j] - 0.5 * (limits[0, j] + limits[1, j])) > 0.0)
    return code


def cut(loops: Loops, pieces: Pieces, walk: Walk) -> None:
    """Fill pieces with the parts of all curves that are within the limits."""
    for n in range(5):
        pieces.size[n] = 0
    for c in range(loops.size[1]):
        cut_loop(c, loops, pieces, walk)


def cut_loop(c: int, loops: Loops, pieces: Pieces, walk: Walk) -> None:
    """Append the pieces of one curve, from a node on where none is open: a fold, or a point outside the limits."""
    first, end = loops.ends[c, 0], loops.ends[c, 1]
    size, parameter = pieces.size, walk.parameter[0]
    settle_nodes(c, loops, pieces.limits, walk)
    size[2] += 1
    if end == first + 1:
        open_if_inside(loops.nodes[first], FOLD, c, pieces)
        close_piece(pieces, parameter, FOLD)
        return
    start, whole, turns = first_node(c, loops, pieces)
    chords, before = end - 1 - first, size[1]
    outer = CIRCLE if whole else (FOLD if turns else LOST)
    open_if_inside(loops.nodes[start], outer, c, pieces)
    several = abs(loops.nodes[end - 1, parameter] - loops.nodes[first, parameter]) > 1.5 * TURN or turns
    for step in range(chords):
        n = start + step if start + step < end - 1 else start + step - chords
        write_chord(loops, n, start, first, end, pieces)
        cut_chord(pieces, walk, c)
        if step == chords - 1:
            break
        m = n + 1 if n + 1 < end - 1 else first
        node = pieces.parts[0, COLUMNS:]
        if loops.fold[m] > 0:
            close_piece(pieces, parameter, FOLD)
            size[2] += 1
            open_if_inside(node, FOLD, c, pieces)
        elif several and is_a_turn_long(pieces, parameter, loops.nodes[m + 1, parameter] - loops.nodes[m, parameter]):
            close_piece(pieces, parameter, CIRCLE)
            open_piece(pieces, node, CIRCLE, c)
    if size[4] > 0:
        close_piece(pieces, parameter, outer)
        if whole and size[1] > before + 1:
            join_round(loops.nodes[first], loops.nodes[end - 1], before, pieces)


def settle_nodes(c: int, loops: Loops, limits: Array, walk: Walk) -> None:
    """Bring the nodes of a curve that are near a limit to it as rounding allows.

    Near a singularity a little that is missing of the pose moves joints by more than what limits are known to.
    """
    first, end = loops.ends[c, 0], loops.ends[c, 1]
    for n in range(first, end):
        node, offset = loops.nodes[n], 0.0
        if abs(excess(node, limits)) > NEAR_LIMIT:
            continue
        for j in range(7):
            walk.z[j], walk.border[j] = node[j], node[7 + j]
            offset += node[j] * node[7 + j]
        residual, _ = to_curve(walk.border, offset, STATIONARY, walk.z, walk.tz, walk)
        if residual <= LARGEST_RESIDUAL and farthest(walk.z, node) <= NEAR_LIMIT:
            for j in range(7):
                node[j] = walk.z[j]
        stand_on_limits(node, limits, walk)


def farthest(x: Array, node: Array) -> float:
    """How far an angle of a point is from that of a node, at most [rad]."""
    most = 0.0
    for j in range(7):
        most = max(most, abs(x[j] - node[j]))
    return most


def stand_on_limits(node: Array, limits: Array, walk: Walk) -> None:
    """Put angles of a node that are near a limit, and stand still, onto it, if the target is reached so.

    Where the arm is singular they are off by noise, which would say all along a curve whether they are within.
    """
    x, system, held, count = walk.z, walk.system, walk.step, 0
    for j in range(7):
        x[j], held[j] = node[j], 0.0
        over = past(node[j], j, limits)
        if abs(over) <= NEAR_LIMIT and abs(node[7 + j]) * LONGEST_STEP <= LIMIT_SNAP:
            above = wrapped(node[j] - 0.5 * (limits[0, j] + limits[1, j])) > 0.0
            x[j], held[j] = node[j] - (over if above else -over), 1.0
            count += 1
    missing = math.inf if count > 0 else 0.0
    for _ in range(STEPS_ON_LIMIT):
        if missing <= LARGEST_RESIDUAL:
            break
        missing = linearise7(walk.chain, walk.T, x, system)
        for i in range(6):
            for j in range(7):
                system[i, j] *= 1.0 - held[j]
        fill_steps(system, max(missing * missing, SMALLEST_PIVOT), walk.columns)
        if missing <= LARGEST_RESIDUAL or not solve_normal(walk.columns):
            break
        for j in range(7):
            for i in range(6):
                x[j] += system[i, j] * walk.columns[i, 6]
    if count > 0 and missing <= LARGEST_RESIDUAL and farthest(x, node) <= NEAR_LIMIT:
        for j in range(7):
            node[j], node[7 + j] = x[j], node[7 + j] * (1.0 - held[j])


def first_node(c: int, loops: Loops, pieces: Pieces) -> tuple[int, bool, bool]:
    """Where to begin on a curve; whether all of it is within the limits without a fold, and whether it begins at one.

    A closed curve can be begun at any node: at the first fold, or else at the last node outside the limits before that.
    """
    start, whole, turns = loops.ends[c, 0], loops.ends[c, 2] == CurveEnd.CLOSED, False
    if not whole:
        return start, whole, turns
    for n in range(loops.ends[c, 0], loops.ends[c, 1] - 1):
        fold = loops.fold[n] > 0
        if (fold and not turns) or (whole and excess(loops.nodes[n], pieces.limits) > LIMIT_SNAP):
            start, whole, turns = n, False, fold
    return start, whole, turns


def open_if_inside(node: Array, code: int, c: int, pieces: Pieces) -> None:
    """Begin a piece at a node, if that is within the limits."""
    if excess(node, pieces.limits) <= LIMIT_SNAP:
        open_piece(pieces, node, code, c)


def is_a_turn_long(pieces: Pieces, parameter: int, step: float) -> bool:
    """Whether the open piece would be longer than a turn of the parameter after a step of that."""
    if pieces.size[4] == 0:
        return False
    first, last = pieces.ends[pieces.size[1], 0], pieces.size[0] - 1
    return bool(abs(pieces.nodes[last, parameter] + step - pieces.nodes[first, parameter]) > TURN)


def join_round(start: Array, end: Array, k: int, pieces: Pieces) -> None:
    """Join the last piece and piece k, which goes on from there: they are cut where a curve without folds began."""
    last = pieces.size[1] - 1
    first = pieces.size[0]
    for n in range(pieces.ends[last, 0], pieces.ends[last, 1]):
        add_row(pieces, pieces.nodes[n])
    for n in range(pieces.ends[k, 0] + 1, pieces.ends[k, 1]):
        add_row(pieces, pieces.nodes[n])
        for j in range(7):
            pieces.nodes[pieces.size[0] - 1, j] += end[j] - start[j]
    pieces.ends[k, 0], pieces.ends[k, 1], pieces.ends[k, 2] = first, pieces.size[0], pieces.ends[last, 2]
    pieces.size[1] = last


def write_chord(loops: Loops, n: int, start: int, first: int, end: int, pieces: Pieces) -> None:
    """Write the chord from node n on as the first part; chords before the start come a whole round later."""
    part = pieces.parts[0]
    for j in range(7):
        later = loops.nodes[end - 1, j] - loops.nodes[first, j] if n < start else 0.0
        part[j], part[7 + j] = loops.nodes[n, j] + later, loops.nodes[n, 7 + j]
        part[14 + j], part[21 + j] = loops.nodes[n + 1, j] + later, loops.nodes[n + 1, 7 + j]


def cut_chord(pieces: Pieces, walk: Walk, c: int) -> None:
    """Go along the chord in pieces.parts[0], and close and open pieces where limits are passed; its end stays there.

    Parts on which the cubic does not tell whether a limit is passed are halved.
    """
    parts, top, halved = pieces.parts, 0, 0
    while top >= 0:
        a, b = parts[top, :COLUMNS], parts[top, COLUMNS:]
        length = chord_length(a, b)
        if (
            length > RESOLUTION
            and halved < MOST_HALVED
            and is_doubtful(a, b, length, pieces.limits)
            and halve_chord(parts, top, walk)
        ):
            top += 1
            halved += 1
            continue
        cut_part(a, b, pieces, walk, c)
        top -= 1
    pieces.size[3] += halved == MOST_HALVED


def passed_at(limits: Array, code: int, a: float, b: float) -> float:
    """The angle near two others at which the limit of a code is passed."""
    side = code % 2
    return nearest_copy(limits[side, code // 2] + (2 * side - 1) * ROUNDING, 0.5 * (a + b))


def is_doubtful(a: Array, b: Array, length: float, limits: Array) -> bool:
    """Whether the cubics through two nodes leave open how often a limit is passed between them."""
    for j in range(7):
        if not limits[0, j] > -math.inf:
            continue
        moves = (abs(a[7 + j]) + abs(b[7 + j])) * length + abs(b[j] - a[j])
        slack = min(DOUBT * length * length, MOVES * moves)
        for u in still_shares(a, b, length, j):
            for side in range(2 if u > 0.0 else 0):
                level = passed_at(limits, 2 * j + side, a[j], b[j])
                value = cubic(a, b, length, u, j) - level
                if abs(value) < slack > LIMIT_SNAP or value * (a[j] - level) < 0.0 or value * (b[j] - level) < 0.0:
                    return True
        for end in (a, b):  # next to where an angle stands still, the cubic may not
            for side in range(2 if abs(end[7 + j]) * length < slack > LIMIT_SNAP else 0):
                if abs(end[j] - passed_at(limits, 2 * j + side, a[j], b[j])) < slack:
                    return True
    return False


def cut_part(a: Array, b: Array, pieces: Pieces, walk: Walk, c: int) -> None:
    """Go along a part of a chord on which each limit is passed once at most, or touched."""
    parameter, events, n = walk.parameter[0], pieces.events, find_events(a, b, pieces, walk)
    for i in range(n + 1):
        # Between two events nothing is passed: the middle tells.
        here = a if i == 0 else events[i - 1, 2:]
        there = b if i == n else events[i, 2:]
        inside = inside_between(here, there, pieces.limits)
        code = int(events[i - 1, 1]) if i > 0 else nearest_limit(here, pieces.limits)
        if pieces.size[4] > 0 and not inside:
            if i > 0:
                put_on_limit(pieces, events[i - 1])
            elif has_only_begun(pieces) and excess(here, pieces.limits) > ROUNDING:
                leave_out(pieces)
            close_piece(pieces, parameter, code)
        elif pieces.size[4] == 0 and inside:
            open_piece(pieces, here, code, c)
            if i > 0:
                put_on_limit(pieces, events[i - 1])
        elif pieces.size[4] == 0 and i > 0 and excess(here, pieces.limits) <= LIMIT_SNAP:
            open_piece(pieces, here, code, c)  # a single point
            put_on_limit(pieces, events[i - 1])
            close_piece(pieces, parameter, code)
        if inside:
            add_row(pieces, there)


def find_events(a: Array, b: Array, pieces: Pieces, walk: Walk) -> int:
    """Fill pieces.events with where limits are passed or touched between two nodes, in order; how many."""
    events, n = pieces.events, 0
    for j in range(7):
        if not pieces.limits[0, j] > -math.inf:
            continue
        for side in range(2):
            if find_event(a, b, 2 * j + side, pieces, walk):
                along = 0.0
                for m in range(7):
                    events[n, 2 + m], events[n, 9 + m] = walk.z[m], walk.tz[m]
                    along += (walk.z[m] - a[m]) * (b[m] - a[m])
                events[n, 0], events[n, 1] = along, 2 * j + side
                n += 1
    for i in range(1, n):
        k = i
        while k > 0 and events[k, 0] < events[k - 1, 0]:
            for m in range(COLUMNS + 2):
                swap = events[k, m]
                events[k, m] = events[k - 1, m]
                events[k - 1, m] = swap
            k -= 1
    return n


def find_event(a: Array, b: Array, code: int, pieces: Pieces, walk: Walk) -> bool:
    """Fill walk.z and walk.tz with where the limit of a code is passed, or touched, between two nodes, if it is."""
    length, j, side = chord_length(a, b), code // 2, code % 2
    level = passed_at(pieces.limits, code, a[j], b[j])
    v0, v1 = a[j] - level, b[j] - level
    if (v0 < 0.0) != (v1 < 0.0):
        u = cubic_root(a, b, length, j, level, 0.0, 1.0)
        found = point_at(a, b, j, level, u, walk)
        pieces.size[3] += not found
        return found
    turns, outside = a[7 + j] * b[7 + j] < 0.0, (v0 > 0.0) == (side > 0)
    if min(abs(v0), abs(v1)) > length or not turns or not outside or not touches(a, b, length, j, level):
        return False
    return point_where_still(a, b, j, walk)


def touches(a: Array, b: Array, length: float, j: int, level: float) -> bool:
    """Whether an angle that stands still between two nodes comes to a level there, by the cubic."""
    for u in still_shares(a, b, length, j):
        if u > 0.0 and abs(cubic(a, b, length, u, j) - level) < DOUBT * length * length + LIMIT_SNAP:
            return True
    return False


def inside_between(here: Array, there: Array, limits: Array) -> bool:
    """Whether the middle between two nodes is within the limits, by the cubic through both, and so are the nodes.

    One of these is not where a limit is passed at a place that was not found. An angle that is past its limit by what
    counts as within is outside all the same where it moves on: so much later it would not count.
    """
    length, most = chord_length(here, there), max(excess(here, limits), excess(there, limits)) - AT_LIMIT
    for j in range(7):
        over = past(cubic(here, there, length, 0.5, j), j, limits)
        moves_on = abs(there[j] - here[j]) * LONGEST_STEP > LIMIT_SNAP * length
        most = max(most, math.inf if over > ROUNDING and moves_on else over)
    return most <= LIMIT_SNAP


def has_only_begun(pieces: Pieces) -> bool:
    """Whether the open piece is a single point so far."""
    return bool(pieces.size[0] == pieces.ends[pieces.size[1], 0] + 1)


def leave_out(pieces: Pieces) -> None:
    """Take the open piece back."""
    pieces.size[0], pieces.size[4] = pieces.ends[pieces.size[1], 0], 0


def add_row(pieces: Pieces, node: Array) -> None:
    """Append a node to the open piece."""
    n = pieces.size[0]
    if n == ROWS:
        pieces.size[3] += 1
        return
    for m in range(COLUMNS):
        pieces.nodes[n, m] = node[m]
    pieces.size[0] = n + 1


def put_on_limit(pieces: Pieces, event: Array) -> None:
    """Put the last node of the open piece on the limit that an event passes, exactly."""
    code, n = int(event[1]), pieces.size[0] - 1
    j, side = code // 2, code % 2
    level = pieces.limits[side, j]
    if abs(wrapped(pieces.nodes[n, j] - level)) <= AT_LIMIT:
        pieces.nodes[n, j] -= wrapped(pieces.nodes[n, j] - level)


def open_piece(pieces: Pieces, node: Array, code: int, c: int) -> None:
    """Begin a piece at a node, where there is room."""
    k = pieces.size[1]
    if k == PIECES or pieces.size[0] == ROWS:
        pieces.size[3] += 1
        return
    pieces.ends[k, 0], pieces.ends[k, 2] = pieces.size[0], code
    pieces.ends[k, 4], pieces.ends[k, 5] = pieces.size[2] - 1, c
    pieces.size[4] = 1
    add_row(pieces, node)


def close_piece(pieces: Pieces, parameter: int, code: int) -> None:
    """End the open piece at its last node, and turn it so that the parameter rises."""
    if pieces.size[4] == 0:
        return
    k = pieces.size[1]
    first, end = pieces.ends[k, 0], pieces.size[0]
    pieces.size[4] = 0
    if end == first:  # for want of room
        return
    pieces.ends[k, 1], pieces.ends[k, 3] = end, code
    pieces.size[1] = k + 1
    if pieces.nodes[end - 1, parameter] < pieces.nodes[first, parameter]:
        swap_code = pieces.ends[k, 2]
        pieces.ends[k, 2] = pieces.ends[k, 3]
        pieces.ends[k, 3] = swap_code
        for i in range((end - first + 1) // 2):
            a, b = pieces.nodes[first + i], pieces.nodes[end - 1 - i]
            for m in range(7):
                swap = a[m]
                a[m] = b[m]
                b[m] = swap
            for m in range(7, COLUMNS):
                swap = a[m]
                a[m] = -b[m]
                b[m] = -swap
