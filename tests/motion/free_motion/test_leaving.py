"""Motions from and to where shapes touch or are near: they come apart and stay apart, by coal, an engine of its own."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import IKSolver, Robot
from jacokin.arrays import Array
from jacokin.ik import Box, Floor, Scene
from jacokin.motion import Trajectory, plan_motion
from jacokin.motion.free_motion.leaving import Leaving, Nearness
from tests.coal_shapes import coal_distance

coal = pytest.importorskip("coal")
CUP = np.array([0.06, 0.06, 0.12])  # [m]
UP = np.array([0.0, 0.0, 1.0])
PLACE = np.array([0.45, 0.2, 0.06])  # [m] of its middle: it stands on the floor
KEPT = 1e-4  # [m] beyond the clearance


def holding(robot: Robot, *, sunk: float = 0.0, others: tuple[Box, ...] = ()) -> tuple[Scene, Array]:
    """A cup in the hand, on the floor or sunk into it [m], and the configuration."""
    q = IKSolver(robot).solve(jacokin.pose(PLACE, down=True)).q
    at = robot.forward_kinematics(q).inverse() * pin.SE3(np.eye(3), PLACE - sunk * UP)
    scene = Scene([Floor(0.0), *others]).attach(Box("cup", CUP, [0, 0, 0]), to="end_effector", pose=at)
    return scene, q


def heights(robot: Robot, scene: Scene, rows: Array) -> Array:
    """(n,) of the cup above the floor by coal [m]."""
    held = scene.attached[0].shape
    assert isinstance(held, Box)
    shapes = coal.Box(*np.asarray(held.size).tolist()), coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    floor = pin.SE3.Identity()
    return np.array([coal_distance(shapes, (robot.forward_kinematics(q) * held.pose, floor)) for q in rows])


def check_comes_apart(distances: Array, kept: float) -> None:
    """Never nearer than before until apart, never near again."""
    apart = int(np.argmax(distances > kept))
    assert distances[apart] > kept
    assert (np.diff(distances[: apart + 1]) > -1e-6).all()
    assert (distances[apart:] > kept - 1e-6).all()


def finely(motion: Trajectory) -> Array:
    """Configurations along a motion, eight between two rows."""
    places = np.arange(8 * (len(motion) - 1) + 1) / 8.0
    return np.column_stack([np.interp(places, np.arange(len(motion)), column) for column in motion.q.T])


@pytest.mark.one_quick
@pytest.mark.parametrize(("clearance", "sunk"), [(0.0, 0.0), (0.01, 0.0), (0.03, 0.0), (0.01, -0.004), (0.0, 0.003)])
def test_a_cup_on_the_floor_is_lifted(robot: Robot, clearance: float, sunk: float) -> None:
    scene, q = holding(robot, sunk=sunk)
    solver = IKSolver(robot, scene=scene, clearance=clearance)
    beside = pin.SE3(robot.forward_kinematics(q).rotation, PLACE + np.array([0.1, 0.1, clearance + sunk + 1e-3]))
    for goal in (robot.home, beside):
        motion = plan_motion(solver, q, goal, time_limit=10.0)
        assert motion.success, motion.message
        assert "floor and cup" in motion.message
        check_comes_apart(heights(robot, scene, finely(motion)), clearance + KEPT)
        assert (np.abs(motion.v) <= robot.velocity_limit).all()
        assert not motion.v[[0, -1]].any()


def test_the_rest_of_the_arm_is_looked_at_meanwhile(robot: Robot) -> None:
    """A shelf above the arm: neither does the cup go through the floor, nor the arm into the shelf."""
    scene, q = holding(robot, others=(Box("shelf", [0.5, 0.5, 0.02], [0.45, 0.2, 0.6]),))
    motion = plan_motion(IKSolver(robot, scene=scene), q, robot.home, time_limit=5.0)
    assert motion.success, motion.message
    assert heights(robot, scene, finely(motion)).min() > -1e-6
    assert np.min(robot.clearance(motion.q, scene.allowing(("cup", "floor")), self_collision=True)) > 0.0


def test_too_deep_is_said(robot: Robot) -> None:
    scene, q = holding(robot, sunk=0.02)
    motion = plan_motion(IKSolver(robot, scene=scene), q, robot.home)
    assert (motion.outcome, len(motion)) == ("START_IN_CONTACT", 1)
    assert "0.02 m deep" in motion.message


def test_a_goal_next_to_a_box_is_reached(robot: Robot) -> None:
    """1e-6 m from a box, which is less than certified motions keep."""
    goal = robot.home + 0.3
    centre = robot.forward_kinematics(goal).translation - 0.4 * UP
    for _ in range(20):
        box = Box("box", [0.1, 0.1, 0.1], centre)
        centre = centre + (float(robot.clearance(goal, Scene([box]))) - 1e-6) * UP
    scene = Scene([Box("box", [0.1, 0.1, 0.1], centre)])
    assert float(robot.clearance(goal, scene)) == pytest.approx(1e-6, abs=1e-8)
    solver = IKSolver(robot, scene=scene)
    there = plan_motion(solver, robot.home, goal)
    assert there.success, there.message
    np.testing.assert_array_equal(there.q[-1], goal)
    assert there.clearance.min() > 0.9e-6
    back = plan_motion(solver, goal, robot.home)
    assert back.success, back.message
    assert back.clearance.min() > 0.9e-6
    stays = plan_motion(solver, goal, goal)
    assert (stays.outcome, len(stays)) == ("OK", 1)


@pytest.mark.parametrize("out", [1e-15, 9e-7, 1e-5, 0.02, 0.3])
def test_joints_outside_their_limits_come_straight_back(robot: Robot, out: float) -> None:
    start = robot.home.copy()
    start[1] = robot.lower[1] - out
    motion = plan_motion(IKSolver(robot), start, robot.home)
    assert motion.success, motion.message
    past = np.maximum(robot.lower - motion.q, motion.q - robot.upper).max(axis=1)
    if out < 1e-6:
        assert past.max() <= 0.0
        assert "outside" not in motion.message
        return
    assert "joint_2 starts outside its limits" in motion.message
    np.testing.assert_array_equal(motion.q[0], start)
    back = int(np.argmax(past <= 0.0))
    assert (np.diff(past[: back + 1]) < 1e-12).all()
    assert (past[back:] <= 0.0).all()


def test_what_is_in_the_way_back_is_named(robot: Robot) -> None:
    start = robot.home.copy()
    start[1] = robot.lower[1] - 0.6
    motion = plan_motion(IKSolver(robot), start, robot.home)
    assert (motion.outcome, len(motion)) == ("START_IN_CONTACT", 1)
    assert "link_base_column and link_2_beam touch on the way back" in motion.message


@pytest.mark.parametrize(
    ("ways", "hindrance"),
    [
        ([[0.0, 0.0, 0.05], [0.0, 0.0, 0.1]], None),
        ([[0.0, 0.0, 1e-4], [0.0, 0.0, 2e-4]], None),  # it is still near at the end
        ([[0.0, 0.0, 0.05], [0.0, 0.0, 0.04], [0.0, 0.0, 0.1]], None),  # nearer again, but apart
        ([[0.0, 0.0, 0.05], [0.0, 0.0, -0.002]], ("cup", "floor")),
        ([[0.0, 0.0, 1e-5], [0.0, 0.0, -1e-4]], ("cup", "floor")),
        ([[0.0, 0.0, 0.05], [0.0, 0.08, 0.05]], None),
        ([[0.0, 0.0, 0.005], [0.0, 0.08, 0.005]], ("cup", "sill")),
    ],
)
def test_what_hinders_a_motion_in_leaving(
    robot: Robot, ways: list[list[float]], hindrance: tuple[str, str] | None
) -> None:
    """A cup on the floor that moves along lines, beside a sill that is 1 cm high and 4 cm away."""
    sill = Box("sill", [0.3, 0.02, 0.01], [PLACE[0], PLACE[1] + 0.08, 0.005])
    scene, q = holding(robot, others=(sill,))
    solver, at, rows = IKSolver(robot, scene=scene), robot.forward_kinematics(q), [q]
    for way in ways:
        rows.append(IKSolver(robot).solve(pin.SE3(at.rotation, at.translation + way), seed=rows[-1]).q)
    assert solver.verifier.contact is not None
    found = Leaving(robot, solver.verifier.contact, 0.0).hindrance(np.array(rows))
    assert (None if found is None else tuple(sorted(found))) == hindrance


@pytest.mark.parametrize(
    ("velocity", "acceleration"),
    [
        (1e4, 1.0),
        ([0.6, 0.6, 0.6, 6e3, 6e3, 6e3], 1.0),
        ([6e3, 6e3, 6e3, 0.6, 0.6, 0.6], 1.0),
        ([1e-2, 1.0, 1.0, 1.0, 1.0, 1e4], [1.0, 1.0, 1.0, 1.0, 1.0, 1e4]),
        (1e4, 1e6),
        (1.0, 1e6),
    ],
)
def test_limits_of_any_size_are_held_around_a_wall(robot: Robot, velocity: float, acceleration: float) -> None:
    wall = Scene([Box("wall", [0.6, 0.02, 0.5], [0.45, -0.05, 0.25]), Floor(-0.02)])
    solver = IKSolver(robot, scene=wall)
    start = solver.solve(jacokin.pose([0.4, -0.35, 0.3], down=True)).q
    goal = jacokin.pose([0.4, 0.25, 0.3], down=True)
    rough = plan_motion(solver, start, goal, velocity_limit=velocity, acceleration_limit=acceleration)
    motion = plan_motion(
        solver, start, goal, velocity_limit=velocity, acceleration_limit=acceleration, dt=rough.duration / 500
    )
    assert motion.success, motion.message
    fastest, hardest = np.broadcast_to(velocity, 6), np.broadcast_to(acceleration, 6)
    assert (np.abs(motion.v) <= fastest).all()
    assert (np.abs(motion.a) <= hardest * (1.0 + 1e-8)).all()
    steps = np.diff(motion.t)[:, None]
    assert (np.abs(np.diff(motion.q, axis=0)) <= steps * fastest * (1.0 + 1e-8)).all()
    assert (np.abs(np.diff(motion.v, axis=0)) <= steps * hardest * (1.0 + 1e-6)).all()
    assert np.min(robot.clearance(motion.q, wall, self_collision=True)) > 0.0


def test_no_more_is_tried_when_the_time_is_over(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    # The cup is between low boxes that are 5 mm from it, with a clearance of 1 cm.
    along, across = np.array([0.06, 0.02, 0.02]), np.array([0.02, 0.06, 0.02])
    places = [PLACE + np.array([x, y, -0.05]) for x, y in ((0.0, -0.045), (0.0, 0.045), (-0.045, 0.0), (0.045, 0.0))]
    boxes = [Box(f"side_{k}", along if k < 2 else across, place) for k, place in enumerate(places)]
    scene, q = holding(robot, others=tuple(boxes))
    solver, walk, walks = IKSolver(robot, scene=scene, clearance=0.01), Leaving._walk, list[int]()

    def counted(
        leaving: Leaving, q: Array, end: Array, near: Nearness, *, room: float
    ) -> tuple[Array | None, Array, Array]:
        walks.append(1)
        return walk(leaving, q, end, near, room=room)

    monkeypatch.setattr(Leaving, "_walk", counted)
    goals = [robot.home + 0.01 * k for k in range(8)]
    motion = plan_motion(solver, q, goals, time_limit=1e-9)
    assert motion.outcome == "START_IN_CONTACT", motion.message
    assert len(walks) == 1
    plan_motion(solver, q, goals, time_limit=10.0)
    assert len(walks) > 9
