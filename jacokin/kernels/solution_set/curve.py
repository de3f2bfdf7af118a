"""One curve of solutions: steps along it, and points between two of its nodes.

A chain of seven joints at a pose has a curve of solutions: the six equations of the pose leave one of seven angles. A
node is a point x (7,) of it with the unit tangent t (7,) of the null space there, side by side in a row (14,).
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.chain import ASTRAY, SMALLEST_PIVOT_7, bring_pivot, linearise7, null_tangent
from jacokin.kernels.limits import TURN
from jacokin.kernels.tolerances import CLOSURE
from jacokin.kernels.trigonometry import whole_below
from jacokin.kernels.vector import Vec, cross, mix

#: [rad] the one resolution: what is nearer than this on a curve, or to another curve, is not told apart.
RESOLUTION = 1e-7
#: Halvings of one chord: where more are wanted, points of other curves are met in between, and no end of them. Parts of
#: it at a time: twice as many as halvings of the longest step down to the resolution.
MOST_HALVED, PARTS = 200, 48
#: [rad] longest step along a curve, and least cosine between the tangents at its ends.
LONGEST_STEP, LEAST_COSINE = 0.3, 0.955
#: Square of the distance of the next point from the tangent, relative to the step's.
LARGEST_BEND = 0.05
#: [m] and [rad]; residual of a point, where Newton's method ends and at most.
RESIDUAL, LARGEST_RESIDUAL = 1e-13, 1e-10
#: [rad] after longer steps nodes are as exact as a point at most: what lies between them is known no better.
SHORT_STEP = 0.02
NEWTON_STEPS = 8
#: What a step of Newton's method leaves, relative to its square, at most [m]: twice what joints at an arm's length do.
SECOND_ORDER = 10.0
#: Steps along a chord at most, and where they end, in its shares and [rad]: as exact as rounding allows.
SECANTS, STATIONARY = 60, 1e-14
#: Share of the largest product of the singular values on a curve, from which down steps are shorter in proportion: how
#: near another curve may be, it tells. Products that are rounding tell nothing.
NEAR_OTHERS, FLAT = 0.15, 1e-8
#: What a step may come to.
StepResult = IntEnum("StepResult", "FAILED STEPPED FLIPPED LONG", start=0)
COLUMNS = 14


class Walk(NamedTuple):
    """The curve that a walk is along, where it stands, and what a step needs."""

    chain: Array  # (8, 3, 4) placements between seven joints that turn about z
    T: Array  # (4, 4) target
    parameter: NDArray[np.int64]  # (1,) index of the angle that is the parameter
    x: Array  # (7,) the last point [rad]
    t: Array  # (7,) its tangent, forwards
    bend: Array  # (7,) how the tangent turns at x, for a distance of 1,
    more: Array  # (7,) how that changes,
    last: Array  # (7,) and how that does
    turned: Array  # (7,) how the tangent turned on the last step,
    length: Array  # (1,) which was so long
    volume: Array  # (2,) product of the Jacobian's singular values ahead, signed, see `tangent`; the largest so far
    y: Array  # (7,) the point ahead
    ty: Array  # (7,)
    z: Array  # (7,) a point between them
    tz: Array  # (7,)
    border: Array  # (7,)
    step: Array  # (7,) of Newton's method
    columns: Array  # (6, 7) the Jacobian before that
    system: Array  # (7, 9)


def make_walk() -> Walk:
    """Fresh arrays."""
    chain, T, parameter = np.zeros((8, 3, 4)), np.eye(4), np.zeros(1, np.int64)
    x, t, bend, more, last, turned, y, ty, z, tz, border, step = (np.zeros(7) for _ in range(12))
    length, volume, columns, system = np.zeros(1), np.zeros(2), np.zeros((6, 7)), np.zeros((7, 9))
    return Walk(
        chain, T, parameter, x, t, bend, more, last, turned, length, volume, y, ty, z, tz, border, step, columns, system
    )


def wrapped(angle: float) -> float:
    """The 2 pi equivalent of an angle in [-pi, pi)."""
    return angle - TURN * whole_below(angle / TURN + 0.5)


def tangent(x: Array, border: Array, t: Array, walk: Walk) -> float:
    """Fill t with the tangent at x for which border . t > 0; see `null_tangent` for what is returned."""
    linearise7(walk.chain, walk.T, x, walk.system)
    return null_tangent(border, t, walk.system)


def to_curve(border: Array, offset: float, wanted: float, x: Array, t: Array, walk: Walk) -> tuple[float, float]:
    """Bring x to the curve where border . x = offset, by Newton's method, and fill t with the tangent there.

    One elimination gives the next step and the tangent before it, which the step's share in the Jacobian then turns.

    Args:
        border: (7,) unit vector; border . t > 0.
        offset: [rad].
        wanted: how much of pose and condition may be left [m and rad].
        x: (7,) changed in place [rad].
        t: (7,) filled.
        walk: the curve.

    Returns:
        How much is left at most, inf where there is no tangent; and what `null_tangent` returns.
    """
    system, columns, step, free = walk.system, walk.columns, walk.step, 0
    left, volume, square = math.inf, 0.0, 0.0
    for j in range(1, 7):
        free = j if abs(border[j]) > abs(border[free]) else free
    for _ in range(NEWTON_STEPS):
        left, rest = linearise7(walk.chain, walk.T, x, system), offset
        for j in range(7):
            rest -= border[j] * x[j]
        left = max(left, abs(rest))
        if left > ASTRAY:
            return left, 0.0
        for i in range(6):
            for j in range(7):
                columns[i, j] = system[i, j]
        volume = solve_for_others(system, free)
        along = border[free]
        for k in range(6):
            j = other_angle(k, free)
            t[j], step[j] = -system[k, 6], system[k, 7]
            along += border[j] * t[j]
            rest -= border[j] * step[j]
        if volume == 0.0 or along == 0.0:
            return math.inf, 0.0
        t[free], step[free] = 1.0, 0.0
        share, square = rest / along, 0.0
        if left <= wanted:
            break
        for j in range(7):
            step[j] += share * t[j]
            x[j] += step[j]
            square += step[j] * step[j]
        if SECOND_ORDER * square <= wanted:
            left = SECOND_ORDER * square
            break
    if square > 0.0:
        turn_tangent(columns, step, free, t, system)
    square, along = 0.0, 0.0
    for j in range(7):
        square += t[j] * t[j]
        along += border[j] * t[j]
    length = math.copysign(math.sqrt(square), along)
    for j in range(7):
        t[j] /= length
    return left, volume * length


def other_angle(k: int, free: int) -> int:
    """The angle that column k of `solve_for_others` is of."""
    return 6 if k == free else k


def solve_for_others(system: Array, free: int) -> float:
    """Solve for all angles but a free one: in column 6 with what that one moves on the right, in column 7 as it is.

    Gauss elimination with row pivoting, of the first six rows, in place, with column 6 in the place of the free one.
    Factors and inverse pivots stay there; column 8 tells which row was which.

    Returns:
        The determinant, with 1 in row 6 of the free angle; 0 where it is singular.
    """
    product = 1.0
    for i in range(6):
        system[i, 8] = i
        if free != 6:
            swap = system[i, free]
            system[i, free] = system[i, 6]
            system[i, 6] = swap
    if free != 6:
        product = -1.0
    for column in range(6):
        if bring_pivot(system, column, 6, 0, 9) != column:
            product = -product
        if abs(system[column, column]) < SMALLEST_PIVOT_7:
            return 0.0
        product *= system[column, column]
        inverse = 1.0 / system[column, column]
        system[column, column] = inverse
        for row in range(column + 1, 6):
            factor = system[row, column] * inverse
            system[row, column] = factor
            for j in range(column + 1, 8):
                system[row, j] -= factor * system[column, j]
    substitute_back(system, 6)
    substitute_back(system, 7)
    return product


def substitute_back(system: Array, column: int) -> None:
    """Solve the triangular equations that `solve_for_others` leaves, in place."""
    for i in range(5, -1, -1):
        value = system[i, column]
        for j in range(i + 1, 6):
            value -= system[i, j] * system[j, column]
        system[i, column] = value * system[i, i]


def turn_tangent(columns: Array, step: Array, free: int, t: Array, system: Array) -> None:
    """Turn t (7,), with 1 for a free angle, as a step (7,) from where `solve_for_others` has solved turns it."""
    linear, angular = moved_jacobian(columns, step, t)
    moved = (linear[0], linear[1], linear[2], angular[0], angular[1], angular[2])
    for i in range(6):
        value = -moved[int(system[i, 8])]
        for j in range(i):
            value -= system[i, j] * system[j, 8]
        system[i, 8] = value
    substitute_back(system, 8)
    for k in range(6):
        t[other_angle(k, free)] += system[k, 8]


def moved_jacobian(columns: Array, step: Array, t: Array) -> tuple[Vec, Vec]:
    """By how much a step (7,) changes what the Jacobian (6, 7) makes of t (7,): its linear and angular part.

    An axis is turned by the joints before it, and what it moves by those and, at its end, by all others.
    """
    linear, angular = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    by_step, by_t = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for j in range(7):
        v, w = (columns[0, j], columns[1, j], columns[2, j]), (columns[3, j], columns[4, j], columns[5, j])
        angular = mix(angular, 1.0, cross(by_step, w), t[j], w, 0.0)
        by_step = mix(by_step, 1.0, w, step[j], w, 0.0)
        linear = mix(linear, 1.0, cross(by_step, v), t[j], cross(by_t, v), step[j])
        by_t = mix(by_t, 1.0, w, t[j], w, 0.0)
    return linear, angular


def advance(walk: Walk, h: float, volume: float, y: Array, ty: Array) -> StepResult:
    """Fill y and ty with the point a distance h along the tangent from walk.x, and its tangent.

    Args:
        walk: where to start.
        h: how far to go [rad].
        volume: of `tangent` at walk.x, along this curve.
        y: filled.
        ty: filled.

    Returns:
        `FAILED` where the step cannot be trusted; `FLIPPED` where only the sign differs, which it does on a curve
        beside this one and where curves meet; `LONG` where it is for how near others may be; else `STEPPED`.
    """
    x, t = walk.x, walk.t
    offset = h
    for j in range(7):
        y[j] = x[j] + h * (t[j] + h * (0.5 * walk.bend[j] + h / 6.0 * (walk.more[j] + 0.25 * h * walk.last[j])))
        offset += t[j] * x[j]
    wanted = LARGEST_RESIDUAL if h > SHORT_STEP else RESIDUAL
    residual, reached = to_curve(t, offset, wanted, y, ty, walk)
    if not residual <= LARGEST_RESIDUAL:
        return StepResult.FAILED
    away, cosine = 0.0, 0.0
    for j in range(7):
        d = y[j] - x[j] - h * t[j]
        away += d * d
    if away > LARGEST_BEND * h * h:
        return StepResult.FAILED
    for j in range(7):
        cosine += t[j] * ty[j]
    if reached == 0.0 or cosine < LEAST_COSINE:
        return StepResult.FAILED
    walk.volume[0] = reached
    if (reached > 0.0) != (volume > 0.0):
        return StepResult.FLIPPED
    walk.volume[1] = max(walk.volume[1], abs(reached))
    least, most = min(abs(volume), abs(reached)), walk.volume[1]
    return StepResult.LONG if most > FLAT and NEAR_OTHERS * h * most > LONGEST_STEP * least else StepResult.STEPPED


def go_on(walk: Walk) -> None:
    """Make the point ahead the last one; how the tangent turned on the way tells where the next one will be.

    By the polynomial that has the tangents at the last three points, and leads from the last but one to the last.
    """
    square, turned = 0.0, 0.0
    for j in range(7):
        d, turn = walk.y[j] - walk.x[j], walk.ty[j] - walk.t[j]
        square, turned = square + d * d, turned + turn * turn
    h, before = math.sqrt(square) * (1.0 + turned / 24.0), walk.length[0]  # of the arc
    for j in range(7):
        turn = (walk.ty[j] - walk.t[j]) / h
        change = (turn - walk.turned[j]) / (h + before) if before > 0.0 else 0.0
        beyond = walk.y[j] - walk.x[j] - h * (0.5 * (walk.t[j] + walk.ty[j]) - h * h / 6.0 * change)
        rest = -12.0 * beyond / (h * h * h * (h + 2.0 * before)) if before > 0.0 else 0.0
        walk.bend[j] = turn + h * (change + (h + before) * rest)
        walk.more[j], walk.last[j] = 2.0 * (change + (2.0 * h + before) * rest), 6.0 * rest
        walk.turned[j], walk.x[j], walk.t[j] = turn, walk.y[j], walk.ty[j]
    walk.length[0] = h


def cubic(a: Array, b: Array, length: float, u: float, j: int) -> float:
    """Coordinate j at a share u of the chord between two nodes (14,), on the cubic through both."""
    v = 1.0 - u
    return float(
        (1.0 + 2.0 * u) * v * v * a[j]
        + u * v * v * length * a[7 + j]
        + u * u * (3.0 - 2.0 * u) * b[j]
        - u * u * v * length * b[7 + j]
    )


def cubic_slope(a: Array, b: Array, length: float, u: float, j: int) -> float:
    """The derivative of `cubic` by u."""
    v = 1.0 - u
    return float(
        6.0 * u * v * (b[j] - a[j]) + v * (1.0 - 3.0 * u) * length * a[7 + j] - u * (2.0 - 3.0 * u) * length * b[7 + j]
    )


def still_shares(a: Array, b: Array, length: float, j: int) -> tuple[float, float]:
    """Where coordinate j of the cubic stands still between two nodes, as shares of the chord; -1 for nowhere."""
    first, moved = length * a[7 + j], b[j] - a[j]
    cube = first + length * b[7 + j] - 2.0 * moved
    half = moved - first - cube
    square = half * half - 3.0 * cube * first  # the derivative is first + 2 half u + 3 cube u^2
    if square <= 0.0:
        return -1.0, -1.0
    q = -(half + math.copysign(math.sqrt(square), half))
    u = q / (3.0 * cube) if cube != 0.0 else -1.0
    v = first / q  # not zero, as the square is not
    return u if 0.0 < u < 1.0 else -1.0, v if 0.0 < v < 1.0 else -1.0


def chord_length(a: Array, b: Array) -> float:
    """Distance between two nodes [rad]."""
    square = 0.0
    for j in range(7):
        square += (b[j] - a[j]) * (b[j] - a[j])
    return math.sqrt(square)


def cubic_root(a: Array, b: Array, length: float, j: int, value: float, low: float, high: float) -> float:
    """The share between low and high at which coordinate j of the cubic has a value that lies between theirs."""
    f_low = cubic(a, b, length, low, j) - value
    u = 0.5 * (low + high)
    for _ in range(SECANTS):
        f = cubic(a, b, length, u, j) - value
        if f == 0.0:
            break
        if (f > 0.0) == (f_low > 0.0):
            low = u
        else:
            high = u
        slope = cubic_slope(a, b, length, u, j)
        before = u
        u = u - f / slope if slope != 0.0 else low
        if not low < u < high:
            u = 0.5 * (low + high)
        if abs(u - before) < 0.1 * STATIONARY:
            break
    return u


def point_across(a: Array, b: Array, u: float, walk: Walk) -> bool:
    """Fill walk.z and walk.tz with the node across the chord from a to b (14,) at a share u of it; False for none.

    Where there are solutions all around, Newton's method would lead to any of them: there, the chord's cubic gives the
    node.
    """
    x, t, length = walk.z, walk.tz, chord_length(a, b)
    if length == 0.0:
        for j in range(7):
            x[j], t[j] = a[j], a[7 + j]
        return True
    offset = 0.0
    for j in range(7):
        walk.border[j] = (b[j] - a[j]) / length
        offset += walk.border[j] * (a[j] + u * (b[j] - a[j]))
    fill_by_cubic(a, b, length, u, walk)
    residual, volume = to_curve(walk.border, offset, RESIDUAL, x, t, walk)
    if abs(volume) < FLAT:
        fill_by_cubic(a, b, length, u, walk)
        if linearise7(walk.chain, walk.T, x, walk.system) <= CLOSURE:
            return True
        residual, _ = to_curve(walk.border, offset, RESIDUAL, x, t, walk)
    return residual <= LARGEST_RESIDUAL


def fill_by_cubic(a: Array, b: Array, length: float, u: float, walk: Walk) -> None:
    """Fill walk.z and walk.tz with the point of the chord's cubic at a share of it, and its direction."""
    size = 0.0
    for j in range(7):
        walk.z[j], walk.tz[j] = cubic(a, b, length, u, j), cubic_slope(a, b, length, u, j)
        size += walk.tz[j] * walk.tz[j]
    for j in range(7):
        walk.tz[j] /= math.sqrt(size)


def halve_chord(parts: Array, top: int, walk: Walk) -> bool:
    """Replace the last of some chords (n, 28), two nodes each, by its halves, the first one last.

    The node between them is left in walk.z and walk.tz. False for no middle, and no room.
    """
    if top + 1 == parts.shape[0]:
        return False
    chord, half = parts[top], parts[top + 1]
    if not point_across(chord[:COLUMNS], chord[COLUMNS:], 0.5, walk):
        return False
    for j in range(7):
        half[j], half[7 + j] = chord[j], chord[7 + j]
        half[14 + j], half[21 + j] = walk.z[j], walk.tz[j]
        chord[j], chord[7 + j] = walk.z[j], walk.tz[j]
    return True


def point_at(a: Array, b: Array, j: int, value: float, u: float, walk: Walk) -> bool:
    """Fill walk.z and walk.tz with the node between a and b (14,) where angle j has a value; u is about where.

    First with the angle given, and where that is no good condition, next to its extremes, by the secant method across
    the chord.
    """
    x, t, length = walk.z, walk.tz, chord_length(a, b)
    for m in range(7):
        walk.border[m] = 1.0 if m == j else 0.0
        x[m] = cubic(a, b, length, u, m)
    residual, _ = to_curve(walk.border, value, RESIDUAL, x, t, walk)
    moved, along = 0.0, 0.0
    for m in range(7):
        moved = max(moved, abs(x[m] - cubic(a, b, length, u, m)))
        along += t[m] * (b[m] - a[m])
    if not residual <= LARGEST_RESIDUAL or moved > 0.01 * length:
        return slide(a, b, j, value, walk)
    for m in range(7):
        t[m] = math.copysign(1.0, along) * t[m]
    return True


def point_where_still(a: Array, b: Array, j: int, walk: Walk) -> bool:
    """Fill walk.z and walk.tz with the node between a and b (14,) where angle j stands still; it turns between them."""
    return slide(a, b, 7 + j, 0.0, walk)


def slide(a: Array, b: Array, k: int, value: float, walk: Walk) -> bool:
    """Fill walk.z and walk.tz with the node between a and b (14,) where its number k has a value; False for none.

    It is looked for across the chord, by the secant method.
    """
    low, f_low, high, f_high = 0.0, a[k] - value, 1.0, b[k] - value
    if f_low * f_high > 0.0:
        return False
    for _ in range(SECANTS):
        u = secant(low, f_low, high, f_high)
        if not point_across(a, b, u, walk):
            return False
        f = (walk.z[k] if k < 7 else walk.tz[k - 7]) - value
        if abs(f) <= STATIONARY or abs(high - low) <= STATIONARY:
            return True
        low, f_low, high, f_high = narrowed(low, f_low, high, f_high, u, f)
    return False


def secant(low: float, f_low: float, high: float, f_high: float) -> float:
    """Where a function of a share is about zero, between two shares at which it has opposite signs."""
    u = high - f_high * (high - low) / (f_high - f_low) if f_high != f_low else 0.5 * (low + high)
    return u if min(low, high) <= u <= max(low, high) else 0.5 * (low + high)


def narrowed(
    low: float, f_low: float, high: float, f_high: float, u: float, f: float
) -> tuple[float, float, float, float]:
    """What lies on both sides of the zero once a share between is known (Illinois method): that one comes last."""
    if f * f_high < 0.0:
        return high, f_high, u, f
    return low, 0.5 * f_low, u, f
