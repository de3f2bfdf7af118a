"""Where solves start: the caller's seed, moved inside the limits, and random configurations."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import angles
from jacokin.model.robot import Robot

FARTHEST_SEED = 1e6  # [rad] beyond this a double no longer resolves an angle to 1e-10 rad
DEFAULT_RANDOM_SEED = 0  # of the generator used when the caller brings none: results repeat


def seed_within_limits(robot: Robot, seed: ArrayLike | None, name: str = "seed") -> tuple[Array, str]:
    """The seed inside the limits, and a sentence when it had to be moved; home when there is none.

    A joint that turns takes the copy inside its limits, any number of turns away; without one, the nearer limit. With
    more than a turn of travel it takes the nearer limit: the copies nearest to that are those nearest to the seed.

    Raises:
        InvalidInputError: wrong length, not finite, or more than 1e6 rad from zero.
    """
    if seed is None:
        return robot.home, ""
    q = near_configuration(robot, seed, name)
    if inside_exactly(robot.lower.tolist(), q.tolist(), robot.upper.tolist()):
        return q, ""
    outside = np.flatnonzero((q < robot.lower) | (q > robot.upper))
    inside = np.clip(q, robot.lower, robot.upper)
    turning = ~robot.sliding & (robot.upper - robot.lower < angles.TURN)
    inside[turning] = angles.into_limits(q[turning], robot.lower[turning], robot.upper[turning])
    names = ", ".join(robot.joint_names[joint] for joint in outside)
    return inside, f"the seed was outside the limits of {names} and was moved inside"


def inside_exactly(lower: list[float], q: list[float], upper: list[float]) -> bool:
    """Whether every joint is inside its limits; of plain floats, which for a few joints is faster than NumPy."""
    for low, value, high in zip(lower, q, upper, strict=True):  # noqa: SIM110 - all() takes three times as long
        if not low <= value <= high:
            return False
    return True


def near_configuration(robot: Robot, q: ArrayLike, name: str) -> Array:
    """A configuration (dof,) [rad] whose angles a double still resolves; within the limits or not.

    Raises:
        InvalidInputError: wrong length, not finite, or more than 1e6 rad from zero.
    """
    checked = robot.configuration(q, name)
    if max(map(abs, checked.tolist())) > FARTHEST_SEED:
        worst = int(np.argmax(np.abs(checked)))
        raise InvalidInputError(
            f"{name}: {robot.joint_names[worst]} = {checked[worst]:.6g} rad is too far from zero; "
            "use a copy within 1e6 rad"
        )
    return checked


def random_configurations(robot: Robot, size: int, rng: np.random.Generator) -> Array:
    """Configurations (size, dof) within the limits; joints limited on one side stay within 1e3 rad of zero."""
    lower = np.where(robot.unlimited, -np.pi, np.maximum(robot.lower, -1e3))
    upper = np.where(robot.unlimited, np.pi, np.minimum(robot.upper, 1e3))
    return rng.uniform(lower, upper, (size, robot.dof))
