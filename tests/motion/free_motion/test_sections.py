"""Ways within limits of jerk, too: between stops, through corners, at every instant, and nothing touches there."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from jacokin import IKSolver, Robot, load_robot
from jacokin.arrays import Array
from jacokin.ik import Box, Scene
from jacokin.kernels.free_motion.rows import duration_of, make_row_work
from jacokin.kernels.free_motion.shortcuts import WayInteger, make_way
from jacokin.kernels.free_motion.space import make_space
from jacokin.model.contact import contact_of_nothing
from jacokin.motion import Trajectory, plan_motion
from jacokin.motion.free_motion.search import CutWay, Randomness, WaySearch
from jacokin.motion.free_motion.timed_course import fit_time
from jacokin.motion.joint_motion import rest_to_rest
from jacokin.motion.rows import Limits, Rows

SPEED = np.array([0.6, 0.6, 0.6, 0.8, 0.8, 0.8])  # [rad/s]
FINE = 1e-4  # [s]


def random_way(rng: np.random.Generator, corners: int) -> tuple[Array, Array]:
    """A way (n, dof) that turns at each corner, and how much of them is cut off."""
    way = np.cumsum(rng.uniform(-1.0, 1.0, (corners + 2, 6)), axis=0)
    times = (np.abs(np.diff(way, axis=0)) / SPEED).max(axis=1)
    cuts = np.zeros(len(way))
    cuts[1:-1] = 0.45 * np.minimum(times[:-1], times[1:]) * rng.uniform(0.3, 1.0, corners)
    return way, cuts


def written(way: Array, cuts: Array, limits: Limits, dt: float = 0.01) -> Rows:
    """Rows of all sections, where nothing touches."""
    robot = load_robot()
    search = WaySearch(robot, contact_of_nothing(robot), 0.0)
    search.begin(way[0], way[-1:], SPEED, limits, Randomness())
    return search.write(CutWay(way, cuts), dt)


def with_stops(way: Array, limits: Limits, dt: float = 0.01) -> float:
    """How long it takes line by line [s]."""
    return sum(float(rest_to_rest(start, end, limits, dt, straight=True).t[-1]) for start, end in pairwise(way))


def check_limits(rows: Rows, limits: Limits) -> None:
    """Of cubics from row to row, as differences of their positions 0.1 ms apart have them."""
    t = np.arange(0.0, float(rows.t[-1]) + 0.5 * FINE, FINE)
    q = CubicHermiteSpline(rows.t, rows.q, rows.v)(t)
    v = np.diff(q, axis=0) / FINE
    a = np.diff(v, axis=0) / FINE
    assert (np.abs(v) <= limits.velocity * (1 + 1e-6)).all()
    assert (np.abs(a) <= limits.acceleration * (1 + 1e-4)).all()
    if limits.jerk is not None:
        coarse = a[::20]  # so that rounding is small
        assert (np.abs(np.diff(coarse, axis=0)) / (20 * FINE) <= 1.001 * limits.jerk).all()
        assert (np.abs(np.diff(rows.a, axis=0)) / rows.t[1] <= limits.jerk * (1 + 1e-8)).all()


@pytest.mark.parametrize("jerk", [None, 0.2, 2.0, 10.0, 1e3])
def test_limits_hold_at_every_instant(rng: np.random.Generator, jerk: float | None) -> None:
    for corners in (0, 1, 3):
        way, cuts = random_way(rng, corners)
        slack = rng.uniform(0.5, 2.0, 6)
        limits = Limits(SPEED, slack, None if jerk is None else jerk * slack[::-1])
        rows = written(way, cuts, limits)
        check_limits(rows, limits)
        np.testing.assert_array_equal(rows.q[[0, -1]], way[[0, -1]])
        assert not rows.v[[0, -1]].any()
        assert not rows.a[[0, -1]].any()
        assert (rows.q >= way.min(axis=0) - 1e-12).all()
        assert (rows.q <= way.max(axis=0) + 1e-12).all()
        least = fit_time(way, cuts, SPEED, limits.velocity, limits.acceleration).duration
        assert least <= rows.t[-1] <= with_stops(way, limits) + 1e-9


def test_corners_are_passed_in_little_more_time_than_without_a_limit_of_jerk(rng: np.random.Generator) -> None:
    for jerk, most in ((4.0, 1.13), (7.0, 1.08), (20.0, 1.04)):
        through, stopping = [], []
        for _ in range(10):
            way, cuts = random_way(rng, 3)
            limits = Limits(SPEED, np.ones(6), np.full(6, jerk))
            plain = float(written(way, cuts, Limits(SPEED, np.ones(6))).t[-1])
            through.append(float(written(way, cuts, limits).t[-1]) / plain)
            stopping.append(with_stops(way, limits) / plain)
        assert np.mean(through) < most
        assert np.mean(stopping) > np.mean(through) + 0.05


def test_a_joint_that_goes_one_way_never_turns_back(rng: np.random.Generator) -> None:
    way, cuts = random_way(rng, 4)
    way = np.cumsum(np.abs(np.diff(way, axis=0, prepend=0.0)), axis=0)
    rows = written(way, cuts, Limits(SPEED, np.ones(6), np.full(6, 5.0)))
    assert (np.diff(rows.q, axis=0) >= -1e-12).all()
    assert (rows.v >= -1e-9).all()


def test_lines_are_kept_far_from_corners(rng: np.random.Generator) -> None:
    way, cuts = random_way(rng, 1)
    rows = written(way, cuts, Limits(SPEED, np.ones(6), np.full(6, 10.0)))
    direction = way[1] - way[0]
    share = (rows.q - way[0]) @ direction / (direction @ direction)
    cut = cuts[1] / (np.abs(direction) / SPEED).max()  # of the line
    begin = np.arange(len(share)) < np.argmax(share > 1.0 - cut - 0.25)
    assert begin.any()
    np.testing.assert_allclose(rows.q[begin] - way[0], share[begin, None] * direction, atol=1e-12)


def fine(motion: Trajectory) -> Array:
    """Configurations (n, dof) every millisecond, as a controller goes by cubics."""
    t = np.arange(0.0, motion.duration, 1e-3)
    return np.asarray(CubicHermiteSpline(motion.t, motion.q, motion.v)(t))


@pytest.mark.one_quick
@pytest.mark.parametrize("jerk", [1.0, 4.0, 15.0])
@pytest.mark.parametrize("seed", range(3))
def test_nothing_touches_where_corners_are_cut_more(robot: Robot, seed: int, jerk: float) -> None:
    rng = np.random.default_rng(seed)
    places = [place for place in rng.uniform(-0.6, 0.6, (10, 2)) if np.hypot(*place) > 0.25]
    scene = Scene([Box(f"post {k}", [0.04, 0.04, 1.2], [*place, 0.6]) for k, place in enumerate(places)])
    solver = IKSolver(robot, scene=scene, collision="reject")
    ways = 0
    for _ in range(6):
        start, goal = (solver.solve(robot.forward_kinematics(robot.sample(rng))) for _ in range(2))
        if not start.success or not goal.success:
            continue
        given: dict[str, Any] = {"time_limit": 10.0, "ways": 1}
        motion = plan_motion(solver, start.q, goal.q, jerk_limit=jerk, **given)
        plain = plan_motion(solver, start.q, goal.q, **given)
        assert motion.success == plain.success
        if not motion.success:
            continue
        ways += "around" in motion.message
        check_limits(motion.rows, Limits(robot.velocity_limit, np.ones(6), np.full(6, jerk)))
        assert np.min(robot.clearance(fine(motion), scene)) > 0.0
        assert motion.duration >= plain.duration - 0.02
    assert ways


def test_torques_and_jerk_are_held_together(robot: Robot) -> None:
    loaded = robot.with_payload(0.8, [0.0, 0.0, 0.05])
    goal = robot.home + np.array([0.6, -0.4, 0.5, 0.3, 0.0, 0.0])
    given: dict[str, Any] = {"acceleration_limit": 10.0, "jerk_limit": 100.0, "velocity_limit": 2.0}
    free = plan_motion(IKSolver(loaded), robot.home, goal, **given)
    needed = np.array([loaded.inverse_dynamics(*row) for row in zip(free.q, free.v, free.a, strict=True)])
    still = np.array([loaded.inverse_dynamics(q, np.zeros(6), np.zeros(6)) for q in free.q])
    limit = np.abs(still).max(axis=0) + 0.3 * (np.abs(needed).max(axis=0) - np.abs(still).max(axis=0)).clip(0.5)
    motion = plan_motion(IKSolver(loaded), robot.home, goal, torque_limit=limit, **given)
    assert motion.success, motion.message
    assert motion.duration > free.duration
    needed = np.array([loaded.inverse_dynamics(*row) for row in zip(motion.q, motion.v, motion.a, strict=True)])
    assert (np.abs(needed) <= limit * (1 + 1e-6)).all()


@pytest.mark.parametrize(("jerk", "dt"), [(1e-6, 0.1), (1e-3, 0.01), (1e9, 0.01), (5.0, 3.0)])
def test_extreme_limits_and_steps_hold(rng: np.random.Generator, jerk: float, dt: float) -> None:
    way, cuts = random_way(rng, 2)
    limits = Limits(SPEED, np.ones(6), np.full(6, jerk))
    rows = written(way, cuts, limits, dt)
    assert float(limits.strain(rows).max()) <= 1.0 + 1e-6
    assert rows.t[-1] <= with_stops(way, limits, dt) + 1e-9
    np.testing.assert_array_equal(rows.q[[0, -1]], way[[0, -1]])


def test_the_expected_duration_is_that_of_a_line(rng: np.random.Generator) -> None:
    for jerk, closely in ((None, 1e-6), (20.0, 1e-6), (1e-3, 0.07)):  # from the last on, full speed is not reached
        way, cuts = random_way(rng, 0)
        limits = Limits(SPEED, np.ones(6), None if jerk is None else np.full(6, jerk))
        work, line = make_row_work(6, 2), make_way(6, 2)
        work.limits[0::3], work.limits[1::3] = limits.velocity, limits.acceleration
        work.limits[2::3] = np.inf if limits.jerk is None else limits.jerk
        space = make_space(6)
        space.speed[:] = SPEED
        line.q[:], line.integers[WayInteger.POINTS] = way.ravel(), 2
        duration = duration_of(work, line, cuts, space)
        assert duration == pytest.approx(with_stops(way, limits, 1e-4), rel=closely + 3e-4)
