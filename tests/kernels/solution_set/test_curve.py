"""Steps along a curve, and points between its nodes."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin.ik.geometry import measure_seven
from jacokin.kernels.solution_set.curve import (
    LARGEST_RESIDUAL,
    LONGEST_STEP,
    RESIDUAL,
    StepResult,
    advance,
    chord_length,
    cubic,
    cubic_root,
    cubic_slope,
    make_walk,
    moved_jacobian,
    point_across,
    point_at,
    point_where_still,
    tangent,
    to_curve,
)
from jacokin.kernels.solution_set.slices import JOINT_3, add_slice, make_seven_joints, make_six_joints, make_slices
from jacokin.kernels.solution_set.trace import NODES, CurveEnd, follow, make_loops
from jacokin.model.angles import TURN, wrap_to_pi
from tests.kernels.solution_set.known_curves import (
    FIRST,
    LAST,
    Curve,
    along_circle,
    begun,
    curve_through,
    nodes_along,
    residual,
    straight_wrist,
    traced,
    walk_on,
)
from tests.seven_joint_arms import load_arm

JOINTS = range(7)


@pytest.fixture(params=["j2s7s300", "panda", "gen3"])
def curve(request: pytest.FixtureRequest, tmp_path: Path, rng: np.random.Generator) -> Curve:
    """The curve through some configuration of an arm."""
    name = request.param
    robot = jacokin.load_robot(name) if name == "j2s7s300" else load_arm(name, tmp_path)
    return curve_through(robot, robot.sample(rng))


def test_a_cubic_is_met_exactly(rng: np.random.Generator) -> None:
    """Seven polynomials of degree three, from their values and slopes at both ends."""
    polynomials = [np.polynomial.Polynomial(rng.normal(size=4)) for _ in JOINTS]
    length = 1.7
    a, b = (np.array([f(s) for f in polynomials] + [f.deriv()(s) for f in polynomials]) for s in (0.0, length))
    for j, f in enumerate(polynomials):
        for u in rng.uniform(-0.2, 1.2, 5):
            assert cubic(a, b, length, u, j) == pytest.approx(f(u * length), abs=1e-12)
            assert cubic_slope(a, b, length, u, j) == pytest.approx(length * f.deriv()(u * length), abs=1e-12)


@pytest.mark.parametrize("power", [1, 3])
def test_the_root_of_a_cubic(rng: np.random.Generator, power: int) -> None:
    """Rising, or with slope and curvature zero at the root itself, where rounding leaves its third root."""
    a, b, length = np.zeros(14), np.zeros(14), 0.8
    for root in rng.uniform(0.05, 0.95, 20):
        f = np.polynomial.Polynomial.fromroots([root * length] * power) * rng.choice([-2.0, 0.3])
        a[2], a[9], b[2], b[9] = f(0.0), f.deriv()(0.0), f(length), f.deriv()(length)
        low, high = (0.0, 1.0) if rng.random() < 0.5 else (0.9 * root, 0.1 + 0.9 * root)
        u = cubic_root(a, b, length, 2, 0.0, low, high)
        assert u == pytest.approx(root, abs=1e-14 if power == 1 else 2e-5)
        assert abs(cubic(a, b, length, u, 2)) < 1e-15


def test_steps_stay_on_the_curve(curve: Curve) -> None:
    """By Pinocchio: the pose stays, and the tangent is the one motion that leaves it."""
    longest = 0.05
    nodes = nodes_along(curve, FIRST, 40, longest)
    for before, node in pairwise(nodes):
        x, t = node[:7], node[7:]
        assert residual(curve, x) < 2.0 * LARGEST_RESIDUAL
        assert np.linalg.norm(t) == pytest.approx(1.0)
        np.testing.assert_allclose(curve.robot.jacobian(x) @ t, 0.0, atol=1e-9)
        assert t @ before[7:] > 0.0
        assert 1e-4 < (x - before[:7]) @ before[7:] < longest + 1e-9


def test_a_step_turns_the_tangent_as_it_moves_the_jacobian(curve: Curve, rng: np.random.Generator) -> None:
    """By Pinocchio: differences of the Jacobian along the step."""
    step, t = rng.normal(size=(2, 7))
    linear, angular = moved_jacobian(curve.robot.jacobian(curve.q), step, t)
    ahead, behind = (curve.robot.jacobian(curve.q + side * 1e-6 * step) @ t for side in (1.0, -1.0))
    np.testing.assert_allclose([*linear, *angular], (ahead - behind) / 2e-6, atol=1e-7)


@pytest.mark.parametrize("wanted", [RESIDUAL, LARGEST_RESIDUAL])
@pytest.mark.parametrize("away", [1e-9, 1e-6, 1e-4, 1e-2])
def test_a_point_nearby_comes_to_the_curve_with_its_tangent(
    curve: Curve, rng: np.random.Generator, away: float, wanted: float
) -> None:
    """No more is left than is said, and the tangent is that of an elimination there."""
    walk, t = walk_on(curve), np.empty(7)
    for border in rng.normal(size=(10, 7)):
        border /= np.linalg.norm(border)
        volume = tangent(curve.q, border, t, walk)
        if abs(border @ t) < 0.3:
            continue
        x = curve.q + away * rng.normal(size=7)
        left, reached = to_curve(border, border @ x, wanted, x, walk.ty, walk)
        assert left <= wanted
        assert residual(curve, x) < left + 1e-14
        volume = tangent(x, border, t, walk)
        np.testing.assert_allclose(walk.ty, t, atol=3.0 * wanted)
        assert reached == pytest.approx(volume, rel=1e-4)


@pytest.mark.parametrize("h", [1e-6, 1e-3, 0.1, 0.5, 1.5, 4.0])
def test_a_step_of_any_length_fails_or_is_on_the_curve(curve: Curve, h: float) -> None:
    walk, volume = begun(curve, FIRST)
    result = advance(walk, h, volume, walk.y, walk.ty)
    assert result != StepResult.FAILED or h > 1e-3
    if result != StepResult.FAILED:
        assert residual(curve, walk.y) < 2.0 * LARGEST_RESIDUAL
        assert walk.t @ walk.ty > 0.9


def test_the_sign_tells_a_curve_from_its_neighbour(curve: Curve) -> None:
    walk, volume = begun(curve, FIRST)
    assert advance(walk, 0.01, -volume, walk.y, walk.ty) == StepResult.FLIPPED


def test_the_cubic_through_two_nodes_is_near_the_curve(curve: Curve) -> None:
    """Its error falls with the fourth power of the distance."""
    errors = []
    for h in (0.08, 0.04):
        a, b = nodes_along(curve, FIRST, 1, h)
        walk = walk_on(curve)
        assert point_across(a, b, 0.5, walk)
        assert residual(curve, walk.z) < LARGEST_RESIDUAL
        errors.append(max(abs(cubic(a, b, chord_length(a, b), 0.5, j) - walk.z[j]) for j in JOINTS))
    assert errors[0] < 1e-3
    assert errors[1] < 0.2 * errors[0] + 1e-12


def test_points_where_an_angle_has_a_value(curve: Curve, rng: np.random.Generator) -> None:
    walk = walk_on(curve)
    x, t, nodes = walk.z, walk.tz, nodes_along(curve, FIRST, 12, 0.1)
    tried = 0
    for a, b in pairwise(nodes):
        length = chord_length(a, b)
        for j in JOINTS:
            value = a[j] + rng.uniform(0.02, 0.98) * (b[j] - a[j])
            u = cubic_root(a, b, length, j, value, 0.0, 1.0)
            assert point_at(a, b, j, value, u, walk)
            assert x[j] == pytest.approx(value, abs=1e-13)
            assert residual(curve, x) < 2.0 * LARGEST_RESIDUAL
            np.testing.assert_allclose(curve.robot.jacobian(x) @ t, 0.0, atol=1e-9)
            tried += 1
    assert tried == 84


def test_points_where_an_angle_stands_still(curve: Curve) -> None:
    """They are its extremes: beside them it is less, or more; points just short of them are found on both sides."""
    walk = walk_on(curve)
    z, nodes = walk.z, nodes_along(curve, FIRST, 60, 0.08)
    tried = 0
    for a, b in pairwise(nodes):
        for j in JOINTS:
            if not (a[7 + j] * b[7 + j] < 0.0 and min(abs(a[7 + j]), abs(b[7 + j])) > 1e-3):
                continue
            assert point_where_still(a, b, j, walk)
            assert abs(walk.tz[j]) < 1e-11
            assert residual(curve, z) < LARGEST_RESIDUAL
            top, side = z.copy(), 1.0 if a[7 + j] > 0.0 else -1.0
            top_node = np.concatenate([top, walk.tz])
            for u in np.linspace(0.0, 1.0, 9):
                assert point_across(a, b, u, walk)
                assert side * (z[j] - top[j]) <= 1e-15
            if side * (a[j] - b[j]) < -1e-7:  # below the extreme, on the way up to it
                value = top[j] - side * 1e-9
                assert point_at(a, top_node, j, value, 0.999, walk)
                assert z[j] == pytest.approx(value, abs=1e-14)
                assert residual(curve, z) < 2.0 * LARGEST_RESIDUAL
            tried += 1
    assert tried > 0


def test_a_circle_is_followed_until_it_closes(rng: np.random.Generator) -> None:
    """Of a straight wrist: joints 5 and 7 turn a whole turn against each other, the others stand still."""
    curve = straight_wrist(rng)
    loops, _ = traced(curve, FIRST)
    first, end, state = loops.ends[0]
    assert state == CurveEnd.CLOSED
    nodes = loops.nodes[first:end, :7]
    for x in nodes:
        np.testing.assert_allclose(x, along_circle(curve, x[FIRST] - curve.q[FIRST]), atol=1e-9)
    turned = nodes[-1] - nodes[0]
    assert abs(turned[FIRST]) == pytest.approx(TURN)
    assert abs(turned[LAST]) == pytest.approx(TURN)
    assert np.linalg.norm(np.diff(nodes, axis=0), axis=1).max() < 1.2 * LONGEST_STEP


@pytest.mark.slow
def test_every_solution_is_passed_once_and_curves_close(rng: np.random.Generator) -> None:
    """All solutions at three values of joint 3: each curve comes back to where it began, through all others once."""
    robot = jacokin.load_robot("j2s7s300")
    curve, parameter = curve_through(robot, robot.sample(rng)), 2
    seven = make_seven_joints()
    seven.arm[:] = measure_seven(robot.pin_model, robot.frame_id(None)).arm
    slices = make_slices()
    for p in rng.uniform(-np.pi, np.pi, 3):
        assert add_slice(walk_on(curve), JOINT_3, p, slices, make_six_joints(), seven)
    loops, _ = traced(curve, parameter, slices)
    assert loops.size[1] > 0
    assert loops.size[3] == 0
    chords = []
    for first, end, state in loops.ends[: loops.size[1]]:
        assert state == CurveEnd.CLOSED
        nodes = loops.nodes[first:end]
        np.testing.assert_allclose(wrap_to_pi(nodes[-1, :7] - nodes[0, :7]), 0.0, atol=1e-9)
        np.testing.assert_allclose(nodes[-1, 7:], nodes[0, 7:], atol=1e-6)
        assert max(residual(curve, x) for x in nodes[:, :7]) < 2.0 * LARGEST_RESIDUAL
        chords += list(zip(nodes[:-1, parameter], nodes[1:, parameter], strict=True))
    assert slices.counts[: slices.size[0]].sum() > 0
    for i in range(slices.size[0]):
        count = slices.counts[i]
        assert (slices.passed[i, :count] == 1).all()
        # Counted in another way: how often the parameter passes the value, or one whole turns away.
        turns = [np.floor((np.array(chord) - slices.p[i]) / TURN) for chord in chords]
        assert sum(int(a != b) for a, b in turns) == count


def test_a_single_point_that_finds_no_room_is_a_doubt_and_no_curve() -> None:
    """A Jacobian of zero leads nowhere; nodes of other curves are not taken for those of one more."""
    slices, loops, walk = make_slices(), make_loops(), make_walk()
    slices.x[0, 0] = 0.0
    loops.size[0] = NODES
    follow(0, 0, slices, loops, walk)
    assert loops.size.tolist() == [NODES, 0, 0, 1]
    loops.size[0] = NODES - 1
    follow(0, 0, slices, loops, walk)
    assert loops.size.tolist() == [NODES, 1, 0, 2]
    assert loops.ends[0].tolist() == [NODES - 1, NODES, CurveEnd.CLOSED]
