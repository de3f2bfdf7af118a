"""Two motions at once: when they touch is what samples say, and nothing is stepped over."""

from __future__ import annotations

import numpy as np
import pytest

import jacokin
from jacokin import IKSolver, Robot
from jacokin.arrays import Array
from jacokin.ik import Scene
from jacokin.model.contact import ContactBetween
from jacokin.motion import Trajectory, move_joints, plan_motion
from jacokin.motion.free_motion.meanwhile import SHORTEST, TimedMotion, find_touch

BASE = jacokin.pose([0.6, 0.0, 0.0], rpy=[0.0, 0.0, np.pi])


@pytest.fixture(scope="module")
def between(robot: Robot) -> ContactBetween:
    scene = Scene().adding_robot(robot, robot.home, name="other", base=BASE)
    return ContactBetween(robot, scene.surroundings, scene.robots[0])


@pytest.fixture(scope="module")
def motions(robot: Robot) -> list[Trajectory]:
    """Random ones, some of which have corners that are rounded."""
    rng, solver = np.random.default_rng(7), IKSolver(robot)
    found = [plan_motion(solver, robot.sample(rng), robot.sample(rng)) for _ in range(40)]
    return [motion for motion in found if motion.success]


def test_a_course_is_the_motion_and_stands_before_and_after_it(motions: list[Trajectory]) -> None:
    motion = motions[0]
    course, later = TimedMotion(motion.rows), TimedMotion(motion.rows, 1.0)
    assert course.duration == motion.duration
    assert later.duration == pytest.approx(motion.duration - 1.0)
    for time in (-1.0, 0.0, 0.004, 1.2345, motion.duration, motion.duration + 1.0):
        np.testing.assert_allclose(course.at(time), motion.state_at(time).q, atol=1e-12)
        np.testing.assert_allclose(later.at(time - 1.0), motion.state_at(time).q, atol=1e-12)


@pytest.mark.one_quick
@pytest.mark.parametrize("length", [0.003, 0.1, 0.6])
def test_the_bound_on_how_far_joints_are_from_a_line_holds(
    motions: list[Trajectory], rng: np.random.Generator, length: float
) -> None:
    for motion in motions[:10]:
        course = TimedMotion(motion.rows)
        for begin in rng.uniform(-0.5, motion.duration + 0.2, 20).tolist():
            (first, last), away = course.line(begin, begin + length)
            shares = np.linspace(0.0, 1.0, 50)[:, None]
            true = np.array([motion.state_at(begin + share * length).q for share in shares[:, 0].tolist()])
            far = np.abs(true - first - shares * (last - first)).max(axis=0)
            assert (far <= away + 1e-12).all()
            assert (away <= far + 0.01).all()  # and says something


@pytest.mark.slow
def test_touches_are_where_samples_find_them(between: ContactBetween, motions: list[Trajectory]) -> None:
    touching = 0
    for arm, other in zip(motions[::2], motions[1::2], strict=False):
        end = max(arm.duration, other.duration)
        touch = find_touch(between, TimedMotion(arm.rows), TimedMotion(other.rows), 0.0, end)
        times = np.arange(0.0, end, 2e-3)
        along = between.distances(*(_at(motion, times) for motion in (arm, other)))
        if touch is None:
            assert along.min() > 0.0
        else:
            touching += 1
            assert along[times < touch.begin].min(initial=np.inf) > 0.0
            # [m] two arms come nearer to each other between two samples.
            assert along[np.abs(times - touch.begin) < 3e-3].min() < 3e-3
            assert touch.end - touch.begin <= SHORTEST
            assert touch.pair[0].startswith("other/")
    assert 0 < touching < len(motions) // 2


def test_one_that_waits_is_later(between: ContactBetween, robot: Robot, motions: list[Trajectory]) -> None:
    """Both clocks: the arm passes a place before the other one comes there, or meets it."""
    for arm, other in zip(motions[::2], motions[1::2], strict=False):
        for delay in (0.0, 1.3):
            late = np.vstack([np.tile(arm.q[0], (int(delay / 0.01), 1)), arm.q])
            rest = np.zeros((len(late) - len(arm.q), robot.dof))
            rows = arm.rows._replace(
                t=0.01 * np.arange(len(late), dtype=np.float64),
                q=late,
                v=np.vstack([rest, arm.v]),
                a=np.vstack([rest, arm.a]),
            )
            if abs(float(arm.t[1]) - 0.01) > 1e-12:
                continue
            end = max(float(rows.t[-1]), other.duration)
            whole = find_touch(between, TimedMotion(rows), TimedMotion(other.rows), delay, end)
            moved = find_touch(between, TimedMotion(arm.rows), TimedMotion(other.rows), 0.0, end - delay, delay)
            assert (whole is None) == (moved is None)


def test_two_that_stand_are_looked_at_once(between: ContactBetween, robot: Robot, rng: np.random.Generator) -> None:
    for q, there in zip(robot.sample(rng, 50), robot.sample(rng, 50), strict=True):
        arm, other = (TimedMotion(move_joints(robot, each, each).rows) for each in (q, there))
        touch = find_touch(between, arm, other, 0.0, 0.0)
        assert (touch is not None) == (between.distances(q[None], there[None])[0] <= 1e-4)


def _at(motion: Trajectory, times: Array) -> Array:
    return np.array([motion.state_at(time).q for time in times.tolist()])
