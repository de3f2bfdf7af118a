"""Angles of the (sin, cos) pairs that the arm's ``joints_pos`` reports."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks
from jacokin.model.angles import nearest_copy, wrap_to_turn


def angles_from_sin_cos(sin_cos: ArrayLike, near: ArrayLike | None = None) -> NDArray[np.float64]:
    """Return the joint angles of (sin, cos) pairs.

    A pair determines an angle up to full turns. The angle in [0, 2 pi) is returned, where the ranges of joints 2 and
    3 lie, and to which ``set_site_to_xpos`` wraps the joints without limits.

    Args:
        sin_cos: pairs (..., 2), sine first; pairs of another norm than 1 are allowed.
        near: angles (...) [rad]; each result is the one nearest to its own of these, up to full turns.

    Returns:
        Angles (...) [rad].

    Raises:
        InvalidInputError: a wrong shape, a value that is not finite, or a pair (0, 0), as in a buffer padded with
            zeros.
    """
    try:
        pairs = checks.numbers(sin_cos)
        reference = None if near is None else checks.numbers(near)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"sin_cos and near must be numbers: {error}") from None
    if pairs.ndim < 1 or pairs.shape[-1] != 2:
        raise InvalidInputError(f"sin_cos must have the shape (..., 2), got {pairs.shape}")
    if not np.isfinite(pairs).all():
        raise InvalidInputError("sin_cos must be finite")
    if not pairs.any(axis=-1).all():
        raise InvalidInputError("sin_cos contains a pair (0, 0), which has no angle")
    angles = np.arctan2(pairs[..., 0], pairs[..., 1])
    if reference is None:
        return wrap_to_turn(angles)
    if not np.isfinite(reference).all() or reference.shape != angles.shape:
        raise InvalidInputError(f"near must be finite angles of the shape {angles.shape}, got {shown(reference)}")
    return np.asarray(nearest_copy(angles, reference))
