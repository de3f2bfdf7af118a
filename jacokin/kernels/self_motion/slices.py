"""All configurations at given values of the parameter: the points that the curves are drawn through."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.branches import COLUMNS, MAX_BRANCHES, PoseQuery
from jacokin.kernels.chain import bordered_newton, linearise7, null_tangent, tangent7
from jacokin.kernels.closed_form.arm import ARM_CONSTANTS, unpack_arm
from jacokin.kernels.closed_form.pose import Work, make_work, solve_pose
from jacokin.kernels.limits import TURN
from jacokin.kernels.self_motion.follow import CURVE_CLOSURE, WORST_CLOSURE, Walk
from jacokin.kernels.self_motion.seven_joints import MOST_AT_Q3, solve_at_q3

#: Values of the parameter at most, and points at each.
SLICES, POINTS = 192, 24
#: Values of the parameter that are solved at, for a full turn: about a free axis, and of seven joints.
SLICES_SIX, SLICES_SEVEN = 96, 48
#: Samples of joint 3 from one slice to the next, see `gaps`, and of a full turn.
WINDOW_SAMPLES = 4
SAMPLES = WINDOW_SAMPLES * SLICES_SEVEN
#: Edges of joint 3 of seven joints, and windows between them, at most.
EDGES, WINDOWS = 8, 32
#: Points without a tangent that are kept.
SINGULAR = 32
#: Points at quarter turns of the parameter that are kept, and [rad] values that are a quarter turn but for rounding.
QUARTER_POINTS, SAME_PARAMETER = 5 * POINTS, 1e-9


class SixJoints(NamedTuple):
    """A six-joint arm and the free axis of its tool."""

    chain: Array  # (7, 3, 4)
    arm: Array  # (46,)
    limits: Array  # (3, 6)
    axis: Array  # (3,) unit vector in the tool frame
    T: Array  # (4, 4) the target turned about the axis
    seed: Array  # (6,)
    work: Work


class SevenJoints(NamedTuple):
    """A seven-joint arm."""

    arm: Array  # (12,) as `seven_joints.solve_at_q3` needs it
    rows: Array  # (8, 7)
    edges: Array  # (EDGES,) joint 3 where both values of joint 4 are one, see `gaps`
    samples: Array  # (SAMPLES + 3, 3) `seven_joints.discriminants` at values evenly apart
    windows: Array  # (WINDOWS, 2) joint 3 in windows between them, and the sign of joint 4; sign 0 in gaps between two


class Slices(NamedTuple):
    """Points of the curves by the value of the parameter."""

    p: Array  # (SLICES,) [rad], rising
    filled: NDArray[np.int64]  # (SLICES,) points at each
    x: Array  # (SLICES, POINTS, 7) [rad]
    t: Array  # (SLICES, POINTS, 7) unit tangents, dp/ds >= 0
    sign: Array  # (SLICES, POINTS) of the determinant, see `chain.tangent7`
    label: NDArray[np.int64]  # (SLICES, POINTS) row of `seven_joints.solve_at_q3`; -1 for none
    crossed: NDArray[np.int64]  # (SLICES,) 1 where curves meet on the way to the next slice
    singular: Array  # (SINGULAR, 7) points without a tangent, as far as there is room


class Quarters(NamedTuple):
    """Points at quarter turns of the parameter: what is singular in a structured target is so there."""

    filled: NDArray[np.int64]  # (1,) how many
    rows: Array  # (QUARTER_POINTS, 8) points, and how far the tool moves there at least, see `least_motion`
    square: Array  # (7, 6) for `least_motion`


def make_six_joints() -> SixJoints:
    """Fresh arrays."""
    work = make_work(np.empty((MAX_BRANCHES, COLUMNS)))
    return SixJoints(
        np.zeros((7, 3, 4)), np.zeros(ARM_CONSTANTS), np.zeros((3, 6)), np.zeros(3), np.eye(4), np.zeros(6), work
    )


def make_seven_joints() -> SevenJoints:
    """Fresh arrays."""
    samples, windows = np.empty((SAMPLES + 3, 3)), np.empty((WINDOWS, 2))
    return SevenJoints(np.zeros(12), np.empty((MOST_AT_Q3, 7)), np.empty(EDGES), samples, windows)


def make_slices() -> Slices:
    """Fresh arrays."""
    points = (SLICES, POINTS)
    return Slices(
        np.zeros(SLICES),
        np.zeros(SLICES, np.int64),
        np.empty((*points, 7)),
        np.empty((*points, 7)),
        np.empty(points),
        np.zeros(points, np.int64),
        np.zeros(SLICES, np.int64),
        np.empty((SINGULAR, 7)),
    )


def make_quarters() -> Quarters:
    """Fresh arrays."""
    return Quarters(np.zeros(1, np.int64), np.empty((QUARTER_POINTS, 8)), np.empty((7, 6)))


def wrapped(angle: float) -> float:
    """The copy of an angle in [-pi, pi)."""
    return angle - TURN * math.floor(angle / TURN + 0.5)


def turn_target(T: Array, axis: Array, angle: float, turned: Array) -> None:
    """Fill turned with T Rot(axis, angle)."""
    c, s = math.cos(angle), math.sin(angle)
    x, y, z = axis[0], axis[1], axis[2]
    for i in range(3):
        a, b, d = T[i, 0], T[i, 1], T[i, 2]
        along = (1.0 - c) * (a * x + b * y + d * z)
        turned[i, 0] = c * a + along * x + s * (b * z - d * y)
        turned[i, 1] = c * b + along * y + s * (d * x - a * z)
        turned[i, 2] = c * d + along * z + s * (a * y - b * x)
        turned[i, 3] = T[i, 3]
    turned[3, 0], turned[3, 1], turned[3, 2], turned[3, 3] = 0.0, 0.0, 0.0, 1.0


def solve_six(T: Array, p: float, six: SixJoints) -> int:
    """All branches of the six-joint arm with its tool turned by p [rad], in six.work.branches.rows; how many."""
    turn_target(T, six.axis, p, six.T)
    solve_pose(six.arm, unpack_arm(six.arm), PoseQuery(six.chain, six.limits, six.T, six.seed), six.work)
    return int(six.work.branches.filled[0])


def add_point(chain: Array, T: Array, parameter: int, i: int, slices: Slices, walk: Walk) -> bool:
    """Count the point at slices.x[i, filled[i]] in if it lies on a curve; fills its tangent."""
    k = slices.filled[i]
    for j in range(7):
        walk.border[j] = 1.0 if j == parameter else 0.0
    sign = tangent7(chain, T, slices.x[i, k], walk.border, slices.t[i, k], walk.system)
    if sign == 0.0:
        return False
    slices.sign[i, k] = sign
    slices.label[i, k] = -1
    slices.filled[i] = k + 1
    return True


def add_row(chain: Array, T: Array, i: int, label: int, seven: SevenJoints, slices: Slices, walk: Walk) -> bool:
    """As `add_point`, for a row of `seven.rows`, improved where its closure asks for it."""
    k = slices.filled[i]
    x = slices.x[i, k]
    for j in range(7):
        x[j] = seven.rows[label, j]
        walk.border[j] = 1.0 if j == 2 else 0.0
    if linearise7(chain, T, x, walk.system) > CURVE_CLOSURE:
        if bordered_newton(chain, T, x, walk.border, slices.p[i], walk.system, 6, CURVE_CLOSURE) > WORST_CLOSURE:
            return False
        linearise7(chain, T, x, walk.system)
    sign = null_tangent(walk.border, slices.t[i, k], walk.system)
    if sign == 0.0:
        return False
    slices.sign[i, k] = sign
    slices.label[i, k] = label
    slices.filled[i] = k + 1
    return True


def keep_singular(slices: Slices, i: int, lost: int) -> int:
    """Keep the point that could not be counted in at slice i; returns how many there are."""
    if lost < SINGULAR:
        for j in range(7):
            slices.singular[lost, j] = slices.x[i, slices.filled[i], j]
    return lost + 1


def fill_slices(
    chain: Array, T: Array, parameter: int, n: int, slices: Slices, six: SixJoints, seven: SevenJoints, walk: Walk
) -> int:
    """Solve at the first n values of slices.p; returns how many points could not be used (exactly on a fold)."""
    lost = 0
    for i in range(n):
        slices.filled[i] = 0
        p = slices.p[i]
        if parameter == 6:
            found = solve_six(T, p, six)
            for k in range(found):
                for j in range(6):
                    slices.x[i, slices.filled[i], j] = six.work.branches.rows[k, j]
                slices.x[i, slices.filled[i], 6] = p
                if not add_point(chain, T, parameter, i, slices, walk):
                    lost = keep_singular(slices, i, lost)
            continue
        solve_at_q3(chain, seven.arm, T, p, seven.rows)
        for k in range(MOST_AT_Q3):
            if math.isnan(seven.rows[k, 0]):
                continue
            if not add_row(chain, T, i, k, seven, slices, walk):
                lost = keep_singular(slices, i, lost)
    return lost


def measure_quarters(chain: Array, T: Array, n: int, slices: Slices, quarters: Quarters, walk: Walk) -> None:
    """Keep the points at quarter turns among the first n values of slices.p."""
    filled, rows = 0, quarters.rows
    for i in range(n):
        p = slices.p[i]
        if abs(p - 0.25 * TURN * math.floor(p / (0.25 * TURN) + 0.5)) >= SAME_PARAMETER:
            continue
        for k in range(slices.filled[i]):
            if filled == QUARTER_POINTS:
                break
            for j in range(7):
                rows[filled, j] = slices.x[i, k, j]
            linearise7(chain, T, slices.x[i, k], walk.system)
            rows[filled, 7] = least_motion(walk.system, quarters.square)
            filled += 1
    quarters.filled[0] = filled


def least_motion(system: Array, square: Array) -> float:
    """A lower bound of the smallest singular value of a Jacobian, at most a root of six too low.

    Squares of singular values add up in the trace of the inverse of J J^T, which Cholesky's factor gives.

    Args:
        system: (7, 8) the Jacobian in its first six rows and seven columns.
        square: (7, 6) to work in.
    """
    for i in range(6):
        for j in range(i + 1):
            product = 0.0
            for column in range(7):
                product += system[i, column] * system[j, column]
            for k in range(j):
                product -= square[i, k] * square[j, k]
            if i > j:
                square[i, j] = product / square[j, j]
            elif product > 0.0:
                square[i, i] = math.sqrt(product)
            else:
                return 0.0
    total = 0.0
    for first in range(6):  # columns of the inverse of the factor
        for i in range(first, 6):
            value = 1.0 if i == first else 0.0
            for k in range(first, i):
                value -= square[i, k] * square[6, k]
            square[6, i] = value / square[i, i]
            total += square[6, i] * square[6, i]
    return 1.0 / math.sqrt(total)
