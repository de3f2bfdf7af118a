"""Candidates for the spherical wrist (A = B): arm first, then wrist, as for any arm with axes 4, 5, 6 in one point.

Used instead of F(q6) there, because F vanishes for every q6 as soon as one arm posture aligns axes 4 and 6, and would
hide the isolated solutions of the other postures.
"""

from __future__ import annotations

import math

from jacokin.arrays import Array
from jacokin.kernels.closed_form.arm import ArmConstants, Pose
from jacokin.kernels.closed_form.wrist import Starts, axis_4, complete
from jacokin.kernels.limits import TURN
from jacokin.kernels.tolerances import ALIGNED_SINE, EDGE_SLACK, FOLDED_SQUARE
from jacokin.kernels.vector import Vec, cross, dot, mix, norm


def spherical_starts(
    k: ArmConstants,
    pose: Pose,
    seed: Array,
    limits: Array,
    starts: Starts,
    q: Array,
) -> None:
    """Fill starts (n, 4) with q1, q5, q6 and a family mark: 1 where axes 4 and 6 are aligned.

    Args:
        k: the arm.
        pose: the target.
        seed: (6,) the seed; a family is represented by the members with its q6, with its q4, and the nearest ones.
        limits: (3, 6) of the joints; members with q4 or q6 on a limit are among those that may be nearest.
        starts: filled from the beginning.
        q: (6,) workspace.
    """
    starts.filled[0] = 0
    # B - O in the shoulder frame; D = -R6 o, so before joint 6 it is D0 + Dc.
    B = mix(pose.D0, 1.0, pose.Dc, 1.0, pose.D0, 0.0)
    X, Y, Z = dot(B, pose.x), dot(B, pose.y), dot(B, pose.z)
    flat2 = X * X + Y * Y - k.e3 * k.e3
    if flat2 < -EDGE_SLACK:
        return
    flat = math.sqrt(max(flat2, 0.0))
    for bx in (flat, -flat, 0.0):
        if bx == 0.0 and flat2 > FOLDED_SQUARE:
            continue
        q1 = math.atan2(Y, X) - math.atan2(k.e3, bx)
        # In the plane (forward, up): |C|^2 = R^2 - e3^2 and C = B + c4 z4.
        size2 = bx * bx + Z * Z
        if size2 == 0.0:
            continue
        along = (k.R2 - k.e3 * k.e3 - size2 - k.c4 * k.c4) / (2.0 * k.c4)
        across2 = size2 - along * along
        if across2 < -EDGE_SLACK:
            continue
        across = math.sqrt(max(across2, 0.0))
        c1, s1 = math.cos(q1), math.sin(q1)
        forward = mix(pose.x, c1, pose.y, s1, pose.x, 0.0)
        for elbow in (across, -across, 0.0):
            if elbow == 0.0 and across2 > FOLDED_SQUARE:
                continue
            x = (along * bx - elbow * Z) / size2
            z = (along * Z + elbow * bx) / size2
            axis = mix(forward, x, pose.z, z, forward, 0.0)  # axis 4 before joint 6
            axis = mix(axis, 1.0 / norm(axis), axis, 0.0, axis, 0.0)
            wrist_starts(k, pose, q1, axis, seed, limits, starts, q)


def wrist_starts(
    k: ArmConstants,
    pose: Pose,
    q1: float,
    axis: Vec,
    seed: Array,
    limits: Array,
    starts: Starts,
    q: Array,
) -> None:
    """The two q5 with axis 4 at the right angle to axis 6, and the q6 that turns it into place."""
    level, across = dot(k.w6, axis), cross(k.w6, axis)
    sine = norm(across)
    # The spherical triangle of axes 4, 5, 6 with sides a, b and theta, in half angles: exact at its flat ends too.
    a = math.atan2(k.sin_a, k.cos_a)
    b = math.atan2(math.hypot(k.w6[0], k.w6[1]), k.w6[2])
    theta = math.atan2(sine, level)
    top = math.sin(0.5 * (theta + a - b)) * math.sin(0.5 * (theta - a + b))
    bottom = math.sin(0.5 * (a + b + theta)) * math.sin(0.5 * (a + b - theta))
    half = 2.0 * math.atan2(math.sqrt(max(top, 0.0)), math.sqrt(max(bottom, 0.0)))
    middle = math.atan2(-k.w6[1], k.w6[0])
    if sine < ALIGNED_SINE:
        complete(k, pose, q1, middle + half, seed[5], q)
        # Along the family q4 takes over from q6: q4 = q[3] - sign (q6 - seed[5]).
        sign, rest = math.copysign(1.0, level), seed[3] - q[3]
        rest -= TURN * math.floor(rest / TURN + 0.5)
        append(starts, q1, middle + half, seed[5], 1.0)
        append(starts, q1, middle + half, seed[5] - sign * rest, 1.0)
        append(starts, q1, middle + half, seed[5] - 0.5 * sign * rest, 1.0)
        for i in range(2):
            if abs(limits[i, 5]) < math.inf:
                append(starts, q1, middle + half, limits[i, 5], 1.0)
            if abs(limits[i, 3]) < math.inf:
                append(starts, q1, middle + half, seed[5] - sign * (limits[i, 3] - q[3]), 1.0)
    elif min(top, bottom) > -EDGE_SLACK:
        for q5 in (middle + half, middle - half):
            turned = cross(k.w6, axis_4(k, q5))
            q6 = math.atan2(dot(k.w6, cross(across, turned)), dot(across, turned))
            append(starts, q1, q5, q6, 0.0)


def append(starts: Starts, q1: float, q5: float, q6: float, family: float) -> None:
    """Add one candidate."""
    i = starts.filled[0]
    starts.rows[i, 0], starts.rows[i, 1], starts.rows[i, 2], starts.rows[i, 3] = q1, q5, q6, family
    starts.filled[0] = i + 1
