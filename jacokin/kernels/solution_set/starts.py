"""From a point beside a curve to the curve, by the least steps that reach the target."""

from __future__ import annotations

from jacokin.arrays import Array
from jacokin.kernels.chain import Newton, linearise7, solve_normal
from jacokin.kernels.solution_set.curve import LARGEST_RESIDUAL, RESIDUAL, Walk
from jacokin.kernels.tolerances import SMALLEST_PIVOT

#: [m] and [rad] a start misses the target by less, and [rad] is no farther from a curve.
NEARBY, FARTHEST_START = 0.02, 0.2
#: Steps from a start to a curve at most: most take five, those to a solution that is all alone up to a hundred.
STARTING_STEPS = 150
#: So many steps one after another that by their equations leave this part of what is missing are the last ones: it is
#: least there, and not zero.
STUCK_STEPS, STUCK = 3, 0.999


def bring_to_curve(start: Array, newton: Newton, walk: Walk) -> bool:
    """Fill walk.z with the point of a curve that a start nearby leads to; False for none."""
    for j in range(7):
        walk.z[j] = start[j]
    if not linearise7(walk.chain, walk.T, walk.z, walk.system) <= NEARBY:  # NaN for no start
        return False
    missing, moved = descend(newton, walk), 0.0
    for j in range(7):
        moved = max(moved, abs(walk.z[j] - start[j]))
    return bool(moved <= FARTHEST_START and missing <= LARGEST_RESIDUAL)


def descend(newton: Newton, walk: Walk) -> float:
    """Bring walk.z to where it reaches the target; returns what is missing [m and rad].

    By the least steps that reach the target (Levenberg and Marquardt), damped by the square of what is missing, which
    the squares of small singular values come near to where solutions meet: each step takes three quarters of that away
    there, and elsewhere the number of digits doubles (Yamashita and Fukushima, 2001).
    """
    x, system, normal = walk.z, walk.system, newton.normal
    missing, stuck = linearise7(walk.chain, walk.T, x, system), 0
    for _ in range(STARTING_STEPS):
        if missing <= RESIDUAL:
            break
        damping = max(missing * missing, SMALLEST_PIVOT)
        fill_steps(system, damping, normal)
        if not solve_normal(normal):
            break
        left, square = 0.0, 0.0
        for i in range(6):
            left += normal[i, 6] * normal[i, 6]
            square += system[i, 7] * system[i, 7]
        stuck = stuck + 1 if damping * damping * left > STUCK * STUCK * square else 0
        if stuck == STUCK_STEPS:
            break
        for j in range(7):
            for i in range(6):
                x[j] += system[i, j] * normal[i, 6]
        missing = linearise7(walk.chain, walk.T, x, system)
    return missing


def fill_steps(system: Array, damping: float, normal: Array) -> None:
    """Fill normal (6, 7) with the equations of the least step that takes away what system (7, 8) says is missing."""
    for i in range(6):
        for k in range(i, 6):
            product = 0.0
            for j in range(7):
                product += system[i, j] * system[k, j]
            normal[i, k] = product
        normal[i, i] += damping
        normal[i, 6] = system[i, 7]
