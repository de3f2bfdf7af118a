"""Where solves and motions start: the caller's seed, moved inside the limits, where the arm is, and at random."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import angles, checks
from jacokin.model.angles import FARTHEST_SEED
from jacokin.model.robot import Robot, unit_of

ON_LIMIT = 1e-6  # [rad] or [m] past its limit, a joint is on it: rounding of files, degrees and single precision
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
    q = seed if checks.is_plain(seed, robot.dof) else robot.configuration(seed, name)
    lower, upper = robot.seed_limits
    if inside_exactly(lower, q.tolist(), upper):  # NaN is not
        return q, ""
    q = near_configuration(robot, q, name)
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
            f"{name}: {robot.joint_names[worst]} = {checked[worst]:.6g} {unit_of(robot, worst)} is too far from zero; "
            "use a value within 1e6"
        )
    return checked


def random_configurations(robot: Robot, size: int, rng: np.random.Generator) -> Array:
    """Configurations (size, dof) within the limits; joints limited on one side stay within 1e3 rad of zero."""
    lower = np.where(robot.unlimited, -np.pi, np.maximum(robot.lower, -1e3))
    upper = np.where(robot.unlimited, np.pi, np.minimum(robot.upper, 1e3))
    return rng.uniform(lower, upper, (size, robot.dof))


def checked_start(robot: Robot, q: ArrayLike | None, name: str = "q", *, outside: bool = False) -> Array:
    """A configuration (dof,) [rad] that the arm is in, or is to go to, read-only; None is home.

    A joint past its limit by at most `ON_LIMIT` is put on the limit. One that is farther out is refused, or left where
    it is with `outside`: an arm that is pushed there by hand still has to come back.

    Args:
        robot: the arm.
        q: (dof,) [rad].
        name: of the argument, for messages.
        outside: True for where the arm is, False for where it is to go.

    Raises:
        InvalidInputError: malformed, outside the limits, or more than 1e6 rad from zero.
    """
    if q is None:
        return robot.home
    found = near_configuration(robot, q, name)
    lower, upper = robot.limit_values
    if inside_exactly(lower, found.tolist(), upper):
        return checks.read_only(found)
    inside = np.clip(found, robot.lower, robot.upper)
    away = np.abs(found - inside)
    joint = int(np.argmax(away))
    if away[joint] <= ON_LIMIT:
        return checks.read_only(inside)
    if outside:
        return checks.read_only(np.where(away <= ON_LIMIT, inside, found))
    unit = unit_of(robot, joint)
    raise InvalidInputError(
        f"{name} puts {robot.joint_names[joint]} at {found[joint]:.17g} {unit}, outside "
        f"[{robot.lower[joint]:.17g}, {robot.upper[joint]:.17g}] {unit}"
    )


def choose_start(robot: Robot, seed: ArrayLike | None, start: ArrayLike | None) -> tuple[Array, str]:
    """Where a path should begin, near `seed`, or begins, at `start`; and a sentence when a seed was moved.

    Joints of `start` may be outside the limits, where they are left.

    Raises:
        InvalidInputError: both are given, or one is malformed.
    """
    if start is None:
        return seed_within_limits(robot, seed)
    if seed is not None:
        raise InvalidInputError("give at most one of seed and start")
    return checked_start(robot, start, "start", outside=True), ""


def describe_jump(robot: Robot, away: Array, name: str) -> str:
    """Where a path starts, for (dof,) distances [rad, m] from a place with a name; "" when it starts there."""
    joint = int(np.argmax(away))
    if away[joint] <= 1e-3:  # [rad] a start this near to the seed is not worth a word
        return ""
    far = f"{away[joint]:.3g} {unit_of(robot, joint)} ({robot.joint_names[joint]})"
    return f"it starts {far} from {name}: bring the arm to q[0] first"
