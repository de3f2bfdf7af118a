"""The cheapest way up a ladder of solutions, against all ways there are."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver, Robot
from jacokin.kernels.rung_links import LinkWork, make_link_work
from jacokin.model.angles import TURN
from jacokin.model.many_configurations import Chain
from jacokin.motion.path import CartesianPath
from jacokin.motion.planning.manifold import Manifold, Pace
from jacokin.motion.planning.search import Ladder, PathSearch, Rung


def make_ladder(robot: Robot, path: CartesianPath, *, keep: bool = True) -> Ladder:
    solver = IKSolver(robot)
    manifold = Manifold(robot, Chain(robot, robot.frame_id(), None), path, 1e-9)
    pace = Pace(path.durations(0.1, 1.0), robot.velocity_limit)
    return Ladder(solver, manifold, pace, 0.5, robot.home, keep=keep)


def line(robot: Robot, q_from: list[float], q_to: list[float], *, free: bool = False) -> CartesianPath:
    poses = [robot.forward_kinematics(np.array(q)) for q in (q_from, q_to)]
    targets = [FreeAxis(pose, axis=(0.0, 0.0, 1.0), range=(-0.5, 0.5)) for pose in poses] if free else poses
    return CartesianPath(targets, robot.default_frame)


def cheapest_of_all(search: PathSearch) -> float:
    """The cost of the best of all ways, by trying each: first solution, then any link that leads on."""
    links = search.ladder.link(search.rungs)
    steps = [dict(zip(zip(a.first, a.second, strict=True), a.cost, strict=True)) for a in links]
    q = search.rungs[0].x[:, :6]
    starts = 0.1 * (((q - search.near) / search.ladder.pace.scale) ** 2).sum(axis=1)
    best = np.inf
    for way in itertools.product(*(range(len(rung.x)) for rung in search.rungs)):
        cost = starts[way[0]]
        for step, pair in zip(steps, itertools.pairwise(way), strict=True):
            cost += step.get(pair, np.inf)
        best = min(best, cost)
    return float(best)


def cost_of(search: PathSearch, way: list[int]) -> float:
    q = search.rungs[0].x[way[0], :6]
    cost = 0.1 * (((q - search.near) / search.ladder.pace.scale) ** 2).sum()
    for link, pair in zip(search.ladder.link(search.rungs), itertools.pairwise(way), strict=True):
        cost += link.cost[(link.first == pair[0]) & (link.second == pair[1])][0]
    return float(cost)


@pytest.mark.parametrize("free", [False, True], ids=["pose", "free axis"])
def test_the_way_is_the_cheapest_of_all(robot: Robot, free: bool) -> None:
    home = robot.home
    path = line(robot, home.tolist(), (home + 0.05).tolist(), free=free)
    ladder = make_ladder(robot, path)
    near = home + np.array([0.0, 0.3, -0.2, 0.0, 0.4, 0.0])  # on a joint that turns endlessly, the copy is the nearest
    search = PathSearch(ladder, np.array([0.0, 0.5, 1.0]), near, exactly=False)
    way = search.best()
    assert len(way) == len(search.rungs) == 3  # no step had to be made smaller
    assert min(len(rung.x) for rung in search.rungs) > 3
    assert cost_of(search, way) == pytest.approx(cheapest_of_all(search), rel=1e-12)


def test_what_is_cut_or_made_dearer_is_not_taken_again(robot: Robot) -> None:
    home = robot.home
    search = PathSearch(
        make_ladder(robot, line(robot, home.tolist(), (home + 0.05).tolist())),
        np.array([0.0, 0.5, 1.0]),
        home,
        exactly=False,
    )
    ways = [search.best()]
    search.cut(2, ways[0][1], ways[0][2])
    ways.append(search.best())
    assert search.charge(1, ways[1][0], ways[1][1], 1e6)
    assert not search.charge(1, ways[1][0], ways[1][1], 1e5)  # it costs more already
    ways.append(search.best())
    assert len({tuple(way) for way in ways}) == 3
    assert np.diff([cost_of(search, way) for way in ways]).min() > 0.0


def test_a_way_that_must_begin_at_a_configuration_does(robot: Robot) -> None:
    home = robot.home
    path = line(robot, home.tolist(), (home + 0.05).tolist())
    search = PathSearch(make_ladder(robot, path), np.array([0.0, 1.0]), home, exactly=True)
    assert np.abs(search.rungs[0].x[search.best()[0]] - home).max() < 1e-9
    away = PathSearch(make_ladder(robot, path), np.array([0.0, 1.0]), home + 0.1, exactly=True)
    assert away.best() == []


def test_steps_are_made_smaller_where_no_way_leads_on(robot: Robot) -> None:
    """Half a turn of the tool in one step: no solution follows another until the step is halved."""
    start = robot.forward_kinematics(robot.home)
    end = pin.SE3(start.rotation @ pin.exp3(np.array([0.0, 0.0, 2.5])), start.translation)
    path = CartesianPath([start, end], robot.default_frame)
    search = PathSearch(make_ladder(robot, path), np.array([0.0, 1.0]), robot.home, exactly=False)
    way = search.best()
    places = [rung.u for rung in search.rungs]
    assert len(way) == len(places) > 2
    assert places == sorted(places)
    q = np.array([rung.x[node] for rung, node in zip(search.rungs, way, strict=True)])
    assert np.abs(search.ladder.manifold.difference(q[:-1], q[1:])).max() <= 1.0


def check_links(ladder: Ladder, a: Rung, b: Rung, farthest: float = 2.5 * 0.5) -> None:
    """The links of two rungs at 0 and 0.3 of a line are those of all pairs of points that pass the rule."""
    manifold, keep = ladder.manifold, ladder.keep
    found = ladder.link([a, b])[0]
    first, second = np.divmod(np.arange(len(a.x) * len(b.x)), len(b.x))
    away = manifold.difference(a.x[first], b.x[second])
    parameters, dof = manifold.parameters, manifold.dof
    near = (np.abs(away[:, :dof]).max(axis=1) <= 1.0) & (np.abs(away[:, parameters]) <= farthest).all(axis=1)
    first, second, away = first[near], second[near], away[near]
    where = np.full(len(away), 0.15)
    position, tilt = manifold.chain.errors(a.x[first] + 0.5 * away, manifold.goal(where))
    more = 0.15 * (away[:, parameters] ** 2).sum(axis=1)
    good = (position <= 2e-3 + more) & (tilt <= 2e-2 + more)
    assert 3 < good.sum() < len(near)
    np.testing.assert_array_equal(found.first, first[good])
    np.testing.assert_array_equal(found.second, second[good])
    time = 0.3 * ladder.pace.times[0]
    speed = np.abs(away[good, :dof]) / ladder.pace.scale / time
    cost = time * (speed**2).sum(axis=1)
    if keep:
        cost += np.where(speed.max(axis=1) > 1.0, 1e3 * time * speed.max(axis=1), 0.0)
    np.testing.assert_allclose(found.cost, cost, rtol=1e-9)


def test_links_are_what_stays_near_the_line_half_way(robot: Robot) -> None:
    home = robot.home
    path = line(robot, home.tolist(), (home + 0.05).tolist(), free=True)
    for keep in (True, False):
        ladder = make_ladder(robot, path, keep=keep)
        a, b = ladder.make_rungs(np.array([0.0, 0.3]))
        check_links(ladder, a, b)


def test_links_of_surfaces_count_both_parameters(bundled: Callable[[str], Robot]) -> None:
    seven = bundled("j2s7s300")
    path = line(seven, seven.home.tolist(), (seven.home + 0.05).tolist(), free=True)
    manifold = Manifold(seven, Chain(seven, seven.frame_id(), None), path, 1e-9, "joint_3")
    pace = Pace(path.durations(0.1, 1.0), seven.velocity_limit)
    ladder = Ladder(IKSolver(seven), manifold, pace, 0.5, seven.home, keep=True)
    a, b = ladder.make_rungs(np.array([0.0, 0.3]), seven.home)
    on_surface = manifold.chain.errors(a.x, manifold.goal(np.zeros(len(a.x))))
    assert np.max(on_surface) < 1e-8
    assert np.unique(np.round(a.x[:, -1], 6)).size >= 2
    assert np.abs(a.x[:, :7] - seven.home).max(axis=1).min() < 1e-9  # where the arm is
    check_links(ladder, a, b, 2.5 * 2.0 * 0.5)


def test_configurations_a_turn_away_are_linked_as_well_without_looking_at_all_pairs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of six joints that move by two turns, each solution stands for up to 64 configurations."""
    limits = {f"joint_{k}": (-TURN, TURN) for k in (1, 4, 5, 6)} | {"joint_2": (0.9, 5.4), "joint_3": (0.4, 5.9)}
    robot = jacokin.load_robot("j2n6s300", limits=limits)
    home = np.array([0.01, 2.9, 1.3, -TURN + 0.02, TURN - 0.01, 3.1])
    ladder = make_ladder(robot, line(robot, home.tolist(), (home + 0.05 * np.sign(-home)).tolist(), free=True))
    a, b = ladder.make_rungs(np.array([0.0, 0.3]))
    assert len(a.x) > 8 * len(a.firsts) > 8
    rooms: list[int] = []

    def make(dof: int, width: int, parameters: int, rungs: int, solutions: int, room: int) -> LinkWork:
        rooms.append(room)
        return make_link_work(dof, width, parameters, rungs, solutions, room)

    monkeypatch.setattr("jacokin.motion.planning.search.make_link_work", make)
    check_links(ladder, a, b)
    assert rooms == [len(a.firsts) * len(b.firsts)]
