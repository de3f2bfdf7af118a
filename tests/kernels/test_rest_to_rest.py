"""From rest to rest in whole ticks: the least sum by exhaustion, limits between ticks, Ruckig's durations."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from jacokin.arrays import Array
from jacokin.kernels.library import Call
from jacokin.kernels.rest_to_rest import (
    NEVER,
    RestInteger,
    RestWork,
    demands,
    fit_rest_to_rest,
    least_ticks,
    least_times,
    make_rest_work,
    meets,
)
from tests.kernels.plain import PlainCall

ROOM = 400  # rows


def random_work(rng: np.random.Generator) -> RestWork:
    """Some joints with limits of their own; every third time without limits of jerk."""
    dof = int(rng.integers(1, 5))
    work = make_rest_work(dof, ROOM)
    work.dt[0] = 10.0 ** rng.uniform(-2.0, 0.5)
    work.start[:] = rng.uniform(-3.0, 3.0, dof)
    work.end[:] = work.start + rng.uniform(-1.0, 1.0, dof) * 10.0 ** rng.uniform(-3.0, 0.5)
    limits = 10.0 ** rng.uniform([-1.0, -1.0, -1.0], [1.0, 1.5, 3.0], (dof, 3))
    if rng.random() < 0.33:
        limits[:, 2] = np.inf
    work.limits[:] = limits.ravel()
    return work


def least_time(work: RestWork) -> float:
    """[s]."""
    dt, sizes = float(work.dt[0]), np.abs(work.end - work.start)
    return dt * max(sum(least_times(*demands(size, work.limits, j, dt))) for j, size in enumerate(sizes.tolist()))


def rows_of(work: RestWork, ticks: int) -> tuple[Array, Array, Array]:
    """Angles, velocities and accelerations (n, dof)."""
    dof = len(work.start)
    q, v, a = (array[: (ticks + 1) * dof].reshape(-1, dof) for array in (work.q, work.v, work.a))
    return q, v, a


def test_whole_ticks_have_the_least_sum(rng: np.random.Generator) -> None:
    for _ in range(300):
        first = 10.0 ** rng.uniform(-1.0, 1.2)
        second = first * 10.0 ** rng.uniform(-1.0, 1.0)
        third = second * 10.0 ** rng.uniform(-1.0, 1.0)
        found = least_ticks(first, second, third)
        total = int(sum(found))
        assert found[0] >= found[1] >= found[2] >= 1.0
        assert meets(first, second, third, *found)
        assert total <= math.ceil(sum(least_times(first, second, third))) + 2
        for n3, n2 in itertools.product(range(1, total), repeat=2):
            n1 = total - 1 - n2 - n3
            if n1 >= n2 >= n3:
                assert not meets(first, second, third, n1, n2, n3)


def test_limits_hold_between_ticks(rng: np.random.Generator) -> None:
    tried = 0
    for _ in range(150):
        work = random_work(rng)
        ticks, dt = PlainCall(fit_rest_to_rest, work)(), float(work.dt[0])
        if ticks >= ROOM:
            continue
        tried += 1
        q, v, a = rows_of(work, ticks)
        velocity, acceleration, jerk = work.limits.reshape(-1, 3).T * (1.0 + 1e-9)
        change = np.diff(a, axis=0) / dt
        for part in np.linspace(0.0, 1.0, 11):
            t = part * dt
            speed = v[:-1] + t * (a[:-1] + 0.5 * t * change)
            place = q[:-1] + t * (v[:-1] + t * (0.5 * a[:-1] + t * change / 6.0))
            assert (np.abs(speed) <= velocity).all()
            assert (np.abs(a[:-1] + t * change) <= acceleration).all()
            assert (np.abs(place - work.start) <= np.abs(work.end - work.start) + 1e-14).all()
        np.testing.assert_allclose(speed, v[1:], atol=1e-10 * float(velocity.max()))
        np.testing.assert_allclose(place, q[1:], atol=1e-13)
        assert (np.abs(change) <= jerk * (1.0 + 1e-8)).all()
        assert (np.diff(q, axis=0) * np.sign(work.end - work.start) >= -1e-14).all()
        np.testing.assert_array_equal(q[0], work.start)
        np.testing.assert_array_equal(q[-1], work.end)
        assert not v[[0, -1]].any()
        assert not a[[0, -1]].any()
        assert least_time(work) / dt * (1.0 - 1e-9) <= ticks <= math.ceil(least_time(work) / dt) + 2
    assert tried > 60


def test_the_least_time_is_that_of_ruckig(rng: np.random.Generator) -> None:
    ruckig = pytest.importorskip("ruckig")
    for _ in range(100):
        work = random_work(rng)
        given = ruckig.InputParameter(len(work.start))
        given.current_position, given.target_position = work.start.tolist(), work.end.tolist()
        velocity, acceleration, jerk = work.limits.reshape(-1, 3).T
        given.max_velocity, given.max_acceleration = velocity.tolist(), acceleration.tolist()
        if np.isfinite(jerk).all():
            given.max_jerk = jerk.tolist()
        theirs = ruckig.Trajectory(len(work.start))
        ruckig.Ruckig(len(work.start)).calculate(given, theirs)
        assert least_time(work) == pytest.approx(theirs.duration, rel=1e-9)


def test_joints_of_the_same_limits_move_along_a_straight_line(rng: np.random.Generator) -> None:
    work = make_rest_work(3, ROOM)
    work.dt[0], work.end[:], work.limits[:] = 0.02, rng.uniform(-1.0, 1.0, 3), np.tile([0.6, 1.0, 5.0], 3)
    q, _, _ = rows_of(work, PlainCall(fit_rest_to_rest, work)())
    shares = q / work.end
    np.testing.assert_allclose(shares, np.tile(shares[:, :1], 3), atol=1e-14)


def test_joints_of_any_limits_move_along_a_straight_line_when_asked_to(rng: np.random.Generator) -> None:
    tried = 0
    for _ in range(50):
        work = random_work(rng)
        work.counts[RestInteger.STRAIGHT] = 1
        ticks, dt, moved = PlainCall(fit_rest_to_rest, work)(), float(work.dt[0]), work.end - work.start
        if ticks >= ROOM:
            continue
        tried += 1
        q, v, a = rows_of(work, ticks)
        shares = (q - work.start) / moved
        np.testing.assert_allclose(shares, np.tile(shares[:, :1], len(moved)), atol=1e-12)
        np.testing.assert_array_equal(q[[0, -1]], [work.start, work.end])
        assert (q == np.clip(q, np.minimum(work.start, work.end), np.maximum(work.start, work.end))).all()
        velocity, acceleration, jerk = work.limits.reshape(-1, 3).T * (1.0 + 1e-8)
        assert (np.abs(v) <= velocity).all()
        assert (np.abs(a) <= acceleration).all()
        assert (np.abs(np.diff(a, axis=0)) <= jerk * dt).all()
        line = make_rest_work(1, ROOM)
        line.dt[0], line.end[0], line.limits[:] = dt, 1.0, (work.limits.reshape(-1, 3).T / np.abs(moved)).min(axis=1)
        assert least_time(line) / dt * (1.0 - 1e-9) <= ticks <= math.ceil(least_time(line) / dt) + 2
    assert tried > 20


def test_machine_code_does_as_python_does(rng: np.random.Generator) -> None:
    for count in range(20):
        work = random_work(rng)
        work.counts[RestInteger.STRAIGHT] = count % 2
        ticks = PlainCall(fit_rest_to_rest, work)()
        plain = [array.copy() for array in work[-3:]]
        for array in work[-3:]:
            array[:] = 0.0
        assert Call(fit_rest_to_rest, work)() == ticks
        for one, other in zip(plain, work[-3:], strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("dt", [1e-300, 1e-30, 1e30, 1e300])
@pytest.mark.parametrize("distance", [5e-324, 1e-30, 1.0, 1e6])
def test_steps_of_extreme_size_are_counted_or_too_many(dt: float, distance: float) -> None:
    for compiled in (PlainCall, Call):
        work = make_rest_work(1, ROOM)
        work.dt[0], work.end[0], work.limits[:] = dt, distance, [0.6, 1.0, 5.0]
        ticks = compiled(fit_rest_to_rest, work)()
        assert ticks == NEVER or (ticks >= 3 and work.q[min(ticks, ROOM - 1)] in (0.0, distance))
        assert np.isfinite(work.q).all()
