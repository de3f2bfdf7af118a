"""Which values of the parameter to solve at, so that no curve is missed: from the characteristic function alone.

At a value p of the parameter all solutions are roots x of one trigonometric polynomial F(x; p) of degree 8: sixteen, of
which the real ones are the solutions and the others pairs x and conj(x). Two solutions that meet and vanish become such
a pair. A closed curve that lies wholly between two values of p is a pair there that comes to the real axis and leaves
it again. How far it is from the axis tells about when: the square of this distance d is smooth in p, also where a pair
is on the axis, so that value, slope and bend of it are followed to where it is zero. Where pairs come from both sides
and might be there in time, or one comes from one side by all three and no more roots are real on the other, the values
between are halved, until they cannot, or until curves are found there. Beside a fold of a curve its own pair is on the
way to the axis, too, and hides what comes there before; so F is looked at right beside each fold once the curves are
known. There the distance of its own pair tells little about where that pair comes to the axis again; it does as seen
from elsewhere, if not where the fold is. So it is where a pair has left the axis just before, or all but come to it.

Where F vanishes at one value of the parameter, whatever x is, a curve may go round at that value, of which no root next
to there tells. The size of F has a minimum there, and the joints are solved for at the very value. Where F all but
vanishes, such a curve may be next to there, and configurations all round are brought to curves.

Two complex solutions may have one angle in common, which is real then: a pair comes to the axis there and leaves it
again, and no curve begins. Near such a place the other angles of the pair tell: solutions become real when all their
angles do, at the same value of p. They follow from the equations, see `pairs`, or where F comes in closed form, from
those it was made of.

Where noise may move a root as far as the axis, or as far as the next root, it is real or not. Of arms whose F comes in
closed form, whole complex solutions tell, which are not near to each other where their roots are, see
`whole_solutions`. Otherwise another labelling of the
joints has the same solutions as real roots of another F: as many as are real for sure in one are solutions, and so are
those that six joints at the pose are found to have; there are no more than may be real in another one. Where the two
numbers are the same, all other roots are apart from the axis; where they are not, the set is in doubt.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.closed_form.arm import ArmConstants, pose_of, unpack_arm
from jacokin.kernels.closed_form.resultant import DEGREE, q5_apart, value_and_slope
from jacokin.kernels.closed_form.roots import RootWork, make_roots
from jacokin.kernels.limits import TURN, nearest_copy
from jacokin.kernels.six_joints.elbow_offset import offset_arm_of, theta_5_apart_of
from jacokin.kernels.six_joints.loop import LABELLINGS, Form, fill_links, joint_of
from jacokin.kernels.six_joints.planar_arm import planar_arm_of, theta_5_apart
from jacokin.kernels.six_joints.spherical_wrist import reach_of
from jacokin.kernels.solution_set.all_roots import (
    Root,
    distance_to_next,
    find_all_roots,
    length_of,
    make_lanes,
    root_of,
    spread_roots,
    tell_roots,
    until_meeting,
)
from jacokin.kernels.solution_set.curve import wrapped
from jacokin.kernels.solution_set.pairs import PairWork, make_pair_work, other_angles_apart
from jacokin.kernels.solution_set.slices import BEFORE, SixJoints, arm_of_equation, count_solutions, turn_target
from jacokin.kernels.solution_set.surface import (
    ASIDE,
    Surface,
    fill_equations,
    fill_F,
    fill_rates,
    fill_surface,
    has_any_structure,
    make_surface,
    size_at,
    size_of,
    solutions_of_root,
)
from jacokin.kernels.solution_set.trace import Loops, passes
from jacokin.kernels.solution_set.whole_solutions import (
    NEAR,
    REAL_ANGLE,
    conditions_of,
    find_solutions,
    has_two_angles,
    off_axis,
    settle,
)
from jacokin.kernels.tolerances import DISTINCT, UNCERTAIN

LOOKED_AT, MOST_FOUND = 32, 128
#: Values of x at which F is looked at, too, at all values of the parameter; evenly all round from the second on [rad].
LINES, FIRST_LINE = 3, 0.7
#: Halvings to where F is zero on such a line.
LINE_HALVINGS = 24
#: Where F is at most this part of its size beside, it may vanish, and at most that part it all but does; steps to
#: there, of a share of the one before.
SMALL, ALMOST_NOTHING, STEPS_TO_LEAST, GOLDEN = 1e-2, 2e-3, 10, 0.6180339887498949
#: Where it vanishes, no more is left of it than this part of its size beside.
NOTHING = 1e-9
#: Rounds to where it vanishes, from how far away F is looked at [rad], and times that in the next round.
ROUNDS_TO_ZERO, FIRST_AWAY, NEXT_AWAY = 3, 4e-3, 0.1
#: [rad] where the even values begin: away from the round angles that people use.
OFFSET = 0.1234
#: Times the distance between two values within which pairs from both sides may come to the axis.
SAFETY = 2.0
#: Share of that distance within which solutions come where a spherical wrist's other angle becomes real.
SURE = 0.15
#: [rad] values nearer to each other than this are halved where the pairs may be solutions, see `is_solution`.
WHOLE = 0.01
#: Share of what is left until a pair comes by which the parameter is moved, to see how fast its other angles do, and
#: the least move [rad]. Their speeds, relative to the parameter, are this at least; and [rad] no square of an angle
#: shrinks faster.
NEARER, SHORTEST_ASIDE, LEAST_SPEED, FASTEST = 0.1, 1e-8, 1.0, 1e3
#: [rad] to where F is looked at again in a labelling in which it is noise.
ELSEWHERE = 1.0
#: [rad] of the parameter: the shortest distance that is halved, and from a fold that is known. How far from there its
#: pair may be expected: relative to that, and to the distance of any other place. So near to a fold counts as at it.
BESIDE, AT_FOLD, NEAR_FOLD = 3e-5, 0.2, 0.1
#: Where its pair is noise there, how often to look farther away.
FARTHER, TIMES_FARTHER = 2, 5.0
#: [rad] roots are found to less than this. A real one is real for sure if the next one is so many times as far away as
#: noise may move it: then the derivative there tells how far that is.
REAL, ALONE = 1e-6, 8.0
#: Values that are halved at most, and halves that wait their turn: halvings of the distance of even values to `BESIDE`
#: leave 15.
MOST_HALVED, DEPTH = 400, 32
#: [rad] roots are foretold from no farther away, and those that this moves by less than a part of their size; how they
#: turn on the way counts where it adds less than a part of that.
FORESEEN, FORETOLD, BENT = 1.5 * TURN / LOOKED_AT, 1.0, 1.0


class Look(NamedTuple):
    """What the roots of F at one value of the parameter tell of those nearby."""

    ahead: float  # after how much a pair that is apart from the real axis may come there [rad], inf for none
    behind: float  # the same on the other side
    sure_ahead: float  # after how much a pair comes there by its value, slope and bend [rad], inf for none
    sure_behind: float  # the same on the other side
    least: int  # how many roots are real for sure,
    most: int  # and how many may be
    at_fold: int  # 1 right beside a fold, of whose own pair little is known


class Islands(NamedTuple):
    """Values of the parameter at which F is looked at, and what it takes."""

    p: Array  # (LOOKED_AT + MOST_FOUND,) evenly all round, then values found between [rad]
    counts: NDArray[np.int64]  # (LOOKED_AT + MOST_FOUND,) roots of F at each; -1 where they are in doubt
    #: Values found, places left in doubt, values all round, halvings, labelling that tells, solutions for each root,
    #: pairs in `coming`.
    size: NDArray[np.int64]  # (7,)
    passed: NDArray[np.int64]  # (LOOKED_AT + MOST_FOUND,) how often curves pass each value
    useless: NDArray[np.int64]  # (LABELLINGS,) 1 where F is noise at any value of the parameter
    comes: Array  # (LOOKED_AT, 4) see `Look`
    coming: Array  # (32, 2) after how much each pair seen last in the arm's own labelling may come, ahead and behind
    stack: Array  # (DEPTH, 12) two values, and of each, see `Look`: when pairs come, real roots, whether it is a fold
    vanishing: Array  # (LOOKED_AT, 2) see `find_vanishing`
    lines: Array  # (LOOKED_AT, LINES) F where x has one of some values, 0 for noise
    crossed: NDArray[np.int64]  # (LOOKED_AT, LINES) how often curves pass there before the next slice
    roots: RootWork
    F: Surface
    pair: PairWork
    z: Array  # (16, 2) exp(i x) of all roots, real and imaginary part
    other: Array  # (16, 2) the same in another labelling of the joints
    found: Array  # (LOOKED_AT + 1, 16, 6) roots at each even value, and at the last one: z, its derivatives by p
    found_at: Array  # (LOOKED_AT + 1, 2) that value, NaN for none, and the degree
    whole: Array  # (16, 4) solutions in two angles, see `whole_solutions`
    lanes: Array  # see `all_roots`


def make_islands() -> Islands:
    """Fresh arrays."""
    return Islands(
        np.empty(LOOKED_AT + MOST_FOUND),
        np.zeros(LOOKED_AT + MOST_FOUND, np.int64),
        np.zeros(7, np.int64),
        np.zeros(LOOKED_AT + MOST_FOUND, np.int64),
        np.zeros(LABELLINGS, np.int64),
        np.empty((LOOKED_AT, 4)),
        np.empty((4 * DEGREE, 2)),
        np.empty((DEPTH, 12)),
        np.empty((LOOKED_AT, 2)),
        np.zeros((LOOKED_AT, LINES)),
        np.zeros((LOOKED_AT, LINES), np.int64),
        make_roots(),
        make_surface(),
        make_pair_work(),
        np.zeros((2 * DEGREE, 2)),
        np.zeros((2 * DEGREE, 2)),
        np.zeros((LOOKED_AT + 1, 2 * DEGREE, 6)),
        np.zeros((LOOKED_AT + 1, 2)),
        np.zeros((2 * DEGREE, 4)),
        make_lanes(),
    )


def foretell(work: Islands, p: float, degree: int) -> None:
    """Move roots as they move with the parameter from the nearest value at which they were found, if that is near."""
    z, best, away = work.z, -1, FORESEEN
    for i in range(LOOKED_AT, -1, -1):
        distance = abs(wrapped(p - work.found_at[i, 0]))  # NaN for none
        if distance < away and work.found_at[i, 1] == degree:
            best, away = i, distance
    if best < 0:
        return
    away = wrapped(p - work.found_at[best, 0])
    for i in range(degree):
        root = work.found[best, i]
        z[i, 0], z[i, 1] = root[0], root[1]
        x, y, half = root[2] * away, root[3] * away, 0.5 * away * away
        square = x * x + y * y
        if square < FORETOLD * (root[0] * root[0] + root[1] * root[1]):
            z[i, 0] += x
            z[i, 1] += y
            x, y = half * root[4], half * root[5]
            if x * x + y * y < BENT * BENT * square:
                z[i, 0] += x
                z[i, 1] += y


def keep_found(i: int, work: Islands) -> None:
    """Keep the roots at the last value of the parameter as those at even value i."""
    for n in range(2):
        work.found_at[i, n] = work.found_at[LOOKED_AT, n]
    for n in range(2 * DEGREE):
        for m in range(6):
            work.found[i, n, m] = work.found[LOOKED_AT, n, m]


def degree_of(work: Islands, noise: float) -> int:
    """Of z^n F as a polynomial: twice the highest wave in F that is no noise."""
    n = DEGREE
    while n > 0 and abs(work.F.cosine[n]) + abs(work.F.sine[n]) <= noise:
        n -= 1
    return 2 * n


def nothing_sure(least: int) -> Look:
    """What noise tells: pairs may be anywhere, and so many roots are real at least."""
    return Look(0.0, 0.0, 0.0, 0.0, least, 2 * DEGREE, 0)


def real_roots(seen: Look) -> int:
    """How many roots are real, -1 in doubt."""
    return seen.least if seen.least == seen.most else -1


def look(k: ArmConstants, six: SixJoints, work: Islands, p: float) -> Look:
    """All roots of F(x; p), and when pairs of them come to the axis; F is left there."""
    seen = look_closely(k, six, work, p, 0.0)
    if seen.least != seen.most:
        work.size[6] = 0
    for n in range(0 if solutions_of_root(k) > 1 else LABELLINGS):
        if n == 1 and seen.least < seen.most:
            seen = together(seen, nothing_sure(count_solutions(six, p)))
        if seen.least == seen.most:
            break
        if work.useless[work.size[4]] == 0:
            seen = together(seen, look_in(k, six, work, p, work.size[4], 0.0))
        if seen.least != seen.most:
            work.size[4] = next_labelling(k, six, work.size[4])
    if seen.least != seen.most or seen.least % 2 == 1:  # of all round, the number is even
        return nothing_sure(0)
    return seen


def look_closely(k: ArmConstants, six: SixJoints, work: Islands, p: float, reach: float) -> Look:
    """What the arm's own labelling tells, and where its roots are too near to each other, whole solutions.

    Args:
        k: the arm.
        six: six joints and their target.
        work: work arrays.
        p: the parameter [rad].
        reach: as for `look_in`.
    """
    seen = look_in(k, six, work, p, -1, reach)
    if seen.least == seen.most or work.found_at[LOOKED_AT, 0] != p or not has_two_angles(k):
        return seen
    F, noise, links = work.F, float(work.F.noise[0]), work.F.equations.links
    degree = degree_of(work, noise)
    count = find_solutions(conditions_of(k, six, p, links), work.z, degree, work.whole)
    if count < 0:
        return seen
    ahead, behind, sure_ahead, sure_behind, real = math.inf, math.inf, math.inf, math.inf, 0
    work.size[6] = 0
    for i in range(degree):
        root = root_of(work.lanes, i)
        if root.d >= NEAR:
            value, rate, unsure, bend = approach(root, noise, F.waves[0] ** 2 * noise, False)
            add_coming(work, first_zero(value, unsure - rate, bend), first_zero(value, unsure + rate, bend))
            ahead, behind = (
                min(ahead, first_zero(value, unsure - rate, bend)),
                min(behind, first_zero(value, unsure + rate, bend)),
            )
            sure_ahead = min(sure_ahead, zero_of_parabola(value, -rate, bend))
            sure_behind = min(sure_behind, zero_of_parabola(value, rate, bend))
    before, after = conditions_of(k, six, p - ASIDE, links), conditions_of(k, six, p + ASIDE, links)
    for i in range(count):
        row = work.whole[i]
        z, zeta = complex(row[0], row[1]), complex(row[2], row[3])
        if max(abs(off_axis(z)), abs(off_axis(zeta))) <= REAL_ANGLE:
            real += 1
            continue
        z_before, zeta_before, was = settle(before, z, zeta)
        z_after, zeta_after, will_be = settle(after, z, zeta)
        if not was or not will_be:
            return seen
        first = until_on_axis(off_axis(z_before), off_axis(z), off_axis(z_after))
        second = until_on_axis(off_axis(zeta_before), off_axis(zeta), off_axis(zeta_after))
        farther = off_axis(z) if abs(off_axis(z)) > abs(off_axis(zeta)) else off_axis(zeta)
        if farther > 0.0:  # of two that are conjugate
            add_coming(work, max(first[0], second[0]), max(first[1], second[1]))
        ahead, behind = min(ahead, max(first[0], second[0])), min(behind, max(first[1], second[1]))
        sure_ahead = min(sure_ahead, max(first[2], second[2]))
        sure_behind = min(sure_behind, max(first[3], second[3]))
    return Look(ahead, behind, sure_ahead, sure_behind, real, real, 0)


def add_coming(work: Islands, ahead: float, behind: float) -> None:
    """Keep after how much a pair may come to the axis, ahead and behind [rad]."""
    work.coming[work.size[6], 0], work.coming[work.size[6], 1] = ahead, behind
    work.size[6] += 1


def until_on_axis(before: float, here: float, after: float) -> tuple[float, float, float, float]:
    """After how much an angle is real, ahead and behind; and the same by its value, slope and bend [rad].

    An angle that leaves the axis right after it came there does both before it is seen again: how fast it came tells.

    Args:
        before: how far it is from the real axis `ASIDE` before [rad].
        here: the same here.
        after: and after it.
    """
    if abs(here) <= REAL_ANGLE:
        return 0.0, 0.0, 0.0, 0.0
    value, low, high = -here * here, -before * before, -after * after
    slope, bend = 0.5 * (high - low) / ASIDE, (high - 2.0 * value + low) / ASIDE**2
    ahead = min(first_zero(value, slope, bend), first_zero(value, (value - low) / ASIDE, 0.0))
    behind = min(first_zero(value, -slope, bend), first_zero(value, (value - high) / ASIDE, 0.0))
    return (
        min(ahead, ASIDE) if abs(after) <= REAL_ANGLE else ahead,
        min(behind, ASIDE) if abs(before) <= REAL_ANGLE else behind,
        zero_of_parabola(value, slope, bend),
        zero_of_parabola(value, -slope, bend),
    )


def together(a: Look, b: Look) -> Look:
    """What two labellings tell: pairs come as in the one in which fewer roots may be real."""
    fewer = a if a.most <= b.most else b
    return Look(fewer.ahead, fewer.behind, fewer.sure_ahead, fewer.sure_behind, max(a.least, b.least), fewer.most, 0)


def look_in(k: ArmConstants, six: SixJoints, work: Islands, p: float, labelling: int, reach: float) -> Look:
    """What one labelling of the joints tells, -1 for the arm's own; F is left there.

    Of pairs that come to the axis within reach [rad], the other angles are looked at, too.
    """
    noise = fill_F(k, six, work.F, p, labelling)
    if not size_of(work.F.cosine, work.F.sine) > UNCERTAIN * noise:
        if labelling >= 0:
            noise = fill_F(k, six, work.F, p + ELSEWHERE, labelling)
            work.useless[labelling] = not size_of(work.F.cosine, work.F.sine) > UNCERTAIN * noise
        return nothing_sure(0)
    degree = degree_of(work, noise)
    noise_of_bend = fill_rates(k, six, work.F, p, labelling, noise)
    if labelling < 0 and k.six.form == Form.SPHERICAL_WRIST and work.F.apart[0] < 0.0:  # another angle is complex
        apart, rate, bend = work.F.apart[0], work.F.apart[1], work.F.apart[2]
        ahead, behind = first_zero(apart, rate, bend), first_zero(apart, -rate, bend)
        return Look(ahead, behind, ahead / SURE, behind / SURE, 0, 0, 0)
    z = work.z if labelling < 0 else work.other
    if labelling < 0:
        foretell(work, p, degree)
        work.found_at[LOOKED_AT, 0], work.size[6] = math.nan, 0
    find_all_roots(work.F.powers[0], degree, z, work.lanes)
    tell_roots(work.F.powers, degree, z, work.lanes)
    ahead, behind, sure_ahead, sure_behind, least, most = math.inf, math.inf, math.inf, math.inf, 0, 0
    for i in range(degree):
        root = root_of(work.lanes, i)
        if root.slope == 0.0:
            return nothing_sure(0)
        if labelling < 0:
            found = work.found[LOOKED_AT, i]
            found[0], found[1] = root.x.real, root.x.imag
            found[2], found[3], found[4], found[5] = (
                root.turns.real,
                root.turns.imag,
                root.bends.real,
                root.bends.imag,
            )
        if abs(root.d) <= REAL:
            error, next_root = degree * noise / length_of(root.slope), distance_to_next(work.lanes, i, degree)
            most, least = most + 1, least + int(next_root > ALONE * error + 2.0 * REAL)
        elif 4.0 * root.on_axis <= degree * noise:
            most += 1
        elif root.d > 0.0:
            is_near_others = distance_to_next(work.lanes, i, degree) < root.d
            value, rate, unsure, bend = approach(root, noise, noise_of_bend, is_near_others)
            comes = (
                first_zero(value, unsure - rate, bend),
                first_zero(value, unsure + rate, bend),
                zero_of_parabola(value, -rate, bend),
                zero_of_parabola(value, rate, bend),
            )
            if min(comes[0], comes[1]) <= reach:
                meets = until_meeting(work.lanes, i, degree)
                comes = with_others(k, six, work, p, labelling, root, comes, meets)
            if labelling < 0:
                add_coming(work, comes[0], comes[1])
            ahead, behind = min(ahead, comes[0]), min(behind, comes[1])
            sure_ahead, sure_behind = min(sure_ahead, comes[2]), min(sure_behind, comes[3])
    if labelling < 0:
        work.found_at[LOOKED_AT, 0], work.found_at[LOOKED_AT, 1] = p, degree
    return Look(ahead, behind, sure_ahead, sure_behind, least, most, 0)


def approach(root: Root, noise: float, noise_of_bend: float, is_near_others: bool) -> tuple[float, float, float, float]:
    """Minus the square of a pair's distance from the real axis: value, slope, how unsure that is, and bend."""
    x, turns, d, slope = root.x, root.turns, root.d, length_of(root.slope)
    rate, change = -(turns / x).real, -(root.bends / x - (turns / x) * (turns / x)).real
    unsure = 0.0  # of the rate, where the pair is alone
    if not is_near_others:
        unsure = length_of(turns / x) * length_of(root.bend) * noise / (slope * slope)
    bend_of_square = -2.0 * (rate * rate + d * change)
    if abs(bend_of_square) <= 2.0 * d * noise_of_bend / slope:
        bend_of_square = 0.0  # noise
    return -d * d, 2.0 * d * rate, 2.0 * d * unsure, bend_of_square


def with_others(
    k: ArmConstants,
    six: SixJoints,
    work: Islands,
    p: float,
    labelling: int,
    root: Root,
    comes: tuple[float, float, float, float],
    meets: tuple[float, float],
) -> tuple[float, float, float, float]:
    """After how much a pair becomes solutions: not before its other angles are real as well.

    How fast these come there tells as long as the root meets no other one: from there on they move otherwise.

    Args:
        k: the arm.
        six: six joints and their target.
        work: work arrays.
        p: the parameter [rad].
        labelling: in which F is.
        root: one of the pair.
        comes: after how much it comes to the axis ahead and behind, and the same for sure [rad].
        meets: after how much it may meet another root, ahead and behind [rad].
    """
    step = max(min(ASIDE, NEARER * min(comes[0], comes[1])), SHORTEST_ASIDE)
    first, second = others_apart(k, six, work, p, labelling, root.x)
    first_beside, second_beside = others_apart(k, six, work, p + step, labelling, root.x + step * root.turns)
    rate, second_rate = (first_beside - first) / step, (second_beside - second) / step
    ahead = max(until_real(first, -rate, meets[0]), until_real(second, -second_rate, meets[0]))
    behind = max(until_real(first, rate, meets[1]), until_real(second, second_rate, meets[1]))
    return max(comes[0], ahead), max(comes[1], behind), max(comes[2], ahead), max(comes[3], behind)


def others_apart(
    k: ArmConstants, six: SixJoints, work: Islands, p: float, labelling: int, z: complex
) -> tuple[float, float]:
    """How far two other angles are from the real axis where z = exp(i x) is a root of F(x; p) [rad]."""
    if labelling < 0 and k.six.form == Form.PLANAR_ARM:
        turn_target(six.T, six.axis, p, six.turned)
        fill_links(six.chain, six.turned, k.six.scale, k.six.form_labelling, work.F.equations.links)
        apart = theta_5_apart(planar_arm_of(work.F.equations.links), z)
        return apart, apart
    if labelling < 0 and k.six.form == Form.ELBOW_OFFSET:
        turn_target(six.T, six.axis, p, six.turned)
        fill_links(six.chain, six.turned, k.six.scale, k.six.form_labelling, work.F.equations.links)
        apart = theta_5_apart_of(offset_arm_of(work.F.equations.links), z)
        return apart, apart
    if labelling < 0 and k.six.scale == 0.0:
        turn_target(six.T, six.axis, p, six.turned)
        apart = q5_apart(k, pose_of(six.arm, k, six.turned), z)
        return apart, apart
    fill_equations(k, six, work.F, p, labelling)
    return other_angles_apart(work.F.equations, z, work.pair)


def until_real(distance: float, speed: float, known: float) -> float:
    """After how much an angle may be real: its square comes to zero at its own speed, but not faster than any.

    Speeds are known to noise only, and not how they change; and so far off nothing is known of them.
    """
    return max(min(0.5 * distance / max(speed, LEAST_SPEED), known), distance * distance / FASTEST)


def first_zero(value: float, slope: float, bend: float) -> float:
    """Where value + slope u + bend u^2 / 2 may be zero first, for u > 0; inf for nowhere. The value is negative.

    Where it only touches zero, rounding leaves no root: a step of Newton's method, half as far, stands for it.
    """
    return min(-value / slope if slope > 0.0 else math.inf, zero_of_parabola(value, slope, bend))


def zero_of_parabola(value: float, slope: float, bend: float) -> float:
    """The first one alone; inf for none."""
    under = slope * slope - 2.0 * bend * value
    if under >= 0.0 and slope + math.sqrt(under) > 0.0:
        return -2.0 * value / (slope + math.sqrt(under))
    return math.inf


def find_islands(six: SixJoints, window: Array, work: Islands) -> None:
    """Fill p and counts, at even values in a window and beside, and between where curves may be."""
    k = arm_of_equation(six)
    step = TURN / LOOKED_AT
    work.size[0], work.size[1], work.size[2], work.size[3] = 0, 0, LOOKED_AT, 0
    work.size[5] = solutions_of_root(k)
    fill_surface(k, six, work.F)
    own = unpack_arm(six.general).six.own
    work.size[4] = next_labelling(k, six, own) if has_any_structure(k) else own
    spread_roots(work.z)
    spread_roots(work.other)
    for labelling in range(LABELLINGS):
        work.useless[labelling] = 0
    for i in range(LOOKED_AT + 1):
        work.found_at[i, 0] = math.nan
    for i in range(LOOKED_AT):
        work.p[i] = wrapped(OFFSET + step * i)
        work.counts[i] = -1
        for n in range(4):
            work.comes[i, n] = math.inf
        for n in range(LINES):
            work.lines[i, n] = 0.0
        if abs(wrapped(work.p[i] - window[0])) <= window[1] + step:
            seen = look(k, six, work, work.p[i])
            keep_found(i, work)
            work.comes[i, 0], work.comes[i, 1], work.counts[i] = seen.ahead, seen.behind, real_roots(seen)
            work.comes[i, 2], work.comes[i, 3] = seen.sure_ahead, seen.sure_behind
            noise = fill_F(k, six, work.F, work.p[i], -1)
            for n in range(LINES):
                value, _ = value_and_slope(work.F.cosine, work.F.sine, line_at(n))
                work.lines[i, n] = value if abs(value) > noise else 0.0
    for i in range(LOOKED_AT):
        halve(k, six, work, (work.p[i], work.p[i] + step), known(work, i), known(work, (i + 1) % LOOKED_AT))


def find_vanishing(six: SixJoints, work: Islands) -> None:
    """Fill vanishing with where F is next to zero for all x about at each even value, NaN for nowhere, from the table.

    Besides, 1 where it vanishes there to rounding, and 0 where it does not quite.
    """
    k = arm_of_equation(six)
    half = 0.5 * TURN / LOOKED_AT
    for i in range(LOOKED_AT):
        work.vanishing[i, 0] = math.nan
    before, here = size_at(k, six, work.F, OFFSET - half), size_at(k, six, work.F, OFFSET)
    for n in range(2 * LOOKED_AT):
        p = OFFSET + half * n
        after = size_at(k, six, work.F, p + half)
        if here <= before and here < after:
            p = least_between(k, six, work.F, p - half, p + half)
            least = size_at(k, six, work.F, p) / min(before, after)
            if least <= SMALL:
                p, vanishes = zero_near(k, six, work.F, p)
                vanishes = vanishes and size_at(k, six, work.F, p) <= NOTHING * min(before, after)
                if vanishes or least <= ALMOST_NOTHING:
                    work.vanishing[n // 2, 0], work.vanishing[n // 2, 1] = wrapped(p), vanishes
        before, here = here, after


def least_between(k: ArmConstants, six: SixJoints, F: Surface, low: float, high: float) -> float:
    """About where F is least between two values of the parameter."""
    a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_a, at_b = size_at(k, six, F, a), size_at(k, six, F, b)
    for _ in range(STEPS_TO_LEAST):
        if at_a < at_b:
            high, b, at_b = b, a, at_a
            a = high - GOLDEN * (high - low)
            at_a = size_at(k, six, F, a)
        else:
            low, a, at_a = a, b, at_b
            b = low + GOLDEN * (high - low)
            at_b = size_at(k, six, F, b)
    return a if at_a < at_b else b


def zero_near(k: ArmConstants, six: SixJoints, F: Surface, p: float) -> tuple[float, bool]:
    """Where F vanishes for all x, to rounding, next to where it is least; False with that place where it does not.

    It grows on both sides of a zero by the same power of the distance, but for what a distance twice as long tells.
    """
    zero, found = p, False
    for n in range(ROUNDS_TO_ZERO):
        away = FIRST_AWAY * NEXT_AWAY**n
        low, high = size_at(k, six, F, zero - away), size_at(k, six, F, zero + away)
        lowest, highest = size_at(k, six, F, zero - 2.0 * away), size_at(k, six, F, zero + 2.0 * away)
        if not min(low, high, lowest, highest) > 0.0:
            return zero, found
        power = math.floor(math.log(highest / high) / math.log(2.0) + 0.5) if highest > high else 0
        if power == 0:
            return p, False
        near, far = zero_between(low, high, power, away), zero_between(lowest, highest, power, 2.0 * away)
        zero, found = zero + (4.0 * near - far) / 3.0, True
    return zero, found


def zero_between(low: float, high: float, power: int, away: float) -> float:
    """How far a zero is from the middle of two places, so far from it, at which sizes are known."""
    ratio = math.pow(high / low, 1.0 / power)
    return away * (1.0 - ratio) / (1.0 + ratio)


def known(work: Islands, i: int) -> Look:
    """What was seen at value i of those all round."""
    c, count = work.comes[i], int(work.counts[i])
    return Look(c[0], c[1], c[2], c[3], count, count, 0)


def halve(
    k: ArmConstants, six: SixJoints, work: Islands, between: tuple[float, float], first: Look, last: Look
) -> None:
    """Add values between two, where pairs that come from both sides become solutions in between."""
    stack, top = work.stack, 0
    write_part(stack[0], between[0], between[1], first, last)
    while top >= 0:
        low, high = stack[top, 0], stack[top, 1]
        count, fold = int(stack[top, 4]), int(stack[top, 5])
        first = Look(stack[top, 2], stack[top, 10], stack[top, 3], 0.0, count, count, fold)
        count, fold = int(stack[top, 8]), int(stack[top, 9])
        last = Look(stack[top, 11], stack[top, 6], 0.0, stack[top, 7], count, count, fold)
        top -= 1
        if not may_come(first, last, high - low) or (high - low < WHOLE and not is_solution(k, six, work, low, high)):
            continue
        if high - low < BESIDE or work.size[3] == MOST_HALVED:
            work.size[1] += 1
            continue
        work.size[3] += 1
        middle = 0.5 * (low + high)
        seen = look(k, six, work, middle)
        count = real_roots(seen)
        if max(real_roots(first), real_roots(last), count) < 0:
            work.size[1] += 1
            continue
        if count < 0 or count > min(real_roots(first), real_roots(last)):
            add_found(work, middle, count)
        write_part(stack[top + 1], low, middle, first, seen)
        write_part(stack[top + 2], middle, high, seen, last)
        top += 2


def may_come(first: Look, last: Look, length: float) -> bool:
    """Whether pairs may come to the axis between two values of the parameter, seen from both."""
    if first.ahead + last.behind <= SAFETY * length:
        return True
    before, after = real_roots(first), real_roots(last)
    if (first.sure_ahead <= length and 0 <= after <= before) or (
        last.sure_behind <= length and 0 <= before <= after
    ):  # it comes, and none is there on the other side
        return True
    elsewhere = (1.0 - NEAR_FOLD) * length
    first_at_fold = first.at_fold > 0 or first.behind <= NEAR_FOLD * length
    last_at_fold = last.at_fold > 0 or last.ahead <= NEAR_FOLD * length
    if first_at_fold and last_at_fold:
        return True
    return (first_at_fold and last.behind <= elsewhere) or (last_at_fold and first.ahead <= elsewhere)


def look_beside_folds(six: SixJoints, loops: Loops, parameter: int, first: int, work: Islands) -> None:
    """Add values between each fold of the curves from the first one on and what is known next, where pairs may come.

    At the slice, the pair of the fold is on its way to the axis, as any that comes there before would be. Before the
    slice there may be a fold that faces this one, at which another pair, or the same one, comes to the axis.
    """
    k, step = arm_of_equation(six), TURN / LOOKED_AT
    for c in range(first, loops.size[1]):
        for n in range(loops.ends[c, 0] + 1, loops.ends[c, 1] - 1):
            side = side_of_fold(loops, n, parameter)
            if side == 0.0:
                continue
            fold = loops.nodes[n, parameter]
            i = math.floor((fold + side * BESIDE - OFFSET) / step) + int(side > 0.0)
            at, i = OFFSET + step * i, i % LOOKED_AT
            faced, curve = facing_fold(loops, parameter, fold, at)
            if faced != at and curve >= first and side < 0.0:  # seen from the other one
                continue
            other = known(work, i)
            comes, gone = (other.behind, other.ahead) if side > 0.0 else (other.ahead, other.behind)
            if faced == at and not (comes <= SAFETY * abs(at - fold) or gone <= NEAR_FOLD * abs(at - fold)):
                continue
            away, here = look_beside(k, six, work, fold, side)
            p, there = fold + side * away, here.behind if side > 0.0 else here.ahead
            is_expected = comes_from_fold(here, side, away)
            if not is_expected and not count_folds(loops, parameter, p - side * there, side, away * AT_FOLD):
                work.size[1] += 1
                continue
            part = 0.5 * AT_FOLD * away
            folds = count_folds(loops, parameter, 0.5 * (fold + p) - side * part, side, 0.5 * away + part)
            work.size[1] += count_coming(work, side, away + part) > folds
            if faced != at:
                away, other = look_beside(k, six, work, faced, -side)
                at = faced - side * away
            if (at - p) * side <= 0.0:
                continue
            if side > 0.0:
                halve(k, six, work, (p, at), here, other)
            else:
                halve(k, six, work, (at, p), other, here)


def look_beside(k: ArmConstants, six: SixJoints, work: Islands, fold: float, side: float) -> tuple[float, Look]:
    """How far from a fold its own pair is no noise, to the side where it is complex, and what the roots tell there."""
    away, seen = BESIDE, look(k, six, work, fold + side * BESIDE)
    for _ in range(FARTHER):
        if real_roots(seen) < 0 or not comes_from_fold(seen, side, away):
            away *= TIMES_FARTHER
            seen = look(k, six, work, fold + side * away)
    return away, Look(seen.ahead, seen.behind, seen.sure_ahead, seen.sure_behind, seen.least, seen.most, 1)


def comes_from_fold(seen: Look, side: float, away: float) -> bool:
    """Whether nothing comes to the axis before the pair of a fold so far away."""
    return (seen.behind if side > 0.0 else seen.ahead) >= away * (1.0 - AT_FOLD)


def facing_fold(loops: Loops, parameter: int, p: float, at: float) -> tuple[float, int]:
    """The first fold from p on to another value at which pairs come to the axis, and its curve; that value for none."""
    nearest, curve, ahead = abs(at - p), -1, at > p
    for c in range(loops.size[1]):
        for n in range(loops.ends[c, 0] + 1, loops.ends[c, 1] - 1):
            side = side_of_fold(loops, n, parameter)
            away = wrapped(loops.nodes[n, parameter] - p) * (1.0 if ahead else -1.0)
            if side == (-1.0 if ahead else 1.0) and 0.0 < away < nearest:
                nearest, curve = away, c
    if curve < 0:
        return at, curve
    return p + nearest if ahead else p - nearest, curve


def side_of_fold(loops: Loops, n: int, parameter: int) -> float:
    """1 where a curve turns back at node n before higher values of the parameter, -1 before lower ones; else 0."""
    if loops.fold[n] == 0:
        return 0.0
    p, before, after = loops.nodes[n, parameter], loops.nodes[n - 1, parameter], loops.nodes[n + 1, parameter]
    return 1.0 if 2.0 * p > before + after else -1.0


def count_folds(loops: Loops, parameter: int, p: float, side: float, away: float) -> int:
    """How often a curve turns back about at a value of the parameter, to that side."""
    count = 0
    for c in range(loops.size[1]):
        for n in range(loops.ends[c, 0] + 1, loops.ends[c, 1] - 1):
            count += side_of_fold(loops, n, parameter) == side and abs(wrapped(loops.nodes[n, parameter] - p)) <= away
    return count


def count_coming(work: Islands, side: float, away: float) -> int:
    """How many solutions may come within so much, in pairs, seen from beside a fold to that side."""
    count, column = 0, int(side > 0.0)
    for i in range(work.size[6]):
        count += work.coming[i, column] <= away
    return count * int(work.size[5])


def write_part(part: Array, low: float, high: float, first: Look, last: Look) -> None:
    """Write a part of the stack."""
    part[0], part[1] = low, high
    part[2], part[3], part[4], part[5] = first.ahead, first.sure_ahead, real_roots(first), first.at_fold
    part[6], part[7], part[8], part[9] = last.behind, last.sure_behind, real_roots(last), last.at_fold
    part[10], part[11] = first.behind, last.ahead


def is_solution(k: ArmConstants, six: SixJoints, work: Islands, low: float, high: float) -> bool:
    """Whether the pairs that come to the axis between two values may be solutions there.

    Where two complex solutions have one real angle in common, F has a pair on the axis without a solution. Their other
    angles tell.
    """
    if k.six.form == Form.SPHERICAL_WRIST:
        return True
    reach = SAFETY * (high - low)
    first, last = look_closely(k, six, work, low, reach), look_closely(k, six, work, high, reach)
    return first.least < first.most or last.least < last.most or may_come(first, last, high - low)


def next_labelling(k: ArmConstants, six: SixJoints, labelling: int) -> int:
    """Another labelling of the joints than one, and than the one in which F is the arm's own."""
    found = (labelling + 1) % LABELLINGS
    if has_any_structure(k) and found == k.six.own:
        found = (found + 1) % LABELLINGS
    return int(found)


def add_found(work: Islands, p: float, count: int) -> None:
    """Add a value of the parameter, with so many roots."""
    if work.size[0] == MOST_FOUND:
        work.size[1] += 1
        return
    work.p[LOOKED_AT + work.size[0]], work.counts[LOOKED_AT + work.size[0]] = p, count
    work.size[0] += 1


def line_at(n: int) -> float:
    """One of the values of x at which F is looked at [rad]."""
    return FIRST_LINE + TURN * n / LINES


def joint_of_root(six: SixJoints, work: Islands, kind: int) -> int:
    """Index among seven angles of the one that a root of F is."""
    k = arm_of_equation(six)
    j = joint_of(k.six.own, 2)
    if k.six.form == Form.SPHERICAL_WRIST:
        fill_links(six.chain, six.T, k.six.scale, k.six.form_labelling, work.F.equations.links)
        meet = abs(reach_of(k.six, work.F.equations.links).cross) < DISTINCT
        j = joint_of(k.six.form_labelling, 1 if meet else 2)
    elif k.six.form in (Form.PLANAR_ARM, Form.ELBOW_OFFSET):
        j = joint_of(k.six.form_labelling, 5)
    elif k.six.scale == 0.0:
        j = 5  # of the Jaco's own F
    return 6 - j if kind == BEFORE else j


def count_on_lines(loops: Loops, parameter: int, joint: int, work: Islands) -> None:
    """Fill crossed with how often curves pass each line between slice i and the next one."""
    step = TURN / LOOKED_AT
    for n in range(LINES):
        for i in range(LOOKED_AT):
            work.crossed[i, n] = 0
        for c in range(loops.size[1]):
            for m in range(loops.ends[c, 0], loops.ends[c, 1] - 1):
                a, b = loops.nodes[m], loops.nodes[m + 1]
                value = nearest_copy(line_at(n), 0.5 * (a[joint] + b[joint]))
                if (a[joint] < value) != (b[joint] < value):
                    p = a[parameter] + (value - a[joint]) / (b[joint] - a[joint]) * (b[parameter] - a[parameter])
                    i = math.floor((p - OFFSET) / step) % LOOKED_AT
                    work.crossed[i, n] += 1


def count_passes(loops: Loops, parameter: int, work: Islands) -> None:
    """Fill passed with how often curves pass each value of the parameter at which F was looked at."""
    step, found = TURN / LOOKED_AT, work.size[2] + work.size[0]
    for i in range(found):
        work.passed[i] = 0
    for c in range(loops.size[1]):
        for n in range(loops.ends[c, 0], loops.ends[c, 1] - 1):
            p, q = loops.nodes[n, parameter], loops.nodes[n + 1, parameter]
            first = math.floor((min(p, q) - OFFSET) / step)
            last = min(math.floor((max(p, q) - OFFSET) / step) + 2, first + LOOKED_AT)
            for m in range(first, last):
                work.passed[m % LOOKED_AT] += passes(work.p[m % LOOKED_AT], p, q)
            for i in range(LOOKED_AT, found):
                work.passed[i] += passes(work.p[i], p, q)


def add_zero_on_line(six: SixJoints, work: Islands, i: int, n: int) -> None:
    """Add the value of the parameter between slices i and i + 1 at which F is zero on line n; it changes its sign."""
    k, x = arm_of_equation(six), line_at(n)
    low, step, sign = work.p[i], 0.5 * TURN / LOOKED_AT, work.lines[i, n]
    for _ in range(LINE_HALVINGS):
        fill_F(k, six, work.F, low + step, -1)
        value, _ = value_and_slope(work.F.cosine, work.F.sine, x)
        if (value > 0.0) == (sign > 0.0):
            low += step
        step *= 0.5
    add_found(work, low + step, real_roots(look(k, six, work, low + step)))
