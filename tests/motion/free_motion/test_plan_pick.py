"""`plan_pick`: a free motion that touches nothing, then a straight line on which only the hand may touch the object."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin import IKSolver, Robot
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.ik import Box, Scene
from jacokin.motion import Grasp, Trajectory, grasps, plan_motion, plan_path, plan_pick
from jacokin.motion.free_motion import handling

TABLE = Box("table", [0.6, 1.2, 0.05], [0.5, 0.0, -0.025])
CUP = Box("cup", [0.06, 0.08, 0.12], jacokin.pose([0.45, 0.2, 0.061], rpy=[0.0, 0.0, 0.4]))
CRATE = Box("crate", [0.2, 0.2, 0.25], [0.4, -0.1, 0.125])
SCENE = Scene([TABLE, CUP, CRATE])


@pytest.mark.slow
def test_a_cup_is_reached_and_carried(robot: Robot) -> None:
    check_a_cup_is_reached_and_carried(robot)


def test_a_cup_is_reached(robot: Robot) -> None:
    check_a_cup_is_reached_and_carried(robot, carried=False)


def check_a_cup_is_reached_and_carried(robot: Robot, *, carried: bool = True) -> None:
    solver = IKSolver(robot, collision="reject", scene=SCENE)
    pick = plan_pick(solver, robot.home, grasps.box(CUP.size, CUP.pose), obstacle="cup", time_limit=20.0)
    assert pick.success, pick.message
    assert pick.approach is not None
    assert pick.held is not None
    assert pick.grasp is not None
    open_scene = SCENE.with_fingers(pick.opening)
    rows = np.vstack([pick.motion.q, pick.approach.q])
    assert np.min(robot.clearance(pick.motion.q, open_scene, self_collision=True)) > 0.0
    touching = open_scene.allowing(("hand", "cup"))
    assert np.min(robot.clearance(pick.approach.q, touching, self_collision=True)) > 0.0
    np.testing.assert_allclose(pick.approach.q[0], pick.motion.q[-1], atol=1e-3)
    assert (np.abs(np.diff(rows, axis=0)) <= robot.velocity_limit * 0.01 * 1.01 + 1e-3).all()
    ends = [robot.forward_kinematics(q) for q in pick.approach.q]
    along = ends[0].actInv(ends[-1].translation)
    np.testing.assert_allclose(along, [0.0, 0.0, 0.1], atol=1e-5)
    centre = ends[-1].actInv(np.array([0.45, 0.2, 0.061]))
    assert abs(centre[0]) < 1e-5  # between the pads
    cup = pick.held.attached[0]
    assert cup.name == "cup"
    assert "cup" not in pick.held.names
    if not carried:
        return
    home = plan_motion(solver.in_scene(pick.held), pick.approach.q[-1], robot.home, time_limit=20.0)
    assert home.success, home.message
    assert np.min(robot.clearance(home.q, pick.held, self_collision=True)) > 0.0


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_what_stands_on_the_table_is_lifted_off(name: str, tmp_path: Path) -> None:
    """With a clearance that the cup on its table does not have."""
    robot = jacokin.load_robot(name)
    cup = Box("cup", [0.06, 0.06, 0.12], [0.45, 0.2, 0.06])
    solver = IKSolver(robot, scene=Scene([TABLE, cup]), clearance=0.01)
    begun = time.monotonic()
    pick = plan_pick(solver, robot.home, grasps.box(cup.size, cup.pose), obstacle="cup", time_limit=20.0)
    assert time.monotonic() - begun < 24.0
    assert pick.success, pick.message
    assert pick.lift is not None
    assert pick.reach is not None
    assert pick.approach is not None
    assert pick.held is not None
    assert len(repr(pick)) < 600
    np.testing.assert_array_equal(pick.lift.q[0], pick.reach.q[-1])
    up = [robot.forward_kinematics(q).translation for q in pick.lift.q[[0, -1]]]
    np.testing.assert_allclose(up[1] - up[0], [0.0, 0.0, 0.1], atol=1e-6)
    distance = np.asarray(robot.clearance(pick.lift.q, pick.held, self_collision=True))
    assert np.min(distance) > -1e-9
    assert (np.diff(np.minimum(distance, 0.0101)) > -1e-7).all()
    assert distance[-1] > 0.0101
    # Motion and approach in one file, from rest to rest.
    assert pick.reach.duration == pytest.approx(pick.motion.duration + pick.approach.duration)
    assert (np.diff(pick.reach.t) > 0.0).all()
    assert not pick.reach.v[[0, -1]].any()
    pick.reach.save(tmp_path / "reach.csv")
    np.testing.assert_array_equal(Trajectory.load(tmp_path / "reach.csv").q, pick.reach.q)
    pick.reach.save(tmp_path / "reach.kinova.csv")
    assert pick.opening is not None
    assert pick.kinova_fingers == pytest.approx(6400.0 * (pick.opening - 0.15) / 1.2)


def test_the_next_line_is_tried(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    real, calls = plan_path, 0

    def fails_at_first(*given: Any, **options: Any) -> Trajectory:
        nonlocal calls
        calls += 1
        if calls == 1:
            raise InvalidInputError("the path takes 4e+07 s")
        return real(*given, **options)

    monkeypatch.setattr(handling, "plan_path", fails_at_first)
    solver = IKSolver(robot, scene=SCENE)
    pick = plan_pick(solver, robot.home, grasps.box(CUP.size, CUP.pose), obstacle="cup", lift=0.0, time_limit=20.0)
    assert pick.success, pick.message
    assert calls == 2
    assert pick.lift is None


def test_an_own_grasp_leaves_the_fingers_as_they_are(robot: Robot) -> None:
    ways = [Grasp(way.target) for way in grasps.box(CUP.size, CUP.pose)]
    open_hand = jacokin.load_robot(finger_angle=0.3)
    pick = plan_pick(IKSolver(open_hand, scene=SCENE), open_hand.home, ways, obstacle="cup", time_limit=20.0)
    assert pick.success, pick.message
    assert (pick.opening, pick.kinova_fingers) == (None, None)


def test_the_time_is_held(robot: Robot) -> None:
    """Nothing is found in so little time, and that is said."""
    solver = IKSolver(jacokin.load_robot("j2s7s300"), scene=SCENE)
    begun = time.monotonic()
    pick = plan_pick(solver, solver.robot.home, grasps.box(CUP.size, CUP.pose) * 50, obstacle="cup", time_limit=0.2)
    assert time.monotonic() - begun < 10.0
    assert pick.success or "time" in pick.message


def test_what_cannot_be_reached_is_said(robot: Robot) -> None:
    far = Box("cup", [0.06, 0.08, 0.12], [1.5, 0.2, 0.061])
    solver = IKSolver(robot, collision="reject", scene=Scene([TABLE, far]))
    pick = plan_pick(solver, robot.home, grasps.box(far.size, far.pose), obstacle="cup")
    assert not pick.success
    assert "no grasp can be approached" in pick.message
    assert pick.held is None


def test_mistakes(robot: Robot) -> None:
    solver = IKSolver(robot, collision="reject", scene=SCENE)
    found = grasps.box(CUP.size, CUP.pose)
    with pytest.raises(UnknownNameError, match="unknown obstacle 'cap'"):
        plan_pick(solver, robot.home, found, obstacle="cap")
    with pytest.raises(InvalidInputError, match="grasps is empty"):
        plan_pick(solver, robot.home, [])
    with pytest.raises(InvalidInputError, match="acceleration_limit must be at most 1e"):
        plan_pick(solver, robot.home, found, acceleration_limit=1e7)
    with pytest.raises(InvalidInputError, match="grasps must be grasps"):
        plan_pick(solver, robot.home, [jacokin.pose([0, 0, 0])])
