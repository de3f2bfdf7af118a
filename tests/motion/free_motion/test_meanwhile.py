"""Plans beside other robots that move: nothing touches at any time, the arm waits or moves aside, and says so."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import jacokin
from benchmarks.two_arms import CLEARANCE, KNOWN, Referee, plan, random_pairs
from jacokin import IKSolver, Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.ik import Box, Floor, Scene, Sphere
from jacokin.motion import MotionState, Trajectory, move_joints, plan_motion
from tests.two_robots import TwoRobots

ACROSS = jacokin.pose([0.8, 0.0, 0.0], rpy=[0.0, 0.0, np.pi])


def over_the_table(robot: Robot, x: float, y: float, z: float = 0.25) -> Array:
    """A configuration (dof,) whose tool points down at a place [m]."""
    result = IKSolver(robot, scene=Scene([Floor(0.0)])).solve(jacokin.pose([x, y, z], down=True), seed=robot.home)
    assert result.success, result.message
    return np.asarray(result.q)


def least(both: TwoRobots, motion: Trajectory, other: Trajectory, begin: float = 0.0, step: float = 0.02) -> float:
    """The smallest distance at all times until both rest, the other one a time ahead [m]."""
    times = np.arange(0.0, max(motion.duration, other.duration - begin) + step, step)
    return min(both.least(motion.state_at(t).q, other.state_at(t + begin).q) for t in times.tolist())


@pytest.fixture(scope="module")
def both(robot: Robot) -> TwoRobots:
    return TwoRobots(robot, robot, ACROSS)


@pytest.fixture(scope="module")
def crossing(robot: Robot) -> tuple[Trajectory, Array, Array]:
    """A motion of the other arm over the middle of the table, and where this one goes across it."""
    there = move_joints(robot, over_the_table(robot, 0.4, -0.35), over_the_table(robot, 0.4, 0.35))
    return there, over_the_table(robot, 0.4, -0.35), over_the_table(robot, 0.4, 0.35)


@pytest.fixture(scope="module")
def solver(robot: Robot, crossing: tuple[Trajectory, Array, Array]) -> IKSolver:
    scene = Scene([Floor(0.0)]).adding_robot(robot, crossing[0].q[0], name="other", base=ACROSS)
    return IKSolver(robot, scene=scene)


@pytest.mark.slow
def test_random_pairs_of_tasks_never_touch(robot: Robot) -> None:
    """By MuJoCo, with both arms in one model, at steps of 2 mrad."""
    referee, solved, waits = Referee(robot), 0, 0
    for pair in random_pairs(robot, 12):
        outcome = plan(robot, pair, 10.0)
        if outcome.motions is None:
            assert outcome.reasons
            continue
        solved += 1
        waits += "waits" in outcome.motions[outcome.order[1]].message
        distance, what = referee.nearest(outcome.motions, 2e-3)
        assert distance > CLEARANCE - KNOWN, what
    assert solved >= 10
    assert waits


@pytest.mark.slow
def test_it_waits_until_the_other_has_passed(robot: Robot, solver: IKSolver, both: TwoRobots) -> None:
    """The other arm stands where this one is to go, and moves slowly away."""
    there, start, goal = (
        over_the_table(robot, 0.4, 0.0),
        over_the_table(robot, 0.3, 0.3),
        over_the_table(robot, 0.4, 0.0),
    )
    other = move_joints(robot, there, over_the_table(robot, 0.2, 0.4), velocity_limit=0.06)
    scene = Scene([Floor(0.0)]).adding_robot(robot, there, name="other", base=ACROSS)
    motion = plan_motion(IKSolver(robot, scene=scene), start, goal, meanwhile={"other": other}, time_limit=10.0)
    assert motion.success, motion.message
    assert re.match(r"waits [0-9.]+ s for other; then reached in", motion.message)
    np.testing.assert_array_equal(motion.q[0], start)
    np.testing.assert_allclose(np.cos(motion.q[-1] - goal), 1.0)
    waited = int(np.argmax((motion.q != start).any(axis=1)))
    assert waited > 1
    assert not motion.v[: waited - 1].any()
    assert least(both, motion, other) > 0.0
    begun = Trajectory.of(robot, robot.velocity_limit, _without(motion, waited - 1))
    assert least(both, begun, other) < 0.0  # it does not wait for nothing


def test_it_moves_aside_where_the_other_passes(
    robot: Robot, solver: IKSolver, both: TwoRobots, crossing: tuple[Trajectory, Array, Array]
) -> None:
    other, start, goal = crossing
    motion = plan_motion(solver, start, goal, meanwhile={"other": other}, time_limit=10.0)
    assert motion.success, motion.message
    assert motion.message.startswith("moves aside first")
    assert least(both, motion, other) > 0.0
    direct = move_joints(robot, start, goal)
    assert least(both, direct, other) < 0.0
    assert (np.abs(motion.v) <= robot.velocity_limit * (1.0 + 1e-9)).all()
    np.testing.assert_array_equal(motion.q[[0, -1]], [start, goal])


@pytest.mark.slow
def test_an_arm_at_its_goal_makes_way_and_comes_back(
    robot: Robot, solver: IKSolver, both: TwoRobots, crossing: tuple[Trajectory, Array, Array]
) -> None:
    other = crossing[0]
    middle = over_the_table(robot, 0.4, 0.0)
    away = plan_motion(solver, middle, middle, meanwhile={"other": other}, time_limit=10.0)
    assert away.success, away.message
    assert len(away) > 2
    np.testing.assert_array_equal(away.q[[0, -1]], [middle, middle])
    assert least(both, away, other) > 0.0


def test_distances_along_the_motion_are_those_in_time(
    robot: Robot, solver: IKSolver, both: TwoRobots, crossing: tuple[Trajectory, Array, Array]
) -> None:
    other, start, goal = crossing
    motion = plan_motion(solver, start, goal, meanwhile={"other": other}, time_limit=10.0)
    alone = robot.clearance(motion.q, Scene([Floor(0.0)]), self_collision=True)
    for row in range(0, len(motion), 40):
        beside = both.least(motion.q[row], other.state_at(float(motion.t[row])).q)
        expected = min(float(np.asarray(alone)[row]), beside)
        assert motion.clearance[row] == pytest.approx(expected, abs=1e-5) or beside >= 0.05


def test_a_clearance_is_kept_in_time(robot: Robot, both: TwoRobots, crossing: tuple[Trajectory, Array, Array]) -> None:
    other, start, goal = crossing
    scene = Scene([Floor(0.0)]).adding_robot(robot, other.q[0], name="other", base=ACROSS)
    solver = IKSolver(robot, scene=scene, clearance=0.03)
    motion = plan_motion(solver, start, goal, meanwhile={"other": other}, time_limit=10.0)
    assert motion.success, motion.message
    assert least(both, motion, other) > 0.03 - 1e-4


def test_a_motion_under_way_is_met_where_it_is(
    robot: Robot, solver: IKSolver, both: TwoRobots, crossing: tuple[Trajectory, Array, Array]
) -> None:
    """The arm begins while the other one is half across; where it stood before is free by then."""
    other, _, goal = crossing
    late = 0.5 * other.duration
    scene = Scene([Floor(0.0)]).adding_robot(robot, other.q[0], name="other", base=ACROSS)
    begin = over_the_table(robot, 0.4, 0.35)  # where the other one began
    assert both.least(begin, other.q[0]) < 0.0
    moving = IKSolver(robot, scene=scene)
    refused = plan_motion(moving, begin, goal, meanwhile={"other": other})
    assert refused.outcome == "START_IN_CONTACT"
    assert "other/" in refused.message
    free = over_the_table(robot, 0.25, 0.4, 0.3)
    motion = plan_motion(moving, begin, free, meanwhile={"other": (other, late)}, time_limit=10.0)
    assert motion.success, motion.message
    assert least(both, motion, other, begin=late) > 0.0
    ended = plan_motion(moving, begin, free, meanwhile={"other": (other, 100.0)}, time_limit=10.0)
    assert ended.success, ended.message
    assert "waits" not in ended.message


@pytest.mark.slow
def test_two_others_and_things_that_stand(robot: Robot, bundled: Callable[[str], Robot]) -> None:
    lite = bundled("gen3_lite")
    near = jacokin.pose([0.1, 0.8, 0.0])
    first = move_joints(robot, over_the_table(robot, 0.4, -0.35), over_the_table(robot, 0.4, 0.35))
    second = move_joints(lite, lite.home, lite.home + 0.4)
    scene = Scene([Floor(0.0), Box("post", [0.05, 0.05, 0.5], [0.3, 0.0, 0.25])])
    scene = scene.adding_robot(robot, first.q[0], name="across", base=ACROSS)
    scene = scene.adding_robot(lite, lite.home, name="beside", base=near)
    solver = IKSolver(robot, scene=scene)
    start, goal = over_the_table(robot, 0.4, -0.35), over_the_table(robot, 0.35, 0.35)
    motion = plan_motion(solver, start, goal, meanwhile={"across": first, "beside": second}, time_limit=10.0)
    assert motion.success, motion.message
    assert least(TwoRobots(robot, robot, ACROSS), motion, first) > 0.0
    assert least(TwoRobots(robot, lite, near), motion, second) > 0.0
    assert np.min(robot.clearance(motion.q, scene.removing("across", "beside"))) > 0.0
    # One of them stands: it is an obstacle where the scene has it.
    alone = plan_motion(solver, start, goal, meanwhile={"across": first}, time_limit=10.0)
    assert alone.success, alone.message
    assert min(TwoRobots(robot, lite, near).least(q, lite.home) for q in alone.q[::5]) > 0.0


@pytest.mark.slow
def test_what_is_held_keeps_clear(robot: Robot, crossing: tuple[Trajectory, Array, Array]) -> None:
    """A ball in the hand, as large as the hand: the arm that carries it is never nearer than its clearance."""
    other, start, goal = crossing
    scene = Scene([Floor(0.0)]).adding_robot(robot, other.q[0], name="other", base=ACROSS)
    held = scene.attach(Sphere("ball", 0.06, [0.0, 0.0, 0.06]), "end_effector").allowing(("ball", "hand"))
    motion = plan_motion(IKSolver(robot, scene=held), start, goal, meanwhile={"other": other}, time_limit=10.0)
    assert motion.success, motion.message
    for row in range(0, len(motion), 20):
        there = other.state_at(float(motion.t[row])).q
        assert float(np.min(robot.clearance(motion.q[row], held.moving({"other": there})))) > 0.0


def test_plans_repeat(robot: Robot, solver: IKSolver, crossing: tuple[Trajectory, Array, Array]) -> None:
    other, start, goal = crossing
    first, again = (plan_motion(solver, start, goal, meanwhile={"other": other}, time_limit=30.0) for _ in range(2))
    np.testing.assert_array_equal(first.q, again.q)
    assert first.message == again.message


def test_a_goal_where_the_other_stops_is_refused(
    robot: Robot, solver: IKSolver, crossing: tuple[Trajectory, Array, Array]
) -> None:
    other, start = crossing[0], over_the_table(robot, 0.2, 0.4, 0.3)
    goal = over_the_table(robot, 0.4, -0.33)  # the bases are opposite each other
    motion = plan_motion(solver, start, goal, meanwhile={"other": other})
    assert motion.outcome == "GOAL_IN_CONTACT"
    assert "other/" in motion.message
    np.testing.assert_array_equal(motion.q, [start])


@pytest.mark.parametrize(
    ("meanwhile", "error", "words"),
    [
        ({"elsewhere": "motion"}, UnknownNameError, "other"),
        ({"other": 3}, InvalidInputError, "Trajectory"),
        ({"other": ("motion", -1.0)}, InvalidInputError, "time"),
        ({"other": ("motion", "late")}, InvalidInputError, "time"),
        ({"other": "seven"}, InvalidInputError, "joint_7"),
        ({"other": "spherical"}, InvalidInputError, "whose joint_5 goes from 0.523599 to 5.75959 rad"),
        ("motion", InvalidInputError, "meanwhile must be a dict"),
    ],
)
def test_mistakes_are_named(
    robot: Robot,
    bundled: Callable[[str], Robot],
    solver: IKSolver,
    crossing: tuple[Trajectory, Array, Array],
    meanwhile: Any,
    error: type[Exception],
    words: str,
) -> None:
    others = {"seven": bundled("j2s7s300"), "spherical": bundled("j2s6s300")}
    known = {"motion": crossing[0]} | {name: move_joints(arm, arm.home, arm.home) for name, arm in others.items()}

    def filled(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(known.get(each, each) if isinstance(each, str) else each for each in value)
        return known.get(value, value) if isinstance(value, str) else value

    given: Any = {name: filled(value) for name, value in meanwhile.items()} if isinstance(meanwhile, dict) else 3
    with pytest.raises(error, match=words):
        plan_motion(solver, crossing[1], crossing[2], meanwhile=given)


def test_an_arm_that_moves_is_refused(
    robot: Robot, solver: IKSolver, crossing: tuple[Trajectory, Array, Array]
) -> None:
    other, start, goal = crossing
    state = move_joints(robot, start, goal).state_at(1.0)
    with pytest.raises(InvalidInputError, match="start at rest"):
        plan_motion(solver, state, goal, meanwhile={"other": other})
    rest = MotionState(start, np.zeros(6), np.zeros(6))
    assert plan_motion(solver, rest, goal, meanwhile={"other": other}, time_limit=10.0).success


def _without(motion: Trajectory, rows: int) -> tuple[Array, Array, Array, Array]:
    return motion.t[:-rows], motion.q[rows:], motion.v[rows:], motion.a[rows:]
