"""The configuration within the limits that comes closest to a target: Newton's method from many starts.

The measure is |p| + w |a|: position error p [m], weight w [m/rad], rotation vector a of the orientation error [rad]. It
has a kink where either vanishes, and its minima often lie there: the position exactly met, the orientation not, or the
other way round. With |x| = sqrt(x x + e e) the kinks are smooth but sharp, and Newton's method overshoots. So the unit
vectors u = p / |p| and v = a / |a| are kept as unknowns of their own, in which the equations u |p| = p are nearly
linear: the primal-dual Newton method of Chan, Golub and Mulet (A nonlinear primal-dual method for total variation-based
image restoration, SIAM J. Sci. Comput. 20(6), 1999). At a kink u and v are the multipliers.

Second derivatives, for joint i at or before joint j (axes z, linear velocities l of the tool, both at unit rate):

    of the position                 z_i x l_j
    of the rotation, composed       (z_i x z_j) / 2, from the product of exponentials
    of the angle, by a rotation     (1 - n n^T) cot(angle / 2) / 2
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.chain import BASE, deviation, moved, place
from jacokin.kernels.configurations.arm import Arm, make_arm
from jacokin.kernels.symmetric import diagonalise, factorise, is_positive, solve_factorised
from jacokin.kernels.trigonometry import angle_of
from jacokin.kernels.vector import Vec, cross, dot, minus, mix, norm

TINY = 1e-300
DAMPING = 3e-3  # of the first step, in the unit of the Hessian [m / rad^2]
LEAST_DAMPING, MOST_DAMPING = 1e-7, 1e4
LESS_DAMPING, MORE_DAMPING = 0.2, 4.0  # factors after a step that the model predicted well, and badly
GOOD_MODEL, BAD_MODEL = 0.7, 0.25  # parts of the predicted progress that were made
LONGEST_STEP = 1.0  # [rad] a quadratic model says nothing beyond
BOUND_PASSES = 2  # times that joints which pass a limit are held there and the others solved again
SETTLED = 1e-8  # [m] less progress in `PATIENCE` steps ends a descent
PATIENCE = 8
#: Size of what Jacobi's method leaves beside the diagonal, squared and relative.
DIAGONAL = 1e-20

STARTS = 112  # nearest ones of those drawn that descend
COARSE = 1e-2  # [m] smoothing of the first stage, which only gets near
FINE = 1e-6  # [m] smoothing of the others: as much may be missing in the end
SAME = 1e-2  # [rad] descents nearer than this to each other have met

#: Columns of what a start goes on with: the unit vectors u and v, damping, and 1 once it has been through a stage.
U, V, DAMPED, BEGUN, STATE_COLUMNS = 0, 3, 6, 7, 8
#: What a configuration is measured as: value, |p| and p / |p|, |a| and a / |a|, the axis of a, x cot(x) at |a| / 2.
VALUE, DISTANCE, TOWARDS, ANGLE, TURNING, ABOUT, HALF_COTANGENT, MEASURED = 0, 1, 2, 5, 6, 9, 12, 13


class Point(NamedTuple):
    """A configuration, the measure and its derivatives."""

    q: Array  # (dof,) [rad]
    measured: Array  # (13,)
    gradient: Array  # (dof,)
    hessian: Array  # (dof * dof,)
    linear: Array  # (dof, 3) velocities of the tool at unit rates
    angular: Array  # (dof, 3)


class ClosestWork(NamedTuple):
    """What a call reads and writes."""

    counts: NDArray[np.int64]  # (2,) starts that descend in any case; steps that were taken
    weight: Array  # (1,) w [m/rad]; 0 where the position alone counts
    arm: Arm  # up to the tool
    circular: NDArray[np.int64]  # (dof,) 1 for joints of which turns make no difference
    lower: Array  # (dof,) limits
    upper: Array  # (dof,)
    T: Array  # (4, 4) target
    starts: Array  # (n * dof,) configurations; the first one is the answer
    values: Array  # (n,) their measures [m]
    states: Array  # (n, 8)
    here: Point
    there: Point
    curvature: Array  # (dof * dof,)
    vectors: Array  # (dof * dof,) to work in
    matrix: Array  # (dof * dof,)
    step: Array  # (dof,)
    held: Array  # (dof,) 1 for joints on a limit
    best: Array  # (8,) values of the last steps


def make_closest_work(dof: int = 0, starts: int = 0) -> ClosestWork:
    """Fresh work arrays for an arm, and so many starts."""
    return ClosestWork(
        np.zeros(2, np.int64),
        np.zeros(1),
        make_arm(),
        np.zeros(dof, np.int64),
        np.zeros(dof),
        np.zeros(dof),
        np.eye(4),
        np.zeros(starts * dof),
        np.zeros(starts),
        np.zeros((starts, STATE_COLUMNS)),
        make_point(dof),
        make_point(dof),
        np.zeros(dof * dof),
        np.zeros(dof * dof),
        np.zeros(dof * dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(PATIENCE),
    )


def make_point(dof: int) -> Point:
    """Fresh arrays."""
    return Point(
        np.zeros(dof),
        np.zeros(MEASURED),
        np.zeros(dof),
        np.zeros(dof * dof),
        np.zeros((dof, 3)),
        np.zeros((dof, 3)),
    )


def find_closest(work: ClosestWork) -> int:
    """Bring the closest configuration to the front of work.starts; returns how many starts descended.

    After each stage the worse ones are dropped, and those that have met.
    """
    dof, number = len(work.lower), len(work.values)
    for i in range(number):
        work.states[i, BEGUN] = 0.0
        for j in range(dof):
            work.here.q[j] = work.starts[i * dof + j]
        fill_velocities(work, work.here)
        work.values[i] = exact(work, work.here)
    work.counts[1] = 0
    first = int(work.counts[0])
    count = min(number, first + STARTS)
    for i in range(first, count):
        bring_least(work, i, number)
    begun = count
    count = run_stage(work, count, True, COARSE, 6, 90)
    count = run_stage(work, count, False, FINE, 10, 36)
    count = run_stage(work, count, False, FINE, 25, 8)
    run_stage(work, count, False, FINE, 80, 1)
    return begun


def bring_least(work: ClosestWork, i: int, number: int) -> None:
    """Exchange start i with the least of those from it up to a number."""
    dof, least = len(work.lower), i
    for k in range(i + 1, number):
        if work.values[k] < work.values[least]:
            least = k
    if least == i:
        return
    value = work.values[i]
    work.values[i] = work.values[least]
    work.values[least] = value
    for j in range(dof):
        q = work.starts[i * dof + j]
        work.starts[i * dof + j] = work.starts[least * dof + j]
        work.starts[least * dof + j] = q
    for j in range(STATE_COLUMNS):
        state = work.states[i, j]
        work.states[i, j] = work.states[least, j]
        work.states[least, j] = state


def run_stage(work: ClosestWork, count: int, convex: bool, smoothing: float, steps: int, kept: int) -> int:
    """Let the first starts descend and bring the best to the front, each apart from the others; returns how many.

    Args:
        work: the starts.
        count: how many there are.
        convex: descend on a bound of the measure that is quadratic in the errors: robust, and slow near the end.
        smoothing: of the measure [m].
        steps: at most.
        kept: how many go on at most.
    """
    dof = len(work.lower)
    for i in range(count):
        work.counts[1] += descend(work, i, convex, smoothing, steps)
        fill_velocities(work, work.here)
        work.values[i] = exact(work, work.here)
    chosen = 0
    last = count
    while chosen < min(kept, last):
        bring_least(work, chosen, last)
        if has_met(work, chosen):  # out of the way
            last -= 1
            value = work.values[last]
            work.values[last] = work.values[chosen]
            work.values[chosen] = value
            for j in range(dof):
                work.starts[chosen * dof + j] = work.starts[last * dof + j]
            for j in range(STATE_COLUMNS):
                work.states[chosen, j] = work.states[last, j]
        else:
            chosen += 1
    return chosen


def has_met(work: ClosestWork, i: int) -> bool:
    """Whether a start is one of those before it."""
    dof = len(work.lower)
    for k in range(i):
        same = True
        for j in range(dof):
            away = work.starts[i * dof + j] - work.starts[k * dof + j]
            if work.circular[j] > 0:
                away -= 2.0 * math.pi * math.floor(away / (2.0 * math.pi) + 0.5)
            if abs(away) > SAME:
                same = False
        if same:
            return True
    return False


def fill_velocities(work: ClosestWork, point: Point) -> None:
    """Fill the velocities at point.q, and columns DISTANCE to ABOUT of point.measured, without smoothing."""
    arm, linear, angular, measured = work.arm, point.linear, point.angular, point.measured
    joints = len(arm.sliding)
    x, y, z, p = BASE
    for j in range(joints):
        x, y, z, p = moved(arm.placements, j, arm.sliding[j] != 0.0, point.q[j], x, y, z, p)
        for i in range(3):
            angular[j, i], linear[j, i] = z[i], p[i]
    x, y, z, p = place(arm.placements, joints, x, y, z, p)
    for j in range(joints):
        axis = vector_of(angular, j)
        v = cross(axis, minus(p, vector_of(linear, j)))
        for i in range(3):
            if arm.sliding[j] != 0.0:
                linear[j, i], angular[j, i] = axis[i], 0.0
            else:
                linear[j, i] = v[i]
    missing, turn, cosine = deviation(work.T, x, y, z, p)
    sine = norm(turn)
    measured[DISTANCE], measured[ANGLE] = norm(missing), angle_of(sine, cosine)
    for i in range(3):
        measured[TOWARDS + i], measured[ABOUT + i] = -missing[i], -turn[i] / max(sine, TINY)


def added(a: Vec, b: Vec) -> Vec:
    """Sum."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def exact(work: ClosestWork, point: Point) -> float:
    """The measure without smoothing, of a point that was placed [m]."""
    return float(point.measured[DISTANCE] + work.weight[0] * point.measured[ANGLE])


def measure(work: ClosestWork, point: Point, smoothing: float) -> None:
    """Fill the smoothed measure at point.q, its gradient, and what the Hessian is made of."""
    fill_velocities(work, point)
    m = point.measured
    angle = m[ANGLE]
    half = 0.5 * angle
    # Below 1e-4 rad the series of x cot(x) is exact in double precision.
    m[HALF_COTANGENT] = 1.0 - half * half / 3.0 if angle < 1e-4 else half / math.tan(half)
    m[DISTANCE] = math.sqrt(m[DISTANCE] * m[DISTANCE] + smoothing * smoothing)
    weight = work.weight[0]
    rest = smoothing / weight if weight > 0.0 else smoothing
    m[ANGLE] = math.sqrt(angle * angle + rest * rest)
    for i in range(3):
        m[TOWARDS + i] /= m[DISTANCE]
        m[TURNING + i] = m[ABOUT + i] * (angle / m[ANGLE])
    m[VALUE] = m[DISTANCE] + weight * m[ANGLE]
    for j in range(len(point.q)):
        point.gradient[j] = along(point.linear[j], m, TOWARDS) + weight * along(point.angular[j], m, TURNING)


def along(row: Array, vectors: Array, first: int) -> float:
    """Component of a row (3,) along the vector that begins at a column."""
    return float(row[0] * vectors[first] + row[1] * vectors[first + 1] + row[2] * vectors[first + 2])


def fill_hessian(work: ClosestWork, point: Point, state: Array, convex: bool) -> None:
    """Fill point.hessian of a point that was measured, with the unit vectors of a state.

    Convex: without what makes it indefinite, a bound from above that is quadratic in the errors.
    """
    dof, m, weight = len(point.q), point.measured, work.weight[0]
    u, v = (state[U], state[U + 1], state[U + 2]), (state[V], state[V + 1], state[V + 2])
    for i in range(dof):
        li, ai = vector_of(point.linear, i), vector_of(point.angular, i)
        across_u, across_v = cross(u, ai), cross(v, ai)
        for j in range(i, dof):
            lj, aj = vector_of(point.linear, j), vector_of(point.angular, j)
            h_position, h_rotation = dot(li, lj), dot(ai, aj)
            if convex:
                h = h_position / m[DISTANCE] + weight * h_rotation / m[ANGLE]
            else:
                to_i, to_j = along(point.linear[i], m, TOWARDS), along(point.linear[j], m, TOWARDS)
                h_position -= 0.5 * (dot(li, u) * to_j + dot(lj, u) * to_i)
                h_position = h_position / m[DISTANCE] + dot(across_u, lj)
                about = along(point.angular[i], m, ABOUT) * along(point.angular[j], m, ABOUT)
                to_i, to_j = along(point.angular[i], m, TURNING), along(point.angular[j], m, TURNING)
                h_rotation = m[HALF_COTANGENT] * (h_rotation - about) + about
                h_rotation -= 0.5 * (dot(ai, v) * to_j + dot(aj, v) * to_i)
                h_rotation = h_rotation / m[ANGLE] + 0.5 * dot(across_v, aj)
                h = h_position + weight * h_rotation
            point.hessian[i * dof + j] = h
            point.hessian[j * dof + i] = h


def vector_of(rows: Array, i: int) -> Vec:
    """A row."""
    return (rows[i, 0], rows[i, 1], rows[i, 2])


def move_duals(point: Point, step: Array, state: Array) -> None:
    """The unit vectors of a state after a step from a point, by their linearised equations; kept in the unit ball."""
    m = point.measured
    moved, turned_by = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for j in range(len(step)):
        linear, angular = vector_of(point.linear, j), vector_of(point.angular, j)
        moved = added(moved, mix(linear, step[j], linear, 0.0, linear, 0.0))
        turned_by = added(turned_by, mix(angular, step[j], angular, 0.0, angular, 0.0))
    n, turn = (m[ABOUT], m[ABOUT + 1], m[ABOUT + 2]), (m[TURNING], m[TURNING + 1], m[TURNING + 2])
    part = dot(n, turned_by)
    half_cotangent = m[HALF_COTANGENT]
    bent = mix(turned_by, half_cotangent, n, part * (1.0 - half_cotangent), cross(turn, turned_by), -0.5 * m[ANGLE])
    move_dual(state, U, (m[TOWARDS], m[TOWARDS + 1], m[TOWARDS + 2]), m[DISTANCE], moved)
    move_dual(state, V, turn, m[ANGLE], bent)


def move_dual(state: Array, first: int, unit: Vec, length: float, change: Vec) -> None:
    """One of them, from p / |p|, |p| and the change of p."""
    dual = (state[first], state[first + 1], state[first + 2])
    new = added(unit, mix(change, 1.0 / length, dual, -dot(unit, change) / length, dual, 0.0))
    size = max(1.0, norm(new))
    for i in range(3):
        state[first + i] = new[i] / size


def descend(work: ClosestWork, i: int, convex: bool, smoothing: float, steps: int) -> int:
    """Let start i descend; returns how many steps it took. It ends in work.here."""
    dof, here, there, state, best = len(work.lower), work.here, work.there, work.states[i], work.best
    for j in range(dof):
        here.q[j] = work.starts[i * dof + j]
    measure(work, here, smoothing)
    if state[BEGUN] == 0.0:
        state[BEGUN], state[DAMPED] = 1.0, DAMPING
        for k in range(3):
            state[U + k], state[V + k] = here.measured[TOWARDS + k], here.measured[TURNING + k]
    fill_hessian(work, here, state, convex)
    fill_curvature(work, convex)
    for k in range(PATIENCE):
        best[k] = math.inf
    taken = 0
    while taken < steps:
        value = here.measured[VALUE]
        if best[taken % PATIENCE] - value < SETTLED:
            break
        best[taken % PATIENCE] = value
        fill_step(work, state[DAMPED])
        predicted = 0.0
        for j in range(dof):
            there.q[j] = min(max(here.q[j] + work.step[j], work.lower[j]), work.upper[j])
            work.step[j] = there.q[j] - here.q[j]
        for j in range(dof):
            bent = 0.0
            for k in range(dof):
                bent += work.curvature[j * dof + k] * work.step[k]
            predicted -= work.step[j] * (here.gradient[j] + 0.5 * bent)
        move_duals(here, work.step, state)
        measure(work, there, smoothing)
        ratio = (value - there.measured[VALUE]) / max(predicted, TINY)
        if there.measured[VALUE] < value:
            copy_point(there, here)
            fill_hessian(work, here, state, convex)
            fill_curvature(work, convex)
        if ratio > GOOD_MODEL:
            state[DAMPED] = max(LESS_DAMPING * state[DAMPED], LEAST_DAMPING)
        elif ratio < BAD_MODEL:
            state[DAMPED] = min(MORE_DAMPING * state[DAMPED], MOST_DAMPING)
        taken += 1
    if convex:  # its damping and vectors mean little to the measure itself
        state[BEGUN] = 0.0
    for j in range(dof):
        work.starts[i * dof + j] = here.q[j]
    return taken


def copy_point(a: Point, b: Point) -> None:
    """All but the Hessian."""
    for j in range(len(a.q)):
        b.q[j], b.gradient[j] = a.q[j], a.gradient[j]
        for i in range(3):
            b.linear[j, i], b.angular[j, i] = a.linear[j, i], a.angular[j, i]
    for k in range(MEASURED):
        b.measured[k] = a.measured[k]


def fill_step(work: ClosestWork, damping: float) -> None:
    """Fill work.step with the way to the minimum of the quadratic model; joints that would pass a limit end on it."""
    dof, here, step, held = len(work.lower), work.here, work.step, work.held
    for j in range(dof):
        on_lower = here.q[j] <= work.lower[j] and here.gradient[j] > 0.0
        on_upper = here.q[j] >= work.upper[j] and here.gradient[j] < 0.0
        held[j], step[j] = 1.0 if on_lower or on_upper else 0.0, 0.0
    for _ in range(BOUND_PASSES):
        solve_model(work, damping)
        past = False
        for j in range(dof):
            inside = min(max(here.q[j] + step[j], work.lower[j]), work.upper[j])
            if held[j] == 0.0 and inside != here.q[j] + step[j]:
                past, held[j], step[j] = True, 1.0, inside - here.q[j]
        if not past:
            break
    longest = 0.0
    for j in range(dof):
        longest = max(longest, abs(step[j]))
    if longest > LONGEST_STEP:
        for j in range(dof):
            step[j] *= LONGEST_STEP / longest


def solve_model(work: ClosestWork, damping: float) -> None:
    """Fill work.step for the joints that are not held, those that are moving as it says."""
    dof, matrix, factor, step, held = len(work.lower), work.matrix, work.vectors, work.step, work.held
    for i in range(dof):
        for j in range(dof):
            matrix[i * dof + j] = 0.0
        if held[i] > 0.0:
            matrix[i * dof + i] = 1.0
            continue
        step[i] = -work.here.gradient[i]
        for j in range(dof):
            if held[j] > 0.0:
                step[i] -= work.curvature[i * dof + j] * step[j]
            else:
                matrix[i * dof + j] = work.curvature[i * dof + j] + (damping if i == j else 0.0)
    if factorise(matrix, factor, dof, 0.0, 0.0):  # else straight down, for once
        solve_factorised(factor, step, dof)


def fill_curvature(work: ClosestWork, convex: bool) -> None:
    """Fill work.curvature with the Hessian of work.here, its eigenvalues made positive: saddle points repel."""
    dof, hessian, curvature = len(work.lower), work.here.hessian, work.curvature
    for k in range(dof * dof):
        curvature[k] = hessian[k]
    if convex or is_positive(hessian, work.matrix, dof):
        return
    diagonalise(curvature, work.vectors, dof, DIAGONAL)
    for i in range(dof):
        work.step[i] = abs(curvature[i * dof + i])
    for i in range(dof):
        for j in range(dof):
            value = 0.0
            for k in range(dof):
                value += work.vectors[i * dof + k] * work.step[k] * work.vectors[j * dof + k]
            curvature[i * dof + j] = value
