"""Joint limits: copies (2-pi-equivalents) of angles within them, margins, joints held on a limit at a tangency."""

from __future__ import annotations

import math

from jacokin.arrays import Array
from jacokin.kernels.chain import Newton, errors, least_squares
from jacokin.kernels.tolerances import HELD_CLOSURE, TANGENCY_EXCESS
from jacokin.kernels.trigonometry import whole_below

TURN = 2.0 * math.pi
#: Gauss-Newton steps on the joints that are not held.
TANGENCY_STEPS = 4


def nearest_copy(angle: float, seed: float) -> float:
    """The copy of an angle nearest to the seed [rad]."""
    return angle + TURN * whole_below((seed - angle) / TURN + 0.5)


def copy_within_limits(angle: float, seed: float, lower: float, upper: float, snap: float) -> float:
    """The copy within [lower, upper] nearest to the seed; without one, the copy that breaks a limit least.

    Past a limit by at most ``snap`` [rad] is put on the limit.
    """
    q = nearest_copy(angle, seed)
    if q < lower - snap:
        q += TURN * math.ceil((lower - snap - q) / TURN)
    elif q > upper + snap:
        q -= TURN * math.ceil((q - upper - snap) / TURN)
    if q > upper + snap:
        if abs(lower - (q - TURN)) < q - upper:
            q -= TURN
    elif q < lower - snap and abs(q + TURN - upper) < lower - q:
        q += TURN
    if lower - snap <= q < lower:
        return lower
    if upper < q <= upper + snap:
        return upper
    return q


def fit_to_limits(q: Array, seed: Array, limits: Array, row: Array) -> tuple[float, bool]:
    """Fill row[0:6] with the copies of q and row[6:12] with their distance to the nearer limit.

    Args:
        q: (6,) any copy of each angle [rad].
        seed: (6,) the seed.
        limits: (3, 6) lower limits, upper limits, and the snap distance in each joint [rad].
        row: (12,) or longer, filled; distances are negative outside and inf for unlimited joints.

    Returns:
        Distance to the seed [rad], and whether every joint is within its limits, exactly.
    """
    total, within = 0.0, True
    for j in range(6):
        lower, upper = limits[0, j], limits[1, j]
        angle = copy_within_limits(q[j], seed[j], lower, upper, limits[2, j])
        margin = min(angle - lower, upper - angle)
        row[j] = angle
        row[6 + j] = margin
        within = within and lower <= angle <= upper
        difference = angle - seed[j]
        total += difference * difference
    return math.sqrt(total), within


def circular_distance(difference: float) -> float:
    """The size of a difference of angles, whole turns apart [rad]."""
    return abs(difference - TURN * whole_below(difference / TURN + 0.5))


def same_configuration(a: Array, b: Array, tolerance: float) -> bool:
    """Whether two configurations agree in every joint up to full turns [rad]."""
    for j in range(6):
        difference = a[j] - b[j]
        if circular_distance(difference) > tolerance:
            return False
    return True


def hold_on_limits(chain: Array, T: Array, limits: Array, row: Array, work: Newton) -> bool:
    """Whether a branch past its limits also reaches the pose within them, when joints are put on a limit.

    Near a fold, where two branches merge, joints are known only to the square root of rounding errors, and a branch
    that touches a limit may come out past it. Joints near a limit are put on it, in every combination, and the others
    solved for in the least-squares sense. A regular branch past its limits does not reach the pose that way.

    Args:
        chain: (7, 3, 4) placements.
        T: (4, 4) the target.
        limits: (3, 6), see `fit_to_limits`.
        row: (12,) or longer: the angles, and their distance to the nearer limit.
        work: work.q is filled with the angles found.
    """
    near = 0
    for j in range(6):
        if row[6 + j] < -TANGENCY_EXCESS:
            return False
        near |= (row[6 + j] < TANGENCY_EXCESS) << j
    for subset in range(1, 64):
        if subset & near != subset:
            continue
        for j in range(6):
            work.q[j], work.held[j] = row[j], 0.0
            if subset >> j & 1:
                work.held[j] = 1.0
                lower, upper = limits[0, j], limits[1, j]
                work.q[j] = lower if row[j] - lower < upper - row[j] else upper
        if not least_squares(chain, T, work, TANGENCY_STEPS):
            continue
        position, orientation = errors(chain, T, work.q)
        if max(position, orientation) < HELD_CLOSURE and snap_to_limits(work.q, limits):
            position, orientation = errors(chain, T, work.q)
            if max(position, orientation) < HELD_CLOSURE:
                return True
    return False


def snap_to_limits(q: Array, limits: Array) -> bool:
    """Put joints past a limit by no more than the snap distance on it, in place; False if one is farther out."""
    for j in range(6):
        if not limits[0, j] - limits[2, j] <= q[j] <= limits[1, j] + limits[2, j]:
            return False
        q[j] = min(max(q[j], limits[0, j]), limits[1, j])
    return True
