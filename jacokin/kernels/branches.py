"""The branches of one target: candidates polished and verified on the model, duplicates dropped, order."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.chain import (
    Newton,
    between,
    columns_of,
    errors,
    linearise,
    make_newton,
    newton_step,
    normal_equations,
    solve_normal,
    triangulate,
)
from jacokin.kernels.closed_form.folds import FoldFound, FoldWork, is_known_fold, make_folds, solve_fold
from jacokin.kernels.configurations.arm import turn_sines
from jacokin.kernels.limits import TURN, fit_to_limits, hold_on_limits, nearest_copy, same_configuration
from jacokin.kernels.tolerances import (
    ALONE_PIVOT,
    ALONE_WAY,
    APART,
    CLOSURE,
    FIRST_SEED_WEIGHT,
    FOLD_FACTOR,
    LEAST_SEED_WEIGHT,
    MAX_POLISH_ERROR,
    NEARLY_AS_NEAR,
    POLISHED_CLOSURE,
    SAME_AS_SEED,
    SAME_BRANCH,
    SEED_STEP,
    SEED_WEIGHT_FACTOR,
    TANGENCY_CLOSURE,
    TANGENCY_EXCESS,
)
from jacokin.kernels.trigonometry import TO_WHOLE, angle_of
from jacokin.kernels.vector import norm

#: Columns of a branch: 0:6 q, 6:12 limit margins, then these; FAMILY is 0 for one on its own, see `continua`.
POSITION_ERROR, ORIENTATION_ERROR, DISTANCE, WITHIN_LIMITS, FAMILY, COLUMNS = 12, 13, 14, 15, 16, 17
#: Candidates that are verified side by side: few poses have more branches.
ABREAST = 8
#: Rows of `Lanes` behind these: 0:6 q as it was found, 6:18 the frame there, and angle, sine and cosine of one joint.
FOUND, FRAME, ANGLE, SINE, COSINE, LANE_ROWS = 17, 23, 35, 36, 37, 38
#: 16 is the most a 6R arm can have; families add members, and a fold may be cut in two by rounding.
MAX_BRANCHES = 24
POLISH_STEPS = 16
TURNS_PER_RADIAN = 1.0 / TURN
#: Gauss-Newton steps from a seed with each weight, at most.
SEED_STEPS = 3


class PoseQuery(NamedTuple):
    """One target for one arm."""

    chain: Array  # (7, 3, 4)
    limits: Array  # (3, 6)
    T: Array  # (4, 4)
    seed: Array  # (6,)


class Lanes(NamedTuple):
    """Candidates that are verified side by side: in one array, because compilers know that its rows do not overlap."""

    rows: Array  # (38, ABREAST) the columns of the branches that they are if none needs polishing; then as named above
    mark: NDArray[np.int64]  # (ABREAST,) what they are to who collects them
    filled: NDArray[np.int64]  # (1,) how many there are


class BranchWork(NamedTuple):
    """A candidate, what it takes to verify it, and the branches found so far."""

    wanted: NDArray[np.int64]  # (1,) 1 where nothing but the nearest branch within the limits is wanted
    lanes: Lanes
    newton: Newton  # with q, the candidate
    fold: FoldWork
    row: Array  # (17,) the branch at hand
    rows: Array  # (24, 17)
    filled: NDArray[np.int64]  # (2,) how many rows, and 1 where some may be missing: a full table, or doubt


def make_branches(rows: Array) -> BranchWork:
    """Fresh work arrays, writing the branches to rows."""
    return BranchWork(
        np.zeros(1, np.int64),
        make_lanes(),
        make_newton(),
        make_folds(),
        np.empty(COLUMNS),
        rows,
        np.zeros(2, np.int64),
    )


def make_lanes() -> Lanes:
    """Fresh work arrays."""
    return Lanes(np.zeros((LANE_ROWS, ABREAST)), np.zeros(ABREAST, np.int64), np.zeros(1, np.int64))


def add_fold(query: PoseQuery, work: BranchWork) -> bool:
    """Append both branches of the fold near work.newton.q; False if there is none."""
    q, fold = work.newton.q, work.fold
    if is_known_fold(fold, q):
        return True
    result = solve_fold(query.chain, query.T, work.newton, fold)
    if result != FoldFound.NEW:
        return result == FoldFound.KNOWN
    found = False
    for i in range(2):
        for j in range(6):
            q[j] = fold.branches[i, j]
        found = add_branch(query, work, 0.0) or found
    return found


def add_branch(query: PoseQuery, work: BranchWork, family: float) -> bool:
    """Polish work.newton.q, check it on the model, and append it unless it is there; False if it misses the target."""
    work.row[FAMILY] = family
    fill_row(query, work)
    return add_row(query, work)


def fill_row(query: PoseQuery, work: BranchWork) -> None:
    """Fill in the row at hand for work.newton.q: angles near the seed, within the limits if possible, and errors."""
    row = work.row
    row[DISTANCE], within = fit_to_limits(work.newton.q, query.seed, query.limits, row)
    row[WITHIN_LIMITS] = 1.0 if within else 0.0
    row[POSITION_ERROR], row[ORIENTATION_ERROR] = errors(query.chain, query.T, row)


def add_row(query: PoseQuery, work: BranchWork) -> bool:
    """Append the row at hand, of work.newton.q, polished if need be; False if it misses the target."""
    row = work.row
    # Members of a family stay at the seed's angle: Newton would slide them along.
    if closure_of(row) > (CLOSURE if row[FAMILY] > 0.0 else POLISHED_CLOSURE):
        if not polish(query, work):
            return False
        fill_row(query, work)
    settled = row[WITHIN_LIMITS] > 0.0 and closure_of(row) <= TANGENCY_CLOSURE
    if not settled and hold_on_limits(query.chain, query.T, query.limits, row, work.newton):
        fill_row(query, work)
    insert(work)
    return True


def collect(work: BranchWork, n: int, mark: int, family: float) -> None:
    """Note that the angles in lane n, from row FOUND on, are the next candidate to be verified."""
    lanes = work.lanes
    lanes.mark[n], lanes.rows[FAMILY, n] = mark, family
    lanes.filled[0] = n + 1


def verify(query: PoseQuery, work: BranchWork) -> int:
    """Fill in the rows of all candidates that were collected, as `fill_row`; returns how many, and begins anew."""
    lanes, rows = work.lanes, work.lanes.rows
    fit_lanes(query, rows)
    count = lanes.filled[0]
    for i in range(count):
        fit_lane(query, work, i)
    for row in range(3):
        for column in range(4):
            begin = query.chain[0, row, column]
            for i in range(ABREAST):
                rows[FRAME + 3 * column + row, i] = begin
    for j in range(6):
        turn_lanes(j, rows)
        place_lanes(query.chain, j + 1, rows)
    measure_lanes(query.T, rows)
    lanes.filled[0] = 0
    return int(count)


def take_nearest(query: PoseQuery, work: BranchWork) -> bool:
    """Add, of the candidates that were collected, the nearest to the seed within the limits, and no other.

    All of them must be branches, of which only this one is verified.

    Returns:
        True; the collection begins anew. Or False, and nothing was done: there is none, or others are nearly as near,
        so that verification, which moves them a little, would tell.
    """
    lanes, rows, row = work.lanes, work.lanes.rows, work.row
    fit_lanes(query, rows)
    chosen, nearest, next_nearest = -1, math.inf, math.inf
    for i in range(lanes.filled[0]):
        least = math.sqrt(rows[DISTANCE, i])  # of any copies
        if least >= next_nearest:
            continue
        fit_lane(query, work, i)
        if rows[WITHIN_LIMITS, i] == 0.0:
            if may_touch_limits(rows, i):
                next_nearest = least
        elif rows[DISTANCE, i] < nearest:
            chosen, nearest, next_nearest = i, rows[DISTANCE, i], min(nearest, next_nearest)
        else:
            next_nearest = min(next_nearest, rows[DISTANCE, i])
    if chosen < 0 or next_nearest < nearest + NEARLY_AS_NEAR:
        return False
    take_candidate(work, chosen)
    for column in range(COLUMNS):
        row[column] = rows[column, chosen]
    row[POSITION_ERROR], row[ORIENTATION_ERROR] = errors(query.chain, query.T, row)
    if add_row(query, work) and row[WITHIN_LIMITS] > 0.0 and row[DISTANCE] < next_nearest:
        lanes.filled[0] = 0
        return True
    work.filled[0] = 0
    return False


def may_touch_limits(rows: Array, i: int) -> bool:
    """Whether `hold_on_limits` may bring the candidate in lane i within its limits."""
    for j in range(6, 12):  # noqa: SIM110  # numba compiles no generator expressions
        if rows[j, i] < -TANGENCY_EXCESS:
            return False
    return True


def fit_lane(query: PoseQuery, work: BranchWork, i: int) -> None:
    """Take copies within the limits for the candidate in lane i, where those nearest to the seed are not."""
    rows = work.lanes.rows
    if rows[WITHIN_LIMITS, i] > 0.0:
        rows[DISTANCE, i] = math.sqrt(rows[DISTANCE, i])
        return
    take_candidate(work, i)
    rows[DISTANCE, i], within = fit_to_limits(work.newton.q, query.seed, query.limits, work.row)
    rows[WITHIN_LIMITS, i] = 1.0 if within else 0.0
    for column in range(12):
        rows[column, i] = work.row[column]


def fit_lanes(query: PoseQuery, rows: Array) -> None:
    """Fill in copies nearest to the seed, their margins, the square of the distance, and whether they are within."""
    for j in range(6):
        fit_joint(query.seed[j], query.limits[0, j], query.limits[1, j], j, rows)


def fit_joint(seed: float, lower: float, upper: float, j: int, rows: Array) -> None:
    """Fill in the copies of an angle nearest to the seed, their margins, and what they are to the distance."""
    for i in range(ABREAST):
        angle = nearest_copy(rows[FOUND + j, i], seed)
        margin = min(angle - lower, upper - angle)
        square, within = (angle - seed) * (angle - seed), 1.0 if margin >= 0.0 else 0.0
        rows[j, i], rows[6 + j, i] = angle, margin
        rows[DISTANCE, i] = rows[DISTANCE, i] + square if j > 0 else square
        rows[WITHIN_LIMITS, i] = rows[WITHIN_LIMITS, i] * within if j > 0 else within


def place_lanes(chain: Array, j: int, rows: Array) -> None:
    """Follow the frames by placement j."""
    a, b, c, d = chain[j, 0, 0], chain[j, 0, 1], chain[j, 0, 2], chain[j, 0, 3]
    e, f, g, h = chain[j, 1, 0], chain[j, 1, 1], chain[j, 1, 2], chain[j, 1, 3]
    m, n, o, p = chain[j, 2, 0], chain[j, 2, 1], chain[j, 2, 2], chain[j, 2, 3]
    for row in range(FRAME, FRAME + 3):
        for i in range(ABREAST):
            x, y, z = rows[row, i], rows[row + 3, i], rows[row + 6, i]
            rows[row, i] = x * a + y * e + z * m
            rows[row + 3, i] = x * b + y * f + z * n
            rows[row + 6, i] = x * c + y * g + z * o
            rows[row + 9, i] = rows[row + 9, i] + (x * d + y * h + z * p)


def turn_lanes(j: int, rows: Array) -> None:
    """Turn the frames about their z axes by the angles of joint j."""
    for i in range(ABREAST):
        rows[ANGLE, i] = rows[j, i]
    turn_sines(rows[ANGLE:LANE_ROWS])
    for row in range(FRAME, FRAME + 3):
        for i in range(ABREAST):
            x, y, s, c = rows[row, i], rows[row + 3, i], rows[SINE, i], rows[COSINE, i]
            rows[row, i], rows[row + 3, i] = x * c + y * s, y * c - x * s


def measure_lanes(T: Array, rows: Array) -> None:
    """Fill in the errors of the frames against the target."""
    tx, ty, tz, tp = columns_of(T)
    for i in range(ABREAST):
        x = (rows[FRAME, i], rows[FRAME + 1, i], rows[FRAME + 2, i])
        y = (rows[FRAME + 3, i], rows[FRAME + 4, i], rows[FRAME + 5, i])
        z = (rows[FRAME + 6, i], rows[FRAME + 7, i], rows[FRAME + 8, i])
        p = (rows[FRAME + 9, i], rows[FRAME + 10, i], rows[FRAME + 11, i])
        d, turned, cosine = between(tx, ty, tz, tp, x, y, z, p)
        rows[POSITION_ERROR, i] = norm(d)
        rows[ORIENTATION_ERROR, i] = angle_of(norm(turned), cosine)


def take_candidate(work: BranchWork, i: int) -> None:
    """Let work.newton.q be the candidate in lane i."""
    for j in range(6):
        work.newton.q[j] = work.lanes.rows[FOUND + j, i]


def add_verified(query: PoseQuery, work: BranchWork, i: int) -> bool:
    """Append the branch of the candidate in lane i, as `add_branch`."""
    take_candidate(work, i)
    for column in range(COLUMNS):
        work.row[column] = work.lanes.rows[column, i]
    return add_row(query, work)


def add_beside_seed(query: PoseQuery, miss: float, work: BranchWork) -> None:
    """Add the branch beside a seed that nearly is one, by a miss [m or rad], where no known branch is as near.

    Next to configurations that are singular in several ways, many far apart close the target to rounding. What makes
    the square of the deviation and a weight times that of the way from the seed least is no farther from the seed than
    any of them, and the smaller the weight, the nearer it is to the target.
    """
    nearest, nearest_at_all = math.inf, math.inf
    for i in range(work.filled[0]):
        nearest_at_all = min(nearest_at_all, work.rows[i, DISTANCE])
        if work.rows[i, WITHIN_LIMITS] > 0.0:
            nearest = min(nearest, work.rows[i, DISTANCE])
    if nearest <= SAME_AS_SEED:
        return
    newton, row, weight = work.newton, work.row, FIRST_SEED_WEIGHT
    for j in range(6):
        newton.q[j], newton.held[j] = query.seed[j], 0.0
    if miss > POLISHED_CLOSURE and is_alone(query, newton, weight, nearest_at_all):
        return
    while miss > POLISHED_CLOSURE and weight >= LEAST_SEED_WEIGHT:
        for j in range(6):
            newton.held[j] = 0.0
        for _ in range(SEED_STEPS):
            if step_from_seed(query, newton, weight) < SEED_STEP:
                break
        if nearest <= way_from_seed(query.seed, newton.q) + SAME_AS_SEED:
            return
        position, orientation = errors(query.chain, query.T, newton.q)
        miss = max(position, orientation)
        weight *= SEED_WEIGHT_FACTOR
    for joint in range(6):  # two joints that came to their limits may hide that one of them can leave its own
        if miss > CLOSURE and newton.held[joint] > 0.0:
            newton.held[joint] = 0.0
            for _ in range(SEED_STEPS):
                if step_from_seed(query, newton, LEAST_SEED_WEIGHT) < SEED_STEP:
                    break
            position, orientation = errors(query.chain, query.T, newton.q)
            miss = max(position, orientation)
    if miss > CLOSURE and not polish(query, work):
        return
    row[DISTANCE], within = fit_to_limits(newton.q, query.seed, query.limits, row)
    row[POSITION_ERROR], row[ORIENTATION_ERROR] = errors(query.chain, query.T, row)
    row[WITHIN_LIMITS] = 1.0 if within else 0.0
    row[FAMILY] = 0.0
    if within and row[DISTANCE] < nearest:
        put_first(query, work)


def is_alone(query: PoseQuery, newton: Newton, weight: float, nearest: float) -> bool:
    """Take the first step from the seed; whether the nearest known branch is where it leads, and others are not near.

    Where the smallest singular value is large beside the way, the next branch is farther than that.
    """
    if math.isinf(step_from_seed(query, newton, weight)):
        return True
    way = way_from_seed(query.seed, newton.q)
    pivot = math.inf
    for j in range(6):
        pivot = min(pivot, newton.normal[j, j])
    return nearest <= ALONE_WAY * way + SAME_AS_SEED and pivot >= ALONE_PIVOT * (weight + way * way)


def step_from_seed(query: PoseQuery, newton: Newton, weight: float) -> float:
    """A Gauss-Newton step of newton.q for the deviation and a weight on the way from the seed, within the limits.

    Returns:
        The length of the step [rad]; inf where there is none.
    """
    q, normal = newton.q, newton.normal
    linearise(query.chain, query.T, q, newton.system)
    normal_equations(newton.system, newton.held, normal)
    for j in range(6):
        if newton.held[j] == 0.0:
            normal[j, j] += weight
            normal[j, 6] += weight * (query.seed[j] - q[j])
    if not solve_normal(normal):
        return math.inf
    square = 0.0
    for j in range(6):
        angle = min(max(q[j] + normal[j, 6], query.limits[0, j]), query.limits[1, j])
        if angle != q[j] + normal[j, 6]:
            newton.held[j] = 1.0
        square += (angle - q[j]) ** 2
        q[j] = angle
    return math.sqrt(square)


def way_from_seed(seed: Array, q: Array) -> float:
    """The distance of angles from a seed [rad]."""
    square = 0.0
    for j in range(6):
        square += (q[j] - seed[j]) ** 2
    return math.sqrt(square)


def put_first(query: PoseQuery, work: BranchWork) -> None:
    """Append the row at hand, the nearest to the seed, in place of those that are the same.

    A full table has members of a continuum, more than there can be branches: then of the most singular one.
    """
    row, rows = work.row, work.rows
    i = 0
    while i < work.filled[0]:
        if is_same(rows[i], row):
            work.filled[0] -= 1
            copy_row(rows[work.filled[0]], rows[i])
        else:
            i += 1
    count = work.filled[0]
    note_full(work, count, MAX_BRANCHES)
    copy_row(row, rows[count if count < MAX_BRANCHES else most_singular(query, work)])
    work.filled[0] = min(count + 1, MAX_BRANCHES)


def most_singular(query: PoseQuery, work: BranchWork) -> int:
    """The row whose Jacobian has the smallest determinant."""
    newton, least, found = work.newton, math.inf, 0
    for i in range(work.filled[0]):
        for j in range(6):
            newton.q[j] = work.rows[i, j]
        size = abs(jacobian_determinant(query.chain, query.T, newton))
        if size < least:
            least, found = size, i
    return found


def jacobian_determinant(chain: Array, T: Array, newton: Newton) -> float:
    """The determinant of the Jacobian at newton.q [m^3]."""
    linearise(chain, T, newton.q, newton.system)
    return triangulate(newton.system, 6, 6, 1.0)


def polish(query: PoseQuery, work: BranchWork) -> bool:
    """Newton on all six joints of work.newton.q, while it helps; whether it then closes the pose."""
    q, row = work.newton.q, work.row
    position, orientation = errors(query.chain, query.T, q)
    worst = max(position, orientation)
    for _ in range(POLISH_STEPS):
        if not POLISHED_CLOSURE < worst < MAX_POLISH_ERROR:
            break
        for j in range(6):
            row[j] = q[j]
        position, orientation = MAX_POLISH_ERROR, MAX_POLISH_ERROR
        if newton_step(query.chain, query.T, work.newton):
            position, orientation = errors(query.chain, query.T, q)
        if max(position, orientation) >= worst:
            for j in range(6):
                q[j] = row[j]
            break
        worst = max(position, orientation)
    return worst <= CLOSURE


def insert(work: BranchWork) -> None:
    """Append the row at hand; of those that are the same on the circle one stays: within limits, then the closer."""
    row, rows = work.row, work.rows
    i = 0
    while i < work.filled[0]:
        if is_same(rows[i], row):
            better = row[WITHIN_LIMITS] > rows[i, WITHIN_LIMITS]
            if not better and (row[WITHIN_LIMITS] < rows[i, WITHIN_LIMITS] or closure_of(row) >= closure_of(rows[i])):
                return
            work.filled[0] -= 1
            copy_row(rows[work.filled[0]], rows[i])
        else:
            i += 1
    count = work.filled[0]
    note_full(work, count, MAX_BRANCHES)
    if count < MAX_BRANCHES:
        copy_row(row, rows[count])
        work.filled[0] = count + 1


def is_same(a: Array, b: Array) -> bool:
    """Whether two branches are one on the circle: as near to each other as folds with their closures would be."""
    for j in range(6):
        if is_apart(a[j] - b[j]):
            return False
    return same_configuration(a, b, SAME_BRANCH + FOLD_FACTOR * math.sqrt(max(closure_of(a), closure_of(b))))


def is_apart(difference: float) -> bool:
    """Whether angles of a joint so far apart [rad] are those of two branches, whatever their closures.

    Nearly all pairs of branches have such a joint, and need neither the root of a closure nor a division.
    """
    turns = difference * TURNS_PER_RADIAN + TO_WHOLE - TO_WHOLE
    return bool(abs(difference - TURN * turns) > APART)


def closure_of(row: Array) -> float:
    """How far a branch is from its target [m or rad]."""
    return float(max(row[POSITION_ERROR], row[ORIENTATION_ERROR]))


def copy_row(source: Array, target: Array) -> None:
    """One by one: compiled, an assignment of arrays brings the code of its error message, which allocates memory."""
    for column in range(COLUMNS):
        target[column] = source[column]


def note_full(work: BranchWork, count: int, size: int) -> None:
    """Note when a table is full: an entry may have been dropped."""
    if count >= size:
        work.filled[1] = 1


def sort_rows(work: BranchWork) -> None:
    """Order the branches by distance to the seed, by insertion."""
    row, rows = work.row, work.rows
    for i in range(1, work.filled[0]):
        j = i
        copy_row(rows[i], row)
        while j > 0 and row[DISTANCE] < rows[j - 1, DISTANCE]:
            copy_row(rows[j - 1], rows[j])
            j -= 1
        if j < i:
            copy_row(row, rows[j])
