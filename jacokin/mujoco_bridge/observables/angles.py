"""From the (sin, cos) pairs that the arm's ``joints_pos`` reports back to angles."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError

TURN = 2.0 * np.pi  # [rad]


def angles_from_sin_cos(sin_cos: ArrayLike, near: ArrayLike | None = None) -> NDArray[np.float64]:
    """Return the joint angles of (sin, cos) pairs.

    A pair tells an angle up to full turns. The angle in [0, 2 pi) is returned: there lie the
    limited ranges of joints 2 and 3, and there ``set_site_to_xpos`` puts the free joints.

    Args:
        sin_cos: pairs (..., 2), sine first; their common length does not matter.
        near: angles (...) [rad]; each angle is returned in the copy nearest to its own.

    Returns:
        Angles (...) [rad].

    Raises:
        InvalidInputError: a wrong shape, a value that is not finite, or a pair (0, 0), which is
            what a buffer padded with zeros holds.
    """
    try:
        pairs = np.asarray(sin_cos, dtype=np.float64)
        reference = None if near is None else np.asarray(near, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"sin_cos and near must be numbers: {error}") from None
    if pairs.ndim < 1 or pairs.shape[-1] != 2:
        raise InvalidInputError(f"sin_cos must have the shape (..., 2), got {pairs.shape}")
    if not np.isfinite(pairs).all():
        raise InvalidInputError("sin_cos holds values that are not finite")
    if not pairs.any(axis=-1).all():
        raise InvalidInputError("sin_cos holds a pair (0, 0), which is no angle")
    angles = np.arctan2(pairs[..., 0], pairs[..., 1])
    if reference is None:
        wrapped = np.mod(angles, TURN)
        return np.asarray(np.where(wrapped >= TURN, 0.0, wrapped))  # the remainder of -1e-17 rounds to 2 pi
    if not np.isfinite(reference).all() or reference.shape != angles.shape:
        raise InvalidInputError(f"near must be finite angles of the shape {angles.shape}, got {reference!r}")
    return np.asarray(angles + TURN * np.round((reference - angles) / TURN))
