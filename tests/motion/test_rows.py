"""Rows as controllers take them: one motion however they interpolate, within limits, and no contact between them."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import Box, Scene
from jacokin.kernels.motion_rows import average_rows, make_average_work, ticks_averaged
from jacokin.model.contact import contact_of_nothing
from jacokin.motion import Trajectory, plan_motion
from jacokin.motion.rows import (
    OnTheWay,
    Rows,
    averaged_rows,
    halved,
    joined,
    most_between,
    sample,
    spline_rows,
    standing,
)
from jacokin.motion.timing import steps_of
from tests.motion.controllers import PARTS, check_as_controllers_go, interpolated

DT = 0.01  # [s]


def test_rows_are_those_of_the_spline_from_rest_to_rest(rng: np.random.Generator) -> None:
    for count in (2, 3, 4, 50):
        q = np.cumsum(rng.normal(size=(count, 3)), axis=0)
        rows = spline_rows(q, DT)
        if count > 3:
            spline = CubicSpline(rows.t, q, bc_type=((1, np.zeros(3)), (1, np.zeros(3))))
            np.testing.assert_allclose(rows.v, spline(rows.t, 1), atol=1e-9)
            np.testing.assert_allclose(rows.a, spline(rows.t, 2), atol=1e-7)
        assert not rows.v[[0, -1]].any()
        for derivative, atol in ((0, 1e-9), (1, 1e-7), (2, 1e-4)):
            one = interpolated(rows.t, (q, rows.v), derivative)
            other = interpolated(rows.t, (q, rows.v, rows.a), derivative)
            np.testing.assert_allclose(one, other, rtol=1e-6, atol=atol * 1e3**derivative)


def test_a_single_row_stands_still() -> None:
    rows = spline_rows(np.ones((1, 6)), DT)
    assert not rows.v.any()
    assert not rows.a.any()
    more = standing(rows, 3, DT)
    assert len(more.q) == 4
    np.testing.assert_array_equal(more.t, DT * np.arange(4))


def test_motions_that_are_joined_stand_still_in_between(rng: np.random.Generator) -> None:
    first, then = (spline_rows(rng.uniform(-1.0, 1.0, (5, 2)), dt) for dt in (0.1, 0.05))
    then = spline_rows(then.q + first.q[-1] - then.q[0], 0.05)
    both = joined(first, then)
    np.testing.assert_allclose(both.t, [0.0, 0.1, 0.2, 0.3, 0.4, 0.45, 0.5, 0.55, 0.6])
    np.testing.assert_array_equal(both.q, np.vstack([first.q, then.q[1:]]))
    np.testing.assert_array_equal(both.v[[0, 4, 8]], 0.0)
    np.testing.assert_allclose(both.a[4], 0.5 * (first.a[-1] + then.a[0]))
    np.testing.assert_array_equal(both.a[5:], then.a[1:])


def test_the_largest_velocity_between_rows_is_found(rng: np.random.Generator) -> None:
    rows = spline_rows(np.cumsum(rng.normal(size=(20, 2)), axis=0), DT)
    fast, hard = most_between(rows)
    spline = CubicSpline(rows.t, rows.q, bc_type=((1, np.zeros(2)), (1, np.zeros(2))))
    for row in range(19):
        at = np.linspace(rows.t[row], rows.t[row + 1], 2001)
        np.testing.assert_allclose(np.abs(spline(at, 1)).max(axis=0), fast[row], rtol=1e-5)
        np.testing.assert_allclose(np.abs(spline(at, 2)).max(axis=0), hard[row], rtol=1e-5)


@pytest.mark.parametrize("dt", [0.001, 0.01, 0.1, 0.7, 5.0])
@pytest.mark.parametrize("length", [1e-6, 0.01, 0.83, 20.0])
def test_jumps_of_acceleration_are_held(dt: float, length: float) -> None:
    """As fast as possible up to half way, and down again."""
    limit = 1.5
    duration = 2.0 * float(np.sqrt(length / limit))

    def at(t: Array) -> Array:
        half = 0.5 * duration
        up = 0.5 * limit * np.minimum(t, half) ** 2
        rest = np.maximum(t - half, 0.0)
        return np.asarray(up + limit * half * rest - 0.5 * limit * rest**2)[:, None]

    for jerk in (None, 0.3, 4.0, 1e3):
        taken = at(np.linspace(0.0, duration, steps_of(duration, dt) + 1))
        limits = np.array([np.inf, np.inf, np.inf if jerk is None else jerk])
        ticks = ticks_averaged(taken.ravel(), 1, len(taken), limits, dt)
        rows = averaged_rows(taken, dt) if ticks == 1 else averaged(taken, ticks, dt)
        fast, hard = most_between(rows)
        assert fast.max() <= 0.5 * limit * duration * (1 + 1e-9)
        assert hard.max() <= limit * (1 + 1e-8)
        assert (np.diff(rows.q[:, 0]) >= -1e-15).all()
        np.testing.assert_array_equal(rows.q[[0, -1], 0], at(np.array([0.0, duration]))[:, 0])
        assert len(rows.t) - 1 == np.ceil(duration / dt - 1e-9) + ticks + 1
        if jerk is None:
            assert ticks == 1
        else:
            assert (np.abs(np.diff(rows.a, axis=0)) <= jerk * dt * (1 + 1e-6) + 1e-12 / dt**2).all()
            assert ticks <= max(np.ceil(2.0 * limit / (jerk * dt)), 1)
        one = interpolated(rows.t, (rows.q, rows.v))
        other = interpolated(rows.t, (rows.q, rows.v, rows.a))
        np.testing.assert_allclose(one, other, atol=1e-9 * length)


def averaged(taken: Array, ticks: int, dt: float) -> Rows:
    """Rows averaged over so many ticks."""
    count = len(taken) + ticks + 1
    work = make_average_work(1, count)
    work.counts[:], work.dt[0], work.taken[: len(taken)] = (1, len(taken), ticks), dt, taken[:, 0]
    average_rows(work)
    return Rows(dt * np.arange(count, dtype=np.float64), work.q[:, None], work.v[:, None], work.a[:, None])


def test_means_stay_between_what_they_are_of() -> None:
    found = sample(lambda t: np.full((len(t), 1), 0.1), 1.0, 0.1)
    assert (found == 0.1).all()


@pytest.mark.parametrize(
    "dt", [0.2, pytest.param(0.5, marks=pytest.mark.slow), pytest.param(2.0, marks=pytest.mark.slow)]
)
def test_nothing_touches_between_coarse_rows(robot: Robot, rng: np.random.Generator, dt: float) -> None:
    finer = found = 0
    for _ in range(8):
        sizes, places = rng.uniform(0.05, 0.25, (6, 3)), rng.uniform([-0.6, -0.6, 0.1], [0.6, 0.6, 0.9], (6, 3))
        scene = Scene([Box(f"box {k}", size, place) for k, (size, place) in enumerate(zip(sizes, places, strict=True))])
        solver = jacokin.IKSolver(robot, scene=scene)
        motion = plan_motion(solver, robot.sample(rng), robot.sample(rng), dt=dt, time_limit=5.0)
        if not motion.success:
            continue
        found, finer = found + 1, finer + ("in rows of" in motion.message)
        assert np.min(robot.clearance(between(motion), scene, self_collision=True)) > 0.0
    assert found > 2
    assert finer > 0


def between(motion: Trajectory) -> Array:
    """Places (n, dof) of straight lines and cubics from row to row."""
    lines = motion.q[:-1, None] + PARTS[:, None] * np.diff(motion.q, axis=0)[:, None]
    cubics = interpolated(motion.t, (motion.q, motion.v))
    return np.concatenate([lines, cubics]).reshape(-1, motion.q.shape[1])


def test_a_joint_that_leaves_its_limit_stays_inside(robot: Robot) -> None:
    """Between coarse rows the spline would swing over it; smaller ones are taken."""
    upper = robot.upper[1]

    def at(t: Array) -> Array:
        q = np.tile(robot.home, (len(t), 1))
        q[:, 1] = upper - 2.0 * np.clip(t - 1.013, 0.0, None) ** 2 * np.clip(2.0 - t, 0.0, None)
        return q

    way = OnTheWay(robot, contact_of_nothing(robot))
    swung = spline_rows(at(np.linspace(0.0, 2.0, 41)), 0.05)
    assert way.fault(swung) == "joint_2 could pass its limit"
    assert interpolated(swung.t, (swung.q, swung.v)).max(axis=(0, 1))[1] > upper + 1e-6
    step = next(step for step in halved(0.05) if not way.fault(spline_rows(at(np.arange(0.0, 2.001, step)), step)))
    assert 1e-4 < step < 0.05


@pytest.mark.parametrize("dt", [0.01, 0.5])
@pytest.mark.parametrize(("velocity", "acceleration"), [(0.3, 0.1), (0.6, 50.0), (100.0, 1.0), (1e4, 1e6)])
def test_motions_around_obstacles_hold_limits_of_any_size(
    robot: Robot, dt: float, velocity: float, acceleration: float
) -> None:
    scene = Scene([Box("wall", [0.6, 0.02, 0.5], [0.45, -0.05, 0.25])])
    solver = jacokin.IKSolver(robot, scene=scene)
    start = solver.solve(jacokin.pose([0.4, -0.35, 0.3], down=True)).q
    goal = jacokin.pose([0.4, 0.25, 0.3], down=True)
    limits: dict[str, Any] = {"velocity_limit": velocity, "acceleration_limit": acceleration}
    motion = plan_motion(solver, start, goal, dt=dt, time_limit=10.0, **limits)
    assert motion.success
    check_as_controllers_go(motion, acceleration)
    for name in limits:
        with pytest.raises(InvalidInputError, match=f"{name} must be at most"):
            plan_motion(solver, start, goal, **cast(dict[str, Any], {name: 1e12}))
