"""`plan_pick`: a free motion that touches nothing, then a straight line on which only the hand may touch the object."""

from __future__ import annotations

import numpy as np
import pytest

import jacokin
from jacokin import IKSolver, Robot
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.ik import Box, Scene
from jacokin.motion import grasps, plan_motion, plan_pick

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
    with pytest.raises(InvalidInputError, match="grasps must be grasps"):
        plan_pick(solver, robot.home, [jacokin.pose([0, 0, 0])])
