"""Axes 2, 3 and 4 of a labelling are parallel, 5 and 6 meet in E: theta_1, theta_5, theta_6, then a plane.

Joints 2, 3 and 4 move along no height above their plane: E has a height that does not depend on them, which is linear
in cosine and sine of theta_1. Nor do they turn its normal, which gives theta_5 and theta_6 as the z axis of a wrist
does. What is left is an arm of two links in the plane, and an angle.
"""

from __future__ import annotations

import math

from jacokin.kernels.branches import BranchWork, PoseQuery
from jacokin.kernels.six_joints.candidates import (
    SIGNS,
    Candidates,
    FormState,
    add_candidate,
    add_last_candidates,
    fill_rest,
    is_open,
    pair_of,
    pair_of_triangle,
    skips,
    slack_after,
    take,
    take_angle,
    take_unit,
    triangle_of,
    unit_from_to,
    unturned_about_z,
)
from jacokin.kernels.six_joints.equations import turned_back_by, turned_by
from jacokin.kernels.six_joints.loop import SixArm, column_of, fill_links, joint_of
from jacokin.kernels.vector import Vec, minus

QUARTER = 0.5 * math.pi
#: Share of the square of the stretched elbow by which it may miss one angle alone with which it reaches, for rounding.
JUST_REACHES = 1e-9


def branches_of_parallel_axes(arm: SixArm, query: PoseQuery, work: Candidates, branches: BranchWork) -> bool:
    """Add every branch; False where the general way must look after what is left open."""
    links, state, labelling = work.links, work.state, arm.form_labelling
    for i in range(len(state)):
        state[i] = 0
    fill_links(query.chain, query.T, arm.scale, labelling, links)
    # Heights change sign with the links of the plane where their axes point opposite ways.
    side = links[1, 2, 2] * links[2, 2, 2]
    height = links[1, 2, 3] + links[1, 2, 2] * links[2, 2, 3] + side * (links[3, 2, 3] + arm.first * links[3, 2, 2])
    E = turned_back_by(links[5], (-links[5, 0, 3], -links[5, 1, 3], arm.second - links[5, 2, 3]))
    normal, t = column_of(links[0], 2), column_of(links[0], 3)
    wanted = height + normal[0] * t[0] + normal[1] * t[1] + normal[2] * t[2] - normal[2] * E[2]
    ones = pair_of(
        normal[0] * E[0] + normal[1] * E[1],
        normal[0] * E[1] - normal[1] * E[0],
        wanted,
        query.seed[joint_of(labelling, 0)],
        slack_after(0),
    )
    if is_open(ones, 0):
        state[FormState.UNSETTLED] = 1
    k = (side * links[3, 2, 0], side * links[3, 2, 1], side * links[3, 2, 2])
    wrist = triangle_of(k, column_of(links[4], 2))
    cosine, sine = work.cosine, work.sine
    for i in range(3):
        if skips(ones, SIGNS[i]):
            continue
        take(work, 0, ones, SIGNS[i])
        fill_rest(work, 1)
        Q = work.rotation
        # The z row of Q, what joints 2 to 6 must make, is that of side L_4 Rz(theta_5) L_5 Rz(theta_6).
        fives = pair_of_triangle(
            wrist, math.sqrt(Q[2, 0] * Q[2, 0] + Q[2, 1] * Q[2, 1]), Q[2, 2], slack_after(ones.fold)
        )
        if is_open(fives, ones.free):
            state[FormState.UNSETTLED] = 1
        for n in range(3):
            if skips(fives, SIGNS[n]):
                continue
            state[FormState.FREE], state[FormState.FOLDS] = ones.free + fives.free, ones.fold + fives.fold
            take(work, 4, fives, SIGNS[n])
            if fives.free > 0:
                angle = angle_that_closes(arm, E, query.seed[joint_of(labelling, 5)], work)
                if math.isnan(angle):
                    state[FormState.UNSETTLED] = max(state[FormState.UNSETTLED], ones.free)
                    continue
                take_angle(work, 5, angle)
            else:
                y = turned_back_by(links[4], unturned_about_z((cosine[4], sine[4]), k))
                take_unit(work, 5, unit_from_to(Q[2, 0], Q[2, 1], y[0], y[1]))
            middle = (ones.fold > 0 and SIGNS[i] == 0.0) or (fives.fold > 0 and SIGNS[n] == 0.0)
            in_the_plane(arm, E, middle, query, work, branches)
    add_last_candidates(query, work, branches)
    if state[FormState.DOUBTFUL] > 0:
        branches.filled[1] = 1
    return bool(state[FormState.UNSETTLED] == 0)


def in_the_plane(arm: SixArm, E: Vec, middle: bool, query: PoseQuery, work: Candidates, branches: BranchWork) -> None:
    """From theta_1, theta_5 and theta_6: both sides of the elbow."""
    links, state, labelling = work.links, work.state, arm.form_labelling
    free, folds = state[FormState.FREE], state[FormState.FOLDS]
    px, py = across_elbow(arm, E, work)
    a, b = column_of(links[1], 3), column_of(links[2], 3)
    bc, bs = turned_by(links[1], (b[0], b[1], 0.0)), turned_by(links[1], (-b[1], b[0], 0.0))
    square = px * px + py * py
    threes = pair_of(
        a[0] * bc[0] + a[1] * bc[1],
        a[0] * bs[0] + a[1] * bs[1],
        0.5 * (square - a[0] * a[0] - a[1] * a[1] - b[0] * b[0] - b[1] * b[1]),
        query.seed[joint_of(labelling, 2)],
        slack_after(folds),
    )
    if threes.there == 0:
        if is_open(threes, free):
            state[FormState.UNSETTLED] = 1
        return
    x = undo_last(work, (1.0, 0.0, 0.0))
    for i in range(3):
        if skips(threes, SIGNS[i]):
            continue
        take(work, 2, threes, SIGNS[i])
        c, s = work.cosine[2], work.sine[2]
        fx, fy = a[0] + c * bc[0] + s * bs[0], a[1] + c * bc[1] + s * bs[1]
        state[FormState.FREE], state[FormState.FOLDS] = free + threes.free, folds + threes.fold
        two = unit_from_to(fx, fy, px, py)
        take_unit(work, 1, two)
        # Rz(theta_2) L_2 Rz(theta_3) L_3 Rz(theta_4) takes x to where the rest wants it.
        y = turned_back_by(links[1], unturned_about_z(two, x))
        y = turned_back_by(links[2], unturned_about_z((c, s), y))
        take_unit(work, 3, (y[0], y[1]))
        add_candidate(arm, query, work, branches, middle or (threes.fold > 0 and SIGNS[i] == 0.0))
    state[FormState.FREE], state[FormState.FOLDS] = free, folds


def across_elbow(arm: SixArm, E: Vec, work: Candidates) -> tuple[float, float]:
    """From joint 2 to joint 4 in the plane, from theta_1, theta_5 and theta_6.

    E is seen from link 1, and from link 4: the origin of joint 4 is where the latter takes it.
    """
    links = work.links
    place = unturned_about_z((work.cosine[0], work.sine[0]), E)
    place = turned_back_by(links[0], minus(place, column_of(links[0], 3)))
    z, t = column_of(links[3], 2), column_of(links[3], 3)
    e = undo_last(work, (t[0] + arm.first * z[0], t[1] + arm.first * z[1], t[2] + arm.first * z[2]))
    return place[0] - e[0], place[1] - e[1]


def angle_that_closes(arm: SixArm, E: Vec, seed: float, work: Candidates) -> float:
    """A free theta_6 with which the elbow reaches across: that of the seed, or one near to it; NaN where none does.

    Axis 6 is parallel to axes 2, 3 and 4 then, so that joint 4 goes round on a circle about E as theta_6 turns: the
    square of its distance to joint 2 is a constant and one wave.
    """
    a, b = column_of(work.links[1], 3), column_of(work.links[2], 3)
    upper, fore = math.hypot(a[0], a[1]), math.hypot(b[0], b[1])
    low, high = (upper - fore) * (upper - fore), (upper + fore) * (upper + fore)
    here, quarter = square_across(arm, E, 0.0, work), square_across(arm, E, QUARTER, work)
    half = square_across(arm, E, 2.0 * QUARTER, work)
    middle = 0.5 * (here + half)
    wave, phase = math.hypot(here - middle, quarter - middle), math.atan2(quarter - middle, here - middle)
    if low <= middle + wave * math.cos(seed - phase) <= high:
        return seed
    low, high = max(low, middle - wave), min(high, middle + wave)
    if low > high + JUST_REACHES * (upper + fore) * (upper + fore) or wave == 0.0:
        return math.nan
    away = math.acos(min(max((0.5 * (low + high) - middle) / wave, -1.0), 1.0))
    return phase + math.copysign(away, math.sin(seed - phase))


def square_across(arm: SixArm, E: Vec, angle: float, work: Candidates) -> float:
    """The square of the distance from joint 2 to joint 4 with a theta_6."""
    take_angle(work, 5, angle)
    x, y = across_elbow(arm, E, work)
    return x * x + y * y


def undo_last(work: Candidates, v: Vec) -> Vec:
    """What joints 2, 3 and 4 must make of a vector: Q (L_4 Rz(theta_5) L_5 Rz(theta_6))^T v."""
    links, Q = work.links, work.rotation
    v = unturned_about_z((work.cosine[4], work.sine[4]), turned_back_by(links[3], v))
    v = unturned_about_z((work.cosine[5], work.sine[5]), turned_back_by(links[4], v))
    return (
        Q[0, 0] * v[0] + Q[0, 1] * v[1] + Q[0, 2] * v[2],
        Q[1, 0] * v[0] + Q[1, 1] * v[1] + Q[1, 2] * v[2],
        Q[2, 0] * v[0] + Q[2, 1] * v[1] + Q[2, 2] * v[2],
    )
