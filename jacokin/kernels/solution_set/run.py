"""The entry point: from a target to the curves of all solutions, and to what of them is within the limits."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.chain import Newton, fill_system, linearise7, make_newton, solve_normal
from jacokin.kernels.limits import TURN
from jacokin.kernels.six_joints.continua import spread_angle
from jacokin.kernels.six_joints.loop import Form
from jacokin.kernels.solution_set.curve import LARGEST_RESIDUAL, RESOLUTION, Walk, make_walk, wrapped
from jacokin.kernels.solution_set.end_wrist import begin_end_wrist, find_wrist_folds
from jacokin.kernels.solution_set.islands import (
    LINES,
    LOOKED_AT,
    OFFSET,
    Islands,
    add_zero_on_line,
    count_on_lines,
    count_passes,
    find_islands,
    find_vanishing,
    joint_of_root,
    look_beside_folds,
    make_islands,
)
from jacokin.kernels.solution_set.meeting import Directions, make_directions, points_aside
from jacokin.kernels.solution_set.near_seed import (
    BEYOND,
    NearSeed,
    Parts,
    add_chords,
    follow_arcs,
    make_near_seed,
    offer_row,
    offer_settled,
    solve_rows,
)
from jacokin.kernels.solution_set.same_axis import add_turns, turns_beside
from jacokin.kernels.solution_set.seven_joints import LAST_STEPS, MOST_ROWS, ROUNDING, find_folds, solve_at_q3
from jacokin.kernels.solution_set.slices import (
    AFTER,
    BEFORE,
    JOINT_3,
    NO_SLICES,
    SevenJoints,
    SixJoints,
    Slices,
    add_slice,
    add_start,
    arm_of_equation,
    fill_general,
    make_seven_joints,
    make_six_joints,
    make_slices,
)
from jacokin.kernels.solution_set.starts import bring_to_curve, descend, fill_steps
from jacokin.kernels.solution_set.trace import (
    LOOPS,
    NODES,
    SPARE_LOOPS,
    SPARE_NODES,
    Loops,
    count_all_passed,
    is_full,
    is_near,
    is_traced,
    make_loops,
    trace,
)
from jacokin.kernels.solution_set.within import Pieces, cut, make_pieces

#: Values of the parameter that are solved at in any case, apart by a share of a turn that no structure has, and rounds
#: of those next to the folds that are known.
FIRST, ROUNDS = 3, 5
#: [rad] the widest window that saves anything.
WIDEST = 2.8
#: Least pivot of the Jacobian times its transpose of a point that is on one curve only.
CROSSING = 1e-10
#: What may change of the equations of folds, relative to the slack of a structure [1/rad].
SLACK_OF_FOLDS = 0.1
#: [rad] between folds nearer to each other than this there is no slice: so far off folds may be, for what an arm misses
#: its structure by.
NARROW = 1e-3
#: Configurations that are brought to curves where not all solutions are known; and how far one must be from all others
#: to be on another curve [rad].
BROUGHT, APART = 64, 0.05
#: Rounds of curves that were met on the way along others.
MEETINGS = 2
#: Where the options are: kind of `slices`, joints, and 1 to look for curves, too, of which no root of F tells, else 0.
SetOption = IntEnum("SetOption", "KIND JOINTS SURE", start=0)


class SetWork(NamedTuple):
    """What a call reads and writes."""

    options: NDArray[np.int64]  # (3,)
    starts: Array  # (n, 7) points near curves that are followed too, NaN for none [rad]
    six: SixJoints
    seven: SevenJoints
    near: NearSeed
    islands: Islands
    slices: Slices
    loops: Loops
    pieces: Pieces
    null: Directions
    walk: Walk
    newton: Newton


def make_set_work() -> SetWork:
    """Fresh arrays."""
    return SetWork(
        np.zeros(3, np.int64),
        np.empty((0, 7)),
        make_six_joints(),
        make_seven_joints(),
        make_near_seed(),
        make_islands(),
        make_slices(),
        make_loops(),
        make_pieces(),
        make_directions(),
        make_walk(),
        make_newton(),
    )


def solve_set(work: SetWork) -> int:
    """Fill loops with all curves and pieces with what of them is within the limits; with a seed, with some at least.

    What is near a seed may be looked at alone; the whole set is where that has no pieces, or there is no room for it.
    An arm that nearly has a structure is looked at near the seed only: there may be no pieces.

    Returns:
        How many things went wrong, so that parts may be missing; 0 for none.
    """
    wrong, whole = find_curves(work, math.isnan(work.near.seed[0]))
    none = work.pieces.size[1] == 0 or is_full(work.loops)
    if none and not whole and work.near.slack[0] == 0.0:
        wrong, _ = find_curves(work, True)
    return wrong


def find_curves(work: SetWork, whole: bool) -> tuple[int, bool]:
    """Fill loops and pieces with the whole set, or with curves on which the solution nearest to the seed may be.

    Returns:
        How many things went wrong, or were not looked at, so that parts may be missing; 0 for none. And whether the
        whole set was looked for: a window all round is that, too.
    """
    kind, slices, loops = int(work.options[SetOption.KIND]), work.slices, work.loops
    slices.size[0] = 0
    for n in range(4):
        loops.size[n] = 0
    loops.window[0], loops.window[1] = 0.0, math.inf
    loops.room[0], loops.room[1] = NODES - SPARE_NODES, LOOPS - SPARE_LOOPS
    doubts, by_roots = 0, False
    on_one_axis = kind in (AFTER, BEFORE) and turns_beside(work.six, work.walk)
    if kind != NO_SLICES and (whole or on_one_axis or not add_near_seed(work)):
        if work.near.slack[0] > 0.0:
            work.pieces.size[1] = 0
            return 1, False
        if on_one_axis:
            doubts += add_turns(kind, work.pieces.limits, slices, loops, work.six, work.seven, work.walk)
            whole = True
        elif kind == JOINT_3:
            doubts += slice_between_folds(work)
            trace(slices, loops, work.walk)
            whole = True
        else:
            whole = whole or not fit_window(work)
            doubts += slice_by_roots(work)
            by_roots = True
    for n in range(work.starts.shape[0]):
        if bring_to_curve(work.starts[n], work.newton, work.walk):
            doubts += not add_start(slices, work.walk.z)
    trace(slices, loops, work.walk)
    doubts += follow_meetings(work)
    if by_roots and whole:
        doubts += doubts_where_F_vanishes(work) if work.options[SetOption.SURE] == 1 else 1
    for i in range(slices.size[0]):
        for k in range(slices.counts[i]):
            doubts += slices.passed[i, k] != 1 and not math.isnan(slices.p[i])
    if whole and doubts + loops.size[3] > 0:
        follow_seed(work)
    cut(loops, work.pieces, work.walk)
    wrong = doubts + loops.size[3] + work.pieces.size[3]
    if wrong > 0 and work.near.slack[0] > 0.0:
        work.pieces.size[1] = 0
    return int(wrong), whole


def fit_window(work: SetWork) -> bool:
    """Follow curves only where solutions may be as near to the seed as what it leads to, or those at its parameter.

    Returns:
        Whether that is not all round, and those are the first slices; else there are none.
    """
    kind, joints = int(work.options[SetOption.KIND]), int(work.options[SetOption.JOINTS])
    window, near, slices, walk = work.loops.window, work.near, work.slices, work.walk
    cosine = start_from_seed(work)
    add_slice(walk, kind, window[0], slices, work.six, work.seven)
    for i in range(slices.size[0]):
        for k in range(slices.counts[i]):
            offer_row(slices.x[i, k], joints, near)
    window[1] = half_width(near.best[0] + BEYOND, joints, cosine)
    if window[1] == math.inf:
        window[0], slices.size[0] = 0.0, 0
    return bool(window[1] < math.inf)


def follow_seed(work: SetWork) -> None:
    """Follow the curve that the seed leads to, if it does and that is not known, after all those of the whole set.

    Last, as it depends on those before which others are followed, where curves meet or there is no room for all.
    """
    loops, slices, first = work.loops, work.slices, work.slices.size[0]
    if math.isnan(work.near.seed[work.walk.parameter[0]]):
        return
    start_from_seed(work)
    loops.window[0], loops.room[0], loops.room[1] = 0.0, NODES, LOOPS
    if slices.size[0] > first:
        trace(slices, loops, work.walk)


def start_from_seed(work: SetWork) -> float:
    """Put the middle of the window at the seed, and add the solution that it leads to as a start, if it does.

    Returns:
        What `half_width` is told of a free axis.
    """
    walk, near = work.walk, work.near
    work.loops.window[0], near.best[0] = near.seed[walk.parameter[0]], math.inf
    for j in range(7):
        walk.z[j] = near.seed[j]
    _, _, cosine = fill_system(7, walk.chain, walk.T, walk.z, walk.system)
    if descend(work.newton, walk) <= LARGEST_RESIDUAL:
        add_start(work.slices, walk.z)
    return cosine


def half_width(distance: float, joints: int, cosine: float) -> float:
    """How far from the seed's the parameter of a solution at a distance from it may be [rad]; inf for all round.

    A free axis is none of the joints: those turn the tool by no more than the sum of what they move, and its angle that
    is nearest to the seed's tool leaves one out, of which the cosine is given.
    """
    width = distance
    if joints == 6:
        turned = math.sqrt(6.0) * distance
        if turned >= math.pi:
            return math.inf
        width = 2.0 * math.acos(min(math.cos(0.5 * turned) / math.sqrt(0.5 * (1.0 + cosine)), 1.0))
    return width if width <= WIDEST else math.inf


def is_in_window(window: Array, p: float) -> bool:
    """Whether a value of the parameter is in the window, or just outside."""
    return bool(abs(wrapped(p - window[0])) <= window[1])


def add_near_seed(work: SetWork) -> bool:
    """Enter chords near to the seed as curves, where folds are known beforehand; False, and none, where they are not.

    The solution that the seed leads to is a start where none that was looked at is nearer. Where an arm is not as near
    to its structure as expected, whole curves are followed instead, from what the structure's configurations lead to;
    not where the seed leads to none, beside what is singular in several ways.
    """
    kind, joints = int(work.options[SetOption.KIND]), int(work.options[SetOption.JOINTS])
    loops, near, slices, seven, roots = work.loops, work.near, work.slices, work.seven, work.islands.roots
    if kind == JOINT_3:
        T = work.walk.T
        count, single = find_folds(work.walk.chain, seven.arm, T, LAST_STEPS, seven.waves, roots, seven.folds)
    elif begin_end_wrist(work.six):
        rounding = ROUNDING + SLACK_OF_FOLDS * near.slack[0]
        count, single = find_wrist_folds(work.six, rounding, seven.waves, roots, seven.folds)
    else:
        return False
    if not single and (near.slack[0] == 0.0 or count == seven.folds.shape[0]):
        return False
    parts = Parts(kind, joints, work.six, seven, work.walk, work.newton)
    cosine = start_from_seed(work)
    if slices.size[0] > 0:
        offer_row(slices.x[0, 0], joints, near)
    led = near.best[0]
    solve_rows(parts, loops.window[0], 0, MOST_ROWS, seven.rows)
    known = True
    for row in range(MOST_ROWS):
        known = known and offer_settled(seven.rows[row], parts, near)
    loops.window[1] = half_width(near.best[0] + near.slack[0] + BEYOND, joints, cosine)
    found = single and known and add_chords(work.pieces.limits, parts, count, near, loops)
    if not found and near.slack[0] > 0.0:
        loops.size[0], loops.size[1] = 0, 0
        return slices.size[0] > 0 and follow_arcs(parts, count, near, loops, slices)
    if not (found and near.best[0] == led < math.inf):
        slices.size[0] = 0
    if not found:
        loops.size[0], loops.size[1], loops.window[1] = 0, 0, math.inf
    return found


def slice_between_folds(work: SetWork) -> int:
    """One slice between each two values of joint 3 at which configurations meet; how many doubts there are.

    Where folds all but meet, those of the arm itself may be elsewhere. Rows that go on beyond them are on curves that
    other slices have.
    """
    slices, seven, roots = work.slices, work.seven, work.islands.roots
    folds = seven.folds
    count, single = find_folds(work.walk.chain, seven.arm, work.walk.T, 0, seven.waves, roots, folds)
    doubts = int(not single)
    for n in range(max(count, 1)):
        low = folds[n] if count > 0 else OFFSET
        high = folds[n + 1] if n + 1 < count else (folds[0] if count > 0 else OFFSET) + TURN
        middle = 0.5 * (low + high)
        if high - low <= NARROW:
            alone = rows_at(work, middle) & ~(rows_at(work, low - NARROW) | rows_at(work, high + NARROW))
            if alone == 0 or high - low <= RESOLUTION:
                continue
        doubts += not add_slice(work.walk, JOINT_3, middle, slices, work.six, seven)
    return doubts


def rows_at(work: SetWork, q3: float) -> int:
    """Which rows of seven joints built like a Jaco's there are at a joint 3, a bit for each."""
    seven, found = work.seven, 0
    solve_at_q3(work.walk.chain, seven.arm, work.walk.T, q3, seven.rows)
    for row in range(MOST_ROWS):
        if not math.isnan(seven.rows[row, 0]):
            found |= 1 << row
    return found


def slice_by_roots(work: SetWork) -> int:
    """Some slices, and more wherever F has other numbers of roots than the curves pass; how many doubts there are."""
    kind, slices, loops, islands, doubts = int(work.options[SetOption.KIND]), work.slices, work.loops, work.islands, 0
    fill_general(work.six)
    find_islands(work.six, loops.window, islands)
    for n in range(FIRST if slices.size[0] == 0 else 0):
        add_slice(work.walk, kind, islands.p[n * islands.size[2] // FIRST], slices, work.six, work.seven)
    joint, beside = joint_of_root(work.six, islands, kind), 0
    for _ in range(ROUNDS):
        doubts += trace_missing(work)
        look_along_lines(work, joint)
        doubts += trace_missing(work)
        found = islands.size[0]
        look_beside_folds(work.six, loops, work.walk.parameter[0], beside, islands)
        beside = loops.size[1]
        if islands.size[0] == found:
            break
    else:
        doubts += trace_missing(work)
    for i in range(islands.size[2] + islands.size[0]):
        if not is_in_window(loops.window, islands.p[i]):
            continue
        n = find_slice(slices, islands.p[i])
        doubts += not is_counted(islands, i) and (n < 0 or slices.doubt[n] > 0)
    return doubts + int(islands.size[1]) + count_crossings(work)


def doubts_where_F_vanishes(work: SetWork) -> int:
    """At how many values of the parameter there may be curves along which it hardly moves that are not known.

    There is none where F vanishes and all solutions are known, and on curves that are. Else, as F may vanish for what
    it is made of alone, or not quite, configurations are brought to curves, and all come to those that are known. So
    they are of an arm of any structure: it may miss by less than noise what makes F vanish.
    """
    kind, slices, islands, doubts = int(work.options[SetOption.KIND]), work.slices, work.islands, 0
    find_vanishing(work.six, islands)
    has_a_form = arm_of_equation(work.six).six.form != Form.GENERAL
    for i in range(LOOKED_AT):
        p, n = islands.vanishing[i, 0], slices.size[0]
        if math.isnan(p):
            continue
        if not add_slice(work.walk, kind, p, slices, work.six, work.seven):
            doubts += 1
            continue
        slices.size[0] = n
        is_sure = has_a_form and slices.doubt[n] == 0 and islands.vanishing[i, 1] > 0.0
        known = True
        for k in range(slices.counts[n]):
            known = known and is_traced(work.loops, slices.x[n, k])
        doubts += not known or (not is_sure and find_elsewhere(work, p))
    return doubts


def find_elsewhere(work: SetWork, p: float) -> bool:
    """Follow curves that configurations of some spread over all angles are brought to, apart from those that are known.

    Returns:
        Whether there was one.
    """
    walk, found = work.walk, False
    for n in range(BROUGHT):
        for j in range(7):
            walk.z[j] = p if j == walk.parameter[0] else spread_angle(n, j)
        if descend(work.newton, walk) <= LARGEST_RESIDUAL and not is_near(work.loops, walk.z, APART):
            found = True
            if add_start(work.slices, walk.z):
                trace(work.slices, work.loops, walk)
    return found


def trace_missing(work: SetWork) -> int:
    """Follow the curves that the slices are on, and those of more slices until curves pass as often as F has roots.

    One slice at a time, where most roots are missing: its curves pass most of the other places.

    Returns:
        1 where there was no room for a slice, else 0.
    """
    slices, loops, islands, kind = work.slices, work.loops, work.islands, int(work.options[SetOption.KIND])
    while True:
        trace(slices, loops, work.walk)
        count_passes(loops, work.walk.parameter[0], islands)
        best, most = -1, 0
        for i in range(islands.size[2] + islands.size[0]):
            missing = islands.counts[i] * islands.size[5] - islands.passed[i]
            if is_counted(islands, i) or not is_in_window(loops.window, islands.p[i]):
                continue
            if (best < 0 or missing > most) and find_slice(slices, islands.p[i]) < 0:
                best, most = i, missing
        if best < 0:
            return 0
        if not add_slice(work.walk, kind, islands.p[best], slices, work.six, work.seven):
            return 1
        count_all_passed(slices.size[0] - 1, 0, slices, loops, work.walk)


def look_along_lines(work: SetWork, joint: int) -> None:
    """Add values of the parameter at which F has a root that no curve passes: where it changes its sign along lines.

    A curve may go round in x while the parameter hardly changes.
    """
    islands, each = work.islands, work.islands.size[5]
    count_on_lines(work.loops, work.walk.parameter[0], joint, islands)
    for n in range(LINES):
        for i in range(LOOKED_AT):
            here, there = islands.lines[i, n], islands.lines[(i + 1) % LOOKED_AT, n]
            inside = is_in_window(work.loops.window, islands.p[i]) or is_in_window(
                work.loops.window, islands.p[(i + 1) % LOOKED_AT]
            )
            if inside and here * there < 0.0 and islands.crossed[i, n] // each % 2 == 0:
                add_zero_on_line(work.six, islands, i, n)


def count_crossings(work: SetWork) -> int:
    """How many folds are where another curve passes: the Jacobian has one null direction more there."""
    loops, newton, count = work.loops, work.newton, 0
    for n in range(loops.size[0]):
        if loops.fold[n] > 0:
            linearise7(work.walk.chain, work.walk.T, loops.nodes[n, :7], work.walk.system)
            fill_steps(work.walk.system, 0.0, newton.normal)
            least = 0.0
            if solve_normal(newton.normal):
                least = math.inf
                for i in range(6):
                    least = min(least, newton.normal[i, i])
            count += least < CROSSING
    return count


def find_slice(slices: Slices, p: float) -> int:
    """The slice at a value, -1 for none."""
    for i in range(slices.size[0]):
        if slices.p[i] == p:
            return i
    return -1


def is_counted(islands: Islands, i: int) -> bool:
    """Whether as many curves as F has roots, times the solutions of each, pass a value at which F was looked at."""
    return bool(islands.counts[i] >= 0 and islands.passed[i] == islands.counts[i] * islands.size[5])


def follow_meetings(work: SetWork) -> int:
    """Follow the curves that cross those there are, where a walk has passed a meeting; how many may be missing."""
    loops, first, doubts = work.loops, 0, 0
    for _ in range(MEETINGS):
        last = loops.size[2]
        for n in range(first, last):
            for side in range(2):
                x = work.walk.z
                if points_aside(loops.meetings[n], 2.0 * side - 1.0, work.null, x, work.walk):
                    doubts += not add_start(work.slices, x)
                else:
                    doubts += 1
        first = last
        trace(work.slices, loops, work.walk)
    return int(doubts + (loops.size[2] > first))
