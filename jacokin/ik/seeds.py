"""Where solves start: the caller's seed moved inside the limits, then random configurations."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError
from jacokin.model.robot import Robot

Array = NDArray[np.float64]

FARTHEST_SEED = 1e6  # [rad] beyond this a double no longer resolves an angle to 1e-10 rad
DEFAULT_RANDOM_SEED = 0  # of the generator used when the caller brings none: results repeat


def seed_within_limits(robot: Robot, seed: ArrayLike | None, name: str = "seed") -> tuple[Array, str]:
    """The seed inside the limits, and a sentence when it had to be moved; home when there is none.

    A limited joint first takes a 2 pi copy inside its limits, then the nearer limit.

    Raises:
        InvalidInputError: wrong length, not finite, or more than 1e6 rad from zero.
    """
    if seed is None:
        return robot.home, ""
    q = robot.configuration(seed, name)
    if max(map(abs, q.tolist())) > FARTHEST_SEED:
        worst = int(np.argmax(np.abs(q)))
        raise InvalidInputError(
            f"{name}: {robot.joint_names[worst]} = {q[worst]:.6g} rad is too far from zero; use a copy within 1e6 rad"
        )
    if (q >= robot.lower).all() and (q <= robot.upper).all():
        return q, ""
    outside = np.flatnonzero((q < robot.lower) | (q > robot.upper))
    inside = q.copy()
    for joint in outside:
        copies = q[joint] + 2.0 * np.pi * np.array([-1.0, 1.0])
        fitting = copies[(copies >= robot.lower[joint]) & (copies <= robot.upper[joint])]
        inside[joint] = fitting[0] if fitting.size else np.clip(q[joint], robot.lower[joint], robot.upper[joint])
    names = ", ".join(robot.joint_names[joint] for joint in outside)
    return inside, f"the seed was outside the limits of {names} and was moved inside"


def starts(robot: Robot, first: list[Array], restarts: int, rng: np.random.Generator) -> Iterator[Array]:
    """The given configurations, then random ones within the limits; `1 + restarts` in all at most."""
    total = 1 + restarts
    yield from first[:total]
    lower = np.where(robot.unlimited, -np.pi, np.maximum(robot.lower, -1e3))
    upper = np.where(robot.unlimited, np.pi, np.minimum(robot.upper, 1e3))
    for _ in range(total - len(first)):
        yield rng.uniform(lower, upper)
