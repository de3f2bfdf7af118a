"""Joints that must stand at zero: least squares of the kernel against NumPy's, and rows that are kept."""

from __future__ import annotations

import numpy as np
import pytest

from jacokin.kernels.branches import POSITION_ERROR
from jacokin.kernels.still_joints import fill_least_squares, make_still_work, stand_still


@pytest.mark.parametrize("columns", [3, 4, 5])
def test_least_squares_are_the_shortest(columns: int, rng: np.random.Generator) -> None:
    for scale in (1.0, 1e3):  # files in millimetres
        matrix, error = rng.normal(size=(6, columns)), rng.normal(size=6)
        matrix[:3] *= scale
        for singular in (False, True):
            if singular:
                matrix[:, -1] = 2.0 * matrix[:, 0]
            system, vectors, step = np.zeros((6, 7)), np.zeros((6, 6)), np.zeros(6)
            system[:, :columns], system[:, 6] = matrix, error
            fill_least_squares(system, columns, vectors, step)
            wanted = np.linalg.lstsq(matrix, error, rcond=None)[0]
            np.testing.assert_allclose(step[:columns], wanted, atol=1e-12 * max(1.0, np.abs(wanted).max()))


def test_rows_that_nearly_stand_are_led_to_the_target_and_others_dropped(rng: np.random.Generator) -> None:
    work = make_still_work()
    for placement in work.chain:
        placement[:, :3], placement[:, 3] = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.normal(size=3)
        placement[:, 0] *= np.linalg.det(placement[:, :3])
    q = np.append(rng.uniform(-2.0, 2.0, 5), 0.0)
    work.T[:] = np.eye(4)
    for placement, angle in zip(work.chain, [*q, None], strict=True):
        link = np.vstack([placement, [0.0, 0.0, 0.0, 1.0]])
        work.T[:] = work.T @ link
        if angle is not None:
            c, s = np.cos(angle), np.sin(angle)
            turn = np.eye(4)
            turn[:2, :2] = [[c, -s], [s, c]]
            work.T[:] = work.T @ turn
    work.tolerances[:], work.counts[:] = 1e-6, (3, 5, 5)
    work.rows[:3, :6] = q
    work.rows[0, 5] = 0.1  # not at zero
    work.rows[1, :5] += 1e-3  # led back
    work.rows[1, 5] = 1e-3
    work.rows[2, :5] += 0.6  # led elsewhere, or nowhere near the target
    work.rows[2, 5] = 0.02
    kept = stand_still(work)
    assert kept >= 1
    np.testing.assert_allclose(work.rows[0, :6], q, atol=1e-9)
    assert work.rows[0, 5] == 0.0
    assert (work.rows[:kept, POSITION_ERROR] < 1e-6).all()
