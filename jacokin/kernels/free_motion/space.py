"""Configurations of a free motion: random ones, differences, and what is in contact at them and between them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import place_links
from jacokin.kernels.contact.motion import is_clear, look_at
from jacokin.kernels.contact.run import MARGIN_KEPT, SLACK, ContactWork, counts_of
from jacokin.kernels.contact.touching import Counts, find_touching

TURN = 2.0 * math.pi
#: Pairs of shapes that are remembered as being in the way.
HINDRANCES = 64
LOOKS = 6.0  # [1/rad] places on a motion that are looked at before it is certified
STRIDE = 4  # these are looked at in so many rounds, for neighbours touch the same
# MRG32k3a (L'Ecuyer: Good parameters and implementations for combined multiple recursive random number generators,
# 1999): nothing it computes leaves 64 bits, so that machine code and plain Python draw the same numbers.
FIRST_MODULUS, SECOND_MODULUS = 4294967087, 4294944443
UNIT = 1.0 / 4294967088.0


class Space(NamedTuple):
    """What configurations are, and what motions cost."""

    lower: Array  # (dof,) limits, infinite where there is none [rad]
    upper: Array  # (dof,)
    low: Array  # (dof,) where random ones lie [rad]
    high: Array  # (dof,)
    unlimited: NDArray[np.int64]  # (dof,) 1 where full turns make no difference
    speed: Array  # (dof,) velocity limits [rad/s]
    weights: Array  # (dof,) what a radian counts for the length of a motion
    levers: Array  # (dof,) how far a point can be from a joint's axis at most [m]


def make_space(dof: int) -> Space:
    """Fresh arrays."""
    lower, upper, low, high, speed, weights, levers = np.zeros((7, dof))
    return Space(lower, upper, low, high, np.zeros(dof, np.int64), speed, weights, levers)


class Hindrances(NamedTuple):
    """Pairs of shapes that ended a motion, and how often."""

    pairs: NDArray[np.int64]  # (HINDRANCES, 2)
    times: NDArray[np.int64]  # (HINDRANCES,) 0 where there is none


def uniform(generator: NDArray[np.int64]) -> float:
    """A random number in [0, 1); the generator's six numbers go on."""
    g = generator
    first = (1403580 * g[1] - 810728 * g[0]) % FIRST_MODULUS
    second = (527612 * g[5] - 1370589 * g[3]) % SECOND_MODULUS
    g[0], g[1], g[2] = g[1], g[2], first
    g[3], g[4], g[5] = g[4], g[5], second
    return float((first - second) % FIRST_MODULUS) * UNIT


def difference(space: Space, dof: int, a: Array, b: Array, step: Array) -> None:
    """Fill the step (dof,) from one configuration to another, unlimited joints the short way round [rad]."""
    for j in range(dof):
        step[j] = b[j] - a[j]
        if space.unlimited[j]:
            step[j] -= TURN * math.floor(step[j] / TURN + 0.5)


def length_of(space: Space, dof: int, step: Array) -> float:
    """Of a motion, a joint counting more that is slower [rad]."""
    total = 0.0
    for j in range(dof):
        total += (step[j] * space.weights[j]) ** 2
    return math.sqrt(total)


def time_of(space: Space, dof: int, step: Array) -> float:
    """Of a motion at full speed [s]."""
    most = 0.0
    for j in range(dof):
        most = max(most, abs(step[j]) / space.speed[j])
    return most


def is_free(contact: ContactWork, q: Array) -> bool:
    """Whether motions may pass a configuration (dof,); if not, the pair is left in `contact.course`."""
    counts = counts_of(contact)
    place_links(contact.geometry.arm, counts.dof, counts.groups, q, contact.places)
    return not is_near(contact, counts, 0.0)


def is_near(contact: ContactWork, counts: Counts, extra: float) -> bool:
    """Whether something is too near where all is placed for a motion to be certified; then the pair is left, too."""
    course, margin = contact.course, contact.numbers[MARGIN_KEPT] + contact.numbers[SLACK] + extra
    if find_touching(contact.geometry, counts, contact.places, contact.hits, margin, -math.inf, False):
        course.pair[0], course.pair[1] = contact.hits.pairs[0, 0], contact.hits.pairs[0, 1]
        return True
    return False


def seems_clear(contact: ContactWork, start: Array, end: Array, extra: float) -> bool:
    """Whether a straight motion between free configurations is clear wherever it is looked at, see `moves_clear`."""
    counts, course, longest = counts_of(contact), contact.course, 0.0
    for j in range(counts.dof):
        course.step[j] = end[j] - start[j]
        longest = max(longest, abs(course.step[j]))
    looks = int(longest * LOOKS)
    for first in range(STRIDE):
        for k in range(first, looks, STRIDE):
            look_at(contact.geometry, counts, contact.places, course, start, (k + 1.0) / (looks + 1.0))
            if is_near(contact, counts, extra):
                return False
    return True


def moves_clear(contact: ContactWork, start: Array, end: Array, extra: float) -> bool:
    """Whether a straight motion is clear with so much more margin [m]; if not, the pair is left in `contact.course`."""
    return seems_clear(contact, start, end, extra) and is_certain(contact, start, end, extra)


def is_certain(contact: ContactWork, start: Array, end: Array, extra: float) -> bool:
    """The same, without a look first, which finds contact sooner."""
    course = contact.course
    margin, slack = contact.numbers[MARGIN_KEPT] + extra, contact.numbers[SLACK]
    counts = counts_of(contact)
    for j in range(counts.dof):
        course.step[j] = end[j] - start[j]
    return is_clear(
        contact.geometry, counts, contact.places, contact.heap, contact.hits.pair, course, start, margin, slack
    )


def remember(hindrances: Hindrances, pair: NDArray[np.int64]) -> None:
    """Count a pair of shapes that is in the way."""
    for k in range(HINDRANCES):
        known = hindrances.times[k] > 0
        if known and (hindrances.pairs[k, 0] != pair[0] or hindrances.pairs[k, 1] != pair[1]):
            continue
        hindrances.pairs[k, 0], hindrances.pairs[k, 1] = pair[0], pair[1]
        hindrances.times[k] += 1
        return
