"""Configurations of a free motion: random ones, differences, and how long motions between them take."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.limits import TURN

#: Pairs of shapes that are remembered as being in the way.
HINDRANCES = 64
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


def weigh(space: Space, dof: int) -> None:
    """Fill the weights: a joint counts more that is slower, and none as more than four times as fast as the slowest."""
    slowest, total = math.inf, 0.0
    for j in range(dof):
        slowest = min(slowest, space.speed[j])
    for j in range(dof):
        total += min(space.speed[j], 4.0 * slowest)
    for j in range(dof):
        space.weights[j] = total / dof / min(space.speed[j], 4.0 * slowest)


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


def remember(hindrances: Hindrances, pair: NDArray[np.int64]) -> None:
    """Count a pair of shapes that is in the way."""
    for k in range(HINDRANCES):
        known = hindrances.times[k] > 0
        if known and (hindrances.pairs[k, 0] != pair[0] or hindrances.pairs[k, 1] != pair[1]):
            continue
        hindrances.pairs[k, 0], hindrances.pairs[k, 1] = pair[0], pair[1]
        hindrances.times[k] += 1
        return
