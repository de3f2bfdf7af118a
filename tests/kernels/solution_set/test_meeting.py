"""Where curves meet: on the circle of a straight wrist, at the places where the elbow can move as well."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from jacokin.arrays import Array
from jacokin.kernels.solution_set.curve import StepResult, advance, tangent
from jacokin.kernels.solution_set.meeting import ASIDE, make_directions, points_aside
from jacokin.model.angles import TURN, wrap_to_pi
from tests.kernels.solution_set.known_curves import (
    MIDDLE,
    Curve,
    along_circle,
    residual,
    straight_wrist,
    traced,
    walk_on,
)


def meetings_of(curve: Curve) -> list[float]:
    """Where on the circle of a straight wrist [rad] the Jacobian has a second null direction."""

    def sixth(s: float) -> float:
        return float(curve.robot.singular_values(along_circle(curve, s))[5])

    grid = np.linspace(0.0, TURN, 181)
    values = [sixth(s) for s in grid]
    found: list[float] = []
    for low, s, high in zip(grid[:-1], grid[1:], np.append(grid[2:], grid[1] + TURN), strict=True):
        if sixth(s) <= min(sixth(low), sixth(high)):
            best = minimize_scalar(sixth, bounds=(low, high), method="bounded", options={"xatol": 1e-12})
            if best.fun < 1e-6 * max(values):
                found.append(float(best.x))
    return found


@pytest.fixture
def curve(rng: np.random.Generator) -> Curve:
    """The circle of a straight wrist."""
    return straight_wrist(rng)


def around(curve: Curve, s: float, h: float = 1e-5) -> Array:
    """Two points (14,) of the circle, on both sides of a place."""
    return np.concatenate([along_circle(curve, s - h), along_circle(curve, s + h)])


def test_the_other_curve_leaves_the_circle_on_both_sides(curve: Curve) -> None:
    """The pose stays, the wrist bends, to opposite sides, and the elbow moves."""
    places = meetings_of(curve)
    assert len(places) >= 2
    null = make_directions()
    for s in places:
        meeting, aside = along_circle(curve, s), []
        for side in (-1.0, 1.0):
            x = np.empty(7)
            assert points_aside(around(curve, s), side, null, x, walk_on(curve))
            assert residual(curve, x) < 1e-9
            assert 0.9 * ASIDE < np.linalg.norm(x - meeting) < 3.0 * ASIDE
            on_circle = along_circle(curve, x[4] - curve.q[4])
            assert np.abs(wrap_to_pi(x - on_circle)).max() > 0.1 * ASIDE
            aside.append(x - meeting)
        assert abs(aside[0][MIDDLE]) > 1e-4
        assert aside[0][MIDDLE] * aside[1][MIDDLE] < 0.0
        assert aside[0] @ aside[1] < 0.0


def test_the_sign_flips_where_a_walk_passes_a_meeting(curve: Curve) -> None:
    """And nowhere else on the circle."""
    walk, h, s, end = walk_on(curve), 1e-3, 0.03, TURN + 0.03
    flips = []
    places = np.array(meetings_of(curve))
    ahead = along_circle(curve, 1.0) - along_circle(curve, 0.0)
    walk.t[:] = ahead / np.linalg.norm(ahead)
    walk.x[:] = along_circle(curve, s)
    volume = tangent(walk.x, walk.t.copy(), walk.t, walk)
    while s < end:
        step = h if np.abs(wrap_to_pi(places - s)).min() < 0.01 else 0.02
        result = advance(walk, step, volume, walk.y, walk.ty)
        assert result != StepResult.FAILED
        if result == StepResult.FLIPPED:
            flips.append(s + 0.5 * step / np.sqrt(2.0))
        walk.x[:], walk.t[:], volume = walk.y, walk.ty, walk.volume[0]
        s += step / np.sqrt(2.0)
    assert len(flips) == len(places)
    for flip in flips:
        assert np.abs(wrap_to_pi(places - flip)).min() < 0.02


def test_away_from_meetings_there_is_no_other_curve(curve: Curve) -> None:
    """What is found across the circle is no point at the distance at which it was looked for."""
    places, null = np.array(meetings_of(curve)), make_directions()
    for s in np.linspace(0.0, TURN, 7):
        if np.abs(wrap_to_pi(places - s)).min() < 0.3:
            continue
        x = np.empty(7)
        found = points_aside(around(curve, s), 1.0, null, x, walk_on(curve))
        assert not found or np.linalg.norm(x - along_circle(curve, s)) > 2.0 * ASIDE


def test_a_trace_notes_the_meetings_of_the_circle(curve: Curve) -> None:
    """Between two points each, as many as there are."""
    loops, _ = traced(curve, 4)
    places = np.array(meetings_of(curve))
    assert loops.size[2] == len(places)
    for a, b in loops.meetings[: loops.size[2]].reshape(-1, 2, 7):
        low, high = a[4] - curve.q[4], b[4] - curve.q[4]
        assert np.abs(wrap_to_pi(places - 0.5 * (low + high))).min() < abs(high - low)
