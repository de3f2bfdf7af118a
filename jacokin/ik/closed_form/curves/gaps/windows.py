"""Windows of joint 3 between two slices, in which configurations exist that no slice sees, or do not: they get a slice.

Joint 4 and joint 2 each exist where a discriminant is positive, a smooth function of joint 3. It is sampled more finely
than configurations are solved for, and where a maximum or minimum lies between samples, that is found.
"""

from __future__ import annotations

import math

from jacokin.arrays import Array
from jacokin.ik.closed_form.curves.seven import discriminant, wrist_from_shoulder
from jacokin.ik.closed_form.curves.slices import SLICES, Slices
from jacokin.ik.closed_form.kernels.vector import Vec

#: Samples from one slice to the next.
WINDOW_SAMPLES = 4
#: Steps towards a maximum; each takes a third off the bracket.
MAXIMUM_STEPS = 24
#: A minimum that the parabola through three samples puts above this share of the middle one is not looked at.
HIGH_MINIMUM = 0.2
#: [m^4] and [m^2]; a discriminant no more than this below zero leaves points on the chord across that close to 1e-11.
SHALLOW = 1e-13
#: [rad] values nearer to each other are one.
SAME_SLICE = 1e-9


def lower_discriminant(chain: Array, arm7: Array, D0: Vec, q3: float, sign: float) -> float:
    """The discriminant that decides: for joint 4 where that is negative, else for joint 2."""
    first, second = discriminant(chain, arm7, D0, q3, sign)
    return first if first < 0.0 else second


def find_maximum(chain: Array, arm7: Array, D0: Vec, low: float, high: float, sign: float) -> tuple[float, float]:
    """Where the discriminant is largest between low and high, and its value; given up where it is positive."""
    best, value = 0.5 * (low + high), -math.inf
    for _ in range(MAXIMUM_STEPS):
        a, b = low + (high - low) / 3.0, high - (high - low) / 3.0
        at_a, at_b = (
            lower_discriminant(chain, arm7, D0, a, sign),
            lower_discriminant(chain, arm7, D0, b, sign),
        )
        if at_a >= at_b:
            best, value, high = a, at_a, b
        else:
            best, value, low = b, at_b, a
        if value > 0.0:
            break
    return best, value


def insert_slice(slices: Slices, n: int, p: float) -> int:
    """Insert a value among the first n, in order; returns how many there are then."""
    if n == SLICES:
        return n
    i = n
    while i > 0 and slices.p[i - 1] > p:
        slices.p[i] = slices.p[i - 1]
        i -= 1
    slices.p[i] = p
    return n + 1


def add_windows(chain: Array, arm7: Array, T: Array, n: int, closed: bool, slices: Slices) -> int:
    """Add a slice in each window that none of the first n slices, evenly apart, lies in, and in each gap between two.

    Returns how many slices there are then.
    """
    D0 = wrist_from_shoulder(chain, arm7, T)
    first, step = slices.p[0], (slices.p[1] - slices.p[0]) / WINDOW_SAMPLES
    gaps = n if closed else n - 1
    total = n
    for k in range(2):
        sign = 1.0 if k == 0 else -1.0
        seen = False  # whether the window at hand has a slice
        peak, peak_at = -math.inf, 0.0
        before = lower_discriminant(chain, arm7, D0, first - step, sign) if closed else math.inf
        here = lower_discriminant(chain, arm7, D0, first, sign)
        for i in range(gaps * WINDOW_SAMPLES + 1):
            p = first + i * step
            after = lower_discriminant(chain, arm7, D0, p + step, sign)
            if here > 0.0:
                seen = seen or i % WINDOW_SAMPLES == 0
                if here > peak:
                    peak, peak_at = here, p
                if not after > 0.0:
                    if not seen:
                        total = insert_slice(slices, total, peak_at)
                    seen, peak = False, -math.inf
            elif here >= before and here >= after and i < gaps * WINDOW_SAMPLES:
                at, value = find_maximum(chain, arm7, D0, p - step, p + step, sign)
                if value > 0.0:
                    total = insert_slice(slices, total, at)
            before, here = here, after
    return add_dips(chain, arm7, D0, first, step, gaps * WINDOW_SAMPLES, total, slices)


def one_discriminant(chain: Array, arm7: Array, D0: Vec, q3: float, kind: int) -> float:
    """The discriminant of joint 4 for kind 0, of joint 2 with either sign of joint 4 for kinds 1 and 2."""
    first, second = discriminant(chain, arm7, D0, q3, -1.0 if kind == 2 else 1.0)
    return first if kind == 0 else second


def find_dip(chain: Array, arm7: Array, D0: Vec, low: float, high: float, kind: int) -> float:
    """Where a discriminant is negative, near its minimum between low and high; nan if it is not."""
    for _ in range(MAXIMUM_STEPS):
        a, b = low + (high - low) / 3.0, high - (high - low) / 3.0
        at_a, at_b = one_discriminant(chain, arm7, D0, a, kind), one_discriminant(chain, arm7, D0, b, kind)
        if min(at_a, at_b) < -SHALLOW:
            return a if at_a <= at_b else b
        if at_a <= at_b:
            high = b
        else:
            low = a
    return math.nan


def insert_new(slices: Slices, n: int, p: float) -> int:
    """As `insert_slice`, unless the value is there."""
    for i in range(n):
        if abs(slices.p[i] - p) < SAME_SLICE:
            return n
    return insert_slice(slices, n, p)


def add_dips(
    chain: Array, arm7: Array, D0: Vec, first: float, step: float, samples: int, total: int, slices: Slices
) -> int:
    """Add a slice where two configurations meet and part again, so that between there are none and no slice sees it.

    The slopes at the slices on both sides do not tell of it.

    Args:
        chain: (8, 3, 4).
        arm7: see `solve_at_q3`.
        D0: what `wrist_from_shoulder` returned.
        first: first sample of joint 3, at a slice [rad].
        step: from sample to sample, WINDOW_SAMPLES to a slice [rad].
        samples: how many.
        total: how many slices there are.
        slices: what they are added to.

    Returns:
        How many slices there are then.
    """
    for kind in range(3):
        seen, length, lowest = False, 0, 0.0  # of the run of samples that are not positive: whether it has a slice
        before = one_discriminant(chain, arm7, D0, first - step, kind)
        here = one_discriminant(chain, arm7, D0, first, kind)
        for i in range(samples):
            p = first + i * step
            after = one_discriminant(chain, arm7, D0, p + step, kind)
            if not here > 0.0:
                seen = (length > 0 and seen) or i % WINDOW_SAMPLES == 0
                length += 1
                lowest = min(lowest, here)
                if after > 0.0:
                    if not seen and lowest < -SHALLOW:
                        total = insert_new(slices, total, p - 0.5 * (length - 1) * step)
                    length, lowest = 0, 0.0
            elif here <= before and here <= after:
                bend = after + before - 2.0 * here
                if (after - before) * (after - before) > 8.0 * (1.0 - HIGH_MINIMUM) * here * bend:
                    at = find_dip(chain, arm7, D0, p - step, p + step, kind)
                    if at == at:
                        total = insert_new(slices, total, at)
            before, here = here, after
    return total
