"""The member of a seven-joint arm that is nearest to a seed: slices from the seed's joint 3 outwards.

A configuration whose joint 3 is farther from the seed's than the best distance so far cannot be nearer, so the sweep
ends there. On the way from one slice to the next, the distances at both and the way between them bound what may lie
there; only where that leaves a chance the curve is looked at closely.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from jacokin.arrays import Array
from jacokin.kernels.chain import tangent7
from jacokin.kernels.limits import TURN
from jacokin.kernels.self_motion.follow import Walk, follow
from jacokin.kernels.self_motion.gaps import find_elbow_windows, find_maximum, lower_discriminant
from jacokin.kernels.self_motion.graph import bridge
from jacokin.kernels.self_motion.nearest import Nearest, least_distance, offer, search_chord
from jacokin.kernels.self_motion.seven_joints import MOST_AT_Q3, solve_at_q3, wrist_from_shoulder
from jacokin.kernels.self_motion.slices import WINDOW_SAMPLES, SevenJoints, Slices, wrapped

#: Slices to a full turn; the one at the seed comes first.
SWEEP = 48
STEP = TURN / SWEEP
JOINT_3 = 2
#: A curve between two slices is taken to be no longer than this times the way from point to point, and a rest [rad].
WAY, WAY_REST = 1.3, 0.02
#: [rad] most by which the points of a fold are away from the slice.
FOLD_REST = 2.0 * STEP + 0.1
#: Halvings of the gap between slices that a fold lies in, and the way [rad] round the fold from there at most.
FOLD_BISECTIONS, NEXT_TO_FOLD = 12, 0.2
#: Of the way: what the slopes may leave unexplained where a chord is used without following the curve.
CHORD_DEFECT, CHORD_REST = 0.05, 1e-4


class SweepWork(NamedTuple):
    """What a sweep reads and writes."""

    chain: Array  # (8, 3, 4)
    T: Array  # (4, 4) target
    seven: SevenJoints
    slices: Slices
    traced: Array  # see `follow`
    nearest: Nearest
    walk: Walk


def sweep(work: SweepWork) -> bool:
    """Fill nearest.best and nearest.x; False where a curve was lost, so that something nearer may exist."""
    nearest = work.nearest
    middle = SWEEP // 2
    low, high = middle, middle
    nearest.best[0] = math.inf
    solve_slice(work, middle)
    for k in range(1, middle + 1):
        if (k - 1) * STEP >= nearest.best[0]:
            break
        low, high = middle - k, middle + k
        solve_slice(work, low)
        solve_slice(work, high)
    for i in range(low, high):
        bound_links(i, work.slices, nearest)
    found = True
    while True:
        least, i, k = nearest.best[0], -1, -1
        for m in range(low, high):
            for n in range(MOST_AT_Q3):
                if nearest.bounds[m, n] < least:
                    least, i, k = nearest.bounds[m, n], m, n
        if i < 0:
            break
        nearest.bounds[i, k] = math.inf
        found = search_link(work, i, k) and found
    windows = find_elbow_windows(work.chain, wrist_from_shoulder(work.chain, work.seven.arm, work.T), work.seven)
    for n in range(windows):
        found = search_elbow_window(work, low, high, work.seven.windows[n, 0], work.seven.windows[n, 1]) and found
    if windows < 0:
        for sign in (1.0, -1.0):
            found = search_windows(work, low, high, sign) and found
    return found


def solve_slice(work: SweepWork, i: int) -> None:
    """Solve at slice i, and offer what is within the limits."""
    slices, nearest = work.slices, work.nearest
    slices.p[i] = nearest.seed[JOINT_3] + (i - SWEEP // 2) * STEP
    rows = slices.x[i]
    solve_at_q3(work.chain, work.seven.arm, work.T, slices.p[i], rows)
    for k in range(MOST_AT_Q3):
        nearest.done[i, k, 0], nearest.done[i, k, 1] = 0, 0
        slices.sign[i, k] = 0.0
        nearest.distances[i, k] = math.inf
        if not math.isnan(rows[k, 0]):
            nearest.distances[i, k] = least_distance(nearest, rows[k])
            if nearest.distances[i, k] < nearest.best[0]:
                offer(nearest, rows[k])


def way_between(a: Array, b: Array) -> float:
    """Distance between two points on circles [rad]."""
    square = 0.0
    for j in range(7):
        d = wrapped(b[j] - a[j])
        square += d * d
    return math.sqrt(square)


def beyond(nearest: Nearest, x: Array, j: int) -> float:
    """How far a limited joint is outside its limits [rad], negative inside."""
    middle, half = (
        0.5 * (nearest.limits[0, j] + nearest.limits[1, j]),
        0.5 * (nearest.limits[1, j] - nearest.limits[0, j]),
    )
    return float(abs(wrapped(x[j] - middle)) - half)


def bound_way(a: Array, b: Array, way: float, d_a: float, d_b: float, nearest: Nearest) -> float:
    """A lower bound of the distance on a curve of this length at most between two points; inf outside the limits."""
    for j in range(7):
        if nearest.limits[0, j] > -math.inf and beyond(nearest, a, j) + beyond(nearest, b, j) > way:
            return math.inf
    return max(0.5 * (d_a + d_b - way), 0.0)


def bound_links(i: int, slices: Slices, nearest: Nearest) -> None:
    """Fill nearest.bounds[i] with lower bounds between slice i and the next."""
    for k in range(MOST_AT_Q3):
        here, there = nearest.distances[i, k], nearest.distances[i + 1, k]
        nearest.bounds[i, k] = math.inf
        if here < math.inf and there < math.inf:
            way = WAY * way_between(slices.x[i, k], slices.x[i + 1, k]) + WAY_REST
            nearest.bounds[i, k] = bound_way(slices.x[i, k], slices.x[i + 1, k], way, here, there, nearest)
        elif here < math.inf or there < math.inf:
            # It turns back, to a configuration with the other sign of joint 2 or of joint 4.
            e = i if here < math.inf else i + 1
            for flip in (2, 4):
                other = k ^ flip
                if nearest.distances[e, other] < math.inf:
                    way = WAY * way_between(slices.x[e, k], slices.x[e, other]) + FOLD_REST
                    bound = bound_way(
                        slices.x[e, k],
                        slices.x[e, other],
                        way,
                        nearest.distances[e, k],
                        nearest.distances[e, other],
                        nearest,
                    )
                    nearest.bounds[i, k] = min(nearest.bounds[i, k], bound)


def fill_tangent(work: SweepWork, i: int, k: int) -> bool:
    """Make sure that point k of slice i has a tangent."""
    slices, walk = work.slices, work.walk
    if slices.sign[i, k] == 0.0:
        for j in range(7):
            walk.border[j] = 1.0 if j == JOINT_3 else 0.0
        slices.sign[i, k] = tangent7(work.chain, work.T, slices.x[i, k], walk.border, slices.t[i, k], walk.system)
    return bool(slices.sign[i, k] != 0.0)


def search_link(work: SweepWork, i: int, k: int) -> bool:
    """Look for a nearer point between slice i and the next on the curve through point k."""
    slices, nearest = work.slices, work.nearest
    here, there = nearest.distances[i, k] < math.inf, nearest.distances[i + 1, k] < math.inf
    if here and there:
        if is_chord(work, i, k, nearest.stack[0]):
            nearest.done[i, k, 1], nearest.done[i + 1, k, 0] = 1, 1
            return search_chord(work.chain, work.T, nearest, work.walk)
        if slices.sign[i, k] != 0.0 and slices.sign[i, k] == slices.sign[i + 1, k]:
            ends = (slices.x[i, k], slices.t[i, k], slices.x[i + 1, k], slices.t[i + 1, k])
            rows = bridge(
                work.chain, work.T, work.seven, k, ends, slices.sign[i, k], slices.p[i], slices.p[i + 1],
                work.traced, 0, work.walk,
            )  # fmt: skip
            if rows > 0:
                nearest.done[i, k, 1], nearest.done[i + 1, k, 0] = 1, 1
                return search_traced(work, i, k, 1.0, rows)
    if here != there:
        e = i if here else i + 1
        if bound_to_fold(work, e, 2 * i + 1 - e, k) >= nearest.best[0]:
            return True
    found = True
    if here and nearest.done[i, k, 1] == 0:
        found = follow_from(work, i, k, 1, i + 1)
    if there and nearest.done[i + 1, k, 0] == 0:
        found = follow_from(work, i + 1, k, 0, i) and found
    return found


def bound_to_fold(work: SweepWork, e: int, beyond_fold: int, k: int) -> float:
    """A lower bound of the distance on the curve from point k of slice e to a fold, and on to where it comes back.

    As `bound_links` gives it, but by way of the points next to the fold, so that it is not farther away than need be.
    """
    chain, T, seven, slices, nearest = work.chain, work.T, work.seven, work.slices, work.nearest
    D0 = wrist_from_shoulder(chain, seven.arm, T)
    sign = 1.0 if k < MOST_AT_Q3 // 2 else -1.0
    inside, outside = slices.p[e], slices.p[beyond_fold]
    for _ in range(FOLD_BISECTIONS):
        middle = 0.5 * (inside + outside)
        if lower_discriminant(chain, seven.arm, D0, middle, sign) > 0.0:
            inside = middle
        else:
            outside = middle
    solve_at_q3(chain, seven.arm, T, inside, seven.rows)
    other, across = -1, math.inf
    for flip in (2, 4):
        partner = k ^ flip
        if nearest.distances[e, partner] < math.inf and not math.isnan(seven.rows[partner, 0]):
            way = way_between(seven.rows[k], seven.rows[partner])
            if way < across:
                other, across = partner, way
    if other < 0 or math.isnan(seven.rows[k, 0]) or across > NEXT_TO_FOLD:
        return 0.0
    a, b, c, d = slices.x[e, k], seven.rows[k], seven.rows[other], slices.x[e, other]
    d_b, d_c = least_distance(nearest, b), least_distance(nearest, c)
    there = bound_way(a, b, WAY * way_between(a, b) + WAY_REST, nearest.distances[e, k], d_b, nearest)
    turn = bound_way(b, c, WAY * across + WAY_REST, d_b, d_c, nearest)
    back = bound_way(c, d, WAY * way_between(c, d) + WAY_REST, d_c, nearest.distances[e, other], nearest)
    return min(there, turn, back)


def search_traced(work: SweepWork, i: int, k: int, flip: float, rows: int) -> bool:
    """Look for a nearer point on a curve from point k of slice i, with flip times its tangent."""
    slices, traced, nearest = work.slices, work.traced, work.nearest
    found = True
    for n in range(rows):
        for m in range(7):
            x = slices.x[i, k, m] if n == 0 else traced[n - 1, m]
            nearest.stack[0, m] = x
            nearest.stack[0, 7 + m] = flip * slices.t[i, k, m] if n == 0 else traced[n - 1, 7 + m]
            nearest.stack[0, 14 + m] = x + wrapped(traced[n, m] - x)
            nearest.stack[0, 21 + m] = traced[n, 7 + m]
        found = search_chord(work.chain, work.T, nearest, work.walk) and found
    return found


def is_chord(work: SweepWork, i: int, k: int, chord: Array) -> bool:
    """Fill chord (28,) with both nodes; False where the slopes at both ends do not explain the way between them."""
    slices = work.slices
    if not (fill_tangent(work, i, k) and fill_tangent(work, i + 1, k)):
        return False
    if slices.sign[i, k] != slices.sign[i + 1, k]:
        return False
    a, ta, b, tb = slices.x[i, k], slices.t[i, k], slices.x[i + 1, k], slices.t[i + 1, k]
    way = way_between(a, b)
    for j in range(7):
        d = wrapped(b[j] - a[j])
        slope = ta[j] / ta[JOINT_3] + tb[j] / tb[JOINT_3]
        if abs(d - 0.5 * STEP * slope) > CHORD_REST + CHORD_DEFECT * way:
            return False
        chord[j], chord[7 + j], chord[14 + j], chord[21 + j] = a[j], ta[j], a[j] + d, tb[j]
    return True


def follow_from(work: SweepWork, i: int, k: int, side: int, j: int) -> bool:
    """Follow the curve from point k of slice i towards slice j at one side, and look at each step.

    It may come back through a fold.
    """
    slices, nearest, traced = work.slices, work.nearest, work.traced
    nearest.done[i, k, side] = 1
    if not fill_tangent(work, i, k):
        return False
    x, t, here, there = slices.x[i, k], slices.t[i, k], slices.p[i], slices.p[j]
    rows, wall = follow(work.chain, work.T, x, t, JOINT_3, here, there, traced, 0, work.walk)
    found = search_traced(work, i, k, 1.0 if side == 1 else -1.0, rows)
    if wall >= 0:
        e, r = (i, side) if wall == 0 else (j, 1 - side)
        for n in range(MOST_AT_Q3):
            if nearest.distances[e, n] < math.inf and way_between(slices.x[e, n], traced[rows - 1, 0:7]) < 1e-6:
                nearest.done[e, n, r] = 1
    return found and wall >= 0


def search_windows(work: SweepWork, low: int, high: int, sign: float) -> bool:
    """Look at curves that lie between two slices entirely, with one of the two signs of joint 4."""
    chain, arm7, T, slices, nearest = work.chain, work.seven.arm, work.T, work.slices, work.nearest
    D0 = wrist_from_shoulder(chain, arm7, T)
    first = 0 if sign > 0.0 else 4
    step = STEP / WINDOW_SAMPLES
    found = True
    for i in range(low, high):
        seen_low, seen_high = nearest.distances[i, first] < math.inf, nearest.distances[i + 1, first] < math.inf
        away = min(abs(slices.p[i] - nearest.seed[JOINT_3]), abs(slices.p[i + 1] - nearest.seed[JOINT_3]))
        if (seen_low and seen_high) or away >= nearest.best[0]:
            continue
        # A run of positive discriminants that includes neither slice is a window; so may be a maximum just below 0.
        seen, peak, peak_at = seen_low, -math.inf, 0.0
        before = lower_discriminant(chain, arm7, D0, slices.p[i] - step, sign)
        here = lower_discriminant(chain, arm7, D0, slices.p[i], sign)
        for n in range(WINDOW_SAMPLES + 1):
            p = slices.p[i] + n * step
            after = lower_discriminant(chain, arm7, D0, p + step, sign)
            at, value = p, -math.inf
            if here > 0.0:
                if here > peak:
                    peak, peak_at = here, p
                if not after > 0.0:
                    if not seen and n < WINDOW_SAMPLES:
                        at, value = peak_at, peak
                    seen, peak = False, -math.inf
            elif here >= before and here >= after:
                at, value = find_maximum(chain, arm7, D0, p - step, p + step, sign)
            if value > 0.0:
                found = search_window(work, at, i, first) and found
            before, here = here, after
    return found


def search_elbow_window(work: SweepWork, low: int, high: int, at: float, sign: float) -> bool:
    """Look at the curves in a window between edges of joint 3, with one of the two signs of joint 4; 0 for none."""
    seed, slices = work.nearest.seed[JOINT_3], work.slices
    at = seed + wrapped(at - seed)
    i = SWEEP // 2 + math.floor((at - seed) / STEP)
    if sign == 0.0 or not low <= i < high:
        return True
    # The window may reach as far as the slices on both sides.
    if min(abs(slices.p[i] - seed), abs(slices.p[i + 1] - seed)) >= work.nearest.best[0]:
        return True
    return search_window(work, at, i, 0 if sign > 0.0 else 4)


def search_window(work: SweepWork, at: float, i: int, first: int) -> bool:
    """Look at the curves through four configurations with joint 3 near slices i and i + 1."""
    slices = work.slices
    spare = slices.x.shape[0] - 1
    solve_at_q3(work.chain, work.seven.arm, work.T, at, slices.x[spare])
    slices.p[spare] = at
    found = True
    for k in range(first, first + 4):
        slices.sign[spare, k] = 0.0
        if math.isnan(slices.x[spare, k, 0]):
            continue
        offer(work.nearest, slices.x[spare, k])
        for side in range(2):
            j = i + side
            if (slices.p[j] > at) == (side == 1):
                found = follow_from(work, spare, k, side, j) and found
    return found
