"""Whether the arcs have all configurations: counted in closed form at values of the parameter of its own.

Configurations come and go where arcs end. Where one does between two slices, a closed curve may lie there too that no
slice meets; so they are counted between the ends, and between them and the slices.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.limits import TURN
from jacokin.kernels.self_motion.arcs import ARCS, Arcs
from jacokin.kernels.self_motion.limit_cuts import Cuts, excess
from jacokin.kernels.self_motion.seven_joints import MOST_AT_Q3, solve_at_q3
from jacokin.kernels.self_motion.slices import SevenJoints, SixJoints, Slices, solve_six

#: [rad] no nearer to an end, where two configurations may count as one.
NEXT_TO_END = 1e-6
#: [rad] a joint this near to a limit may be taken for outside.
ON_LIMIT = 1e-6
#: Ends, and places at which something is missing, that there is room for.
ENDS, MISSING = 2 * ARCS + 2, 16


class Census(NamedTuple):
    """Where configurations are counted, and where arcs lack some."""

    ends: Array  # (ENDS,) of all arcs [rad], from the first slice on
    between: Array  # (ENDS,) those between two slices, rising; these slices before and after them
    missing: Array  # (MISSING,) values of the parameter at which there are more configurations than arcs
    x: Array  # (7,) to work in


def make_census() -> Census:
    """Fresh arrays."""
    return Census(np.empty(ENDS), np.empty(ENDS), np.empty(MISSING), np.zeros(7))


def fill_ends(parameter: int, first: float, arcs: Arcs, census: Census) -> int:
    """Fill census.ends; returns how many there are."""
    count = 0
    for arc in range(arcs.size[1]):
        for side in range(2):
            node = arcs.arcs[arc, 0] if side == 0 else arcs.arcs[arc, 1] - 1
            p = arcs.nodes[node, parameter]
            census.ends[count] = p - TURN * math.floor((p - first) / TURN)
            count += 1
    return count


def fill_between(low: float, high: float, ends: int, census: Census) -> int:
    """Fill census.between with both slices and the ends between them; returns how many those are, with the slices."""
    census.between[0] = low
    count = 1
    for k in range(ends):
        p = census.ends[k]
        if not low < p < high:
            continue
        i = count
        while census.between[i - 1] > p:
            census.between[i] = census.between[i - 1]
            i -= 1
        census.between[i] = p
        count += 1
    census.between[count] = high
    return count + 1


def covering(low: float, high: float, p: float) -> int:
    """How often a span of the parameter passes a value, whole turns apart."""
    return int(math.ceil((high - p) / TURN) - math.floor((low - p) / TURN)) - 1


def take_census(
    chain: Array,
    T: Array,
    parameter: int,
    n: int,
    closed: bool,
    six: SixJoints,
    seven: SevenJoints,
    slices: Slices,
    arcs: Arcs,
    cuts: Cuts,
    found: int,
    census: Census,
) -> tuple[int, int]:
    """Count configurations and arcs, and those within the limits and intervals.

    Args:
        chain: (8, 3, 4).
        T: (4, 4) target.
        parameter: index of the joint that is the parameter.
        n: number of slices.
        closed: the last slice is followed by the first, one turn on.
        six: the arm of six joints.
        seven: the arm of seven joints.
        slices: that the arcs were drawn through.
        arcs: all of them.
        cuts: the intervals.
        found: how many of those there are.
        census: filled with places where arcs are missing.

    Returns:
        How many places of that kind there are, and how many where intervals are missing alone.
    """
    missing, uncut = 0, 0
    ends = fill_ends(parameter, slices.p[0], arcs, census)
    for i in range(n if closed else n - 1):
        number = fill_between(slices.p[i], slices.p[i + 1] if i + 1 < n else slices.p[0] + TURN, ends, census)
        for k in range(number - 1 if number > 2 else 0):
            if census.between[k + 1] - census.between[k] <= 2.0 * NEXT_TO_END:
                continue
            p = 0.5 * (census.between[k] + census.between[k + 1])
            there, within = count_at(chain, T, p, parameter, six, seven, cuts, census)
            for arc in range(arcs.size[1]):
                first, last = arcs.arcs[arc, 0], arcs.arcs[arc, 1] - 1
                there -= covering(arcs.nodes[first, parameter], arcs.nodes[last, parameter], p)
            for row in range(found):
                within -= covering(cuts.intervals[row, 7 + parameter], cuts.intervals[row, 14 + parameter], p)
            if there > 0 and missing < MISSING:
                census.missing[missing] = p
                missing += 1
            elif within > 0:
                uncut += 1
    return missing, uncut


def count_at(
    chain: Array, T: Array, p: float, parameter: int, six: SixJoints, seven: SevenJoints, cuts: Cuts, census: Census
) -> tuple[int, int]:
    """How many configurations there are at a value of the parameter, and how many of them are within the limits."""
    there, within = 0, 0
    number = solve_six(T, p, six) if parameter == 6 else MOST_AT_Q3
    if parameter != 6:
        solve_at_q3(chain, seven.arm, T, p, seven.rows)
    for k in range(number):
        if parameter == 6:
            for j in range(6):
                census.x[j] = six.work.branches.rows[k, j]
            census.x[6] = p
        else:
            if math.isnan(seven.rows[k, 0]):
                continue
            for j in range(7):
                census.x[j] = seven.rows[k, j]
        there += 1
        if excess(census.x, cuts.limits) <= -ON_LIMIT:
            within += 1
    return there, within
