"""What controllers make of rows: straight lines, cubics that meet velocities, quintics that meet accelerations, too."""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array
from jacokin.motion import Trajectory

PARTS = np.linspace(0.0, 1.0, 21)  # of a step, at which it is looked at


def interpolated(t: Array, rows: tuple[Array, ...], derivative: int = 0) -> Array:
    """(n - 1, 21, dof) values along each step of the polynomial that meets derivatives (n, dof) at both its ends.

    Args:
        t: (n,) times of the rows [s].
        rows: positions, velocities and, for quintics, accelerations (n, dof).
        derivative: 0 for positions, 1 for velocities, 2 for accelerations.
    """
    steps, order = np.diff(t), 2 * len(rows)
    matrix = np.zeros((len(steps), order, order))
    for k in range(len(rows)):
        for power in range(k, order):
            factor = float(np.prod(np.arange(power - k + 1, power + 1)))
            matrix[:, k, power] = factor * (power == k)
            matrix[:, len(rows) + k, power] = factor * steps ** (power - k)
    ends = np.concatenate([np.stack([each[:-1] for each in rows]), np.stack([each[1:] for each in rows])])
    factors = np.linalg.solve(matrix, ends.swapaxes(0, 1))
    at = steps[:, None] * PARTS
    found = np.zeros((len(steps), len(PARTS), rows[0].shape[1]))
    for power in range(derivative, order):
        factor = float(np.prod(np.arange(power - derivative + 1, power + 1)))
        found += factor * at[:, :, None] ** (power - derivative) * factors[:, power, None]
    return found


def check_as_controllers_go(result: Trajectory, acceleration: Array | float | None = None) -> None:
    """From rest to rest; velocity, position and, if given, acceleration limits hold from row to row."""
    assert not result.v[0].any()
    assert not result.v[-1].any()
    limit = result.velocity_limit
    assert (np.abs(np.diff(result.q, axis=0) / np.diff(result.t)[:, None]) <= limit * (1 + 1e-9) + 1e-9).all()
    for rows in ((result.q, result.v), (result.q, result.v, result.a)):
        at = interpolated(result.t, rows)
        assert (at >= result.lower - 1e-6).all()
        assert (at <= result.upper + 1e-6).all()
        assert (np.abs(interpolated(result.t, rows, 1)) <= limit * (1 + 1e-6) + 1e-8).all()
        if acceleration is not None:
            assert (np.abs(interpolated(result.t, rows, 2)) <= 1.05 * np.asarray(acceleration)).all()
