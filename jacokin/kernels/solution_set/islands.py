"""Which values of the parameter to solve at, so that no curve is missed: from the characteristic function alone.

At a value p of the parameter all solutions are roots of one trigonometric polynomial F(x; p) of degree 8. Between two
roots that are nearest to each other F has an extremum; there w = -2 F / F'' is the square of half their distance, and
it is negative where the two are complex. In p it goes through zero where two solutions meet and vanish. A closed curve
that lies wholly between two slices is an extremum whose w is negative at both and positive in between.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.closed_form.arm import ArmConstants, pose_of, unpack_arm
from jacokin.kernels.closed_form.resultant import DEGREE, fourier_of_F, slope_and_curvature, value_and_slope
from jacokin.kernels.closed_form.roots import RootWork, find_roots, make_roots
from jacokin.kernels.limits import TURN
from jacokin.kernels.six_joints.characteristic import Determinant, fourier_of_determinant, make_determinant
from jacokin.kernels.six_joints.equations import Equations, make_equations, write_equations
from jacokin.kernels.six_joints.loop import LABELLINGS, SPHERICAL_WRIST, fill_links, joint_of
from jacokin.kernels.six_joints.spherical_wrist import fill_both_turns, fill_quartic, reach_of
from jacokin.kernels.solution_set.curve import wrapped
from jacokin.kernels.solution_set.slices import BEFORE, SixJoints, turn_target
from jacokin.kernels.solution_set.trace import Loops
from jacokin.kernels.tolerances import DISTINCT, UNCERTAIN

LOOKED_AT, MOST_FOUND, EXTREMA = 48, 128, 32
#: Values of x at which F is looked at, too, at all values of the parameter; evenly all round from the second on [rad].
LINES, FIRST_LINE = 3, 0.7
#: Halvings to where F is zero on such a line.
LINE_HALVINGS = 24
#: [rad] where the even values begin: away from the round angles that people use.
OFFSET = 0.1234
#: Times the change of w from slice to slice, by its slope, by which it may be below zero and come there.
SAFETY = 2.0
#: Times the distance to where w is zero by its slope, that is looked at.
OVERSHOOT = 1.2
#: [rad] of the parameter: for slopes of w, and how well a peak of w is known.
ASIDE, CLOSE_ENOUGH = 1e-4, 1e-7
#: [rad^2] w of two roots that are not told from one; and how often a peak of w is looked at from closer by.
ONE_ROOT, LOOKS = 1e-13, 24
#: [rad^2] w that rounding leaves open: where that is more, the peak is not known well enough to look for it otherwise.
BLURRED = 1e-6
#: [rad^2] w of two complex roots that may be one real solution at a place known to 1e-3 rad.
NEARLY_DOUBLE = 1e-5
#: [rad] how well that place is known, and w [rad^2] of what may be one real solution just there.
PEAK_KNOWN, NEARLY_ONE = 1e-3, 1e-11
#: Newton's method for an extremum: steps, the largest one and the last one [rad]; and w of no extremum.
NEWTON_STEPS, LARGEST_MOVE, SAME_PLACE, NONE = 20, 0.1, 1e-11, -1e9


class Extremum(NamedTuple):
    """An extremum of F."""

    x: float  # [rad]
    w: float  # [rad^2]
    bend: float  # F'': of one sign as long as the extremum is between the same two roots
    labelling: int  # see `fill_F`


class Islands(NamedTuple):
    """Values of the parameter at which F is looked at, and what it takes."""

    p: Array  # (LOOKED_AT + MOST_FOUND,) evenly all round, then values found beside folds [rad]
    counts: NDArray[np.int64]  # (LOOKED_AT + MOST_FOUND,) roots of F at each; -1 where they are in doubt
    peak: NDArray[np.int64]  # (MOST_FOUND,) 1 where w comes to zero, and no farther
    size: NDArray[np.int64]  # (3,) values found, places for which there was no room, values all round
    x: Array  # (LOOKED_AT, EXTREMA) extrema [rad]
    w: Array  # (LOOKED_AT, EXTREMA) [rad^2]
    slope: Array  # (LOOKED_AT, EXTREMA) dw / dp [rad]
    bend: Array  # (LOOKED_AT, EXTREMA) F''
    extrema: NDArray[np.int64]  # (LOOKED_AT,)
    lines: Array  # (LOOKED_AT, LINES) F where x has one of some values, 0 for noise
    crossed: NDArray[np.int64]  # (LOOKED_AT, LINES) how often curves pass there before the next slice
    roots: RootWork
    cosine: Array  # (9,) F
    sine: Array  # (9,)
    apart: Array  # (1,) of F of a spherical wrist, see `fill_both_turns`
    equations: Equations
    determinant: Determinant


def make_islands() -> Islands:
    """Fresh arrays."""
    many = (LOOKED_AT, EXTREMA)
    return Islands(
        np.empty(LOOKED_AT + MOST_FOUND),
        np.zeros(LOOKED_AT + MOST_FOUND, np.int64),
        np.zeros(MOST_FOUND, np.int64),
        np.zeros(3, np.int64),
        np.empty(many),
        np.empty(many),
        np.empty(many),
        np.empty(many),
        np.zeros(LOOKED_AT, np.int64),
        np.zeros((LOOKED_AT, LINES)),
        np.zeros((LOOKED_AT, LINES), np.int64),
        make_roots(),
        np.empty(DEGREE + 1),
        np.empty(DEGREE + 1),
        np.zeros(1),
        make_equations(),
        make_determinant(),
    )


def fill_F(k: ArmConstants, six: SixJoints, work: Islands, p: float, labelling: int) -> float:
    """Fill cosine and sine with the coefficients of F(x; p), up to a factor; returns the noise of its values.

    In the way that suits the arm, or in a labelling of its joints as those of any arm; -1 for the former. Of a
    spherical wrist, F is then about where the wrist is: each root goes with two solutions.
    """
    if labelling >= 0:
        return fill_determinant(unpack_arm(six.general), six, work, p, labelling)
    if k.six.form == SPHERICAL_WRIST:
        turn_target(six.T, six.axis, p, six.turned)
        fill_links(six.chain, six.turned, k.six.scale, k.six.form_labelling, work.equations.links)
        reach = reach_of(k.six, work.equations.links)
        if abs(reach.cross) < DISTINCT:
            noise, work.apart[0] = fill_both_turns(reach, work.cosine, work.sine)
            return noise
        work.apart[0] = 0.0
        _, _, noise = fill_quartic(reach, work.cosine, work.sine)
        return noise
    if k.six.scale > 0.0:
        return fill_determinant(k, six, work, p, k.six.own)
    turn_target(six.T, six.axis, p, six.turned)
    return fourier_of_F(k, pose_of(six.arm, k, six.turned), work.cosine, work.sine)


def fill_determinant(k: ArmConstants, six: SixJoints, work: Islands, p: float, labelling: int) -> float:
    """As `fill_F`, of an arm of any structure in one labelling."""
    turn_target(six.T, six.axis, p, six.turned)
    fill_links(six.chain, six.turned, k.six.scale, labelling, work.equations.links)
    write_equations(work.equations)
    return fourier_of_determinant(work.equations, work.determinant, work.cosine, work.sine)


def fill_extrema(k: ArmConstants, six: SixJoints, work: Islands, i: int) -> float:
    """Fill extrema, x, w and slope of slice i; returns the noise of F."""
    p, x, w, roots = work.p[i], work.x[i], work.w[i], work.roots
    noise = fill_F(k, six, work, p, -1)
    for n in range(DEGREE + 1):
        roots.cosine[n], roots.sine[n] = n * work.sine[n], -n * work.cosine[n]
    count = find_roots(DEGREE * noise, 0.0, roots)
    found = 0
    for e in range(min(count, EXTREMA)):
        value, _ = value_and_slope(work.cosine, work.sine, roots.roots[e, 0])
        _, bend = slope_and_curvature(work.cosine, work.sine, roots.roots[e, 0])
        if bend == 0.0:
            continue
        x[found], w[found], work.bend[i, found] = roots.roots[e, 0], -2.0 * value / bend, bend
        if abs(value) <= noise:
            w[found] = 0.0
        found += 1
    work.extrema[i] = found
    for n in range(LINES):
        value, _ = value_and_slope(work.cosine, work.sine, line_at(n))
        work.lines[i, n] = value if abs(value) > noise else 0.0
    work.counts[i] = count_of(k, six, work, p, noise)
    fill_F(k, six, work, p + ASIDE, -1)
    for e in range(found):
        value, _ = value_and_slope(work.cosine, work.sine, x[e])
        work.slope[i, e] = (-2.0 * value / work.bend[i, e] - w[e]) / ASIDE
    return noise


def find_islands(six: SixJoints, window: Array, work: Islands) -> None:
    """Fill p and counts, at even values in a window and beside, and next to every fold that F shows between."""
    k = unpack_arm(six.arm)
    work.size[0], work.size[1], work.size[2] = 0, 0, LOOKED_AT
    for i in range(LOOKED_AT):
        work.p[i] = wrapped(OFFSET + TURN * i / LOOKED_AT)
        work.extrema[i], work.counts[i] = 0, -1
        for n in range(LINES):
            work.lines[i, n] = 0.0
        if abs(wrapped(work.p[i] - window[0])) <= window[1] + TURN / LOOKED_AT:
            fill_extrema(k, six, work, i)
    for i in range(LOOKED_AT):
        for e in range(work.extrema[i]):
            look_between(k, six, work, i, e)


def line_at(n: int) -> float:
    """One of the values of x at which F is looked at [rad]."""
    return FIRST_LINE + TURN * n / LINES


def joint_of_root(six: SixJoints, work: Islands, kind: int) -> int:
    """Index among seven angles of the one that a root of F is."""
    k = unpack_arm(six.arm)
    j = joint_of(k.six.own, 2)
    if k.six.form == SPHERICAL_WRIST:
        fill_links(six.chain, six.T, k.six.scale, k.six.form_labelling, work.equations.links)
        meet = abs(reach_of(k.six, work.equations.links).cross) < DISTINCT
        j = joint_of(k.six.form_labelling, 1 if meet else 2)
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
                value = line_at(n)
                value += TURN * math.floor((0.5 * (a[joint] + b[joint]) - value) / TURN + 0.5)
                if (a[joint] < value) != (b[joint] < value):
                    p = a[parameter] + (value - a[joint]) / (b[joint] - a[joint]) * (b[parameter] - a[parameter])
                    i = math.floor((p - OFFSET) / step) % LOOKED_AT
                    work.crossed[i, n] += 1


def add_zero_on_line(six: SixJoints, work: Islands, i: int, n: int) -> None:
    """Add the value of the parameter between slices i and i + 1 at which F is zero on line n; it changes its sign."""
    k, x = unpack_arm(six.arm), line_at(n)
    low, step, sign = work.p[i], 0.5 * TURN / LOOKED_AT, work.lines[i, n]
    for _ in range(LINE_HALVINGS):
        fill_F(k, six, work, low + step, -1)
        value, _ = value_and_slope(work.cosine, work.sine, x)
        if (value > 0.0) == (sign > 0.0):
            low += step
        step *= 0.5
    if work.size[0] == MOST_FOUND:
        work.size[1] += 1
        return
    p = low + step
    noise = fill_F(k, six, work, p, -1)
    work.p[LOOKED_AT + work.size[0]] = p
    work.counts[LOOKED_AT + work.size[0]] = count_of(k, six, work, p, noise)
    work.peak[work.size[0]] = 0
    work.size[0] += 1


def count_of(k: ArmConstants, six: SixJoints, work: Islands, p: float, noise: float) -> int:
    """How many roots F(x; p) has, of which the coefficients are at hand; -1 where there is doubt.

    Where two complex solutions have one real angle in common, F has a double root without a solution: in another
    labelling they have not, and there the two roots are apart. Where they are not, there may be a single solution.
    The noise is infinite for such a place.
    """
    count = count_single_roots(work, noise)
    if k.six.form == SPHERICAL_WRIST:
        enough = ONE_ROOT if noise < math.inf else NEARLY_DOUBLE
        return 0 if count < 0 and work.apart[0] < -enough else count
    first = unpack_arm(six.general).six.own
    for n in range(1 if k.six.scale > 0.0 else 0, LABELLINGS):  # the first one is the arm's own
        if count >= 0:
            break
        labelling = (first + n) % LABELLINGS
        other = fill_F(k, six, work, p, labelling)
        count = count_single_roots(work, other)
        if count >= 0 and not noise < math.inf and is_nearly_double(k, six, work, p, labelling, other):
            return -1
    return count


def count_single_roots(work: Islands, noise: float) -> int:
    """How many roots the F at hand has, -1 where some may not be single."""
    roots, total = work.roots, 0.0
    for n in range(DEGREE + 1):
        roots.cosine[n], roots.sine[n] = work.cosine[n], work.sine[n]
        total += abs(work.cosine[n]) + abs(work.sine[n])
    if not total > UNCERTAIN * noise:
        return -1
    count = find_roots(noise, 0.0, roots)
    for i in range(count):
        if roots.roots[i, 1] > 0.0:
            return -1
    return count


def is_nearly_double(k: ArmConstants, six: SixJoints, work: Islands, p: float, labelling: int, noise: float) -> bool:
    """Whether two complex roots in a labelling come together at a value of the parameter nearby."""
    roots = work.roots
    for n in range(DEGREE + 1):
        roots.cosine[n], roots.sine[n] = n * work.sine[n], -n * work.cosine[n]
    nearest = Extremum(0.0, -NEARLY_DOUBLE, 0.0, labelling)
    for e in range(find_roots(DEGREE * noise, 0.0, roots)):
        value, _ = value_and_slope(work.cosine, work.sine, roots.roots[e, 0])
        _, bend = slope_and_curvature(work.cosine, work.sine, roots.roots[e, 0])
        if bend != 0.0 and nearest.w < -2.0 * value / bend <= 0.0:
            nearest = Extremum(roots.roots[e, 0], -2.0 * value / bend, bend, labelling)
    if nearest.bend == 0.0:
        return False
    for side in range(2):
        step = (2.0 * side - 1.0) * PEAK_KNOWN
        _, peak, _ = climb(k, six, work, p, step, 0.5 * step, nearest)
        if peak.w > -NEARLY_ONE:
            return True
    return False


def look_between(k: ArmConstants, six: SixJoints, work: Islands, i: int, e: int) -> None:
    """Add a value next to slice i where an extremum that is below zero here comes to zero on the way to a neighbour."""
    x, w, slope = work.x[i, e], work.w[i, e], work.slope[i, e]
    step = TURN / LOOKED_AT
    if not w <= 0.0 or -w > SAFETY * abs(slope) * step:
        return
    side = 1 if slope > 0.0 else -1
    first = side * min(OVERSHOOT * abs(w / slope), step)
    start = Extremum(x, w, work.bend[i, e], -1)
    p, found, noise = climb(k, six, work, work.p[i], side * step, first, start)
    w = found.w
    if w > -ONE_ROOT:  # or a point where F has a double root, and two solutions that are complex
        if work.size[0] < MOST_FOUND:
            work.p[LOOKED_AT + work.size[0]] = p
            peak = w <= ONE_ROOT  # perhaps a single solution, or complex ones
            blurred = peak and 2.0 * noise > BLURRED * abs(found.bend)
            count = -1 if blurred else count_of(k, six, work, p, math.inf if peak else noise)
            work.counts[LOOKED_AT + work.size[0]] = count
            work.peak[work.size[0]] = peak
            work.size[0] += 1
        else:
            work.size[1] += 1


def climb(
    k: ArmConstants, six: SixJoints, work: Islands, p: float, step: float, first: float, e: Extremum
) -> tuple[float, Extremum, float]:
    """The peak of w of one extremum from p to p + step, or the first place on the way where w is positive.

    Args:
        k: constants of the six joints.
        six: those joints.
        work: F is left there.
        p: where to start [rad].
        step: how far to look, of either sign [rad].
        first: how far to look first [rad].
        e: the extremum at p.

    Returns:
        P and the extremum there, and the noise of F.
    """
    low, high = p, p + step
    trial, noise = p + first, 0.0
    for _ in range(LOOKS):
        there, noise = at_extremum(k, six, work, trial, e)
        if there.w > e.w:
            ahead = OVERSHOOT * abs(there.w / (there.w - e.w) * (trial - p))  # to zero, as w has risen so far
            low, p, e = p, trial, there
            trial = p + math.copysign(min(ahead, 0.5 * abs(high - p)), step)
        else:
            high, trial = trial, 0.5 * (p + low)
            there, noise = at_extremum(k, six, work, trial, e)
            if there.w > e.w:
                high, p, e = p, trial, there
            else:
                low = trial
            trial = 0.5 * (p + high)
        if e.w > ONE_ROOT or abs(high - low) < CLOSE_ENOUGH:
            break
    return p, e, noise


def at_extremum(k: ArmConstants, six: SixJoints, work: Islands, p: float, e: Extremum) -> tuple[Extremum, float]:
    """The extremum of F(x; p) nearest to another one and like it, and the noise of F; its w is `NONE` for none."""
    noise = fill_F(k, six, work, p, e.labelling)
    x, bend = e.x, e.bend
    for _ in range(NEWTON_STEPS):
        slope, bend = slope_and_curvature(work.cosine, work.sine, x)
        if bend * e.bend <= 0.0:
            break
        step = -slope / bend
        x += min(max(step, -LARGEST_MOVE), LARGEST_MOVE)
        if abs(step) < SAME_PLACE:
            break
    if bend * e.bend <= 0.0:
        x, bend = nearest_extremum(work, noise, x, e.bend)
        if bend == 0.0:
            return Extremum(x, NONE, e.bend, e.labelling), noise
    value, _ = value_and_slope(work.cosine, work.sine, x)
    w = 0.0 if abs(value) <= noise else -2.0 * value / bend
    return Extremum(x, w, bend, e.labelling), noise


def nearest_extremum(work: Islands, noise: float, x: float, like: float) -> tuple[float, float]:
    """Place and F'' of the extremum of the F at hand that is nearest to x and like another; F'' is 0 for none."""
    roots = work.roots
    for n in range(DEGREE + 1):
        roots.cosine[n], roots.sine[n] = n * work.sine[n], -n * work.cosine[n]
    least, found, there = LARGEST_MOVE, x, 0.0
    for e in range(find_roots(DEGREE * noise, 0.0, roots)):
        _, bend = slope_and_curvature(work.cosine, work.sine, roots.roots[e, 0])
        away = abs(wrapped(roots.roots[e, 0] - x))
        if bend * like > 0.0 and away < least:
            least, found, there = away, roots.roots[e, 0], bend
    return found, there
