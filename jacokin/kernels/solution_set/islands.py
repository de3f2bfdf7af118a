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
from jacokin.kernels.six_joints.loop import LABELLINGS, SPHERICAL_WRIST, fill_links
from jacokin.kernels.six_joints.spherical_wrist import fill_both_turns, fill_quartic, reach_of
from jacokin.kernels.solution_set.curve import wrapped
from jacokin.kernels.solution_set.slices import SixJoints, turn_target
from jacokin.kernels.tolerances import DISTINCT, UNCERTAIN

LOOKED_AT, MOST_FOUND, EXTREMA = 48, 128, 32
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
#: Newton's method for an extremum: steps, the largest one and the last one [rad]; and w of no extremum.
NEWTON_STEPS, LARGEST_MOVE, SAME_PLACE, NONE = 20, 0.1, 1e-11, -1e9


class Islands(NamedTuple):
    """Values of the parameter at which F is looked at, and what it takes."""

    p: Array  # (LOOKED_AT + MOST_FOUND,) evenly all round, then values found beside folds [rad]
    counts: NDArray[np.int64]  # (LOOKED_AT + MOST_FOUND,) roots of F at each; -1 where they are in doubt
    size: NDArray[np.int64]  # (3,) values found, places for which there was no room, values all round
    x: Array  # (LOOKED_AT, EXTREMA) extrema [rad]
    w: Array  # (LOOKED_AT, EXTREMA) [rad^2]
    slope: Array  # (LOOKED_AT, EXTREMA) dw / dp [rad]
    bend: Array  # (LOOKED_AT, EXTREMA) F''
    extrema: NDArray[np.int64]  # (LOOKED_AT,)
    roots: RootWork
    cosine: Array  # (9,) F
    sine: Array  # (9,)
    equations: Equations
    determinant: Determinant


def make_islands() -> Islands:
    """Fresh arrays."""
    many = (LOOKED_AT, EXTREMA)
    return Islands(
        np.empty(LOOKED_AT + MOST_FOUND),
        np.zeros(LOOKED_AT + MOST_FOUND, np.int64),
        np.zeros(3, np.int64),
        np.empty(many),
        np.empty(many),
        np.empty(many),
        np.empty(many),
        np.zeros(LOOKED_AT, np.int64),
        make_roots(),
        np.empty(DEGREE + 1),
        np.empty(DEGREE + 1),
        make_equations(),
        make_determinant(),
    )


def fill_F(k: ArmConstants, six: SixJoints, work: Islands, p: float, labelling: int) -> float:
    """Fill cosine and sine with the coefficients of F(x; p), up to a factor; returns the noise of its values.

    A general arm has an F in each labelling of its joints, and the same number of roots in all that suit it.
    """
    turn_target(six.T, six.axis, p, six.turned)
    if k.six.scale > 0.0:
        wrist = k.six.form == SPHERICAL_WRIST
        fill_links(
            six.chain, six.turned, k.six.scale, k.six.form_labelling if wrist else labelling, work.equations.links
        )
        if wrist:  # where the wrist is; each way of its own joints goes with one on the other side
            reach = reach_of(k.six, work.equations.links)
            if abs(reach.cross) < DISTINCT:
                return fill_both_turns(reach, work.cosine, work.sine)
            _, _, noise = fill_quartic(reach, work.cosine, work.sine)
            return noise
        write_equations(work.equations)
        return fourier_of_determinant(work.equations, work.determinant, work.cosine, work.sine)
    return fourier_of_F(k, pose_of(six.arm, k, six.turned), work.cosine, work.sine)


def fill_extrema(k: ArmConstants, six: SixJoints, work: Islands, i: int) -> float:
    """Fill extrema, x, w and slope of slice i; returns the noise of F."""
    p, x, w, roots = work.p[i], work.x[i], work.w[i], work.roots
    noise = fill_F(k, six, work, p, k.six.own)
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
    work.counts[i] = count_of(k, six, work, p, noise)
    fill_F(k, six, work, p + ASIDE, k.six.own)
    for e in range(found):
        value, _ = value_and_slope(work.cosine, work.sine, x[e])
        work.slope[i, e] = (-2.0 * value / work.bend[i, e] - w[e]) / ASIDE
    return noise


def find_islands(six: SixJoints, work: Islands) -> None:
    """Fill p and count, at even values all round and beside every fold that F shows between them."""
    k = unpack_arm(six.arm)
    work.size[0], work.size[1], work.size[2] = 0, 0, LOOKED_AT
    for i in range(LOOKED_AT):
        work.p[i] = wrapped(OFFSET + TURN * i / LOOKED_AT)
        fill_extrema(k, six, work, i)
    for i in range(LOOKED_AT):
        for e in range(work.extrema[i]):
            look_between(k, six, work, i, e)


def count_of(k: ArmConstants, six: SixJoints, work: Islands, p: float, noise: float) -> int:
    """How many roots F(x; p) has, of which the coefficients are at hand; -1 where there is doubt.

    Where two complex solutions have one real angle in common, F has a double root without a solution: in another
    labelling they have not.
    """
    count = count_single_roots(work, noise)
    if k.six.scale > 0.0 and k.six.form != SPHERICAL_WRIST:
        other = 1
        while count < 0 and other < LABELLINGS:
            count = count_single_roots(work, fill_F(k, six, work, p, (k.six.own + other) % LABELLINGS))
            other += 1
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


def look_between(k: ArmConstants, six: SixJoints, work: Islands, i: int, e: int) -> None:
    """Add a value next to slice i where an extremum that is below zero here comes to zero on the way to a neighbour."""
    x, w, slope = work.x[i, e], work.w[i, e], work.slope[i, e]
    step = TURN / LOOKED_AT
    if not w <= 0.0 or -w > SAFETY * abs(slope) * step:
        return
    side = 1 if slope > 0.0 else -1
    first = side * min(OVERSHOOT * abs(w / slope), step)
    p, w, noise = climb(k, six, work, work.p[i], side * step, w, x, first, work.bend[i, e])
    if w > -ONE_ROOT:  # or a point where F has a double root, and two solutions that are complex
        if work.size[0] < MOST_FOUND:
            work.p[LOOKED_AT + work.size[0]] = p
            work.counts[LOOKED_AT + work.size[0]] = count_of(k, six, work, p, noise)
            work.size[0] += 1
        else:
            work.size[1] += 1


def climb(
    k: ArmConstants, six: SixJoints, work: Islands, p: float, step: float, w: float, x: float, first: float, bend: float
) -> tuple[float, float, float]:
    """The peak of w of one extremum from p to p + step, or the first place on the way where w is positive.

    Args:
        k: constants of the six joints.
        six: those joints.
        work: F is left there.
        p: where to start [rad].
        step: how far to look, of either sign [rad].
        w: at p [rad^2].
        x: the extremum at p [rad].
        first: how far to look first [rad].
        bend: F'' there: of one sign as long as the extremum is between the same two roots.

    Returns:
        P and w there, and the noise of F.
    """
    low, high = p, p + step
    trial, noise = p + first, 0.0
    for _ in range(LOOKS):
        at, there, noise = at_extremum(k, six, work, trial, x, bend)
        if at > w:
            ahead = OVERSHOOT * abs(at / (at - w) * (trial - p))  # to zero, as w has risen so far
            low, p, w, x = p, trial, at, there
            trial = p + math.copysign(min(ahead, 0.5 * abs(high - p)), step)
        else:
            high, trial = trial, 0.5 * (p + low)
            at, there, noise = at_extremum(k, six, work, trial, x, bend)
            if at > w:
                high, p, w, x = p, trial, at, there
            else:
                low = trial
            trial = 0.5 * (p + high)
        if w > ONE_ROOT or abs(high - low) < CLOSE_ENOUGH:
            break
    return p, w, noise


def at_extremum(
    k: ArmConstants, six: SixJoints, work: Islands, p: float, x: float, like: float
) -> tuple[float, float, float]:
    """W and place of the extremum of F(x; p) nearest to x at which F'' has the sign of `like`, and the noise of F."""
    noise = fill_F(k, six, work, p, k.six.own)
    bend = like
    for _ in range(NEWTON_STEPS):
        slope, bend = slope_and_curvature(work.cosine, work.sine, x)
        if bend * like <= 0.0:
            break
        step = -slope / bend
        x += min(max(step, -LARGEST_MOVE), LARGEST_MOVE)
        if abs(step) < SAME_PLACE:
            break
    if bend * like <= 0.0:
        x, bend = nearest_extremum(work, noise, x, like)
        if bend == 0.0:
            return NONE, x, noise
    value, _ = value_and_slope(work.cosine, work.sine, x)
    return (0.0 if abs(value) <= noise else -2.0 * value / bend), x, noise


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
