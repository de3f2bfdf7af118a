"""Following a self-motion step by step: predictor along the null space, corrector on the plane across it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.chain import bordered_newton, null_tangent, tangent7

#: [rad] longest step along a curve.
LONGEST_STEP = 0.1
#: [rad] a curve that cannot be followed with steps of this length is given up.
SHORTEST_STEP = 1e-8
#: [m] and [rad]; Newton stops at this closure, far above rounding and far below what is promised.
CURVE_CLOSURE = 1e-12
#: The same on the way along a curve: where it nearly closes up, the place of a fold is off by a million times as much.
STEP_CLOSURE = 1e-14
#: [m] and [rad]; a point that closes worse is not on the curve.
WORST_CLOSURE = 1e-9
#: Least cosine between the tangents at both ends of a step.
TURNING = 0.96
#: Square of the correction, relative to the step's.
CORRECTION = 0.04
#: |dp/ds| at a fold: p then differs from the fold's by the square of this.
FOLD_SLOPE = 1e-9
FOLD_STEPS = 60
MOST_STEPS = 2000
#: [m] and [rad]; points between nodes are what users get: as exact as rounding allows.
POINT_CLOSURE = 1e-14
#: [rad] how far p may be off.
PARAMETER_ACCURACY = 1e-14
BISECTIONS = 60
#: [m] and [rad]; a place that Newton's method leads to from the cubic is taken where it closes so well and, as a share
#: of the chord, is no farther from there.
PLACE_CLOSURE, PLACE_CORRECTION = 1e-13, 0.01
CUBIC_STEPS = 4


class Walk(NamedTuple):
    """Where a walk along a curve stands; one set for each thread."""

    x: Array  # (7,) the last point [rad]
    t: Array  # (7,) its tangent
    y: Array  # (7,) the point ahead
    ty: Array  # (7,)
    z: Array  # (7,) a point between them
    tz: Array  # (7,)
    bend: Array  # (7,) how the tangent turned on the last step, for a distance of 1
    border: Array  # (7,)
    system: Array  # (7, 8)


def make_walk() -> Walk:
    """Fresh arrays."""
    a, b, c, d, e, f, g, h = (np.empty(7) for _ in range(8))
    return Walk(a, b, c, d, e, f, g, h, np.empty((7, 8)))


def advance(chain: Array, T: Array, walk: Walk, h: float, y: Array, ty: Array, sign: float) -> bool:
    """Fill y and ty with the curve's point a distance h along the tangent of walk.x, and its tangent.

    False where the step cannot be trusted: too far from the tangent, too much of a turn, or another curve.
    """
    x, t = walk.x, walk.t
    offset = h
    for j in range(7):
        y[j] = x[j] + h * (t[j] + 0.5 * h * walk.bend[j])
        offset += t[j] * x[j]
    # Where two curves nearly meet, points between them close to 1e-10 as well.
    closure = bordered_newton(chain, T, y, t, offset, walk.system, 6, STEP_CLOSURE)
    if not closure <= CURVE_CLOSURE:
        return False
    correction, cosine = 0.0, 0.0
    for j in range(7):
        d = y[j] - x[j] - h * t[j]
        correction += d * d
    if correction > CORRECTION * h * h or tangent_at(chain, T, y, closure, STEP_CLOSURE, t, ty, walk) != sign:
        return False
    for j in range(7):
        cosine += t[j] * ty[j]
    return cosine >= TURNING


def tangent_at(
    chain: Array, T: Array, x: Array, closure: float, tolerance: float, border: Array, t: Array, walk: Walk
) -> float:
    """As `tangent7`, where `bordered_newton` with this tolerance came to x and returned this closure.

    Where that was good enough, the Jacobian of x is in walk.system already.
    """
    if closure <= tolerance:
        return null_tangent(border, t, walk.system)
    return tangent7(chain, T, x, border, t, walk.system)


def fill_bend(walk: Walk, t: Array, way: float) -> None:
    """Fill walk.bend from the tangents walk.t and t, so far apart along the curve."""
    for j in range(7):
        walk.bend[j] = (t[j] - walk.t[j]) / way


def find_fold(chain: Array, T: Array, walk: Walk, h: float, parameter: int, sign: float) -> float:
    """Fill walk.z and walk.tz with the point between walk.x and walk.y where dp/ds = 0; returns its distance, or -1."""
    a, fa, b, fb = 0.0, walk.t[parameter], h, walk.ty[parameter]
    fill_bend(walk, walk.ty, h)
    for _ in range(FOLD_STEPS):
        s = b - fb * (b - a) / (fb - fa) if fb != fa else 0.5 * (a + b)
        if not min(a, b) < s < max(a, b):
            s = 0.5 * (a + b)
        if not advance(chain, T, walk, s, walk.z, walk.tz, sign):
            return -1.0
        f = walk.tz[parameter]
        if abs(f) < FOLD_SLOPE or abs(b - a) < 1e-13:
            return s
        if f * fb < 0.0:
            a, fa = b, fb
        else:
            fa *= 0.5
        b, fb = s, f
    return -1.0


def reach_wall(chain: Array, T: Array, walk: Walk, way: float, parameter: int, wall: float, sign: float) -> bool:
    """Fill walk.z and walk.tz with the point between walk.x and a distance way ahead where p = wall."""
    for j in range(7):
        walk.border[j] = 1.0 if j == parameter else 0.0
    closure = bordered_newton(chain, T, walk.z, walk.border, wall, walk.system, 12, CURVE_CLOSURE)
    if not closure <= CURVE_CLOSURE:
        return False
    along, across = 0.0, 0.0
    for j in range(7):
        along += walk.t[j] * (walk.z[j] - walk.x[j])
    for j in range(7):
        d = walk.z[j] - walk.x[j] - along * walk.t[j]
        across += d * d
    if not -1e-9 <= along <= way + 1e-6 or across > CORRECTION * way * way + 1e-18:
        return False
    return tangent_at(chain, T, walk.z, closure, CURVE_CLOSURE, walk.t, walk.tz, walk) == sign


def record(traced: Array, n: int, x: Array, t: Array, fold: float) -> None:
    """Row n of traced (15,): point, tangent, and 1 at a fold."""
    for j in range(7):
        traced[n, j] = x[j]
        traced[n, 7 + j] = t[j]
    traced[n, 14] = fold


def follow(
    chain: Array,
    T: Array,
    x0: Array,
    t0: Array,
    parameter: int,
    here: float,
    there: float,
    traced: Array,
    first: int,
    walk: Walk,
) -> tuple[int, int]:
    """Follow the curve from x0, where p = here, towards p = there, through folds, until it meets one of the two walls.

    Args:
        chain: (8, 3, 4).
        T: (4, 4) target.
        x0: (7,) a point of the curve.
        t0: (7,) its tangent, of either sign.
        parameter: index of the joint that is the parameter.
        here: p at x0 [rad].
        there: the other wall [rad].
        traced: (n, 15) filled from row first with the points after x0, the last one on a wall.
        first: see above.
        walk: workspace.

    Returns:
        How many rows were filled, and the wall that was met: 0 here, 1 there, -1 the curve was lost.
    """
    x, t, y, ty, z, tz = walk.x, walk.t, walk.y, walk.ty, walk.z, walk.tz
    forward = (there > here) == (t0[parameter] > 0.0)
    for j in range(7):
        x[j] = x0[j]
        t[j] = t0[j] if forward else -t0[j]
        walk.bend[j] = 0.0
    sign = tangent7(chain, T, x, t, tz, walk.system)
    low, high = min(here, there), max(here, there)
    rising = there > here
    n, h = first, 0.5 * LONGEST_STEP
    for _ in range(MOST_STEPS):
        if n + 3 >= traced.shape[0] or h < SHORTEST_STEP or sign == 0.0:
            return n - first, -1
        if not advance(chain, T, walk, h, y, ty, sign):
            h *= 0.5
            continue
        way = h
        fold = (ty[parameter] > 0.0) != rising
        if fold:
            way = find_fold(chain, T, walk, h, parameter, sign)
            if way < 0.0:
                h *= 0.5
                continue
        end = z[parameter] if fold else y[parameter]
        wall = high if rising else low
        if (end >= wall) == rising or end == wall:
            share = (wall - x[parameter]) / (end - x[parameter]) if end != x[parameter] else 0.0
            if fold:  # p is a parabola up to the fold
                share = 1.0 - math.sqrt(max(0.0, 1.0 - share))
            fill_bend(walk, ty, h)
            s = way_to(wall - x[parameter], t[parameter], walk.bend[parameter], share * way, way)
            for j in range(7):
                z[j] = x[j] + s * (t[j] + 0.5 * s * walk.bend[j])
            if not reach_wall(chain, T, walk, way, parameter, wall, sign):
                h *= 0.5
                continue
            record(traced, n, z, tz, 0.0)
            return n + 1 - first, 1 if wall == there else 0
        if fold:
            record(traced, n, z, tz, 1.0)
            n += 1
            rising = not rising
            wall = high if rising else low
            if (y[parameter] >= wall) == rising:  # the wall behind the fold is nearer than y: go on from the fold
                fill_bend(walk, tz, way)
                for j in range(7):
                    x[j], t[j] = z[j], tz[j]
                h = max(0.5 * (h - way), 16.0 * SHORTEST_STEP)
                continue
        record(traced, n, y, ty, 0.0)
        n += 1
        fill_bend(walk, ty, h)
        for j in range(7):
            x[j], t[j] = y[j], ty[j]
        h = min(1.6 * h, LONGEST_STEP)
    return n - first, -1


def way_to(rise: float, slope: float, bend: float, straight: float, farthest: float) -> float:
    """Where slope s + bend s^2 / 2 has risen so far; `straight` if that is not between 0 and the farthest."""
    square = slope * slope + 2.0 * bend * rise
    bottom = slope + math.copysign(math.sqrt(square), slope) if square >= 0.0 else 0.0
    s = 2.0 * rise / bottom if bottom != 0.0 else -1.0
    return s if 0.0 <= s <= farthest else straight


def chord_length(a: Array, b: Array) -> float:
    """Distance between two nodes in joint space [rad]."""
    square = 0.0
    for j in range(7):
        square += (b[j] - a[j]) * (b[j] - a[j])
    return math.sqrt(square)


def share_of(a: Array, b: Array, x: Array) -> float:
    """The share of the chord between two nodes (14,) that a point (7,) between them lies across."""
    along, square = 0.0, 0.0
    for j in range(7):
        along += (x[j] - a[j]) * (b[j] - a[j])
        square += (b[j] - a[j]) * (b[j] - a[j])
    return along / square if square > 0.0 else 0.0


def cubic_between(a: Array, b: Array, length: float, u: float, j: int) -> float:
    """Joint j at a share u of the chord between two nodes (14,), by the cubic through both."""
    v = 1.0 - u
    return float(
        (1.0 + 2.0 * u) * v * v * a[j]
        + u * v * v * length * a[7 + j]
        + u * u * (3.0 - 2.0 * u) * b[j]
        - u * u * v * length * b[7 + j]
    )


def closure_between(chain: Array, T: Array, a: Array, b: Array, share: float, x: Array, walk: Walk) -> float:
    """Fill x with the curve's point across the chord between two nodes (14,) at a share of it; how well it closes."""
    length = chord_length(a, b)
    if length == 0.0:
        for j in range(7):
            x[j] = a[j]
        return WORST_CLOSURE
    offset = 0.0
    for j in range(7):
        walk.border[j] = (b[j] - a[j]) / length
        x[j] = cubic_between(a, b, length, share, j)
        offset += walk.border[j] * (a[j] + share * (b[j] - a[j]))
    return bordered_newton(chain, T, x, walk.border, offset, walk.system, 8, POINT_CLOSURE)


def between(chain: Array, T: Array, a: Array, b: Array, share: float, x: Array, walk: Walk) -> bool:
    """As `closure_between`; False if the point was not found."""
    return closure_between(chain, T, a, b, share, x, walk) <= WORST_CLOSURE


def node_between(chain: Array, T: Array, a: Array, b: Array, share: float, walk: Walk) -> float:
    """As `between`, with the point in walk.x and its tangent in walk.t; the sign of `tangent7`, 0 if not found."""
    closure = closure_between(chain, T, a, b, share, walk.x, walk)
    if not closure <= WORST_CLOSURE:
        return 0.0
    return tangent_at(chain, T, walk.x, closure, POINT_CLOSURE, walk.border, walk.t, walk)


def place_joint(chain: Array, T: Array, a: Array, b: Array, j: int, value: float, x: Array, walk: Walk) -> float:
    """As `where_joint_is`, by Newton's method from the cubic; -1 where that leads away from there."""
    length = chord_length(a, b)
    rise = b[j] - a[j]
    share = (value - a[j]) / rise
    for _ in range(CUBIC_STEPS):
        slope = (
            rise
            + (1.0 - 2.0 * share) * ((1.0 - share) * (length * a[7 + j] - rise) - share * (length * b[7 + j] - rise))
            - share * (1.0 - share) * (length * (a[7 + j] + b[7 + j]) - 2.0 * rise)
        )
        if slope * rise <= 0.0:
            return -1.0
        share -= (cubic_between(a, b, length, share, j) - value) / slope
        if not 0.0 <= share <= 1.0:
            return -1.0
    for m in range(7):
        walk.border[m] = 1.0 if m == j else 0.0
        walk.y[m] = cubic_between(a, b, length, share, m)
        x[m] = walk.y[m]
    closure = bordered_newton(chain, T, x, walk.border, value, walk.system, 6, POINT_CLOSURE)
    correction = 0.0
    for m in range(7):
        walk.border[m] = (b[m] - a[m]) / length
        correction += (x[m] - walk.y[m]) * (x[m] - walk.y[m])
    if not (closure <= PLACE_CLOSURE and correction <= PLACE_CORRECTION * PLACE_CORRECTION * length * length):
        return -1.0
    share = share_of(a, b, x)
    return share if 0.0 < share < 1.0 else -1.0


def where_joint_is(chain: Array, T: Array, a: Array, b: Array, j: int, value: float, x: Array, walk: Walk) -> float:
    """Fill x with the point between two nodes where joint j has a value that lies between theirs; its share, or -1.

    Leaves the direction of the chord in walk.border.
    """
    low, f_low, high, f_high = 0.0, a[j] - value, 1.0, b[j] - value
    if f_low == 0.0 or f_high == 0.0:
        share = 0.0 if f_low == 0.0 else 1.0
        return share if between(chain, T, a, b, share, x, walk) else -1.0
    if f_low * f_high < 0.0:
        share = place_joint(chain, T, a, b, j, value, x, walk)
        if share >= 0.0:
            return share
    for _ in range(BISECTIONS):
        share = high - f_high * (high - low) / (f_high - f_low) if f_high != f_low else 0.5 * (low + high)
        if not min(low, high) <= share <= max(low, high):
            share = 0.5 * (low + high)
        if not between(chain, T, a, b, share, x, walk):
            return -1.0
        f = x[j] - value
        if abs(f) <= PARAMETER_ACCURACY or abs(high - low) < 1e-15:
            return share
        if f * f_high < 0.0:
            low, f_low = high, f_high
        else:
            f_low *= 0.5
        high, f_high = share, f
    return -1.0
