"""Joining slices of a seven-joint arm: the signs of joints 4, 2 and 6 tell which points belong together.

Where the slopes at both ends do not explain the way between them, closed-form points between them are tried before the
curve is followed step by step.
"""

from __future__ import annotations

import math

from jacokin.arrays import Array
from jacokin.ik.closed_form.curves.chain7 import tangent7
from jacokin.ik.closed_form.curves.follow import Walk, record
from jacokin.ik.closed_form.curves.seven import solve_at_q3
from jacokin.ik.closed_form.curves.slices import SevenJoints, wrapped

#: [rad] longest way in one joint between two slices that is joined without following the curve.
DIRECT_WAY = 0.6
#: Share of the way, and rest [rad], that the mean of both slopes may leave unexplained.
DIRECT_DEFECT, DIRECT_REST = 0.01, 1e-5
#: Parts of the way between two slices at most.
MOST_PARTS = 8


def explained(x: Array, t: Array, y: Array, u: Array, h: float, parameter: int) -> bool:
    """Whether the tangents t and u explain the way from point x to point y, h apart in the parameter."""
    way, defect = 0.0, 0.0
    for m in range(7):
        if m != parameter:
            d = wrapped(y[m] - x[m])
            way = max(way, abs(d))
            defect = max(defect, abs(d - 0.5 * h * (t[m] / t[parameter] + u[m] / u[parameter])))
    return defect <= DIRECT_REST + DIRECT_DEFECT * way and way <= DIRECT_WAY


def bridge(
    chain: Array,
    T: Array,
    seven: SevenJoints,
    label: int,
    ends: tuple[Array, Array, Array, Array],
    sign: float,
    low: float,
    high: float,
    traced: Array,
    first: int,
    walk: Walk,
) -> int:
    """Fill traced from row first with closed-form points between two slices, and the point of the second one.

    Args:
        chain: (8, 3, 4).
        T: (4, 4) target.
        seven: the arm.
        label: row of `solve_at_q3`.
        ends: point and tangent at both ends.
        sign: of the determinant at both ends.
        low: joint 3 at the first slice [rad].
        high: joint 3 at the second one [rad].
        traced: see `follow`.
        first: see above.
        walk: workspace.

    Returns:
        How many rows were filled; 0 where the points do not leave it certain that they are on one curve.
    """
    x, t, y, u = ends
    parts = 2
    while parts <= MOST_PARTS and first + parts <= traced.shape[0]:
        h = (high - low) / parts
        certain = True
        for n in range(1, parts + 1):
            row = traced[first + n - 1]
            if n < parts:
                solve_at_q3(chain, seven.arm, T, low + n * h, seven.rows)
                if math.isnan(seven.rows[label, 0]):
                    return 0
                for j in range(7):
                    walk.border[j] = 1.0 if j == 2 else 0.0
                if tangent7(chain, T, seven.rows[label], walk.border, walk.ty, walk.system) != sign:
                    return 0
                record(traced, first + n - 1, seven.rows[label], walk.ty, 0.0)
            else:
                record(traced, first + n - 1, y, u, 0.0)
            before = traced[first + n - 2]
            if not (
                explained(x, t, row[0:7], row[7:14], h, 2)
                if n == 1
                else explained(before[0:7], before[7:14], row[0:7], row[7:14], h, 2)
            ):
                certain = False
                break
        if certain:
            return parts
        parts *= 2
    return 0
