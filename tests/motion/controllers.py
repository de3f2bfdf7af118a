"""What controllers make of rows: straight lines, cubics that meet velocities, quintics that meet accelerations, too."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from jacokin.arrays import Array
from jacokin.motion import Trajectory

PARTS = np.linspace(0.0, 1.0, 21)  # of a step, at which it is looked at


def cubic(step: float, q: Array, v: Array) -> list[Polynomial]:
    """Of each joint, over seconds, from the two rows (2, dof) of a step."""
    matrix = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [1, step, step**2, step**3], [0, 1, 2 * step, 3 * step**2]])
    return [Polynomial(each) for each in np.linalg.solve(matrix, np.vstack([q[0], v[0], q[1], v[1]])).T]


def quintic(step: float, q: Array, v: Array, a: Array) -> list[Polynomial]:
    """As `cubic`, with accelerations."""
    powers = [step**k for k in range(6)]
    matrix = np.array(
        [
            [1, 0, 0, 0, 0, 0],
            [0, 1, 0, 0, 0, 0],
            [0, 0, 2, 0, 0, 0],
            powers,
            [0, *(k * powers[k - 1] for k in range(1, 6))],
            [0, 0, *(k * (k - 1) * powers[k - 2] for k in range(2, 6))],
        ]
    )
    return [Polynomial(each) for each in np.linalg.solve(matrix, np.vstack([q[0], v[0], a[0], q[1], v[1], a[1]])).T]


def check_as_controllers_go(result: Trajectory, acceleration: Array | float | None = None) -> None:
    """From rest to rest; velocity, position and, if given, acceleration limits hold from row to row."""
    assert not result.v[0].any()
    assert not result.v[-1].any()
    steps, limit = np.diff(result.t), result.velocity_limit
    assert (np.abs(np.diff(result.q, axis=0) / steps[:, None]) <= limit * (1 + 1e-9) + 1e-9).all()
    for row, step in enumerate(steps.tolist()):
        two = slice(row, row + 2)
        q, v, a = result.q[two], result.v[two], result.a[two]
        for curves in (cubic(step, q, v), quintic(step, q, v, a)):
            for joint, curve in enumerate(curves):
                at = PARTS * step
                assert np.abs(curve.deriv()(at)).max() <= limit[joint] * (1 + 1e-6) + 1e-8, (row, joint)
                assert curve(at).min() >= result.lower[joint] - 1e-6, (row, joint)
                assert curve(at).max() <= result.upper[joint] + 1e-6, (row, joint)
                if acceleration is not None:
                    most = 1.05 * float(np.broadcast_to(acceleration, limit.shape)[joint])
                    assert np.abs(curve.deriv(2)(at)).max() <= most, (row, joint)
