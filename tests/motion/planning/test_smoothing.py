"""Knots moved along their curves: they stay on the path and within the limits, and the motion costs less."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

from jacokin import FreeAxis, Robot
from jacokin.arrays import Array
from jacokin.model.many_configurations import Chain
from jacokin.motion.path import CartesianPath
from jacokin.motion.planning.manifold import Manifold, Pace
from jacokin.motion.planning.smoothing import Smoothing

KNOTS = 13


@pytest.fixture(scope="module")
def path(robot: Robot) -> CartesianPath:
    """A line along which the tool may turn about its z axis."""
    poses = [robot.forward_kinematics(robot.home + step) for step in (0.0, 0.1)]
    return CartesianPath([FreeAxis(pose, axis=(0.0, 0.0, 1.0)) for pose in poses], robot.default_frame)


@pytest.fixture(scope="module")
def manifold(robot: Robot, path: CartesianPath) -> Manifold:
    return Manifold(robot, Chain(robot, robot.frame_id(), None), path, 1e-9)


@pytest.fixture(scope="module")
def rough(robot: Robot, manifold: Manifold) -> tuple[Array, Array]:
    """Places, and points there whose free angle goes to and fro as a coarse search may leave it."""
    u = np.linspace(0.0, 1.0, KNOTS)
    x = [np.append(robot.home, 0.0)]
    for place in u[1:]:
        found, good = manifold.project(np.array([place]), x[-1][None])
        assert good[0]
        x.append(found[0])
    turned = np.array(x)
    turned[1:-1, -1] += 0.15 * (-1.0) ** np.arange(KNOTS - 2)
    found, worst = manifold.chain.close(turned, manifold.goal(u), np.tile([False] * 6 + [True], (KNOTS, 1)))
    assert worst.max() < 1e-9
    return u, found


def on_path(manifold: Manifold, u: Array, x: Array) -> bool:
    lower, upper = manifold.window(u)
    near = np.max(manifold.chain.errors(x, manifold.goal(u))) < 1e-8
    return bool(near and (x >= lower).all() and (x <= upper).all())


def test_the_motion_costs_less_and_stays_on_the_path(
    manifold: Manifold, rough: tuple[Array, Array], robot: Robot
) -> None:
    u, x = rough
    smoothing = Smoothing(manifold, Pace(np.array([2.0]), robot.velocity_limit), u, None)
    free = np.zeros(KNOTS, dtype=np.bool_)
    smooth = smoothing.improve(x, free)
    assert on_path(manifold, u, x)
    assert on_path(manifold, u, smooth)
    assert np.array_equal(smooth[0], x[0])  # nothing pulls it
    assert smoothing.cost(smooth) < 0.2 * smoothing.cost(x)
    # At a minimum: another round finds next to nothing.
    assert smoothing.cost(smoothing.smooth(smooth, free)) > 0.99 * smoothing.cost(smooth)


def test_pinned_knots_stay(manifold: Manifold, rough: tuple[Array, Array], robot: Robot) -> None:
    u, x = rough
    pinned = np.arange(KNOTS) % 3 == 0
    smooth = Smoothing(manifold, Pace(np.array([2.0]), robot.velocity_limit), u, None).improve(x, pinned)
    assert np.abs(smooth[pinned] - x[pinned]).max() < 1e-9
    assert not np.allclose(smooth[~pinned], x[~pinned])


def test_joints_that_are_too_fast_are_relieved(manifold: Manifold, rough: tuple[Array, Array], robot: Robot) -> None:
    """In an eighth of the time the rough way is too fast; smoothing saves most of what it is late by."""
    u, x = rough
    time = 0.25  # [s]
    smoothing = Smoothing(manifold, Pace(np.array([time]), robot.velocity_limit), u, None)

    def excess(points: Array) -> float:
        speed = np.abs(np.diff(points[:, :6], axis=0)) / (time / (KNOTS - 1)) / robot.velocity_limit
        return float(np.maximum(speed.max(axis=1) - 1.0, 0.0).sum())

    assert excess(x) > 1.0
    assert excess(smoothing.improve(x, np.zeros(KNOTS, dtype=np.bool_))) < 0.5 * excess(x)


def test_the_first_knot_is_pulled_where_the_path_should_begin(
    manifold: Manifold, rough: tuple[Array, Array], robot: Robot
) -> None:
    u, x = rough
    found, good = manifold.project(u[:1], (x[0] + np.append(np.zeros(6), 0.2))[None])
    assert good[0]
    aim = found[0, :6]
    smoothing = Smoothing(manifold, Pace(np.array([2.0]), robot.velocity_limit), u, (aim, 1e4))
    smooth = smoothing.improve(x, np.zeros(KNOTS, dtype=np.bool_))
    assert np.abs(smooth[0, :6] - aim).max() < 0.1 * np.abs(x[0, :6] - aim).max()


@pytest.fixture(scope="module")
def seven(bundled: Callable[[str], Robot]) -> Robot:
    return bundled("j2s7s300")


def surface(seven: Robot, span: tuple[float, float]) -> Manifold:
    """Of seven joints along a line, with a range of the angle about an axis."""
    start = seven.forward_kinematics(seven.home)
    ends = [start, pin.SE3(start.rotation, start.translation + np.array([0.0, 0.06, 0.03]))]
    path = CartesianPath([FreeAxis(pose, axis=(1.0, 0.0, 0.0), range=span) for pose in ends], seven.default_frame)
    return Manifold(seven, Chain(seven, seven.frame_id(), None), path, 1e-9, "joint_3")


def surface_way(manifold: Manifold, home: Array, noise: float) -> tuple[Array, Array]:
    """Places, and points near a configuration, both parameters of which go to and fro."""
    u = np.linspace(0.0, 1.0, KNOTS)
    rng = np.random.default_rng(3)
    guess = np.tile(np.append(home, 0.0), (KNOTS, 1))
    guess[:, manifold.parameters] += noise * rng.uniform(-1.0, 1.0, (KNOTS, 2))
    held = np.zeros(guess.shape, dtype=np.bool_)
    held[:, manifold.parameters] = True
    x, worst = manifold.chain.close(guess, manifold.goal(u), held)
    assert worst.max() < 1e-9
    return u, x


def test_both_parameters_of_a_surface_are_moved(seven: Robot) -> None:
    """To where neither helps any more, and farther than one of them alone leads."""
    manifold = surface(seven, (-np.pi, np.pi))
    u, x = surface_way(manifold, seven.home, 0.15)
    smoothing = Smoothing(manifold, Pace(np.array([2.0]), seven.velocity_limit), u, None)
    smooth = smoothing.improve(x, np.zeros(KNOTS, dtype=np.bool_))
    assert on_path(manifold, u, smooth)
    assert np.array_equal(smooth[0], x[0])
    least = smoothing.cost(smooth)
    assert least < 0.1 * smoothing.cost(x)
    for column in manifold.parameters:
        held = np.zeros(x.shape, dtype=np.bool_)
        held[:, manifold.parameters] = True
        for way in (-0.02, 0.02):
            moved = smooth.copy()
            moved[1:, column] += way
            moved, worst = manifold.chain.close(moved, manifold.goal(u), held)
            assert worst.max() < 1e-9
            assert smoothing.cost(moved) > 0.999 * least


def test_knots_slide_along_a_limit_of_a_surface(seven: Robot) -> None:
    """The angle wants out of its range: it stays on the limit, and the other parameter is moved all the same."""
    wide = surface(seven, (-np.pi, np.pi))
    u, x = surface_way(wide, seven.home, 0.1)
    pace = Pace(np.array([2.0]), seven.velocity_limit)
    free = np.zeros(KNOTS, dtype=np.bool_)
    angle = Smoothing(wide, pace, u, None).improve(x, free)[1:, -1]
    narrow = surface(seven, (float(x[:, -1].min()) - 1e-3, float(x[:, -1].max()) + 1e-3))
    low, high = narrow.window(u[:1])[0][0, -1], narrow.window(u[:1])[1][0, -1]
    assert ((angle < low) | (angle > high)).any()
    smoothing = Smoothing(narrow, pace, u, None)
    smooth = smoothing.improve(x, free)
    assert on_path(narrow, u, smooth)
    stuck = (smooth[:, -1] < low + 2e-3) | (smooth[:, -1] > high - 2e-3)
    assert stuck.sum() > 2
    elbow = np.abs(np.diff(x[:, 2])).sum(), np.abs(np.diff(smooth[:, 2])).sum()
    assert elbow[1] < 0.3 * elbow[0]
