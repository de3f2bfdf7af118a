"""Ways with rounded corners: continuous, within limits at every instant, and no slower than stopping."""

from __future__ import annotations

import numpy as np
import pytest

from jacokin.motion.free_motion.timed_course import TimedCourse, fit_time
from jacokin.motion.timing import fit_course

VELOCITY = np.array([0.63, 0.63, 0.63, 0.84, 0.84, 0.84])  # [rad/s]
ACCELERATION = np.array([1.0, 2.0, 0.5, 1.0, 3.0, 1.0])  # [rad/s^2]


def timed(way: np.ndarray, *, clear: bool = True) -> TimedCourse:
    cuts = cuts_of(way) if clear else np.zeros(len(way))
    return fit_time(way, cuts, VELOCITY, VELOCITY, ACCELERATION)


def lengths_of(way: np.ndarray) -> np.ndarray:
    """Of its lines, at full speed [s]."""
    return np.asarray((np.abs(np.diff(way, axis=0)) / VELOCITY).max(axis=1))


def cuts_of(way: np.ndarray) -> np.ndarray:
    """Nearly half of the shorter line at each corner."""
    lengths = lengths_of(way)
    return np.array([0.0, *0.45 * np.minimum(lengths[:-1], lengths[1:]), 0.0])


@pytest.mark.parametrize("corners", [0, 1, 2, 6])
def test_limits_hold_at_every_instant(rng: np.random.Generator, corners: int) -> None:
    for _ in range(6):
        way = np.cumsum(rng.normal(size=(corners + 2, 6)) * rng.choice([0.05, 0.3, 1.0]), axis=0)
        found = timed(way)
        t = np.linspace(0.0, found.duration, 5001)
        q, v, a = found.at(t)
        assert (np.abs(v) <= VELOCITY).all()
        assert (np.abs(a) <= ACCELERATION).all()
        np.testing.assert_allclose(q[[0, -1]], way[[0, -1]], atol=1e-12)
        np.testing.assert_allclose(v[[0, -1]], 0.0, atol=1e-12)
        h = t[1]
        np.testing.assert_allclose(np.diff(q, axis=0), 0.5 * h * (v[1:] + v[:-1]), atol=ACCELERATION.max() * h * h)
        assert (np.abs(np.diff(v, axis=0)) <= ACCELERATION * h * (1.0 + 1e-6) + 1e-12).all()


def test_corners_are_passed_without_stopping(rng: np.random.Generator) -> None:
    way = np.cumsum(rng.uniform(0.2, 0.6, size=(5, 6)), axis=0)
    through, stopping = timed(way), timed(way, clear=False)
    assert through.duration < 0.85 * stopping.duration
    inside = np.linspace(0.05, 0.95, 200) * through.duration
    assert np.abs(through.at(inside)[1]).max(axis=1).min() > 0.1
    speeds = np.interp(stopping.begins[1:-1], stopping.s, stopping.speed)
    np.testing.assert_allclose(speeds, 0.0, atol=1e-12)


def test_a_corner_is_cut_within_its_triangle(rng: np.random.Generator) -> None:
    way = rng.normal(size=(3, 6))
    found, corner = timed(way), way[1]
    begins, ends = np.interp(found.begins[1:3], found.s, found.t).tolist()
    q = found.at(np.linspace(begins, ends, 50))[0]
    a, b = found.q[1], found.q[2]
    weights = np.linalg.lstsq(np.column_stack([a - corner, b - corner]), (q - corner).T, rcond=None)[0]
    assert (weights >= -1e-9).all()
    assert (weights.sum(axis=0) <= 1.0 + 1e-9).all()


def test_one_line_takes_the_known_time() -> None:
    step = np.array([0.5, -0.1, 0.05, 0.2, 0.0, 0.3])
    found = timed(np.array([np.zeros(6), step]))
    used = step != 0.0
    speed = (VELOCITY[used] / np.abs(step[used])).min()
    pull = (ACCELERATION[used] / np.abs(step[used])).min()
    expected = 1.0 / speed + speed / pull if speed**2 < pull else 2.0 / np.sqrt(pull)
    assert found.duration == pytest.approx(expected, rel=1e-6)


def test_times_are_those_of_a_course_of_places(rng: np.random.Generator) -> None:
    """On the same places, `fit_course`, which knows nothing of lines and parabolas, finds the same speeds."""
    for corners in (1, 3, 7):
        way = np.cumsum(rng.normal(size=(corners + 2, 6)) * rng.choice([0.05, 0.3, 1.0]), axis=0)
        cuts = cuts_of(way) * rng.choice([0.0, 0.3, 1.0], size=corners + 2)
        found = fit_time(way, cuts, VELOCITY, VELOCITY, ACCELERATION)
        on, piece = found.s - found.begins[found.piece], found.piece[:-1]
        assert (on >= 0.0).all()
        ends = np.stack([on[:-1], found.s[1:] - found.begins[piece]])[:, :, None]
        stops = np.append(0.0, np.cumsum(lengths_of(way)))[cuts == 0.0]
        top = np.where((np.abs(found.s[:, None] - stops) <= 1e-12).any(axis=1), 0.0, np.inf)
        slope = found.slope[piece] + ends * found.bend[piece]
        by_places = fit_course(found.s, slope, VELOCITY, ACCELERATION, top)
        np.testing.assert_allclose(found.t, by_places.t, rtol=1e-6, atol=1e-9)
