"""Tasks of a tick: where frames are, what is missing to their targets, its Jacobian, and how that turns.

A task is one target of one frame. Its error is weighted; a displacement x of the joints with J x = error reaches the
target to first order. Position and rotation are taken apart, unlike in the SE(3) logarithm: so the position goes
straight whatever the orientation does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import HINGE, fill_frames
from jacokin.kernels.trigonometry import angle_of
from jacokin.kernels.vector import Vec, cross, dot, minus, mix, norm

#: What a task asks of its frame: position and orientation, position, orientation, an axis along a direction, a position
#: in a box; or of all joints.
POSE, POSITION, ORIENTATION, DIRECTION, REGION, JOINTS = range(6)
#: Columns of a task's integers: what it is, the joint that carries its frame (counted from 1), and the frame's number.
KIND, LINK, FRAME, TASK_INTEGERS = range(4)
#: Columns of its numbers: weight [1/m] and that of turning [1/rad], the frame on its link (3, 4), and the target: a
#: pose (3, 4); a position (3,); axis (3,) and direction (3,); lower (3,) and upper corner (3,).
WEIGHT, TURN_WEIGHT, PLACEMENT, GOAL, SECOND_GOAL, TASK_NUMBERS = 0, 1, 2, 14, 17, 26
#: [m] from the base; nothing beyond is within reach, and its error would drown all else.
FAR = 100.0
#: Of a sine: less is aligned, or opposite.
ALIGNED = 1e-12
#: Below this cosine the axis of a rotation is read from its symmetric part.
OBTUSE = -0.5
#: A pose that misses a rigid one by less is taken as it is.
NEARLY_RIGID = 1e-9


class JointFrames(NamedTuple):
    """The joints of an arm; each moves about or along the z axis of its frame."""

    kinds: NDArray[np.int64]  # (dof,)
    placements: Array  # (dof, 3, 4) of each frame on the one before
    frames: Array  # (dof + 1, 3, 4) in the base, whose own is first; filled


class TaskRows(NamedTuple):
    """Tasks."""

    integers: NDArray[np.int64]  # (tasks, 3)
    numbers: Array  # (tasks, 26)
    joints: Array  # (tasks dof,) angles of tasks for joints [rad]


def make_task_rows(dof: int = 0, tasks: int = 0) -> TaskRows:
    """Fresh arrays."""
    return TaskRows(np.zeros((tasks, TASK_INTEGERS), np.int64), np.zeros((tasks, TASK_NUMBERS)), np.zeros(tasks * dof))


def is_rigid(pose: Array) -> bool:
    """Whether a pose (4, 4) is finite, right-handed and orthonormal."""
    x = (pose[0, 0], pose[0, 1], pose[0, 2])
    y = (pose[1, 0], pose[1, 1], pose[1, 2])
    p = (pose[0, 3], pose[1, 3], pose[2, 3])
    first, second, both = dot(x, x) - 1.0, dot(y, y) - 1.0, dot(x, y)
    third = minus(cross(x, y), (pose[2, 0], pose[2, 1], pose[2, 2]))
    misfit = first * first + second * second + both * both + dot(third, third)
    last = pose[3, 0] == 0.0 and pose[3, 1] == 0.0 and pose[3, 2] == 0.0 and pose[3, 3] == 1.0
    return bool(last and misfit < NEARLY_RIGID * NEARLY_RIGID and dot(p, p) < math.inf)


def take_pose(tasks: TaskRows, pose: Array) -> None:
    """Take a pose (4, 4) as the target of the first task."""
    for i in range(3):
        for j in range(4):
            tasks.numbers[0, GOAL + 4 * i + j] = pose[i, j]


def place_joints(arm: JointFrames, q: Array) -> None:
    """Fill the frames at a configuration (dof,) [rad]."""
    fill_frames(arm.placements, arm.kinds, len(q), q, arm.frames)


def axis_of(frames: Array, link: int, column: int) -> Vec:
    """An axis of a link's frame, or its origin (column 3)."""
    return (frames[link, 0, column], frames[link, 1, column], frames[link, 2, column])


def carried(frames: Array, link: int, row: Array, column: int) -> Vec:
    """An axis of a task's frame in the base, or its origin (column 3)."""
    u, v, w = row[PLACEMENT + column], row[PLACEMENT + 4 + column], row[PLACEMENT + 8 + column]
    return mix(axis_of(frames, link, 0), u, axis_of(frames, link, 1), v, axis_of(frames, link, 2), w)


def origin_of(frames: Array, link: int, row: Array) -> Vec:
    """Where a task's frame is in the base [m]."""
    a, b = carried(frames, link, row, 3), axis_of(frames, link, 3)
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def goal_of(row: Array, column: int) -> Vec:
    """An axis of the target's frame."""
    return (row[GOAL + column], row[GOAL + 4 + column], row[GOAL + 8 + column])


def rows_of(kind: int, dof: int) -> int:
    """How many numbers the error of a task has."""
    if kind == POSE:
        return 6
    return dof if kind == JOINTS else 3


def missing_position(kind: int, row: Array, p: Vec) -> Vec:
    """From a frame to its target [m]: a distant target counts as one at `FAR` on the way there."""
    if kind == REGION:
        return (
            min(max(p[0], row[GOAL]), row[SECOND_GOAL]) - p[0],
            min(max(p[1], row[GOAL + 1]), row[SECOND_GOAL + 1]) - p[1],
            min(max(p[2], row[GOAL + 2]), row[SECOND_GOAL + 2]) - p[2],
        )
    t = target_position(kind, row)
    largest = max(abs(t[0]), max(abs(t[1]), abs(t[2])))
    if largest > FAR:
        scaled = (t[0] / largest, t[1] / largest, t[2] / largest)  # whose norm does not overflow
        part = FAR / norm(scaled)
        t = (part * scaled[0], part * scaled[1], part * scaled[2])
    return minus(t, p)


def target_position(kind: int, row: Array) -> Vec:
    """Of a pose or a position [m]."""
    if kind == POSE:
        return goal_of(row, 3)
    return (row[GOAL], row[GOAL + 1], row[GOAL + 2])


def rotation_vector(frames: Array, link: int, row: Array) -> Vec:
    """From a frame to the orientation of its target, in base axes [rad]."""
    turn, cosine = (0.0, 0.0, 0.0), -0.5
    for k in range(3):
        now, goal = carried(frames, link, row, k), goal_of(row, k)
        turn = mix(turn, 1.0, cross(now, goal), 0.5, turn, 0.0)
        cosine += 0.5 * dot(now, goal)
    sine = norm(turn)
    angle = angle_of(sine, cosine)
    if cosine > OBTUSE:
        part = angle / sine if sine > 0.0 else 1.0
        return (part * turn[0], part * turn[1], part * turn[2])
    # The symmetric part of the rotation is (1 - cosine) a a^T + cosine I, a the axis: its longest column.
    best = (0.0, 0.0, 0.0)
    for i in range(3):
        column = (0.0, 0.0, 0.0)
        for k in range(3):
            now, goal = carried(frames, link, row, k), goal_of(row, k)
            column = mix(column, 1.0, goal, 0.5 * now[i], now, 0.5 * goal[i])
        unit = (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)
        column = mix(column, 1.0, unit, -cosine, unit, 0.0)
        if norm(column) > norm(best):
            best = column
    along = dot(best, turn)
    length = norm(best)
    if along < 0.0 or (along == 0.0 and best[0] + best[1] + best[2] > 0.0):
        length = -length
    return (angle / length * best[0], angle / length * best[1], angle / length * best[2])


def direction_rotation(frames: Array, link: int, row: Array) -> tuple[Vec, Vec, float]:
    """Where an axis points, the rotation vector to its direction [rad], and its angle.

    The difference of the two unit vectors would be an error whose gradient vanishes where they are opposite, so that
    the arm would stay there; the rotation vector is longest there.
    """
    axis = (row[GOAL], row[GOAL + 1], row[GOAL + 2])
    goal = (row[SECOND_GOAL], row[SECOND_GOAL + 1], row[SECOND_GOAL + 2])
    points = mix(
        carried(frames, link, row, 0),
        axis[0],
        carried(frames, link, row, 1),
        axis[1],
        carried(frames, link, row, 2),
        axis[2],
    )
    turn = cross(points, goal)
    sine = norm(turn)
    angle = angle_of(sine, dot(points, goal))
    if sine < ALIGNED:  # any perpendicular axis does
        a, b, c = abs(points[0]), abs(points[1]), abs(points[2])
        unit = (0.0, 0.0, 1.0)
        if a <= b and a <= c:
            unit = (1.0, 0.0, 0.0)
        elif b <= c:
            unit = (0.0, 1.0, 0.0)
        turn = cross(points, unit)
        sine = norm(turn)
    part = angle / sine
    return points, (part * turn[0], part * turn[1], part * turn[2]), angle


def fill_errors(frames: Array, tasks: TaskRows, first: int, last: int, q: Array, error: Array) -> None:
    """Fill the weighted errors of some tasks at a configuration (dof,) [rad], where the frames are."""
    dof, at = len(q), 0
    for t in range(first, last):
        kind, link, row = tasks.integers[t, KIND], tasks.integers[t, LINK], tasks.numbers[t]
        if kind == JOINTS:
            for j in range(dof):
                error[at + j] = row[TURN_WEIGHT] * (tasks.joints[t * dof + j] - q[j])
        elif kind == DIRECTION:
            _, turn, _ = direction_rotation(frames, link, row)
            for i in range(3):
                error[at + i] = row[TURN_WEIGHT] * turn[i]
        else:
            if kind != ORIENTATION:
                away = missing_position(kind, row, origin_of(frames, link, row))
                for i in range(3):
                    error[at + i] = row[WEIGHT] * away[i]
            if kind in (POSE, ORIENTATION):
                turn = rotation_vector(frames, link, row)
                start = at + 3 if kind == POSE else at
                for i in range(3):
                    error[start + i] = row[TURN_WEIGHT] * turn[i]
        at += rows_of(kind, dof)


def fill_columns(arm: JointFrames, link: int, p: Vec, columns: Array) -> None:
    """Fill linear and angular velocity (dof, 6) of a point of a link for a unit rate of each joint, in base axes."""
    for j in range(len(arm.kinds)):
        v, w = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        if j < link:
            axis = axis_of(arm.frames, j + 1, 2)
            if arm.kinds[j] == HINGE:
                v, w = cross(axis, minus(p, axis_of(arm.frames, j + 1, 3))), axis
            else:
                v = axis
        for i in range(3):
            columns[j, i], columns[j, 3 + i] = v[i], w[i]


def fill_jacobian(arm: JointFrames, tasks: TaskRows, last: int, columns: Array, jacobian: Array) -> None:
    """Fill the weighted Jacobians of the first tasks, (rows dof,)."""
    dof, at = len(arm.kinds), 0
    for t in range(last):
        kind, link, row = tasks.integers[t, KIND], tasks.integers[t, LINK], tasks.numbers[t]
        if kind == JOINTS:
            for i in range(dof):
                for j in range(dof):
                    jacobian[(at + i) * dof + j] = row[TURN_WEIGHT] if i == j else 0.0
            at += dof
            continue
        p = origin_of(arm.frames, link, row)
        fill_columns(arm, link, p, columns)
        if kind == DIRECTION:
            points, _, _ = direction_rotation(arm.frames, link, row)
            for j in range(dof):
                about = points[0] * columns[j, 3] + points[1] * columns[j, 4] + points[2] * columns[j, 5]
                for i in range(3):
                    jacobian[(at + i) * dof + j] = row[TURN_WEIGHT] * (columns[j, 3 + i] - points[i] * about)
        else:
            if kind != ORIENTATION:
                away = missing_position(kind, row, p)
                for i in range(3):
                    weight = 0.0 if kind == REGION and away[i] == 0.0 else row[WEIGHT]
                    for j in range(dof):
                        jacobian[(at + i) * dof + j] = weight * columns[j, i]
            if kind in (POSE, ORIENTATION):
                start = at + 3 if kind == POSE else at
                for i in range(3):
                    for j in range(dof):
                        jacobian[(start + i) * dof + j] = row[TURN_WEIGHT] * columns[j, 3 + i]
        at += rows_of(kind, dof)


def add_bend(arm: JointFrames, tasks: TaskRows, last: int, columns: Array, left: Array, hessian: Array) -> None:
    """Add how the Jacobians of the first tasks turn against errors that stay, minus the sum of left_i dJ_i/dq.

    Joint i turns how joint j, which comes after it or is it, moves or turns a point; the product is symmetric.

    Args:
        arm: with its frames.
        tasks: that come first.
        last: how many they are.
        columns: (dof, 6) to work in.
        left: (rows,) errors that stay.
        hessian: (dof dof,) added to.
    """
    dof, at = len(arm.kinds), 0
    for t in range(last):
        kind, link, row = tasks.integers[t, KIND], tasks.integers[t, LINK], tasks.numbers[t]
        size = rows_of(kind, dof)
        if kind != JOINTS:
            fill_columns(arm, link, origin_of(arm.frames, link, row), columns)
            tip, moves, turns = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
            if kind == DIRECTION:  # its tip is pulled across the axis
                tip, _, _ = direction_rotation(arm.frames, link, row)
                moves = cross((left[at], left[at + 1], left[at + 2]), tip)
                moves = mix(moves, -row[TURN_WEIGHT], moves, 0.0, moves, 0.0)
            else:
                if kind != ORIENTATION:
                    moves = (-row[WEIGHT] * left[at], -row[WEIGHT] * left[at + 1], -row[WEIGHT] * left[at + 2])
                if kind in (POSE, ORIENTATION):
                    end, half = at + size - 3, -0.5 * row[TURN_WEIGHT]
                    turns = (half * left[end], half * left[end + 1], half * left[end + 2])
            for i in range(dof):
                angular = (columns[i, 3], columns[i, 4], columns[i, 5])
                by_turn, by_move = cross(turns, angular), cross(moves, angular)
                for j in range(i, dof):
                    w = (columns[j, 3], columns[j, 4], columns[j, 5])
                    v = (columns[j, 0], columns[j, 1], columns[j, 2])
                    if kind == DIRECTION:
                        v = cross(w, tip)
                    value = dot(by_turn, w) + dot(by_move, v)
                    hessian[i * dof + j] += value
                    if j > i:
                        hessian[j * dof + i] += value
        at += size


def fill_faces(arm: JointFrames, tasks: TaskRows, last: int, columns: Array, rows: Array, ends: Array) -> int:
    """Fill inequalities rows x <= ends that keep frames inside their boxes; returns how many.

    Args:
        arm: with its frames.
        tasks: that come first.
        last: how many they are.
        columns: (dof, 6) to work in.
        rows: (room dof,) filled.
        ends: (room,) filled [m].
    """
    dof, count = len(arm.kinds), 0
    for t in range(last):
        if tasks.integers[t, KIND] != REGION:
            continue
        link, row = tasks.integers[t, LINK], tasks.numbers[t]
        p = origin_of(arm.frames, link, row)
        fill_columns(arm, link, p, columns)
        for side in range(2):
            for i in range(3):
                gap = row[SECOND_GOAL + i] - p[i] if side == 0 else p[i] - row[GOAL + i]
                if gap < 0.0 or gap == math.inf:
                    continue
                for j in range(dof):
                    rows[count * dof + j] = columns[j, i] if side == 0 else -columns[j, i]
                ends[count] = gap
                count += 1
    return count


def measure_task(frames: Array, tasks: TaskRows, t: int, q: Array) -> tuple[float, float]:
    """Distance [m] and angle [rad] of a frame to its target, unweighted."""
    kind, link, row = tasks.integers[t, KIND], tasks.integers[t, LINK], tasks.numbers[t]
    distance, angle = 0.0, 0.0
    if kind == JOINTS:
        for j in range(len(q)):
            angle = max(angle, abs(tasks.joints[t * len(q) + j] - q[j]))
        return 0.0, angle
    if kind == DIRECTION:
        _, _, angle = direction_rotation(frames, link, row)
        return 0.0, angle
    p = origin_of(frames, link, row)
    if kind == REGION:
        distance = norm(missing_position(kind, row, p))
    elif kind != ORIENTATION:
        away = minus(target_position(kind, row), p)
        distance = norm(away)
        if distance == math.inf:  # its square, not the distance itself
            largest = max(abs(away[0]), max(abs(away[1]), abs(away[2])))
            distance = largest * norm((away[0] / largest, away[1] / largest, away[2] / largest))
    if kind in (POSE, ORIENTATION):
        turn, trace = (0.0, 0.0, 0.0), 0.0
        for k in range(3):
            now, goal = carried(frames, link, row, k), goal_of(row, k)
            turn = mix(turn, 1.0, cross(now, goal), 1.0, turn, 0.0)
            trace += dot(now, goal)
        angle = angle_of(norm(turn), trace - 1.0)
    return distance, angle
