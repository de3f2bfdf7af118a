"""Ways around what is in the way: machine code as plain Python, random numbers as published, all motions clear."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin.arrays import Array
from jacokin.kernels.contact.run import ContactNumber
from jacokin.kernels.free_motion import run
from jacokin.kernels.free_motion.run import MotionWork, make_motion_work, run_free_motion
from jacokin.kernels.free_motion.shortcuts import WayInteger
from jacokin.kernels.free_motion.sight import IS_CERTAIN
from jacokin.kernels.free_motion.space import uniform
from jacokin.kernels.free_motion.trees import (
    NEAR,
    NEAR_TREE,
    NONE,
    SearchInteger,
    SearchNumber,
    cut_off,
    draw,
    is_worth,
    nearest_node,
)
from jacokin.kernels.library import Call
from jacokin.model import angles
from jacokin.model.contact import Contact
from jacokin.model.obstacles import Box, Surroundings
from jacokin.model.scene import Scene
from tests.kernels.plain import PlainCall

WALL = Scene([Box("wall", [0.6, 0.02, 0.5], [0.45, -0.05, 0.25])]).surroundings


def problem(around: Surroundings = WALL, form: Any = Call, room: int = 1024) -> tuple[Any, Contact]:
    """A call prepared for a motion past the wall, which is in the way of the straight one."""
    robot = jacokin.load_robot()
    contact = Contact(robot, around)
    call = form(run_free_motion, make_motion_work(contact.geometry, 4, room, 64, 2000))
    work: MotionWork = call.work
    space = work.space
    space.lower[:], space.upper[:], space.unlimited[:] = robot.lower, robot.upper, robot.unlimited
    space.low[:], space.high[:] = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, 2.0 * np.pi)
    space.low[robot.unlimited], space.high[robot.unlimited] = -np.pi, np.pi
    space.speed[:] = robot.velocity_limit
    space.levers[:] = contact.levers
    numbers = work.sight.contact.numbers
    numbers[ContactNumber.MARGIN_KEPT], numbers[ContactNumber.SLACK] = 0.0, 1e-4  # [m]
    work.generator[:] = 12345
    work.integers[run.MotionInteger.JOINTS], work.integers[run.MotionInteger.TRIES_IN_VAIN] = robot.dof, 40
    solver = jacokin.IKSolver(robot, collision="reject", scene=Scene([*WALL.obstacles]))
    work.start[:] = solver.solve(jacokin.pose([0.4, -0.3, 0.3], down=True)).q
    goal = solver.solve(jacokin.pose([0.4, 0.25, 0.3], down=True), seed=work.start).q
    work.goals[:6], work.integers[run.MotionInteger.GOALS], work.integers[run.MotionInteger.ENOUGH] = goal, 1, 1
    work.rows.limits[0::3], work.rows.limits[1::3] = robot.velocity_limit, 1.0
    return call, contact


def ask(call: Any, task: int, steps: int = 0) -> int:
    """Run one task."""
    call.work.integers[run.MotionInteger.TASK], call.work.integers[run.MotionInteger.STEPS] = task, steps
    return int(call())


def search(call: Any) -> None:
    """Until the trees meet."""
    begin(call)
    for _ in range(100):
        if ask(call, run.MotionTask.FIND_WAYS, 20) != run.SEARCHING:
            return
    pytest.fail("no way")


def begin(call: Any, ways: int = 1) -> None:
    """Try the straight motion, which is blocked, before so many ways around are looked for."""
    assert ask(call, run.MotionTask.STRAIGHT_MOTIONS) == 0
    assert call.work.integers[run.MotionInteger.GOAL] == NONE
    call.work.integers[run.MotionInteger.WAYS], call.work.integers[run.MotionInteger.IS_LATE] = ways, 0


def way_of(call: Any) -> Array:
    """The configurations (n, dof) of the way."""
    work: MotionWork = call.work
    return work.way.q[: 6 * work.way.integers[WayInteger.POINTS]].reshape(-1, 6).copy()


def rows_of(call: Any) -> Array:
    """Positions, velocities and accelerations (3, n, dof) of the way in rows."""
    call.work.rows.numbers[:] = 0.05, 1.0
    count = ask(call, run.MotionTask.ROWS)
    return np.array([each[: 6 * count].reshape(count, 6) for each in call.work.rows.rest[-3:]])


def time_of(call: Any, way: Array) -> float:
    """At full speed [s]."""
    return float((np.abs(np.diff(way, axis=0)) / call.work.space.speed).max(axis=1).sum())


def test_random_numbers_are_those_of_the_generator_that_is_cited() -> None:
    """The first numbers of RngStreams, which is MRG32k3a with 12345 six times (L'Ecuyer and others, 2002)."""
    generator = np.full(6, 12345, dtype=np.int64)
    drawn = [uniform(generator) for _ in range(3)]
    np.testing.assert_allclose(drawn, [0.12701112204657714, 0.3185275653967945, 0.3091860155832701], rtol=1e-15)


@pytest.mark.slow
def test_machine_code_finds_what_plain_python_finds() -> None:
    compiled, plain = problem()[0], problem(form=PlainCall)[0]
    for call in (compiled, plain):
        search(call)
        while ask(call, run.MotionTask.FIND_WAYS, 12) != run.FINISHED:
            pass
    assert (rows_of(compiled) == rows_of(plain)).all()
    np.testing.assert_array_equal(way_of(compiled), way_of(plain))
    np.testing.assert_array_equal(compiled.work.cuts, plain.work.cuts)
    np.testing.assert_array_equal(compiled.work.numbers, plain.work.numbers)
    np.testing.assert_array_equal(compiled.work.generator, plain.work.generator)


def test_ways_are_clear_lead_to_the_goal_and_repeat(rng: np.random.Generator) -> None:
    call, contact = problem()
    for _ in range(5):
        call.work.generator[:] = rng.integers(1, 1000, 6)
        before = call.work.generator.copy()
        search(call)
        way = way_of(call)
        assert all(contact.in_the_way(a, b) is None for a, b in itertools.pairwise(way))
        np.testing.assert_array_equal(way[0], call.work.start)
        assert call.work.way.integers[WayInteger.GOAL] == 0
        turns = (way[-1] - call.work.goals[:6]) / (2.0 * np.pi)
        np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)
        limited = call.work.space.unlimited == 0
        assert not np.round(turns)[limited].any()
        longest = time_of(call, way)
        while ask(call, run.MotionTask.FIND_WAYS, 10) != run.FINISHED:
            shorter = time_of(call, way_of(call))
            assert shorter <= longest + 1e-9
            longest = shorter
        way = way_of(call)
        assert (way >= call.work.space.lower).all()
        assert (way <= call.work.space.upper).all()
        for a, b in itertools.pairwise(way):
            assert contact.in_the_way(a, b) is None
            assert not any(contact.touches(a + share * (b - a)) for share in np.linspace(0.0, 1.0, 400))
        call.work.generator[:] = before
        search(call)
        while ask(call, run.MotionTask.FIND_WAYS, 3) != run.FINISHED:
            pass
        np.testing.assert_array_equal(way_of(call), way)


def test_the_quickest_of_some_ways_is_taken(rng: np.random.Generator) -> None:
    call, contact = problem()
    for _ in range(4):
        before, found = rng.integers(1, 1000, 6), []
        for ways in (1, 2, 6):
            call.work.generator[:] = before
            begin(call, ways)
            while ask(call, run.MotionTask.FIND_WAYS, 256) != run.FINISHED:
                pass
            assert call.work.integers[run.MotionInteger.GOAL] == 0
            duration, at_full_speed = call.work.numbers.tolist()
            assert time_of(call, way_of(call)) == pytest.approx(at_full_speed, rel=1e-12)
            assert duration == pytest.approx(0.05 * (rows_of(call).shape[1] - 1), abs=0.2)
            assert all(contact.in_the_way(a, b) is None for a, b in itertools.pairwise(way_of(call)))
            found.append(duration)
        assert found[0] >= found[1] >= found[2]


def test_motions_of_the_trees_that_are_certain_are_clear(rng: np.random.Generator) -> None:
    call, contact = problem()
    trees, space, certain = call.work.trees, call.work.space, 0
    for _ in range(20):
        call.work.generator[:] = rng.integers(1, 1000, 6)
        search(call)
        for tree in range(2):
            q, first = trees.q.reshape(2, -1, 6)[tree], 1024 * tree
            for node in range(trees.integers[tree]):
                parent = trees.parents[first + node]
                if parent != NONE and trees.known[first + node] == IS_CERTAIN:
                    end = angles.nearest_copy(q[node], q[parent], space.unlimited == 1)
                    assert contact.in_the_way(q[parent], end) is None
                    certain += 1
    assert certain > 10


def test_a_cut_corner_is_clear() -> None:
    call, contact = problem()
    search(call)
    ask(call, run.MotionTask.CORNERS)
    way, cuts, times = way_of(call), call.work.cuts, call.work.way.times
    assert cuts[: len(way)].any()
    for k in range(1, len(way) - 1):
        if not cuts[k]:
            continue
        back, ahead = cuts[k] / (times[k] - times[k - 1]), cuts[k] / (times[k + 1] - times[k])
        first, last = way[k] + back * (way[k - 1] - way[k]), way[k] + ahead * (way[k + 1] - way[k])
        for u in np.linspace(0.0, 1.0, 200):
            assert not contact.touches((1 - u) ** 2 * first + 2 * u * (1 - u) * way[k] + u * u * last)


def test_corners_that_are_none_are_left_out() -> None:
    call = problem()[0]
    search(call)
    while ask(call, run.MotionTask.FIND_WAYS, 50) != run.FINISHED:
        pass
    way, cuts = way_of(call), call.work.cuts.copy()
    assert len(way) > 2
    more = [way[0]]
    for a, b in itertools.pairwise(way):
        more += [a, 0.25 * (3.0 * a + b), 0.5 * (a + b), b]
    call.work.way.q[: 6 * len(more)] = np.ravel(more)
    call.work.way.integers[WayInteger.POINTS] = len(more)
    ask(call, run.MotionTask.CORNERS)
    np.testing.assert_allclose(way_of(call), way, rtol=0, atol=1e-12)
    np.testing.assert_allclose(call.work.cuts[: len(way)], cuts[: len(way)], rtol=0, atol=1e-12)
    assert cuts[1 : len(way) - 1].any()
    call.work.integers[[run.MotionInteger.KEPT_FIRST, run.MotionInteger.KEPT_LAST]] = 1, len(way) - 3
    ask(call, run.MotionTask.CORNERS)
    assert not call.work.cuts[: len(way)].any()


def test_a_goal_to_which_no_motion_is_certain_is_told_apart() -> None:
    call, contact = problem()
    work: MotionWork = call.work
    work.goals[:6], work.start[:] = work.start.copy(), work.goals[:6].copy()
    start, goal = contact.distances(np.array([work.start, work.goals[:6]]), self_collision=True).tolist()
    assert start > goal + 2e-3  # [m]
    slack = goal + 1e-3
    for kept, state in ((1e-4, run.GoalState.BLOCKED), (slack, run.GoalState.NEAR)):
        work.sight.contact.numbers[ContactNumber.SLACK] = kept
        assert ask(call, run.MotionTask.LOOK) == 1
        assert ask(call, run.MotionTask.STRAIGHT_MOTIONS) == (state == run.GoalState.NEAR)
        assert work.known[0] == state
    work.start[:] = work.goals[:6]
    assert ask(call, run.MotionTask.LOOK) == 0


def test_the_nearest_node_is_the_nearest_on_the_torus(rng: np.random.Generator) -> None:
    call = problem()[0]
    search(call)
    work: MotionWork = call.work
    sizes = work.trees.integers[[SearchInteger.FIRST_SIZE, SearchInteger.SECOND_SIZE]]
    for tree in range(2):
        nodes = work.trees.q[tree * 1024 * 6 :][: sizes[tree] * 6].reshape(-1, 6)
        for _ in range(20):
            q = rng.uniform(work.space.low, work.space.high)
            away = np.abs(nodes - q)
            away = np.where(work.space.unlimited == 1, np.minimum(away, 2.0 * np.pi - away), away)
            expected = np.argmin(((away * work.space.weights) ** 2).sum(axis=1))
            assert nearest_node(work.trees, work.space, 6, tree, q) == expected


def test_what_is_cut_off_is_nearest_to_nothing(rng: np.random.Generator) -> None:
    call = problem()[0]
    search(call)
    trees, space = call.work.trees, call.work.space
    size, lost = int(trees.integers[SearchInteger.FIRST_SIZE]), {2}
    for node in range(3, size):
        if int(trees.parents[node]) in lost:
            lost.add(node)
    cut_off(trees, 6, 0, 2)
    away = np.isinf(trees.columns[: 6 * 1024].reshape(6, -1)[:, :size]).all(axis=0)
    assert set(np.flatnonzero(away).tolist()) == lost
    for _ in range(50):
        assert nearest_node(trees, space, 6, 0, rng.uniform(space.low, space.high)) not in lost


def test_random_configurations_lie_where_a_way_is_quick_enough() -> None:
    call = problem()[0]
    search(call)
    work: MotionWork = call.work
    trees, space = work.trees, work.space
    start, goal = trees.q[:6], trees.q[1024 * 6 :][:6]
    direct = time_of(call, np.array([start, angles.nearest_copy(goal, start, space.unlimited == 1)]))
    for bound in (1.05 * direct, 1.5 * direct, 4.0 * direct):
        trees.numbers[SearchNumber.BOUND], quick, seen = bound, 0, []
        for _ in range(1000):
            draw(trees, space, 6, work.generator, 0)
            seen.append(trees.sample.copy())
            quick += is_worth(trees, space, 6, trees.sample)
            assert (space.low <= trees.sample).all()
            assert (trees.sample <= space.high).all()
        assert quick == 1000
        assert (np.ptp(seen, axis=0) > 0.0).all()


@pytest.mark.parametrize("tree", [0, 1])
def test_random_configurations_are_near_to_the_tree_that_grows_or_to_what_is_between_the_ends(tree: int) -> None:
    call = problem()[0]
    call.work.space.high[:] = np.where(call.work.space.unlimited, np.pi, 50.0)  # [rad] hardly ever near, at random
    search(call)
    work: MotionWork = call.work
    trees, space = work.trees, work.space
    nodes = trees.q.reshape(2, -1, 6)[tree, : trees.integers[tree]]
    wraps = space.unlimited == 1
    start, goal = work.start, angles.nearest_copy(work.goals[:6], work.start, wraps)
    low, high, near_tree, drawn = np.minimum(start, goal) - NEAR, np.maximum(start, goal) + NEAR, 0, set()
    for _ in range(1000):
        draw(trees, space, 6, work.generator, tree)
        q = trees.sample
        away = q - nodes
        away -= 2.0 * np.pi * np.round(away / (2.0 * np.pi)) * wraps
        on_tree = bool((np.abs(away) <= NEAR + 1e-9).all(axis=1).any())
        turned = low + (q - low) % (2.0 * np.pi) * wraps + (q - low) * ~wraps
        assert on_tree or ((low - 1e-9 <= turned) & (turned <= high + 1e-9)).all()
        assert ((space.low <= q) & (q <= space.high)).all()
        near_tree += on_tree
        drawn.add(q.tobytes())
    assert near_tree >= 1000 * NEAR_TREE - 60
    assert len(drawn) == 1000


def test_a_search_without_room_says_so() -> None:
    call = problem(room=2)[0]
    begin(call)
    assert ask(call, run.MotionTask.FIND_WAYS, 500) == run.SEARCHING
    assert call.work.trees.integers[SearchInteger.IS_FULL] == 1
    assert call.work.trees.integers[SearchInteger.SAMPLES] == 0
    assert len(call.work.way.integers) == WayInteger.COUNT


def test_pairs_in_the_way_are_counted() -> None:
    call, contact = problem()
    search(call)
    seen = call.work.hindrances
    count = int((seen.times > 0).sum())
    assert count > 0
    assert "wall" in {contact.names[k] for k in seen.pairs[:count].ravel().tolist()}
