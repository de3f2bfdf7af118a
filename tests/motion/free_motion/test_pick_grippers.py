"""A box is picked by one jaw on five joints, by two slides and by hinges on seven, and by Kinova's lite arm."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver, Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import Box, Scene
from jacokin.model import Gripper
from jacokin.model.mujoco_twin import to_spec
from jacokin.motion import grasps, plan_pick
from jacokin.motion.grasps import Grasp
from tests.gripper_arms import load, panda_text

SIZE = [0.024, 0.03, 0.05]


class Case(NamedTuple):
    """An arm, where the box stands, and the shapes that are its two sides."""

    robot: str
    place: list[float]
    sides: tuple[str, str]
    distance: float = 0.1


CASES = [
    Case("so101", [0.2, 0.05, 0.025], ("gripper_link", "moving_jaw_link"), 0.05),
    Case("panda", [0.5, 0.1, 0.025], ("leftfinger", "rightfinger")),
    Case("mimicking", [0.5, 0.1, 0.025], ("left_pad", "right_pad")),
    Case("gen3_lite", [0.4, 0.1, 0.025], ("finger_tip_1", "finger_tip_2")),
]


def test_a_box_is_picked_by_one_jaw(tmp_path: Path) -> None:
    check_a_box_is_picked(CASES[0], tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES[1:], ids=[case.robot for case in CASES[1:]])
def test_a_box_is_picked(case: Case, tmp_path: Path) -> None:
    check_a_box_is_picked(case, tmp_path)


@pytest.mark.slow
def test_the_palm_does_not_touch_the_box(tmp_path: Path) -> None:
    """A hand whose palm ends 3 cm farther out than where the fingers begin; the box would fit between them."""
    path = tmp_path / "panda.urdf"
    hand = '<origin xyz="0.0 0.0 0.03"/><geometry><box size="0.04 0.2 0.06"/>'
    assert hand in panda_text()
    path.write_text(panda_text().replace(hand, '<origin xyz="0.0 0.0 0.045"/><geometry><box size="0.04 0.2 0.09"/>'))
    robot = jacokin.load_robot(path)
    box = Box("box", [0.03, 0.03, 0.05], [0.5, 0.1, 0.025])
    scene, gripper = Scene([box]), Gripper.of(robot)
    ways = grasps.box(box.size, box.pose, gripper=gripper)
    pick = plan_pick(IKSolver(robot, scene=scene), robot.home, ways, obstacle="box", lift=0.04, time_limit=20.0)
    assert pick.success, pick.message
    assert pick.reach is not None
    assert pick.opening is not None
    assert np.min(robot.clearance(pick.reach.q, scene.with_fingers(pick.opening))) > 0.0
    # Grasps of one's own that are deeper are refused: the palm is in the box before the fingers close.
    ahead = pin.SE3(np.eye(3), 0.02 * gripper.pads.rotation[:, 2])
    deeper = [
        Grasp(FreeAxis(way.target.pose * ahead, axis=way.target.axis, range=way.target.range), way.opening, gripper)
        for way in ways
    ]
    pick = plan_pick(IKSolver(robot, scene=scene), robot.home, deeper, obstacle="box", lift=0.04, time_limit=5.0)
    assert not pick.success


def check_a_box_is_picked(case: Case, tmp_path: Path) -> None:
    robot = jacokin.load_robot(case.robot) if case.robot == "gen3_lite" else load(case.robot, tmp_path)
    table = Box("table", [0.4, 0.8, 0.02], [case.place[0], 0.0, -0.0101])
    box = Box("box", SIZE, case.place)
    scene = Scene([table, box])
    hand = Gripper.of(robot)
    ways = grasps.box(box.size, box.pose, gripper=hand)
    solver = IKSolver(robot, scene=scene)
    pick = plan_pick(solver, robot.home, ways, obstacle="box", distance=case.distance, lift=0.04, time_limit=20.0)
    assert pick.success, pick.message
    assert pick.reach is not None
    assert pick.approach is not None
    assert pick.grasp is not None
    assert pick.opening is not None
    assert pick.held is not None
    assert pick.kinova_fingers is None
    q = pick.reach.q[-1]
    # The tool is where the grasp says, and came straight along the z axis of the pads.
    T_base_tool = robot.forward_kinematics(q)
    turned = pick.grasp.target.at(pick.grasp.target.parameter_of(T_base_tool.rotation))
    np.testing.assert_allclose(T_base_tool.homogeneous, turned.homogeneous, atol=1e-6)
    before = T_base_tool.actInv(robot.forward_kinematics(pick.approach.q[0]).translation)
    np.testing.assert_allclose(before, -case.distance * hand.pads.rotation[:, 2], atol=1e-5)
    # Nothing touches anything up to there, neither the box nor the table.
    opened = scene.with_fingers(pick.opening)
    assert np.min(robot.clearance(pick.reach.q, opened, self_collision=True)) > 0.0
    # The box is between the two sides: each is within 25 mm of it, on its own side, and it shuts on the box.
    toward = [_nearest(robot, q, box, pick.opening, name) for name in case.sides]
    along = T_base_tool.rotation @ hand.pads.rotation[:, 0]
    shares = [float(each @ along) for each in toward]
    assert shares[0] * shares[1] < 0.0, shares
    assert all(0.3 * hand.spare < abs(share) < 0.025 for share in shares), shares  # a jaw that turned is aslant
    shut = scene.with_fingers(float(hand.openings[0]))
    assert robot.clearance(q, shut.removing("table")) < 0.0
    assert pick.lift is not None
    up = [robot.forward_kinematics(row).translation for row in pick.lift.q[[0, -1]]]
    np.testing.assert_allclose(up[1] - up[0], [0.0, 0.0, 0.04], atol=1e-6)


def _nearest(robot: Robot, q: Array, box: Box, opening: float, link: str) -> Array:
    """(3,) from a box to the nearest shape of a link [m], by MuJoCo."""
    spec = to_spec(robot, geometry=True, finger_angle=opening)
    box.add_to(spec.worldbody)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    found = []
    names = [model.geom(k).name for k in range(model.ngeom)]
    for name in names:
        if link in name:
            ends = np.zeros(6)
            far = mujoco.mj_geomDistance(model, data, names.index(box.name), names.index(name), 1.0, ends)
            found.append((far, ends[3:] - ends[:3]))
    return min(found, key=lambda each: each[0])[1]


def test_cylinders_and_spheres_too(tmp_path: Path) -> None:
    """A cylinder and a sphere that stand on a table, by one jaw, whose middle is beside the axis of the tool."""
    robot = load("so101", tmp_path)
    hand, solver = Gripper.of(robot), IKSolver(robot)
    place = [0.2, 0.05, 0.03]
    for ways in (
        grasps.cylinder(0.012, 0.06, place, gripper=hand),
        grasps.sphere(0.015, place, gripper=hand),
    ):
        for way in ways[::10]:
            assert way.opening is not None
            middle = way.target.pose * hand.pads_at(way.opening)
            across = middle.actInv(np.array(place))
            assert abs(across[0]) < 1e-9
            assert across[1] == pytest.approx(0.0, abs=0.05)
    ways = grasps.cylinder(0.012, 0.06, place, gripper=hand)
    pick = plan_pick(solver, robot.home, ways, distance=0.03, time_limit=20.0)
    assert pick.success, pick.message


def test_a_line_that_is_too_long_is_said(tmp_path: Path) -> None:
    robot = load("so101", tmp_path)
    ways = grasps.box(SIZE, [0.2, 0.05, 0.025], gripper=Gripper.of(robot))
    pick = plan_pick(IKSolver(robot), robot.home, ways, distance=0.15, time_limit=10.0)
    assert not pick.success
    assert "grasps are within reach, but no clear line of 0.15 m to one: try a smaller distance" in pick.message


def test_grasps_of_another_hand_are_refused(tmp_path: Path) -> None:
    robot = load("panda", tmp_path)
    solver = IKSolver(robot)
    with pytest.raises(InvalidInputError, match=r"are for the hand of a Jaco, .* gripper=jacokin.model.Gripper.of"):
        plan_pick(solver, robot.home, grasps.box(SIZE, [0.5, 0.0, 0.1]))
    ways = grasps.box(SIZE, [0.5, 0.0, 0.1], gripper=Gripper.of(robot, "link7"))
    with pytest.raises(InvalidInputError, match="pose the frame 'link7', but the solver poses 'hand_tcp'"):
        plan_pick(solver, robot.home, ways)
    with pytest.raises(InvalidInputError, match="gripper must be"):
        grasps.box(SIZE, [0.5, 0.0, 0.1], gripper=robot)  # type: ignore[arg-type]
