"""Windows of joint 3 between two slices, in which configurations exist that no slice sees: they get a slice.

Joint 4 and joint 2 each exist where a discriminant is positive, a smooth function of joint 3. It is sampled more finely
than configurations are solved for, and where its maximum lies between samples, that is found.
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
    """Add a slice in each window that none of the first n slices, evenly apart, lies in; returns how many there are."""
    D0 = wrist_from_shoulder(chain, arm7, T)
    first, step = slices.p[0], (slices.p[1] - slices.p[0]) / WINDOW_SAMPLES
    gaps = n if closed else n - 1
    total = n
    for k in range(2):
        sign = 1.0 if k == 0 else -1.0
        seen = False  # whether the window at hand has a slice
        peak, peak_at = -math.inf, 0.0
        before, here = -math.inf, lower_discriminant(chain, arm7, D0, first, sign)
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
            elif here >= before and here >= after and 0 < i < gaps * WINDOW_SAMPLES:
                at, value = find_maximum(chain, arm7, D0, p - step, p + step, sign)
                if value > 0.0:
                    total = insert_slice(slices, total, at)
            before, here = here, after
    return total
