"""The seven-joint arm with joint 3 given: at most eight configurations, each from a chain of plane angles.

The wrist centre W depends on joints 1 to 4 only. Its distance from O, where axes 1 and 2 meet, gives joint 4; its
height along axis 1 gives joint 2, its direction joint 1; the spherical wrist gives joints 6, 5 and 7.
"""

from __future__ import annotations

import math

from jacokin.arrays import Array
from jacokin.kernels.closed_form.resultant import DEGREE, SAMPLES, SPACING, TO_COSINE, TO_SINE, value_and_slope
from jacokin.kernels.closed_form.roots import RootWork, find_roots
from jacokin.kernels.six_joints.equations import turned_back_by, turned_by
from jacokin.kernels.six_joints.loop import column_of
from jacokin.kernels.solution_set.curve import wrapped
from jacokin.kernels.trigonometry import angle_of, sin_cos
from jacokin.kernels.vector import Vec, dot

MOST_ROWS = 8
MOST_FOLDS = 64
#: Waves of the functions that vanish at folds, at most.
WAVES = 4
#: Steps of Newton's method after which a fold is as exact as rounding allows: beside it, joints move by the square root
#: of what it is off.
LAST_STEPS = 2
#: What the last digits of a target change of an equation, relative to its largest terms.
ROUNDING = 1e-14


def row_of(link: Array, k: int) -> Vec:
    """Row k of a rotation."""
    return (link[k, 0], link[k, 1], link[k, 2])


def about_z(c: float, s: float, v: Vec) -> Vec:
    """A vector turned about z, by its cosine and sine."""
    return (c * v[0] - s * v[1], s * v[0] + c * v[1], v[2])


def plane_equation(r: Vec, v: Vec, right: float) -> tuple[float, float, float]:
    """The coefficients of a cos q + b sin q = c that r . Rz(q) v = right stands for."""
    return r[0] * v[0] + r[1] * v[1], r[1] * v[0] - r[0] * v[1], right - r[2] * v[2]


def half_between(c: float, r: float) -> float:
    """Half the angle between the two solutions of a plane equation of amplitude r; 0 where it misses them."""
    return angle_of(math.sqrt(max((r - c) * (r + c), 0.0)), c)


def wrist_from_shoulder(chain: Array, arm7: Array, T: Array) -> Vec:
    """From O to W, in the axes of joint 1 at q1 = 0."""
    W = turned_by(T, (arm7[0], arm7[1], arm7[2]))
    return turned_back_by(chain[0], (W[0] + T[0, 3] - arm7[3], W[1] + T[1, 3] - arm7[4], W[2] + T[2, 3] - arm7[5]))


def elbow(chain: Array, arm7: Array, c3: float, s3: float) -> Vec:
    """From O to the origin of joint 4, in the axes after joint 2."""
    d = turned_by(chain[2], about_z(c3, s3, column_of(chain[3], 3)))
    return (chain[2, 0, 3] - arm7[6] + d[0], chain[2, 1, 3] - arm7[7] + d[1], chain[2, 2, 3] - arm7[8] + d[2])


def elbow_equation(chain: Array, arm7: Array, D0: Vec, u: Vec, c3: float, s3: float) -> tuple[float, float, float]:
    """The coefficients of a cos q4 + b sin q4 = c, from the distance of W from O."""
    w4 = (arm7[9], arm7[10], arm7[11])
    seen = turned_back_by(chain[3], about_z(c3, -s3, turned_back_by(chain[2], u)))
    return plane_equation(seen, w4, 0.5 * (dot(D0, D0) - dot(u, u) - dot(w4, w4)))


def wrist_after_joint_2(chain: Array, arm7: Array, u: Vec, c3: float, s3: float, c4: float, s4: float) -> Vec:
    """From O to W, in the axes after joint 2."""
    at4 = about_z(c4, s4, (arm7[9], arm7[10], arm7[11]))
    d = turned_by(chain[2], about_z(c3, s3, turned_by(chain[3], at4)))
    return (u[0] + d[0], u[1] + d[1], u[2] + d[2])


def fold_equations(
    chain: Array, arm7: Array, D0: Vec, q3: float
) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
    """Three functions of joint 3 that vanish where configurations meet: trigonometric polynomials of degrees 2, 4, 4.

    The first one is the discriminant of joint 4. Joint 2 has one value where the height of W after joint 2 is one of
    two constants, the second and the third function: with joint 4's equation, both linear in its cosine and sine. Each
    comes with the size of its terms, to which rounding is in proportion.
    """
    s3, c3 = sin_cos(q3)
    u = elbow(chain, arm7, c3, s3)
    a, b, c = elbow_equation(chain, arm7, D0, u, c3, s3)
    up = turned_back_by(chain[3], about_z(c3, -s3, row_of(chain[2], 2)))  # axis z after joint 2, seen after joint 3
    across, along = up[0] * arm7[9] + up[1] * arm7[10], up[1] * arm7[9] - up[0] * arm7[10]
    height = u[2] + up[2] * arm7[11]
    r = chain[1, 2, 2]
    flat = math.sqrt(max((1.0 - r * r) * (dot(D0, D0) - D0[2] * D0[2]), 0.0))
    above, below = r * D0[2] + flat - height, r * D0[2] - flat - height
    first = (a * a + b * b - c * c, a * a + b * b + c * c)
    return first, meeting_of(a, b, c, across, along, above), meeting_of(a, b, c, across, along, below)


def meeting_of(a: float, b: float, c: float, d: float, e: float, f: float) -> tuple[float, float]:
    """What vanishes where a cos q + b sin q = c and d cos q + e sin q = f have a solution; the size of its terms."""
    x, y, z = c * e - b * f, a * f - c * d, a * e - b * d
    size = (abs(c * e) + abs(b * f)) ** 2 + (abs(a * f) + abs(c * d)) ** 2 + (abs(a * e) + abs(b * d)) ** 2
    return x * x + y * y - z * z, size


def find_folds(
    chain: Array, arm7: Array, T: Array, steps: int, waves: Array, roots: RootWork, folds: Array
) -> tuple[int, bool]:
    """Fill folds with the values of joint 3 where configurations meet, in order; how many, and whether all are single.

    A root that may be a double one gives the ends of its interval.

    Args:
        chain: (8, 3, 4) the arm's placements.
        arm7: (12,) see `solve_at_q3`.
        T: (4, 4) target.
        steps: of Newton's method to a fold from where it is found, to 5e-8.
        waves: filled with coefficients.
        roots: work arrays.
        folds: filled.
    """
    D0 = wrist_from_shoulder(chain, arm7, T)
    waves[:] = 0.0
    most = (0.0, 0.0, 0.0)
    for j in range(SAMPLES):
        elbow4, above, below = fold_equations(chain, arm7, D0, SPACING * j)
        most = (max(most[0], elbow4[1]), max(most[1], above[1]), max(most[2], below[1]))
        add_sample(j, elbow4[0], 2, waves[0])
        add_sample(j, above[0], 4, waves[1])
        add_sample(j, below[0], 4, waves[2])
    count, single = 0, most[2] > 0.0
    for which in range(3):
        count, alone = add_folds(ROUNDING * most[which], waves[which], steps, count, roots, folds)
        single = single and alone
    sort_folds(count, folds)
    return count, single


def add_sample(j: int, value: float, degree: int, waves: Array) -> None:
    """Add sample j of a trigonometric polynomial to its coefficients (2, 5), of cosines and sines."""
    for n in range(degree + 1):
        waves[0, n] += TO_COSINE[j, n] * value
        waves[1, n] += TO_SINE[j, n] * value


def add_folds(noise: float, waves: Array, steps: int, count: int, roots: RootWork, folds: Array) -> tuple[int, bool]:
    """Append the roots of a function to so many folds; how many there are then, and whether all are single.

    Where it is within noise for longer, all of that is one interval.
    """
    for n in range(DEGREE + 1):
        roots.cosine[n], roots.sine[n] = (waves[0, n], waves[1, n]) if n <= WAVES else (0.0, 0.0)
    found, single, end = find_roots(noise, 0.0, roots), True, math.nan
    for i in range(found):
        p, half = roots.roots[i, 0], roots.roots[i, 1]
        single = single and half == 0.0
        if abs(p - half - end) <= ROUNDING:
            end = p + half
            folds[count - 1] = wrapped(end)
            continue
        end = p + half if half > 0.0 else math.nan
        for _ in range(steps if half == 0.0 else 0):
            value, slope = value_and_slope(roots.cosine, roots.sine, p)
            p -= value / slope if slope != 0.0 else 0.0
        for side in range(1 if half == 0.0 else 2):
            if count < folds.shape[0]:
                folds[count] = wrapped(p + (2 * side - 1) * half)
                count += 1
    return count, single


def sort_folds(count: int, folds: Array) -> None:
    """Put so many folds in order."""
    for i in range(1, count):
        k = i
        while k > 0 and folds[k] < folds[k - 1]:
            swap = folds[k]
            folds[k] = folds[k - 1]
            folds[k - 1] = swap
            k -= 1


def solve_at_q3(chain: Array, arm7: Array, T: Array, q3: float, rows: Array) -> None:
    """Fill rows (8, 7) with the configurations that reach T with this joint 3; row 4 a + 2 b + c has signs a, b, c.

    Args:
        chain: (8, 3, 4) the arm's placements.
        arm7: (12,) W in the tool frame, O in the base, O after joint 2, W after joint 4 [m].
        T: (4, 4) target.
        q3: [rad].
        rows: filled; NaN in the first column where there is none.
    """
    solve_rows_at_q3(chain, arm7, T, q3, 0, MOST_ROWS, rows)


def solve_rows_at_q3(chain: Array, arm7: Array, T: Array, q3: float, low: int, high: int, rows: Array) -> None:
    """Fill rows low to high - 1 of those of `solve_at_q3`, which have the configurations with this joint 3."""
    for i in range(low, high):
        rows[i, 0] = math.nan
    D0 = wrist_from_shoulder(chain, arm7, T)
    x = turned_back_by(chain[0], turned_by(T, row_of(chain[7], 0)))
    y = turned_back_by(chain[0], turned_by(T, row_of(chain[7], 1)))
    z = turned_back_by(chain[0], turned_by(T, row_of(chain[7], 2)))
    towards = angle_of(D0[1], D0[0])
    s3, c3 = sin_cos(q3)
    u = elbow(chain, arm7, c3, s3)
    a, b, c = elbow_equation(chain, arm7, D0, u, c3, s3)
    r4 = math.sqrt(a * a + b * b)
    if not abs(c) <= r4 * (1.0 + ROUNDING) or r4 == 0.0:
        return
    middle4, half4 = angle_of(b, a), half_between(c, r4)
    for i in range(2):
        if 4 * i >= high or 4 * i + 4 <= low:
            continue
        q4 = middle4 + (half4 if i == 0 else -half4)
        s4, c4 = sin_cos(q4)
        v = wrist_after_joint_2(chain, arm7, u, c3, s3, c4, s4)
        a, b, c = plane_equation(row_of(chain[1], 2), v, D0[2])
        r2 = math.sqrt(a * a + b * b)
        if not abs(c) <= r2 * (1.0 + ROUNDING) or r2 == 0.0:
            continue
        middle2, half2 = angle_of(b, a), half_between(c, r2)
        for k in range(2):
            n = 4 * i + 2 * k
            if n >= high or n + 2 <= low:
                continue
            q2 = middle2 + (half2 if k == 0 else -half2)
            s2, c2 = sin_cos(q2)
            D1 = turned_by(chain[1], about_z(c2, s2, v))
            q1 = towards - angle_of(D1[1], D1[0])
            s1, c1 = sin_cos(q1)
            turns = ((c1, s1), (c2, s2), (c3, s3), (c4, s4))
            first, last = max(n, low), min(n + 2, high)
            for m in range(first, last):
                rows[m, 0], rows[m, 1], rows[m, 2], rows[m, 3] = q1, q2, q3, q4
            solve_wrist(
                (chain[5], chain[6]),
                after_joint_4(chain, turns, x),
                after_joint_4(chain, turns, y),
                after_joint_4(chain, turns, z),
                (4, 5, 6),
                rows,
                first,
                last,
            )


def solve_wrist(
    links: tuple[Array, Array],
    x: Vec,
    y: Vec,
    z: Vec,
    columns: tuple[int, int, int],
    rows: Array,
    first: int,
    last: int,
) -> None:
    """The three angles of a square spherical wrist, in rows from first up to last.

    Args:
        links: between its joints.
        x: axis of what the joints must make, as seen before the first of them.
        y: likewise.
        z: likewise.
        columns: of the angles.
        rows: filled.
        first: first row; odd rows have the other sign.
        last: row after the last one.
    """
    before, after = links
    axis = column_of(after, 2)
    a, b, c = plane_equation(row_of(before, 2), axis, z[2])
    r = math.sqrt(a * a + b * b)
    middle, half = angle_of(b, a), half_between(c, r)
    towards = angle_of(z[1], z[0])
    for n in range(first, last):
        q6 = middle + (half if n % 2 == 0 else -half)
        s6, c6 = sin_cos(q6)
        e = turned_by(before, about_z(c6, s6, axis))
        q5 = towards - angle_of(e[1], e[0])
        s5, c5 = sin_cos(q5)
        f = turned_back_by(after, about_z(c6, -s6, turned_back_by(before, about_z(c5, -s5, x))))
        g = turned_back_by(after, about_z(c6, -s6, turned_back_by(before, about_z(c5, -s5, y))))
        rows[n, columns[0]], rows[n, columns[1]] = q5, q6
        rows[n, columns[2]] = angle_of(f[1] - g[0], f[0] + g[1])


def after_joint_4(chain: Array, turns: tuple[tuple[float, float], ...], v: Vec) -> Vec:
    """A vector seen before joint 1, turned into the axes before joint 5, by cosine and sine of each joint between."""
    for i in range(4):
        c, s = turns[i]
        v = turned_back_by(chain[1 + i], about_z(c, -s, v))
    return v
