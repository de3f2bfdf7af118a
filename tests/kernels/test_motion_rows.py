"""Rows of motions: configurations where a course is, averages as NumPy has them, and what steps could pass."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from jacokin.arrays import Array
from jacokin.kernels.library import Call
from jacokin.kernels.motion_rows import (
    average_rows,
    look_between,
    make_average_work,
    make_between_work,
    make_sample_work,
    sample_course,
)
from jacokin.motion.free_motion.timed_course import fit_time
from tests.kernels.plain import PlainCall

DT = 0.01  # [s]
LEVERS = np.array([1.0, 0.5])  # [m]


@pytest.mark.parametrize("corners", [0, 1, 5])
def test_a_course_is_sampled_where_it_is_at_each_time(rng: np.random.Generator, corners: int) -> None:
    way = np.cumsum(rng.normal(size=(corners + 2, 6)), axis=0)
    lengths = np.abs(np.diff(way, axis=0)).max(axis=1)
    cuts = np.array([0.0, *0.4 * np.minimum(lengths[:-1], lengths[1:]), 0.0])
    cuts[2:3] = 0.0  # one corner is a stop
    timed = fit_time(way, cuts, np.ones(6), np.ones(6), np.ones(6))
    places, work = len(timed.t), make_sample_work(6, 701, len(timed.t))
    work.begins[: len(timed.begins)], work.piece[:] = timed.begins, timed.piece
    work.t[:], work.s[:], work.speed[:], work.span[0] = timed.t, timed.s, timed.speed, timed.duration
    for array, values in ((work.at, timed.q), (work.slope, timed.slope), (work.bend, timed.bend)):
        array[: values.size] = values.ravel()
    work.lower[:], work.upper[:] = way.min(axis=0), way.max(axis=0)
    for steps in (1, 2, 700):
        work.counts[:] = 6, steps + 1, places
        assert sample_course(work) == steps + 1
        found = work.q[: 6 * (steps + 1)].reshape(-1, 6)
        assert (way.min(axis=0) <= found).all()
        assert (found <= way.max(axis=0)).all()
        np.testing.assert_allclose(found, timed.at(np.linspace(0.0, timed.duration, steps + 1))[0], rtol=0, atol=1e-13)


def averages(taken: Array, ticks: int) -> tuple[Array, Array, Array]:
    """Rows of the spline, from the averages themselves."""
    still = [np.repeat(taken[end], 2 * ticks + 2, axis=0) for end in (slice(0, 1), slice(-1, None))]
    padded = np.concatenate([still[0], taken, still[1]])
    points = np.array([padded[k : k + ticks].mean(axis=0) for k in range(len(padded) - ticks + 1)])
    before, here, after = (points[ticks + 2 + k : len(points) - ticks - 2 + k] for k in (-1, 0, 1))
    return (before + 4.0 * here + after) / 6.0, (after - before) / (2.0 * DT), (after - 2.0 * here + before) / DT**2


@pytest.mark.parametrize("form", [Call, PlainCall])
@pytest.mark.parametrize("ticks", [1, 2, 9])
def test_rows_are_those_of_averages(rng: np.random.Generator, form: Any, ticks: int) -> None:
    for count in (2, 3, 40):
        taken = np.cumsum(rng.normal(size=(count, 2)) * DT**2, axis=0).cumsum(axis=0)
        more = count + ticks + 1
        work = make_average_work(2, more + 3)  # with more room than it takes
        work.counts[:], work.dt[0], work.taken[: 2 * count] = (2, count, ticks), DT, taken.ravel()
        assert form(average_rows, work)() == more
        rows = [each[: 2 * more].reshape(more, 2) for each in (work.q, work.v, work.a)]
        for found, expected in zip(rows, averages(taken, ticks), strict=True):
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(rows[0][[0, -1]], taken[[0, -1]])
        assert (rows[0] >= taken.min(axis=0)).all()
        assert (rows[0] <= taken.max(axis=0)).all()


@pytest.mark.parametrize("form", [Call, PlainCall])
def test_steps_that_could_pass_a_limit_are_seen(form: Any) -> None:
    """An acceleration of 2 rad/s^2 leaves the line by a quarter of the square of the step."""
    q, a = np.array([[0.0, 0.0], [0.1, 0.0], [0.2, 0.0]]), np.array([[0.0, 2.0], [0.0, 0.0], [0.0, 0.0]])
    for above, beyond in ((0.3 * DT**2, []), (0.2 * DT**2, [0]), (-1e-6, [0, 1])):
        work = make_between_work(2, 3)
        work.counts[:], work.dt[0], work.q[:], work.a[:] = (2, 3), DT, q.ravel(), a.ravel()
        work.lower[:], work.upper[:], work.levers[:] = [0.0, -1.0], [0.2, above], LEVERS
        assert work.beyond[: form(look_between, work)()].tolist() == beyond
        np.testing.assert_allclose(work.reach[:2], [0.5 * 0.25 * DT**2, 0.0], rtol=1e-12)
