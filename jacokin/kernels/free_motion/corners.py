"""How much of each corner of a way may be cut off by a parabola that is clear."""

from __future__ import annotations

import math

from jacokin.arrays import Array
from jacokin.kernels.free_motion.shortcuts import Way, WayInteger, measure, put
from jacokin.kernels.free_motion.sight import Sight, moves_clear, near_on_curve
from jacokin.kernels.free_motion.space import Space

LARGEST_CUT = 0.45  # of the shorter of two lines is cut off at their corner
CORNER_TRIES = 5  # each cuts half as much
STRAIGHT = 1e-9  # a corner whose directions differ by less is none
SAME = 1e-9  # [rad] a motion that is shorter is none
CHORD = 2e-4  # [m] shapes may be nearer on a parabola than on the chords that are certified


def cut_corners(way: Way, space: Space, dof: int, sight: Sight, cuts: Array, kept: tuple[int, int]) -> None:
    """Fill for each corner how much time at full speed is cut off on both sides of it [s]; 0 where it must stay.

    Corners that are none are left out first. So many corners at the beginning and at the end are kept uncut.
    """
    leave_out_still(way, dof)
    leave_out_straight(way, space, dof)
    measure(way, space, dof)
    last = way.integers[WayInteger.POINTS] - 1
    cuts[0] = cuts[last] = 0.0
    for corner in range(1, last):
        before = way.times[corner] - way.times[corner - 1]
        after = way.times[corner + 1] - way.times[corner]
        cuts[corner], size = 0.0, LARGEST_CUT * min(before, after)
        if not kept[0] < corner < last - kept[1]:
            continue
        turn(way, space, dof, corner - 1, corner)
        for _ in range(CORNER_TRIES):
            if is_parabola_clear(way, space, dof, sight, corner, size / before, size / after, size):
                cuts[corner] = size
                break
            size *= 0.5


def leave_out_still(way: Way, dof: int) -> None:
    """Leave out configurations that are those before them."""
    count = 1
    for k in range(1, way.integers[WayInteger.POINTS]):
        away = 0.0
        for j in range(dof):
            away = max(away, abs(way.q[k * dof + j] - way.q[(count - 1) * dof + j]))
        if away > SAME:
            put(way.q, dof, count, way.q[k * dof : (k + 1) * dof])
            count += 1
    way.integers[WayInteger.POINTS] = count


def leave_out_straight(way: Way, space: Space, dof: int) -> None:
    """Leave out configurations at which a way goes straight on."""
    count, last = 1, way.integers[WayInteger.POINTS] - 1
    for k in range(1, last + 1):
        if k == last or turn(way, space, dof, count - 1, k) >= STRAIGHT:
            put(way.q, dof, count, way.q[k * dof : (k + 1) * dof])
            count += 1
    way.integers[WayInteger.POINTS] = count


def turn(way: Way, space: Space, dof: int, before: int, corner: int) -> float:
    """How sharply a way turns at a corner, between an earlier configuration and the next one, as a part of full speed.

    `way.step` is filled: how sharply each joint does [rad/s].
    """
    here, there, first, last, sharp = corner * dof, before * dof, 0.0, 0.0, 0.0
    for j in range(dof):
        first = max(first, abs(way.q[here + j] - way.q[there + j]) / space.speed[j])
        last = max(last, abs(way.q[here + dof + j] - way.q[here + j]) / space.speed[j])
    for j in range(dof):
        gained = (way.q[here + dof + j] - way.q[here + j]) / last - (way.q[here + j] - way.q[there + j]) / first
        way.step[j] = abs(gained)
        sharp = max(sharp, way.step[j] / space.speed[j])
    return sharp


def is_parabola_clear(
    way: Way, space: Space, dof: int, sight: Sight, corner: int, back: float, ahead: float, size: float
) -> bool:
    """Whether the parabola is clear that leaves and meets the lines of a corner at shares of their lengths.

    `way.step` (dof,) is how sharply each joint turns for each second of the size [s]; the product is half of the
    parabola's second derivative by a parameter that runs from 0 to 1 [rad].
    """
    here, start = corner * dof, way.other[2 * dof : 3 * dof]
    for j in range(dof):
        q = way.q[here + j]
        first, second = back * (way.q[here - dof + j] - q), ahead * (way.q[here + dof + j] - q)
        start[j], sight.contact.course.step[j], sight.sweep.bend[j] = q + first, -2.0 * first, first + second
    low, high = near_on_curve(sight, start)
    if low < 0.0:
        return False
    away = 0.0
    for j in range(dof):
        away += 0.25 * way.step[j] * size * space.levers[j]
    # The chord of one of n equal parts is at most turn / (4 n^2) from its part of the parabola, joint by joint.
    parts = max(2, math.ceil(math.sqrt(away / CHORD)))
    begin, last, new = math.floor(low * parts), way.other[:dof], way.other[dof : 2 * dof]
    for k in range(begin, math.ceil(high * parts) + 1):
        u = k / parts
        for j in range(dof):
            q = way.q[here + j]
            first, second = q + back * (way.q[here - dof + j] - q), q + ahead * (way.q[here + dof + j] - q)
            new[j] = (1.0 - u) * (1.0 - u) * first + 2.0 * u * (1.0 - u) * q + u * u * second
        if k > begin and not moves_clear(sight, last, new, away / (parts * parts)):
            return False
        for j in range(dof):
            last[j] = new[j]
    return True
