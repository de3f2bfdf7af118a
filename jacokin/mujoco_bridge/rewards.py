"""Rewards between 0 and 1: whether a number is where it should be, or how far from there it is.

The shapes and their names are those of dm_control's `rewards.tolerance`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks

VALUE_AT_MARGIN = 0.1


# Each is 1 at d = 0 and `value` at d = 1. The first five never reach 0.
SHAPES: Mapping[str, Callable[[Array, float], Array]] = {
    "gaussian": lambda d, value: np.exp(d**2 * np.log(value)),
    "hyperbolic": lambda d, value: 1.0 / np.cosh(d * np.arccosh(1.0 / value)),
    "long_tail": lambda d, value: 1.0 / (1.0 + d**2 * (1.0 / value - 1.0)),
    "reciprocal": lambda d, value: 1.0 / (1.0 + d * (1.0 / value - 1.0)),
    "tanh_squared": lambda d, value: 1.0 - np.tanh(d * np.arctanh(np.sqrt(1.0 - value))) ** 2,
    "cosine": lambda d, value: 0.5 * (1.0 + np.cos(np.minimum(d * np.arccos(2.0 * value - 1.0), np.pi))),
    "linear": lambda d, value: np.clip(1.0 - d * (1.0 - value), 0.0, 1.0),
    "quadratic": lambda d, value: np.clip(1.0 - d**2 * (1.0 - value), 0.0, 1.0),
}
_REACH_ZERO = ("cosine", "linear", "quadratic")


def fall_beyond(excess: Array, margin: float, sigmoid: str, value_at_margin: float = VALUE_AT_MARGIN) -> Array:
    """`tolerance` of checked arrays (...) that say how far something is beyond its bounds, negative within them.

    One simulation gets the same bits as the rows of many: also a single number is computed as an array, because NumPy
    rounds the powers of numbers differently.
    """
    distance = np.atleast_1d(np.maximum(excess, 0.0) / margin)
    return SHAPES[sigmoid](distance, value_at_margin).reshape(np.shape(excess))


def tolerance(
    x: ArrayLike,
    bounds: tuple[float, float] = (0.0, 0.0),
    margin: float = 0.0,
    sigmoid: str = "gaussian",
    value_at_margin: float = VALUE_AT_MARGIN,
) -> float | Array:
    """1 where x is within the bounds; outside, a value that falls with the distance from them.

    Args:
        x: a number, or an array of any shape.
        bounds: lower and upper bound, which belong to the interval; they may be infinite or equal.
        margin: distance from the bounds at which the value is `value_at_margin`, in the unit of x; with 0 the value is
            0 everywhere outside the bounds.
        sigmoid: how the value falls: "gaussian", "hyperbolic", "long_tail", "reciprocal", "tanh_squared", "cosine",
            "linear" or "quadratic".
        value_at_margin: between 0 and 1; 0 itself for "cosine", "linear" and "quadratic" only.

    Returns:
        Values in 0..1 of the shape of x; a float for a number. NaN gives NaN.

    Raises:
        UnknownNameError: no such sigmoid; lists the valid ones.
        InvalidInputError: another argument is wrong.
    """
    try:
        values = checks.numbers(x)
        lower, upper = checks.numbers(bounds).tolist()
    except (TypeError, ValueError) as error:
        raise InvalidInputError(
            f"x must be numbers and bounds two of them, got {checks.shown(x)} and {checks.shown(bounds)}"
        ) from error
    if not lower <= upper:
        raise InvalidInputError(f"bounds must be (lower, upper) with lower <= upper, got {shown(bounds)}")
    width = checks.non_negative("margin", margin)
    shape = SHAPES[checks.choice("sigmoid", sigmoid, SHAPES)]
    value = checks.number("value_at_margin", value_at_margin)
    if not (0.0 < value < 1.0 or (value == 0.0 and sigmoid in _REACH_ZERO)):
        raise InvalidInputError(
            f"value_at_margin must be above 0 and below 1, or 0 for {', '.join(_REACH_ZERO)}; "
            f"got {shown(value_at_margin)}"
        )
    with np.errstate(over="ignore", invalid="ignore"):  # far away, the squares are infinite and the values 0
        distance = np.where(values < lower, lower - values, np.where(values > upper, values - upper, 0.0 * values))
        distance = np.where((lower <= values) & (values <= upper), 0.0, distance)
        if width == 0.0:
            result = np.where(np.isnan(distance), np.nan, distance == 0.0)
        else:
            result = np.where(distance == 0.0, 1.0, shape(distance / width, value))
    return float(result) if np.ndim(x) == 0 else np.asarray(result)
