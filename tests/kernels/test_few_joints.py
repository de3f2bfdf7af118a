"""Joints that must stand at zero: least squares of the kernel against NumPy's, and rows that are kept."""

from __future__ import annotations

import numpy as np
import pytest

from jacokin.kernels.branches import DISTANCE, POSITION_ERROR, WITHIN_LIMITS
from jacokin.kernels.few_joints import fill_least_squares, make_few_work, take_few


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
    work = make_few_work()
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
    work.tolerances[:], work.counts[:], work.seed[:] = 1e-6, (3, 5, 5, 0, 0, 0), q
    work.rows[:3, :6] = q
    work.rows[0, 5] = 0.1  # not at zero
    work.rows[1, :5] += 1e-3  # led back
    work.rows[1, 5] = 1e-3
    work.rows[2, :5] += 0.6  # led elsewhere, or nowhere near the target
    work.rows[2, 5] = 0.02
    kept = take_few(work)
    assert kept >= 1
    np.testing.assert_allclose(work.rows[0, :6], q, atol=1e-9)
    assert work.rows[0, 5] == 0.0
    assert (work.rows[:kept, POSITION_ERROR] < 1e-6).all()


def test_rows_about_an_axis_are_nearest_first_and_within_the_range() -> None:
    """Of five joints and the angle about the axis; of four, the last one turns about the axis itself."""
    work = make_few_work()
    work.bounds[:, :5] = np.array([[-2.0], [2.0]])
    work.counts[:], work.range[:] = (3, 5, 6, 1, 0, 0), (-0.5, 0.5)
    for row, near, turned in zip(work.rows, (0.9, 0.2, 0.5), (2.0 * np.pi + 0.3, 0.6, -0.5), strict=False):
        row[:6], row[6:11] = [near, 0.0, 0.0, 0.0, 0.0, turned], 1.0
    assert take_few(work) == 3
    np.testing.assert_allclose(work.rows[:3, DISTANCE], [0.2, 0.5, 0.9])
    np.testing.assert_allclose(work.angles[:3], [0.5, -0.5, 0.3], atol=1e-15)
    assert work.rows[:3, WITHIN_LIMITS].tolist() == [0.0, 1.0, 1.0]
    assert (work.rows[:3, 5] == 0.0).all()

    for sign in (1, -1):
        work.counts[:], work.seed[:5] = (1, 4, 6, 1, sign, 0), (0.0, 0.0, 0.0, 0.0, 1.5)
        work.rows[0, :6], work.rows[0, 6:12] = [0.1, 0.0, 0.0, 0.0, 0.2, 0.0], 1.0
        assert take_few(work) == 1
        turned = 0.2 + sign * 1.5  # of the tool at the seed's last joint: as far out of the range as that moves
        np.testing.assert_allclose(work.angles[0], np.clip(turned, -0.5, 0.5))
        np.testing.assert_allclose(work.rows[0, 4], 1.5 - sign * (turned - work.angles[0]))
        np.testing.assert_allclose(work.rows[0, 10], 2.0 - abs(work.rows[0, 4]))
