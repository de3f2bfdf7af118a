"""Checks of the numbers that tracking and joint motion take."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.model.robot import Robot

Array = NDArray[np.float64]
Item = TypeVar("Item")


def positive(name: str, value: float, unit: str) -> float:
    """A positive, finite number, or an error that names it."""
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float | np.number)
        or not np.isfinite(value)
        or value <= 0
    ):
        raise InvalidInputError(f"{name} must be a positive number [{unit}], got {value!r}")
    return float(value)


def limits(name: str, value: ArrayLike, dof: int, unit: str = "rad/s^2") -> Array:
    """Positive limits, one for all joints or one for each."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{name} must be one number or {dof} [{unit}], got {value!r}") from error
    if array.ndim == 0:
        array = np.full(dof, array)
    array = checks.vector(name, array, dof, unit)
    if not (array > 0.0).all():
        raise InvalidInputError(f"{name} must be positive [{unit}], got {array.tolist()}")
    return checks.read_only(array)


def velocity_limits(robot: Robot, value: ArrayLike | None) -> Array:
    """The given limits, or the robot's own; refuses joints without any.

    Raises:
        InvalidInputError: malformed or not positive, or the robot's file (MJCF has no such field) gives none.
    """
    if value is not None:
        return limits("velocity_limit", value, robot.dof, "rad/s")
    missing = [
        name for name, limit in zip(robot.joint_names, robot.velocity_limit, strict=True) if not np.isfinite(limit)
    ]
    if missing:
        raise InvalidInputError(
            f"the description of {robot.name} gives no velocity limits for {', '.join(missing)}; "
            "pass velocity_limit= [rad/s]"
        )
    return limits("velocity_limit", robot.velocity_limit, robot.dof, "rad/s")


def number(name: str, value: float, unit: str) -> float:
    """A finite number >= 0, or an error that names it."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not np.isfinite(value) or value < 0:
        raise InvalidInputError(f"{name} must be finite and >= 0 [{unit}], got {value!r}")
    return float(value)


def listed(name: str, items: Iterable[Item]) -> tuple[Item, ...]:
    """The items of a list, or an error that names what should have been one."""
    try:
        return tuple(items)
    except TypeError:
        raise InvalidInputError(f"{name} must be a list, got {type(items).__name__}") from None
