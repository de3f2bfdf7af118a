"""What of a curve is within the limits: on curves whose points are known."""

from __future__ import annotations

import numpy as np
import pytest

import jacokin
from jacokin.arrays import Array
from jacokin.kernels.solution_set import within
from jacokin.kernels.solution_set.curve import make_walk, point_where_still
from jacokin.kernels.solution_set.trace import CurveEnd, Loops, make_loops
from jacokin.kernels.solution_set.within import CIRCLE, FOLD, Pieces, cut, excess, make_pieces, nearest_limit
from jacokin.model.angles import TURN, wrap_to_pi
from tests.kernels.solution_set.known_curves import (
    FIRST,
    LAST,
    Curve,
    along_circle,
    curve_through,
    residual,
    straight_wrist,
    traced,
    walk_on,
)

LOWER, UPPER = 0, 1


def without_limits() -> Array:
    """Limits (2, 7) of joints without any."""
    return np.array([np.full(7, -np.inf), np.full(7, np.inf)])


def pieces_of(curve: Curve, parameter: int, loops: Loops, limits: Array) -> Pieces:
    """The pieces of traced curves within limits."""
    pieces = make_pieces()
    pieces.limits[:] = limits
    cut(loops, pieces, walk_on(curve, parameter))
    assert pieces.size[3] == 0  # nothing went wrong
    return pieces


def rows_of(pieces: Pieces) -> list[Array]:
    """The nodes (n, 14) of each piece."""
    return [pieces.nodes[first:end] for first, end in pieces.ends[: pieces.size[1], :2]]


def test_how_far_angles_are_past_their_limits(rng: np.random.Generator) -> None:
    """The largest excess of any joint, whole turns aside; and which limit that is."""
    limits = without_limits()
    limits[:, 1], limits[:, 4] = (-0.5, 2.0), (1.0, 1.5)
    assert excess(rng.normal(size=7), without_limits()) == -np.inf
    x = rng.normal(size=7)
    for turns in (-2, 0, 1):
        x[1], x[4] = 1.9 + TURN * turns, 1.2 + TURN * turns
        assert excess(x, limits) == pytest.approx(-0.1)
        assert nearest_limit(x, limits) == 2 * 1 + UPPER
        x[4] = 0.7 + TURN * turns
        assert excess(x, limits) == pytest.approx(0.3)
        assert nearest_limit(x, limits) == 2 * 4 + LOWER


def test_without_limits_a_circle_is_whole(rng: np.random.Generator) -> None:
    curve = straight_wrist(rng)
    loops, _ = traced(curve, FIRST)
    pieces = pieces_of(curve, FIRST, loops, without_limits())
    (rows,) = rows_of(pieces)
    assert pieces.ends[0, 2:4].tolist() == [CIRCLE, CIRCLE]
    assert rows[-1, FIRST] - rows[0, FIRST] == pytest.approx(TURN)


@pytest.mark.parametrize(("width", "count"), [(3.0, 1), (TURN - 0.01, 1), (TURN + 0.5, 2)])
def test_a_piece_is_a_turn_long_at_most(width: float, count: int) -> None:
    """From fold to fold and back: it is cut where it would be longer."""
    loops, walk, pieces, s = make_loops(), make_walk(), make_pieces(), np.linspace(0.0, TURN, 81)
    loops.nodes[: len(s)] = 0.0
    loops.nodes[: len(s), 0], loops.nodes[: len(s), 1] = 0.5 * width * (1.0 - np.cos(s)), np.sin(s)
    tangents = np.column_stack([0.5 * width * np.sin(s), np.cos(s)])
    loops.nodes[: len(s), 7:9] = tangents / np.linalg.norm(tangents, axis=1)[:, np.newaxis]
    loops.fold[[0, 40]] = 1
    loops.ends[0], loops.size[:2] = (0, len(s), CurveEnd.CLOSED), (len(s), 1)
    pieces.limits[:] = without_limits()
    cut(loops, pieces, walk)
    rows = rows_of(pieces)
    assert len(rows) == 2 * count
    assert sum(each[-1, 0] - each[0, 0] for each in rows) == pytest.approx(2.0 * width)
    assert max(each[-1, 0] - each[0, 0] for each in rows) <= TURN
    assert (pieces.ends[: 2 * count, 2:4] == CIRCLE).sum() == 4 * (count - 1)


def test_a_circle_is_cut_where_joint_5_is_on_its_limits(rng: np.random.Generator) -> None:
    """At the values themselves; the piece begins at the one and ends at the other."""
    curve = straight_wrist(rng)
    loops, _ = traced(curve, FIRST)
    for _ in range(5):
        limits = without_limits()
        limits[:, FIRST] = np.cumsum(rng.uniform(0.2, 3.0, 2))
        pieces = pieces_of(curve, FIRST, loops, limits)
        (rows,) = rows_of(pieces)
        assert pieces.ends[0, 2:4].tolist() == [2 * FIRST + LOWER, 2 * FIRST + UPPER]
        np.testing.assert_allclose(wrap_to_pi(rows[[0, -1], FIRST] - limits[:, FIRST]), 0.0, atol=1e-14)
        for x in rows[:, :7]:
            np.testing.assert_allclose(x, along_circle(curve, x[FIRST] - curve.q[FIRST]), atol=1e-9)


def test_a_table_that_is_full_is_a_doubt(rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pieces of a curve with folds, as many as there is room for: nothing is read or written beyond their table."""
    robot, parameter = jacokin.load_robot("j2s7s300"), 2
    curve = curve_through(robot, robot.sample(rng))
    loops, _ = traced(curve, parameter)
    whole = pieces_of(curve, parameter, loops, without_limits())
    pieces = make_pieces()
    pieces.limits[:] = without_limits()
    for room in (1, *(int(first) for first in whole.ends[1 : whole.size[1], 0])):
        monkeypatch.setattr(within, "ROWS", room)
        cut(loops, pieces._replace(nodes=pieces.nodes[:room]), walk_on(curve, parameter))
        assert pieces.size[3] > 0
        assert pieces.size[0] == pieces.ends[pieces.size[1] - 1, 1] == room


def test_two_joints_cut_a_circle_where_both_are_within(rng: np.random.Generator) -> None:
    """Arcs of joint 5 and of joint 7, which turns against it: what they have in common, in up to two pieces."""
    curve = straight_wrist(rng)
    loops, _ = traced(curve, FIRST)
    way = along_circle(curve, 1.0)[LAST] - curve.q[LAST]
    seen = set()
    for _ in range(12):
        limits = without_limits()
        limits[:, FIRST] = curve.q[FIRST] + np.cumsum([rng.uniform(-3.0, 0.0), rng.uniform(1.0, 5.0)])
        limits[:, LAST] = curve.q[LAST] + np.cumsum([rng.uniform(-3.0, 0.0), rng.uniform(1.0, 5.0)])
        pieces = pieces_of(curve, FIRST, loops, limits)
        # How far along the circle each joint is within its limits, and where both are.
        a = limits[:, FIRST] - curve.q[FIRST]
        b = np.sort(way * (limits[:, LAST] - curve.q[LAST]))
        common = [(max(a[0], b[0] + k * TURN), min(a[1], b[1] + k * TURN)) for k in (-1, 0, 1)]
        wanted = sorted(wrap_to_pi(low) for low, high in common if low < high)
        found = sorted(wrap_to_pi(rows[0, FIRST] - curve.q[FIRST]) for rows in rows_of(pieces))
        np.testing.assert_allclose(found, wanted, atol=1e-12)
        length = sum(max(high - low, 0.0) for low, high in common)
        assert sum(rows[-1, FIRST] - rows[0, FIRST] for rows in rows_of(pieces)) == pytest.approx(length, abs=1e-11)
        seen.add(len(found))
    assert seen >= {1, 2}


def test_pieces_of_any_curve_cover_what_is_within(rng: np.random.Generator) -> None:
    """Of a seven-joint Jaco with its limits: each node of the curve is in a piece just when it is within them."""
    robot, parameter = jacokin.load_robot("j2s7s300"), 2
    for q in robot.sample(rng, 3):
        curve = curve_through(robot, q)
        loops, _ = traced(curve, parameter)
        bounded = np.isfinite(robot.lower)
        limits = without_limits()
        limits[:, bounded] = robot.lower[bounded], robot.upper[bounded]
        pieces = pieces_of(curve, parameter, loops, limits)
        rows = rows_of(pieces)
        for each in rows:
            assert (np.diff(each[:, parameter]) >= -1e-9).all()  # the parameter rises
            assert max(excess(x, limits) for x in each[:, :7]) <= 1e-9
            assert max(residual(curve, x) for x in each[:, :7]) < 1e-9
        kept = np.concatenate(rows)[:, :7]
        first, end, _ = loops.ends[0]
        within = 0
        for x in loops.nodes[first:end, :7]:
            among = np.abs(wrap_to_pi(kept - x)).max(axis=1).min() < 1e-9
            assert among == (excess(x, limits) <= 1e-9)
            within += among
        assert within > 0
        for code, node in [(pieces.ends[k, 2 + side], each[-side]) for k, each in enumerate(rows) for side in (0, 1)]:
            if code >= 0:  # on the limit that is named
                assert wrap_to_pi(node[code // 2] - limits[code % 2, code // 2]) == pytest.approx(0.0, abs=1e-9)
            elif code == FOLD:
                assert abs(node[7 + parameter]) < 1e-9


def extreme(curve: Curve, loops: Loops, joint: int) -> Array:
    """The point (7,) of a curve where an angle is largest, and stands still."""
    first, end, _ = loops.ends[0]
    nodes = loops.nodes[first:end]
    top = int(nodes[:-1, joint].argmax())
    before = nodes[top - 1] if top > 0 else nodes[-2]
    after = nodes[top + 1]
    walk = walk_on(curve)
    a, b = (nodes[top], after) if nodes[top, 7 + joint] > 0.0 else (before, nodes[top])
    assert point_where_still(a, b, joint, walk)
    return walk.z


@pytest.mark.one_quick
@pytest.mark.parametrize("joint", [1, 5])
def test_a_joint_that_touches_its_limit(rng: np.random.Generator, joint: int) -> None:
    """One point where its largest angle is its lower limit, to the root of rounding; two ends beside it where the limit
    is a little below; nothing where it is above.
    """
    robot, parameter, tried = jacokin.load_robot("j2s7s300"), 2, 0
    for q in robot.sample(rng, 6):
        curve = curve_through(robot, q)
        loops, _ = traced(curve, parameter)
        nodes = loops.nodes[loops.ends[0, 0] : loops.ends[0, 1]]
        if np.ptp(nodes[:, joint]) > 2.9:  # the window of the limits below is 3 rad wide
            continue
        top, pieces, tried = extreme(curve, loops, joint), {}, tried + 1
        for below in (0.0, 1e-5, -1e-6):
            limits = without_limits()
            limits[:, joint] = top[joint] - below + np.array([0.0, 3.0])
            pieces[below] = rows_of(pieces_of(curve, parameter, loops, limits))
            assert all(residual(curve, x) < 1e-9 for rows in pieces[below] for x in rows[:, :7])
        assert pieces[-1e-6] == []
        (touching,) = pieces[0.0]
        np.testing.assert_allclose(wrap_to_pi(touching[:, :7] - top), 0.0, atol=3e-4)
        (across,) = pieces[1e-5]
        np.testing.assert_allclose(wrap_to_pi(across[[0, -1], joint] - top[joint]), -1e-5, atol=1e-13)
        ends = wrap_to_pi(across[[0, -1], :7] - top)
        assert ends[0] @ ends[1] < 0.0  # on both sides
        np.testing.assert_allclose(ends, 0.0, atol=0.1)
    assert tried > 0
