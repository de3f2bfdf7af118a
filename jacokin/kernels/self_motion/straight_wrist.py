"""Configurations of a target whose wrist is straight: the axes before and after its middle joint are one line.

A target has them at single values of the parameter or, mostly, nowhere: there is one equation more than unknowns. They
are solved for by themselves, because no curve need come near in a way that is noticed.

With seven joints, the distance from the shoulder O to the wrist centre W gives joint 4. The forearm's axis 5 is that of
the last link then, so W - O and axis 5 are known in the base and in the forearm: joints 1, 2 and 3 turn the one pair
into the other, if W - O is as long seen along axis 5 as it is along axis 7.

About a free axis of six joints, axis 4 is that of the last link: the elbow C turns with the tool about the free axis,
and comes to its distance from O at two angles at most. There axis 3, perpendicular to axes 1 and 4, passes O at its own
distance or does not.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.closed_form.arm import ArmConstants, Pose, pose_of, unpack_arm
from jacokin.kernels.closed_form.wrist import complete
from jacokin.kernels.limits import TURN
from jacokin.kernels.self_motion.seven_joints import (
    about_z,
    after_joint_4,
    column_of,
    elbow,
    elbow_equation,
    of_target,
    plane_equation,
    row_of,
    solve_wrist,
    turned,
    turned_back,
    wrist_from_shoulder,
)
from jacokin.kernels.self_motion.slices import SevenJoints, SixJoints, turn_target, wrapped
from jacokin.kernels.vector import Vec, cross, dot, mix, norm

#: Configurations that there is room for.
STRAIGHT = 64
#: Values of joint 3 that are looked at, and [m] what is left to rounding.
SAMPLES, SLACK = 8, 1e-6
#: [m^2] by which a target may be beyond reach at some of them, though at its edge at another one.
EDGE = 1e-5
#: Times that the forearm is looked at anew with joint 3 as it came out.
SETTLING = 4
#: Cosine of axes 4 and 5, and 5 and 6, that are square; others are never one line.
SQUARE = 1e-9
#: [m^2] of a distance that hardly changes about a free axis; and angles at which the other condition is looked at then.
CONSTANT, ANGLES = 1e-4, 48
#: [m] by which axis 3 may pass O at another distance than its own: what is left to the rounding of a double root.
OFFSET_SLACK = 1e-4
#: Sine of axes 4 and 1 that are nearly parallel: axis 3 may be anywhere about them.
ALONG_AXIS_1 = 1e-3
#: [rad] configurations nearer to each other are one.
SAME = 1e-3


class Straight(NamedTuple):
    """Configurations near which a wrist may be straight, but for the turn of its outer joints against each other."""

    filled: NDArray[np.int64]  # (1,) how many
    rows: Array  # (STRAIGHT, 7) joints, and the parameter after six
    q: Array  # (6,) to work in
    row: Array  # (7,) the same


def make_straight() -> Straight:
    """Fresh arrays."""
    return Straight(np.zeros(1, np.int64), np.empty((STRAIGHT, 7)), np.empty(6), np.empty(7))


def keep(straight: Straight, row: Array, outer: int) -> None:
    """Add a row (7,), unless there is one that differs in joint `outer` and the next but one alone."""
    n = straight.filled[0]
    for i in range(n):
        apart = 0.0
        for j in range(7):
            if j != outer and j != outer + 2:
                apart = max(apart, abs(wrapped(straight.rows[i, j] - row[j])))
        if apart < SAME:
            return
    if n < STRAIGHT:
        for j in range(7):
            straight.rows[n, j] = row[j]
        straight.filled[0] = n + 1


# --- Seven joints ---


class Forearm(NamedTuple):
    """What is seen from the forearm with joint 3 at some angle: from O to W, and axis 5."""

    towards: Vec
    axis5: Vec
    q4: float


def forearm_at(chain: Array, arm7: Array, D0: Vec, q3: float, sign: float) -> tuple[bool, Forearm]:
    """The forearm with one of the two values of joint 4, and whether there is one."""
    c3, s3 = math.cos(q3), math.sin(q3)
    w4, z5 = (arm7[9], arm7[10], arm7[11]), column_of(chain, 4, 2)
    u = elbow(chain, arm7, c3, s3)
    a, b, c = elbow_equation(chain, arm7, D0, u, c3, s3)
    r4 = math.sqrt(a * a + b * b)
    if r4 == 0.0 or abs(c) > r4 + EDGE:
        return False, Forearm(w4, z5, 0.0)
    q4 = math.atan2(b, a) + sign * math.acos(min(1.0, max(-1.0, c / r4)))
    c4, s4 = math.cos(q4), math.sin(q4)
    seen = turned_back(chain, 3, about_z(c3, -s3, turned_back(chain, 2, u)))
    return True, Forearm(mix(seen, 1.0, about_z(c4, s4, w4), 1.0, w4, 0.0), about_z(c4, s4, z5), q4)


def find_straight_seven(chain: Array, T: Array, seven: SevenJoints, straight: Straight) -> int:
    """Fill straight.rows; returns how many there are."""
    straight.filled[0] = 0
    arm7 = seven.arm
    D0 = wrist_from_shoulder(chain, arm7, T)
    axis7 = turned_back(chain, 0, of_target(T, row_of(chain, 7, 2)))
    along7 = dot(axis7, D0)
    for sign4 in (1.0, -1.0):
        least, most = math.inf, -math.inf
        for n in range(SAMPLES):
            there, forearm = forearm_at(chain, arm7, D0, TURN * n / SAMPLES, sign4)
            if there:
                along5 = dot(forearm.axis5, forearm.towards)
                least, most = min(least, along5), max(most, along5)
        slack = most - least + SLACK
        for sign in (1.0, -1.0):
            if not least - slack <= sign * along7 <= most + slack:
                continue
            axis5 = mix(axis7, sign, axis7, 0.0, axis7, 0.0)
            for n in range(2 * SAMPLES):
                sign2 = 1.0 if n < SAMPLES else -1.0
                q3 = TURN * n / SAMPLES
                for _ in range(SETTLING):
                    there, forearm = forearm_at(chain, arm7, D0, q3, sign4)
                    if not there:
                        break
                    q1, q2, q3 = shoulder(chain, D0, axis5, forearm, sign2)
                if there:
                    add_seven(chain, T, (q1, q2, q3), forearm.q4, seven.rows, straight)
    return int(straight.filled[0])


def shoulder(chain: Array, D0: Vec, axis5: Vec, forearm: Forearm, sign: float) -> Vec:
    """Joints 1, 2 and 3 [rad] that turn the forearm into its place in the base.

    Args:
        chain: (8, 3, 4).
        D0: what `wrist_from_shoulder` returned.
        axis5: where axis 5 has to be, seen before joint 1.
        forearm: as it is at some angle of joint 3, on which it hardly depends.
        sign: which of the two values of joint 2.
    """
    axis3 = turn_pair(forearm.towards, forearm.axis5, D0, axis5, row_of(chain, 3, 2))
    front = turn_pair(forearm.towards, forearm.axis5, D0, axis5, row_of(chain, 3, 0))
    lever = column_of(chain, 2, 2)
    a, b, c = plane_equation(row_of(chain, 1, 2), lever, axis3[2])
    q2 = math.atan2(b, a) + sign * math.acos(min(1.0, max(-1.0, c / math.sqrt(a * a + b * b))))
    c2, s2 = math.cos(q2), math.sin(q2)
    d = turned(chain, 1, about_z(c2, s2, lever))
    q1 = math.atan2(axis3[1], axis3[0]) - math.atan2(d[1], d[0])
    f = turned_back(chain, 1, about_z(math.cos(q1), -math.sin(q1), front))
    f = turned_back(chain, 2, about_z(c2, -s2, f))
    return q1, q2, math.atan2(f[1], f[0])


def add_seven(chain: Array, T: Array, shoulder: Vec, q4: float, rows: Array, straight: Straight) -> None:
    """Add the configuration that joints 1 to 4 determine; rows (8, 7) are to work in."""
    q1, q2, q3 = shoulder
    c1, s1, c2, s2 = math.cos(q1), math.sin(q1), math.cos(q2), math.sin(q2)
    c3, s3, c4, s4 = math.cos(q3), math.sin(q3), math.cos(q4), math.sin(q4)
    rows[0, 0], rows[0, 1], rows[0, 2], rows[0, 3] = q1, q2, q3, q4
    x = turned_back(chain, 0, of_target(T, row_of(chain, 7, 0)))
    y = turned_back(chain, 0, of_target(T, row_of(chain, 7, 1)))
    z = turned_back(chain, 0, of_target(T, row_of(chain, 7, 2)))
    solve_wrist(
        chain,
        after_joint_4(chain, c1, s1, c2, s2, c3, s3, c4, s4, x),
        after_joint_4(chain, c1, s1, c2, s2, c3, s3, c4, s4, y),
        after_joint_4(chain, c1, s1, c2, s2, c3, s3, c4, s4, z),
        rows,
        0,
        2,
    )
    keep(straight, rows[0], 4)


def turn_pair(a: Vec, b: Vec, A: Vec, B: Vec, v: Vec) -> Vec:
    """A vector turned as a is into A and b, as nearly as possible, into B."""
    x, X = unit(a), unit(A)
    z, Z = unit_across(x, b), unit_across(X, B)
    return mix(X, dot(x, v), cross(Z, X), dot(cross(z, x), v), Z, dot(z, v))


def unit(a: Vec) -> Vec:
    """A vector of length 1; where there is no direction, x."""
    length = norm(a)
    return mix(a, 1.0 / length, a, 0.0, a, 0.0) if length > 0.0 else (1.0, 0.0, 0.0)


def unit_across(x: Vec, b: Vec) -> Vec:
    """A unit vector at a right angle to x and to b; to x alone where both are one line."""
    z = cross(x, b)
    if norm(z) < SLACK:
        z = cross(x, (0.0, 0.0, 1.0) if abs(x[2]) < 0.5 else (1.0, 0.0, 0.0))
    return unit(z)


# --- Six joints and a free axis ---


class Upright(NamedTuple):
    """What a turn of the tool leaves of a straight wrist's conditions; zero where both are met."""

    distance: float  # of C from O, squared, but for what it is [m^2]
    offset: float  # of axis 3 from O, but for its own, times the sine between axes 1 and 4 [m]


def pose_at(T: Array, p: float, six: SixJoints, k: ArmConstants) -> Pose:
    """The pose of the tool turned by p [rad]."""
    turn_target(T, six.axis, p, six.T)
    return pose_of(six.arm, k, six.T)


def upright(k: ArmConstants, pose: Pose, sign: float) -> Upright:
    """See `Upright`; axis 4 is axis 6 times a sign."""
    z4 = mix(k.w6, sign, k.w6, 0.0, k.w6, 0.0)
    D = mix(pose.D0, 1.0, pose.Dc, 1.0, pose.D0, 0.0)
    C = mix(D, 1.0, z4, k.c4, z4, 0.0)
    n = cross(mix(pose.m0, 1.0, pose.mc, 1.0, pose.m0, 0.0), z4)
    return Upright(dot(C, C) - k.R2, abs(dot(n, D)) - abs(k.e3) * norm(n))


def find_straight_six(T: Array, six: SixJoints, straight: Straight) -> int:
    """Fill straight.rows; returns how many there are. Of arms built like a Jaco, with a spherical wrist."""
    straight.filled[0] = 0
    k = unpack_arm(six.arm)
    if not k.spherical or abs(k.cos_a) > SQUARE or abs(k.w6[2]) > SQUARE:
        return 0
    for sign in (1.0, -1.0):
        # The distance is a sinusoid, which three angles determine.
        f0 = upright(k, pose_at(T, 0.0, six, k), sign).distance
        f1 = upright(k, pose_at(T, 0.25 * TURN, six, k), sign).distance
        f2 = upright(k, pose_at(T, 0.5 * TURN, six, k), sign).distance
        mean, a = 0.5 * (f0 + f2), 0.5 * (f0 - f2)
        b = f1 - mean
        r = math.sqrt(a * a + b * b)
        if abs(mean) > r + SLACK:
            continue
        if r > CONSTANT:
            middle, half = math.atan2(-b, -a), math.acos(min(1.0, max(-1.0, mean / r)))
            add_upright(T, middle + half, sign, k, six, OFFSET_SLACK, straight)
            add_upright(T, middle - half, sign, k, six, OFFSET_SLACK, straight)
            continue
        before = abs(upright(k, pose_at(T, -TURN / ANGLES, six, k), sign).offset)
        here = abs(upright(k, pose_at(T, 0.0, six, k), sign).offset)
        for n in range(ANGLES):
            p = n * TURN / ANGLES
            after = abs(upright(k, pose_at(T, p + TURN / ANGLES, six, k), sign).offset)
            if here < before and here <= after:
                add_upright(T, p, sign, k, six, math.inf, straight)
            before, here = here, after
    return int(straight.filled[0])


def add_upright(
    T: Array, p: float, sign: float, k: ArmConstants, six: SixJoints, slack: float, straight: Straight
) -> None:
    """Add the configuration with a straight wrist and the tool turned by p, or two where axis 4 is along axis 1.

    Args:
        T: (4, 4) target.
        p: [rad].
        sign: of axis 4, as seen along axis 6.
        k: the arm.
        six: to work in.
        slack: by which axis 3 may pass O at another distance than its own [m].
        straight: added to.
    """
    pose = pose_at(T, p, six, k)
    q5 = math.atan2(-sign * k.w6[1], sign * k.w6[0])
    z4 = mix(k.w6, sign, k.w6, 0.0, k.w6, 0.0)
    D = mix(pose.D0, 1.0, pose.Dc, 1.0, pose.D0, 0.0)
    x, y = dot(D, pose.x), dot(D, pose.y)
    n = cross(pose.z, z4)
    size = norm(n)
    if size > 0.0:
        side = 1.0 if dot(n, D) * k.e3 >= 0.0 else -1.0
        if abs(side * dot(n, D) / size - k.e3) <= slack:
            add_six(k, pose, math.atan2(-side * dot(n, pose.x), side * dot(n, pose.y)), q5, p, straight)
    far = math.hypot(x, y)
    if size < ALONG_AXIS_1 and far > 0.0:
        half = math.acos(min(1.0, max(-1.0, k.e3 / far)))
        for turn in (half, -half):
            add_six(k, pose, math.atan2(y, x) + turn - 0.25 * TURN, q5, p, straight)  # axis 3 is y at q1 = 0


def add_six(k: ArmConstants, pose: Pose, q1: float, q5: float, p: float, straight: Straight) -> None:
    """Add what joints 1 and 5 determine, with joint 6 at 0."""
    complete(k, pose, q1, q5, 0.0, straight.q)
    for j in range(6):
        straight.row[j] = straight.q[j]
    straight.row[6] = p
    keep(straight, straight.row, 3)
