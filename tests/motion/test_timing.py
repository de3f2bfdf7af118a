"""Time parametrisation: limits hold between ticks, ends stand still, and nothing is slower than it need be."""

from __future__ import annotations

import numpy as np
import pytest

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.motion.timing import (
    check_ticks,
    fit_acceleration,
    fit_line,
    fit_speed,
    fit_ticks,
    sample_lines,
)

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


def test_the_speed_asked_for_is_kept_where_joints_can_follow() -> None:
    u = np.linspace(0.0, 2.0, 5)
    q = np.column_stack([[0.0, 0.1, 0.2, 1.2, 1.3]])
    schedule = fit_speed(u, q, np.full(4, 0.5), np.array([1.0]))
    assert np.diff(schedule.t) == pytest.approx([0.5, 0.5, 1.0, 0.5])


def test_a_straight_joint_path_takes_the_time_of_full_acceleration_and_braking() -> None:
    """A joint that moves by d at most a: 2 sqrt(d / a), the bang-bang optimum."""
    u = np.linspace(0.0, 1.0, 201)
    stops = np.zeros(201, dtype=np.bool_)
    stops[[0, -1]] = True
    schedule = fit_acceleration(
        u, 0.8 * u[:, None], np.full(200, 1e-6), np.array([100.0]), np.array([2.0]), stops, np.full(200, np.inf)
    )
    assert schedule.t[-1] == pytest.approx(2.0 * np.sqrt(0.8 / 2.0), rel=1e-3)
    assert schedule.speed is not None
    assert schedule.speed[100] == pytest.approx(np.sqrt(2.0 * 2.0 * 0.4) / 0.8, rel=1e-2)


@pytest.mark.parametrize("acceleration", [None, np.array([2.0, 1.5])], ids=["velocity", "acceleration"])
@pytest.mark.parametrize("speed", [0.5, 5.0])
def test_limits_hold_at_every_tick_and_between(acceleration: Array | None, speed: float) -> None:
    velocity = np.array([1.0, 0.8])
    u = np.linspace(0.0, 2.0, 801)
    ticks = fit_ticks(u, bent(u), bent, np.full(2, 1.0 / speed), DT, velocity, acceleration)
    assert (ticks[0], ticks[-1]) == (0.0, 2.0)
    assert (np.diff(ticks) >= 0.0).all()
    v = np.diff(bent(ticks), axis=0) / DT
    assert (np.abs(v) <= velocity * (1 + 1e-12)).all()
    assert len(ticks) - 1 >= np.floor(2.0 / speed / DT)  # no faster than asked
    if acceleration is not None:  # from rest to rest
        change = np.diff(np.vstack([np.zeros(2), v, np.zeros(2)]), axis=0) / DT
        assert (np.abs(change) <= acceleration * (1 + 1e-9)).all()
    else:  # joint 1 is at its limit where it is fastest
        assert np.abs(v).max() > 0.9 * min(1.0, 3.0 * speed)


def test_the_path_stands_still_where_joints_turn_sharply() -> None:
    u = np.linspace(0.0, 2.0, 401)

    def corner(u: Array) -> Array:
        return np.column_stack([np.minimum(u, 1.0), np.maximum(u - 1.0, 0.0)])

    limit = np.array([2.0, 2.0])
    ticks = fit_ticks(u, corner(u), corner, np.full(2, 0.5), DT, np.full(2, 5.0), limit)
    v = np.diff(corner(ticks), axis=0) / DT
    at_corner = int(np.searchsorted(ticks, 1.0))
    assert np.abs(v[at_corner - 1 : at_corner + 1]).max() < 0.1
    assert (np.abs(np.diff(v, axis=0)) / DT <= limit * (1 + 1e-9)).all()
