"""Axes 4, 5 and 6 of a labelling meet in W: theta_3, theta_2 and theta_1 from where W is, then the wrist.

W is fixed beside axis 3, and before axis 1 it is where the target wants it: with f = L_2 Rz(theta_3) w,

    Rz(theta_1) L_1 Rz(theta_2) f = W.

Height and distance of the left side do not depend on theta_1. They are linear in the two coordinates of f that theta_2
turns, and these turned coordinates are as long as before (Pieper, 1968): in general a polynomial of degree 2 in
theta_3; where axes 1 and 2 meet or are parallel, height and distance know one turned coordinate only, and without it
an equation remains that is linear in cosine and sine of theta_3.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from jacokin.arrays import Array
from jacokin.kernels.branches import BranchWork, PoseQuery
from jacokin.kernels.closed_form.resultant import value_and_slope
from jacokin.kernels.closed_form.roots import RootWork, find_roots
from jacokin.kernels.limits import nearest_copy
from jacokin.kernels.six_joints.candidates import (
    SIGNS,
    Candidates,
    FormState,
    Triangle,
    add_candidate,
    add_last_candidates,
    angle_from_to,
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
    turn_from_to,
    unit_from_to,
)
from jacokin.kernels.six_joints.equations import turned_back_by, turned_by
from jacokin.kernels.six_joints.loop import SixArm, column_of, fill_links, joint_of
from jacokin.kernels.tolerances import ALIGNED_SINE, DISTINCT, EXACT_STRUCTURE, FREE_ANGLE, SMALLEST_NOISE
from jacokin.kernels.vector import Vec, dot

#: A function of theta_3: constant part, parts of cosine and sine.
Wave = Vec


class Reach(NamedTuple):
    """What brings W to its place."""

    W: Vec  # where it is, before joint 1
    f0: Vec  # f is f0 + cos(theta_3) fc + sin(theta_3) fs
    fc: Vec
    fs: Vec
    u: Vec  # axis 1 to axis 2, seen after joint 1 in the axes of joint 2
    v: Vec  # axis 1, likewise
    distance: Wave  # u . (turned f), without its z, must be this
    height: Wave  # v . (turned f) likewise
    cross: float  # u x v along axis 2


def branches_of_spherical_wrist(
    arm: SixArm, query: PoseQuery, work: Candidates, roots: RootWork, branches: BranchWork
) -> bool:
    """Add every branch; False where the general way must look after what is left open."""
    for i in range(len(work.state)):
        work.state[i] = 0
    fill_links(query.chain, query.T, arm.scale, arm.form_labelling, work.links)
    reach = reach_of(arm, work.links)
    wrist = triangle_of((work.links[3, 2, 0], work.links[3, 2, 1], work.links[3, 2, 2]), column_of(work.links[4], 2))
    if abs(reach.cross) < DISTINCT:
        at_linear_roots(arm, reach, wrist, query, work, branches)
    else:
        at_quartic_roots(arm, reach, wrist, query, work, roots, branches)
    add_last_candidates(query, work, branches)
    if work.state[FormState.DOUBTFUL] > 0:
        branches.filled[1] = 1
    return bool(work.state[FormState.UNSETTLED] == 0)


def reach_of(arm: SixArm, links: Array) -> Reach:
    """The constants of one target; lengths scaled."""
    after, before = links[2], links[5]
    z, t = column_of(after, 2), column_of(after, 3)
    w = (t[0] + arm.first * z[0], t[1] + arm.first * z[1], t[2] + arm.first * z[2])
    W = turned_back_by(before, (-before[0, 3], -before[1, 3], arm.second - before[2, 3]))
    t1, t2 = column_of(links[0], 3), column_of(links[1], 3)
    u, v = turned_back_by(links[0], t1), (links[0, 2, 0], links[0, 2, 1], links[0, 2, 2])
    up = turned_by(links[1], (0.0, 0.0, w[2]))
    f0 = (t2[0] + up[0], t2[1] + up[1], t2[2] + up[2])
    fc, fs = turned_by(links[1], (w[0], w[1], 0.0)), turned_by(links[1], (-w[1], w[0], 0.0))
    flat = w[0] * w[0] + w[1] * w[1]
    distance = (
        0.5 * (dot(W, W) - dot(t1, t1) - dot(f0, f0) - flat) - u[2] * f0[2],
        -dot(f0, fc) - u[2] * fc[2],
        -dot(f0, fs) - u[2] * fs[2],
    )
    height = (W[2] - t1[2] - v[2] * f0[2], -v[2] * fc[2], -v[2] * fs[2])
    return Reach(W, f0, fc, fs, u, v, distance, height, u[0] * v[1] - u[1] * v[0])


def at(wave: Wave, c: float, s: float) -> float:
    """Its value."""
    return wave[0] + c * wave[1] + s * wave[2]


def combined(a: Wave, x: float, b: Wave, y: float) -> Wave:
    """X a + y b."""
    return (x * a[0] + y * b[0], x * a[1] + y * b[1], x * a[2] + y * b[2])


def at_linear_roots(
    arm: SixArm, reach: Reach, wrist: Triangle, query: PoseQuery, work: Candidates, branches: BranchWork
) -> None:
    """The branches where axes 1 and 2 meet or are parallel: u and v have one direction."""
    state = work.state
    ex, ey, along_u, along_v, square = direction_of(reach)
    rest = combined(reach.distance, along_v, reach.height, -along_u)
    joint = joint_of(arm.form_labelling, 2)
    threes = pair_of(rest[1], rest[2], -rest[0], query.seed[joint], slack_after(0))
    if is_open(threes, 0):
        state[FormState.UNSETTLED] = 1
    coordinate = combined(reach.distance, along_u / square, reach.height, along_v / square)
    for i in range(3):
        if skips(threes, SIGNS[i]):
            continue
        take(work, 2, threes, SIGNS[i])
        c, s = work.cosine[2], work.sine[2]
        f = (at_turn(reach, 0, c, s), at_turn(reach, 1, c, s), at_turn(reach, 2, c, s))
        # f turned by theta_2 has this coordinate along e.
        x = at(coordinate, c, s)
        twos = pair_of(
            f[0] * ex + f[1] * ey,
            f[0] * ey - f[1] * ex,
            x,
            query.seed[joint_of(arm.form_labelling, 1)],
            slack_after(threes.fold),
        )
        if is_open(twos, threes.free):
            state[FormState.UNSETTLED] = 1
        for k in range(3):
            if not skips(twos, SIGNS[k]):
                state[FormState.FREE], state[FormState.FOLDS] = threes.free + twos.free, threes.fold + twos.fold
                work.slack[0] = slack_after(state[FormState.FOLDS])
                middle = (threes.fold > 0 and SIGNS[i] == 0.0) or (twos.fold > 0 and SIGNS[k] == 0.0)
                take(work, 1, twos, SIGNS[k])
                turn_wrist(arm, reach, wrist, f, middle, query, work, branches)


def at_turn(reach: Reach, i: int, c: float, s: float) -> float:
    """Coordinate i of f."""
    return reach.f0[i] + c * reach.fc[i] + s * reach.fs[i]


def at_quartic_roots(
    arm: SixArm,
    reach: Reach,
    wrist: Triangle,
    query: PoseQuery,
    work: Candidates,
    roots: RootWork,
    branches: BranchWork,
) -> None:
    """The branches where the turned coordinates of f follow from height and distance."""
    state = work.state
    x, y, noise = fill_quartic(reach, roots.cosine, roots.sine)
    for i in range(find_roots(noise, 0.0, roots)):
        theta = roots.roots[i, 0]
        _, slope = value_and_slope(roots.cosine, roots.sine, theta)
        if roots.roots[i, 1] > 0.0 or slope == 0.0:
            state[FormState.UNSETTLED] = 1
            continue
        take_angle(work, 2, theta)
        c, s = work.cosine[2], work.sine[2]
        f = (at_turn(reach, 0, c, s), at_turn(reach, 1, c, s), at_turn(reach, 2, c, s))
        take_unit(work, 1, unit_from_to(f[0], f[1], at(x, c, s), at(y, c, s)))
        state[FormState.FREE], state[FormState.FOLDS] = 0, 0
        # What the structure may miss moves the root, most where others are near it.
        work.slack[0] = slack_after(0) + EXACT_STRUCTURE / SMALLEST_NOISE * noise / abs(slope)
        if f[0] * f[0] + f[1] * f[1] < FREE_ANGLE * FREE_ANGLE:
            take_angle(work, 1, query.seed[joint_of(arm.form_labelling, 1)])
            state[FormState.FREE] = 1
        turn_wrist(arm, reach, wrist, f, False, query, work, branches)


def fill_quartic(reach: Reach, cosine: Array, sine: Array) -> tuple[Wave, Wave, float]:
    """Fill the coefficients of the polynomial of degree 2 in theta_3 whose roots bring W to its place.

    Returns:
        The turned coordinates of f, and the noise of the polynomial's values.
    """
    u, v = reach.u, reach.v
    x = combined(reach.distance, v[1] / reach.cross, reach.height, -u[1] / reach.cross)
    y = combined(reach.height, u[0] / reach.cross, reach.distance, -v[0] / reach.cross)
    for n in range(len(cosine)):
        cosine[n], sine[n] = 0.0, 0.0
    size = add_square(x, 1.0, cosine, sine) + add_square(y, 1.0, cosine, sine)
    for i in range(2):
        size += add_square((reach.f0[i], reach.fc[i], reach.fs[i]), -1.0, cosine, sine)
    return x, y, SMALLEST_NOISE * size


def fill_both_turns(reach: Reach, cosine: Array, sine: Array) -> tuple[float, float]:
    """Fill the coefficients of the polynomial of degree 2 in theta_2, where axes 1 and 2 meet or are parallel.

    Two theta_3 solve an equation of their own, and for each theta_2 has one like it. With c_3 and s_3 = (e + r g) / h,
    where r is a root that may be imaginary, the product of both equations for theta_2 has no root.

    Returns:
        The noise of its values, and the square of r relative to h: where that is negative, theta_3 is complex.
    """
    ex, ey, along_u, along_v, square = direction_of(reach)
    rest = combined(reach.distance, along_v, reach.height, -along_u)
    x = combined(reach.distance, along_u / square, reach.height, along_v / square)
    along = combined(wave_of(reach, 0), ex, wave_of(reach, 1), ey)
    across = combined(wave_of(reach, 0), ey, wave_of(reach, 1), -ex)
    h = rest[1] * rest[1] + rest[2] * rest[2]
    r2 = h - rest[0] * rest[0]
    # h times a wave is its first number plus r times its second.
    a, b, c = parts_of(along, rest, h), parts_of(across, rest, h), parts_of(x, rest, h)
    for n in range(len(cosine)):
        cosine[n], sine[n] = 0.0, 0.0
    size = add_square((-c[0], a[0], b[0]), 1.0, cosine, sine)
    size += add_square((-c[1], a[1], b[1]), -r2, cosine, sine)
    return SMALLEST_NOISE * size, r2 / h if h > 0.0 else 0.0


def direction_of(reach: Reach) -> tuple[float, float, float, float, float]:
    """The direction that u and v have in common, their coordinates along it, and the sum of their squares."""
    u, v = reach.u, reach.v
    uu, vv = u[0] * u[0] + u[1] * u[1], v[0] * v[0] + v[1] * v[1]
    longer, square = (u, uu) if uu > vv else (v, vv)
    ex, ey = longer[0] / math.sqrt(square), longer[1] / math.sqrt(square)
    return ex, ey, u[0] * ex + u[1] * ey, v[0] * ex + v[1] * ey, uu + vv


def wave_of(reach: Reach, i: int) -> Wave:
    """Coordinate i of f."""
    return (reach.f0[i], reach.fc[i], reach.fs[i])


def parts_of(wave: Wave, rest: Wave, h: float) -> tuple[float, float]:
    """H times a wave where another one is zero: a number, and what is multiplied by the root."""
    return (
        h * wave[0] - rest[0] * (rest[1] * wave[1] + rest[2] * wave[2]),
        rest[1] * wave[2] - rest[2] * wave[1],
    )


def add_square(wave: Wave, factor: float, cosine: Array, sine: Array) -> float:
    """Add a multiple of the square of a wave to a polynomial; returns a bound of its size."""
    a, b, c = wave
    cosine[0] += factor * (a * a + 0.5 * (b * b + c * c))
    cosine[1] += factor * 2.0 * a * b
    sine[1] += factor * 2.0 * a * c
    cosine[2] += factor * 0.5 * (b * b - c * c)
    sine[2] += factor * b * c
    size = abs(a) + abs(b) + abs(c)
    return abs(factor) * size * size


def turn_wrist(
    arm: SixArm,
    reach: Reach,
    wrist: Triangle,
    f: Vec,
    middle: bool,
    query: PoseQuery,
    work: Candidates,
    branches: BranchWork,
) -> None:
    """From theta_3, theta_2 and f: theta_1, and the branches of both sides of the wrist."""
    state, links, labelling = work.state, work.links, arm.form_labelling
    c2, s2 = work.cosine[1], work.sine[1]
    g = turned_by(links[0], (c2 * f[0] - s2 * f[1], s2 * f[0] + c2 * f[1], f[2]))
    gx, gy = g[0] + links[0, 0, 3], g[1] + links[0, 1, 3]
    on_axis = max(gx * gx + gy * gy, reach.W[0] * reach.W[0] + reach.W[1] * reach.W[1]) < ALIGNED_SINE * ALIGNED_SINE
    if on_axis:
        take_angle(work, 0, query.seed[joint_of(labelling, 0)])
    else:
        take_unit(work, 0, unit_from_to(gx, gy, reach.W[0], reach.W[1]))
    fill_rest(work, 3)
    free, folds = state[FormState.FREE] + on_axis, state[FormState.FOLDS]
    Q = work.rotation
    # Q = Rz(theta_4) L_4 Rz(theta_5) L_5 Rz(theta_6): its z column and row.
    sine = math.sqrt(Q[0, 2] * Q[0, 2] + Q[1, 2] * Q[1, 2])
    fives = pair_of_triangle(wrist, sine, Q[2, 2], work.slack[0])
    if is_open(fives, free) or (wrist.alike and fives.free == 0 and sine < work.slack[0]):
        state[FormState.UNSETTLED] = 1
    for i in range(3):
        if skips(fives, SIGNS[i]):
            continue
        state[FormState.FREE], state[FormState.FOLDS] = free + fives.free, folds + fives.fold
        take(work, 4, fives, SIGNS[i])
        c5, s5 = work.cosine[4], work.sine[4]
        if fives.free > 0:
            fours_and_sixes(arm, c5, s5, query, work, branches)
            continue
        h, k = wrist.h, wrist.k
        y = turned_by(links[3], (c5 * h[0] - s5 * h[1], s5 * h[0] + c5 * h[1], h[2]))
        take_unit(work, 3, turn_from_to(y[0], y[1], Q[0, 2], Q[1, 2]))
        y = turned_back_by(links[4], (c5 * k[0] + s5 * k[1], c5 * k[1] - s5 * k[0], k[2]))
        take_unit(work, 5, turn_from_to(Q[2, 0], Q[2, 1], y[0], y[1]))
        add_candidate(arm, query, work, branches, middle or (fives.fold > 0 and SIGNS[i] == 0.0))
    state[FormState.FREE], state[FormState.FOLDS] = free - on_axis, folds


def fours_and_sixes(
    arm: SixArm, c5: float, s5: float, query: PoseQuery, work: Candidates, branches: BranchWork
) -> None:
    """Two members where axes 4 and 6 are aligned: theta_6 at the seed's angle, and theta_4."""
    links, theta, Q = work.links, work.theta, work.rotation
    four, six = joint_of(arm.form_labelling, 3), joint_of(arm.form_labelling, 5)
    # L_4 Rz(theta_5) L_5 is a turn about z, behind half a turn about x where the axes point opposite ways.
    x = turned_by(
        links[3], (c5 * links[4, 0, 0] - s5 * links[4, 1, 0], s5 * links[4, 0, 0] + c5 * links[4, 1, 0], links[4, 2, 0])
    )
    sign = 1.0 if Q[2, 2] > 0.0 else -1.0
    sum_of_both = angle_from_to(x[0], x[1], Q[0, 0], Q[1, 0])
    theta[5] = query.seed[six]
    theta[3] = sum_of_both - sign * theta[5]
    add_candidate(arm, query, work, branches, False)
    theta[3] = query.seed[four]
    theta[5] = nearest_copy(sign * (sum_of_both - theta[3]), query.seed[six])
    add_candidate(arm, query, work, branches, False)
