"""Checking actions: once, at the border of the environments."""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks


def bounded(action: object, lower: Array, upper: Array) -> Array:
    """An action within its bounds, as a new array; values beyond them are put on them.

    Args:
        action: what a user gave.
        lower: lower bounds, of any shape.
        upper: upper bounds.

    Raises:
        InvalidInputError: wrong shape, not real numbers, or NaN.
    """
    values = _as_array(action)
    if values.shape != lower.shape or values.dtype.kind not in "fiu":
        raise InvalidInputError(
            f"action must be numbers of shape {lower.shape}, got shape {values.shape} and dtype {values.dtype}"
        )
    found = np.asarray(np.minimum(np.maximum(values, lower), upper), dtype=np.float64)
    total = float(found.sum())
    if total != total:  # NaN; infinite values are bounded
        raise InvalidInputError(f"action must not be NaN, got {checks.shown(values)}")
    return found


def _as_array(action: object) -> np.ndarray:
    if type(action) is np.ndarray:
        return action
    try:
        return checks.numbers(action)  # type: ignore[arg-type]  # `numbers` checks
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"action must be an array of numbers, got {checks.shown(action)}: {error}") from error
