"""All solutions of a chain of seven joints at one value of its parameter: six joints at a pose."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.branches import COLUMNS, MAX_BRANCHES, PoseQuery
from jacokin.kernels.closed_form.arm import ARM_CONSTANTS, ArmConstants, unpack_arm
from jacokin.kernels.closed_form.pose import Work, make_work, solve_pose
from jacokin.kernels.six_joints.loop import Form, fill_links
from jacokin.kernels.solution_set.curve import Walk
from jacokin.kernels.solution_set.seven_joints import MOST_FOLDS, MOST_ROWS, WAVES, solve_at_q3
from jacokin.kernels.tolerances import STRUCTURE_TOLERANCE

#: Values of the parameter, and points at each, at most.
SLICES, POINTS = 160, MAX_BRANCHES
#: Which joint is the parameter, of the six others: after them, before them, or joint 3 of an arm built like a Jaco. And
#: where nothing is solved for, to follow curves from given points only.
AFTER, BEFORE, JOINT_3, NO_SLICES = 0, 1, 2, 3


#: Constants of six joints, see `closed_form.arm`: a scale of lengths, 0 for a Jaco, and a labelling; and the labelling
#: in which a Jaco has no double roots.
SCALE, OWN, JACO_LABELLING = 39, 40, 6


class Slices(NamedTuple):
    """All solutions at some values of the parameter."""

    p: Array  # (SLICES,) [rad]; NaN for points of any value, to start from only
    counts: NDArray[np.int64]  # (SLICES,)
    x: Array  # (SLICES, POINTS, 7) [rad]
    passed: NDArray[np.int64]  # (SLICES, POINTS) by how many curves
    doubt: NDArray[np.int64]  # (SLICES,) 1 where solutions may be missing
    size: NDArray[np.int64]  # (1,) values


class SixJoints(NamedTuple):
    """Six joints, at a pose that turns with the parameter about an axis of the tool."""

    chain: Array  # (7, 3, 4), of joints 7 to 2 the other way round where the parameter is the first one
    arm: Array  # (46,) their constants, see `closed_form.arm`
    general: Array  # (46,) filled: constants as those of an arm of any structure, see `fill_general`
    limits: Array  # (3, 6) without any
    seed: Array  # (6,)
    axis: Array  # (3,) unit vector in the tool frame
    T: Array  # (4, 4) the target at p = 0
    turned: Array  # (4, 4)
    links: Array  # (6, 3, 4) see `end_wrist`
    work: Work


class SevenJoints(NamedTuple):
    """Seven joints built like a Jaco's."""

    arm: Array  # (12,) see `seven_joints.solve_at_q3`
    rows: Array  # (8, 7)
    folds: Array  # (MOST_FOLDS,)
    waves: Array  # (3, 2, 5) coefficients of the functions that vanish there


def make_slices() -> Slices:
    """Fresh arrays, without slices."""
    return Slices(
        np.zeros(SLICES),
        np.zeros(SLICES, np.int64),
        np.empty((SLICES, POINTS, 7)),
        np.zeros((SLICES, POINTS), np.int64),
        np.zeros(SLICES, np.int64),
        np.zeros(1, np.int64),
    )


def make_six_joints() -> SixJoints:
    """Fresh arrays."""
    limits = np.array([np.full(6, -np.inf), np.full(6, np.inf), np.zeros(6)])
    work = make_work(np.empty((POINTS, COLUMNS)))
    return SixJoints(
        np.zeros((7, 3, 4)),
        np.zeros(ARM_CONSTANTS),
        np.zeros(ARM_CONSTANTS),
        limits,
        np.zeros(6),
        np.zeros(3),
        np.eye(4),
        np.eye(4),
        np.zeros((6, 3, 4)),
        work,
    )


def make_seven_joints() -> SevenJoints:
    """Fresh arrays."""
    return SevenJoints(np.zeros(12), np.empty((MOST_ROWS, 7)), np.empty(MOST_FOLDS), np.zeros((3, 2, WAVES + 1)))


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


def fill_general(six: SixJoints) -> None:
    """Fill six.general: a scale of lengths, and a labelling that suits the arm, to begin with."""
    size = 0.0
    for i in range(1, 6):
        square = 0.0
        for row in range(3):
            square += six.chain[i, row, 3] * six.chain[i, row, 3]
        size += 0.5 * math.sqrt(square)
    for i in range(ARM_CONSTANTS):
        six.general[i] = 0.0
    six.general[SCALE] = 1.0 / size
    six.general[OWN] = six.arm[OWN] if six.arm[SCALE] > 0.0 else JACO_LABELLING


def arm_of_equation(six: SixJoints) -> ArmConstants:
    """The constants that F is made with: an arm whose wrist is not square counts as one of any structure.

    Such a wrist does not reach every orientation: where its point is, which the F of wrists tells, is not enough.
    """
    k, links = unpack_arm(six.arm), six.work.six.equations.links
    if k.six.form == Form.SPHERICAL_WRIST:
        fill_links(six.chain, six.T, k.six.scale, k.six.form_labelling, links)
        if max(abs(links[3, 2, 2]), abs(links[4, 2, 2])) > STRUCTURE_TOLERANCE:
            return unpack_arm(six.general)
    return k


def count_solutions(six: SixJoints, p: float) -> int:
    """Solve six joints at a value of the parameter; how many solutions there are at least."""
    turn_target(six.T, six.axis, p, six.turned)
    six.work.branches.wanted[0] = 0
    solve_pose(six.arm, unpack_arm(six.arm), PoseQuery(six.chain, six.limits, six.turned, six.seed), six.work)
    return int(six.work.branches.filled[0])


def add_slice(walk: Walk, kind: int, p: float, slices: Slices, six: SixJoints, seven: SevenJoints) -> bool:
    """Append all solutions at a value of the parameter; False where there is no room."""
    i = slices.size[0]
    if i == SLICES:
        return False
    count, slices.doubt[i] = 0, 0
    if kind == JOINT_3:
        solve_at_q3(walk.chain, seven.arm, walk.T, p, seven.rows)
        for k in range(MOST_ROWS):
            if not math.isnan(seven.rows[k, 0]):
                for j in range(7):
                    slices.x[i, count, j] = seven.rows[k, j]
                count += 1
    else:
        count, branches = count_solutions(six, p), six.work.branches
        slices.doubt[i] = branches.filled[1]
        for k in range(count):
            for j in range(6):
                slices.x[i, k, j if kind == AFTER else 6 - j] = branches.rows[k, j]
            slices.x[i, k, 6 if kind == AFTER else 0] = p
    for k in range(POINTS):
        slices.passed[i, k] = 0
    slices.p[i], slices.counts[i] = p, count
    slices.size[0] = i + 1
    return True


def add_start(slices: Slices, x: Array) -> bool:
    """Append a point to start from, of any value of the parameter; False where there is no room."""
    i = slices.size[0]
    if i == SLICES:
        return False
    slices.p[i], slices.counts[i], slices.passed[i, 0] = math.nan, 1, 0
    for j in range(7):
        slices.x[i, 0, j] = x[j]
    slices.size[0] = i + 1
    return True
