"""Where the parameter turns about the axis of the joint next to it: the two turn against each other, all others stand.

A hand that may turn about the axis of its last joint is such: what solves one pose of six joints tells all curves.
"""

from __future__ import annotations

import math

from jacokin.arrays import Array
from jacokin.kernels.branches import FAMILY
from jacokin.kernels.closed_form.arm import unpack_arm
from jacokin.kernels.limits import TURN
from jacokin.kernels.six_joints.loop import Form
from jacokin.kernels.solution_set.curve import Walk
from jacokin.kernels.solution_set.slices import AFTER, SevenJoints, SixJoints, Slices, add_slice
from jacokin.kernels.solution_set.trace import CurveEnd, Loops, add_node, enter_run
from jacokin.kernels.tolerances import LIMIT_SNAP

#: [m] and [rad] by which two axes on one line may miss each other: less than solutions may miss the target by.
SAME_AXIS = 1e-10
#: On a turn of both.
CHORDS = 8


def turns_beside(six: SixJoints, walk: Walk) -> bool:
    """Whether it is so, and the six joints are of a form that has all solutions at singular poses as well.

    Curves of others are followed: F along the parameter tells more of solutions that meet.
    """
    k = unpack_arm(six.arm).six
    has_all = k.scale == 0.0 or k.form in (Form.SPHERICAL_WRIST, Form.PARALLEL_AXES)
    return has_all and sense_beside(walk.chain, walk.parameter[0]) != 0.0


def sense_beside(chain: Array, parameter: int) -> float:
    """How the joint next to the parameter turns as that rises and the tool stands: 1 or -1, or 0 for another axis."""
    link = chain[parameter if parameter > 0 else 1]
    away = max(abs(link[0, 2]), abs(link[1, 2]), abs(link[0, 3]), abs(link[1, 3]))
    return -math.copysign(1.0, link[2, 2]) if away <= SAME_AXIS else 0.0


def add_turns(
    kind: int, limits: Array, slices: Slices, loops: Loops, six: SixJoints, seven: SevenJoints, walk: Walk
) -> int:
    """Enter the curve through each solution at the target itself, where it comes with the least rounding.

    The joints that stand are held within limits (2, 7), as at a pose: where an arm is stretched as well, rounding has
    much effect. And where joints may turn against each other at a pose already, there is more than curves.

    Returns:
        How many doubts there are.
    """
    parameter = walk.parameter[0]
    beside, sense = parameter - 1 if parameter > 0 else 1, sense_beside(walk.chain, parameter)
    for j in range(5):
        for side in range(2):
            six.limits[side, j] = limits[side, j if kind == AFTER else 6 - j]
        six.limits[2, j] = LIMIT_SNAP
    add_slice(walk, kind, 0.0, slices, six, seven)
    for j in range(5):
        six.limits[0, j], six.limits[1, j], six.limits[2, j] = -math.inf, math.inf, 0.0
    i = slices.size[0] - 1
    doubts = slices.doubt[i]
    for j in range(7):
        walk.t[j] = 0.0
    walk.t[parameter], walk.t[beside] = math.sqrt(0.5), sense * math.sqrt(0.5)
    for k in range(slices.counts[i]):
        doubts += six.work.branches.rows[k, FAMILY] > 0.0
        first = loops.size[0]
        for n in range(CHORDS + 1):
            for j in range(7):
                walk.x[j] = slices.x[i, k, j]
            walk.x[parameter] += n * TURN / CHORDS
            walk.x[beside] += sense * n * TURN / CHORDS
            add_node(loops, walk.x, walk.t, 0)
        enter_run(loops, first, CurveEnd.CLOSED)
        slices.passed[i, k] = 1
    return int(doubts)
