"""Time parametrisation: limits hold between ticks, ends stand still, and nothing is slower than it need be."""

from __future__ import annotations

import numpy as np
import pytest

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.motion.timing import check_ticks, fit_course, fit_line, sample_lines, slopes, with_ramps

DT = 0.01  # [s]


def test_lines_take_whole_ticks() -> None:
    assert np.allclose(sample_lines(np.array([0.02, 0.0, 0.025]), DT), [0.0, 0.5, 1.0, 2 + 1 / 3, 2 + 2 / 3, 3.0])


@pytest.mark.parametrize(("durations", "match"), [([1.0, 1e9], "most of it segment 1"), ([1e-3], "less than one")])
def test_paths_of_too_many_ticks_or_none_are_refused(durations: list[float], match: str) -> None:
    with pytest.raises(InvalidInputError, match=match):
        check_ticks(np.array(durations), DT)


def bent(u: Array) -> Array:
    """One joint moves as sin(3 u), another as u: both parts of q' u'' + q'' u'^2 count."""
    return np.column_stack([np.sin(3.0 * u), u])


def test_a_bent_joint_path_is_run_through_within_acceleration() -> None:
    u = np.linspace(0.0, 1.0, 401)
    limit, velocity = np.array([1.0, 0.5]), np.array([1.0, 10.0])
    schedule = fit_line(u, bent(u), 1.0, velocity, limit)
    joints = bent(schedule.ticks(2e-4))
    step = schedule.t[-1] / (len(joints) - 1)
    assert np.abs(np.diff(joints[[0, 1, -2, -1]], axis=0))[[0, 2]].max() < 1e-7  # at rest at both ends
    v = np.diff(joints[::50], axis=0) / (50 * step)
    assert (np.abs(v) <= velocity).all()
    acceleration = np.abs(np.diff(v, axis=0) / (50 * step)).max(axis=0)
    assert (acceleration <= limit).all()
    assert (acceleration > 0.75 * limit).any()  # and no slower than that
    hurried = fit_line(u, bent(u), 1.0, velocity, 1e6 * limit)
    assert hurried.t[-1] == pytest.approx(np.abs(np.diff(np.sin(3.0 * u))).sum() / 0.98, rel=0.35)
    assert fit_line(u, bent(u), 20.0, velocity, limit).t[-1] == pytest.approx(20.0, rel=0.02)  # as asked


def test_a_line_of_one_tick_moves() -> None:
    schedule = fit_line(np.array([2.0, 3.0]), np.array([[0.0], [0.1]]), 0.01, np.array([1.0]), np.array([2.0]))
    assert schedule.t[-1] == pytest.approx(2.0 * np.sqrt(0.1 / 1.6), rel=1e-6)
    assert (schedule.ticks(DT)[0], schedule.ticks(DT)[-1]) == (2.0, 3.0)


def test_a_straight_joint_path_takes_the_time_of_full_acceleration_and_braking() -> None:
    """A joint that moves by d at most a: 2 sqrt(d / a), the bang-bang optimum."""
    u = np.linspace(0.0, 1.0, 201)
    q, top = 0.8 * u[:, None], np.full(201, np.inf)
    schedule = fit_course(u, slopes(u, q), np.array([100.0]), np.array([2.0]), top)
    assert schedule.t[-1] == pytest.approx(2.0 * np.sqrt(0.8 / 2.0), rel=1e-3)
    assert schedule.speed[100] == pytest.approx(np.sqrt(2.0 * 2.0 * 0.4) / 0.8, rel=1e-2)


@pytest.mark.parametrize("speed", [0.5, 5.0])
def test_limits_hold_at_every_place_and_between(speed: float) -> None:
    velocity, acceleration = np.array([1.0, 0.8]), np.array([2.0, 1.5])
    u = np.linspace(0.0, 2.0, 801)
    schedule = fit_course(u, slopes(u, bent(u)), velocity, acceleration, np.full(801, speed))
    t = np.linspace(0.0, schedule.duration, 4001)
    q = bent(schedule.at(t))
    v, step = np.diff(q, axis=0) / t[1], t[1]
    assert (np.abs(v) <= velocity * (1 + 1e-4)).all()
    assert (np.diff(schedule.at(t)) <= speed * step * (1 + 1e-9)).all()
    change = np.abs(np.diff(v, axis=0)) / step
    assert (change <= acceleration * 1.02).all()  # slopes are differences
    assert (change.max(axis=0) > 0.9 * acceleration).any()


def test_what_corners_add_in_proportion_to_speed_counts_with_the_acceleration_of_a_course() -> None:
    acceleration, u = np.array([2.0, 1.5]), np.linspace(0.0, 2.0, 801)
    slope, sudden = slopes(u, bent(u)), np.zeros((800, 2))
    sudden[395:405] = (4.0, 0.5)
    schedule = fit_course(u, slope, np.array([9.0, 9.0]), acceleration, np.full(801, 5.0), sudden=sudden)
    rise = np.diff(schedule.speed**2) / (2.0 * np.diff(u))
    bend = (slope[1] - slope[0]) / np.diff(u)[:, None]
    for ends, speed in ((slope[0], schedule.speed[:-1]), (slope[1], schedule.speed[1:])):
        needed = np.abs(ends * rise[:, None] + bend * speed[:, None] ** 2) + sudden * speed[:, None]
        assert (needed <= acceleration * (1.0 + 1e-6)).all()
    free = fit_course(u, slope, np.array([9.0, 9.0]), acceleration, np.full(801, 5.0))
    assert (schedule.speed <= free.speed + 1e-9).all()
    assert 0.3 < schedule.speed[400] < 0.5 < free.speed[400]


@pytest.mark.parametrize(("whole", "ramp"), [(100, 0), (100, 20), (7, 6), (6, 6), (2, 2), (1, 0)])
def test_ramps_lead_to_the_ticks_at_full_speed_and_from_them(whole: int, ramp: int) -> None:
    places = np.cumsum(np.append(0.0, np.linspace(1.0, 2.0, whole)))
    found = with_ramps(places, ramp)
    assert len(found) == whole + 1 + ramp + 2
    assert (found[0], found[-1]) == (0.0, places[-1])
    assert (np.diff(found) >= 0.0).all()
    inner = found[ramp + 2 : whole + 1]
    assert np.isin(np.round(inner, 9), np.round(places, 9)).all()
    if ramp >= 6:
        speed = np.diff(with_ramps(np.arange(whole + 1.0), ramp))
        assert np.abs(np.diff(speed)).max() <= 1.0 / ramp + 1e-12
