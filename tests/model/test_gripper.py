"""`Gripper.of`: the room between the pads, and where it is, are what the numbers of the descriptions say."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin.errors import InvalidInputError, ModelError
from jacokin.model import Gripper
from jacokin.model.gripper import JACO
from jacokin.model.mujoco_twin import to_spec
from tests import gripper_arms
from tests.gripper_arms import load
from tests.robot_files import skeleton


def test_two_slides(tmp_path: Path) -> None:
    """Each finger slides by its opening; fingers are 54 mm long and end 9 mm ahead of the tool."""
    hand = Gripper.of(load("panda", tmp_path))
    np.testing.assert_allclose(hand.widths, 2.0 * hand.openings, atol=1e-9)
    assert hand.openings[-1] == pytest.approx(0.04)
    np.testing.assert_allclose(hand.middles, 0.0, atol=1e-9)
    np.testing.assert_allclose(np.abs(hand.pads.rotation[:, 0]), [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(hand.pads.rotation[:, 2], [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(hand.pads.translation, [0.0, 0.0, 0.0584 + 0.027 - 0.1034], atol=1e-9)
    assert hand.depth == pytest.approx(0.027, abs=0.0015)  # to a line of the grid
    assert hand.ahead == pytest.approx(0.027)
    assert hand.span == pytest.approx(0.068)


def test_one_jaw_on_a_hinge(tmp_path: Path) -> None:
    """The middle moves away from the jaw that stands, whose face is in the plane of the tool."""
    robot = load("so101", tmp_path)
    hand = Gripper.of(robot)
    np.testing.assert_allclose(hand.pads.rotation, np.diag([-1.0, -1.0, 1.0]), atol=1e-12)  # the jaw opens along -x
    middles = np.array([hand.pads_at(value).translation for value in hand.openings]) @ hand.pads.rotation[:, 0]
    np.testing.assert_allclose(middles, 0.5 * hand.widths, atol=5e-4)
    assert (np.diff(hand.openings) > 0.0).all()
    assert 0.03 < hand.span < 0.06
    # The narrowest place is at the end of the pads near the hinge; the face of the jaw is 26.1 mm from the hinge.
    height = 0.0981274 + hand.pads.translation[2] - hand.depth - 0.0234
    face = 0.0202 + height * np.tan(hand.openings) - 0.0261 / np.cos(hand.openings)
    np.testing.assert_allclose(hand.widths[1:], face[1:] + 0.0079, atol=1e-5)


def test_hinges_that_follow_one_another(tmp_path: Path) -> None:
    """The pads are those that MuJoCo finds, for hinges of which one turns by minus the other's angle."""
    robot = load("mimicking", tmp_path)
    hand = Gripper.of(robot)
    assert hand.openings[0] > hand.openings[-1]  # shut at the upper limit
    np.testing.assert_allclose(hand.middles, 0.0, atol=1e-9)
    for value, width in zip(hand.openings[::8], hand.widths[::8], strict=True):
        model = to_spec(robot, geometry=True, finger_angle=float(value)).compile()
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        names = [model.geom(k).name for k in range(model.ngeom)]
        pads = [names.index(next(n for n in names if n.startswith(f"{side}_pad"))) for side in ("left", "right")]
        between = mujoco.mj_geomDistance(model, data, *pads, 1.0, None)
        assert width <= between + 1e-6
        assert width >= between - 0.02  # a knuckle may be nearer


def test_the_gripper_of_the_gen3_lite_is_about_its_tool_frame() -> None:
    """Kinova's own tool frame is between the fingers, which close along its x axis."""
    hand = Gripper.of(jacokin.load_robot("gen3_lite"))
    np.testing.assert_allclose(hand.pads.rotation, np.eye(3), atol=1e-12)
    assert np.linalg.norm(hand.pads.translation) < 0.005
    assert 0.07 < hand.widths[-1] < 0.12
    assert hand.openings[-1] < hand.openings[0]


def test_the_hand_of_a_jaco_is_a_table() -> None:
    assert Gripper.of(jacokin.load_robot()) is JACO
    assert JACO.opening_for(0.03) == pytest.approx(np.interp(0.034, [0.031, 0.041], [0.8, 0.6]))
    assert JACO.widest([0.4, 0.2, 0.9]) == 0.2


def test_the_frame_may_be_another_one(tmp_path: Path) -> None:
    """The pads are where they were."""
    robot = load("panda", tmp_path)
    there, here = Gripper.of(robot, "link7"), Gripper.of(robot)
    poses = [robot.forward_kinematics(robot.home, frame=hand.frame) * hand.pads for hand in (there, here)]
    turn = pin.log3(poses[0].rotation.T @ poses[1].rotation)
    assert np.linalg.norm(poses[0].translation - poses[1].translation) < 1e-9
    assert np.linalg.norm(turn) < 1e-9 or np.linalg.norm(turn) == pytest.approx(np.pi)


def test_followers_follow_the_angle_of_the_fingers(tmp_path: Path) -> None:
    """Loaded at an angle, and with contact looked for at it: the right finger is the left one's mirror."""
    path = tmp_path / "arm.urdf"
    path.write_text(gripper_arms.mimicking_text())
    robot = jacokin.load_robot(path, finger_angle=0.5)
    left, right = (
        robot.pin_model.frames[robot.frame_id("hand")].placement.actInv(
            robot.pin_model.frames[robot.frame_id(f"{side}_pad")].placement
        )
        for side in ("left", "right")
    )
    np.testing.assert_allclose(left.translation, right.translation * [1, -1, 1], atol=1e-12)
    assert left.translation[1] < 0.03
    np.testing.assert_allclose(left.rotation, np.eye(3), atol=1e-12)


def test_what_is_missing_is_said(tmp_path: Path) -> None:
    bare = tmp_path / "bare.urdf"
    bare.write_text(skeleton("a>l1 b>l2 c>l3 d>l4 e>l5 +tool"))
    with pytest.raises(ModelError, match="has no gripper: no joint moves fingers"):
        Gripper.of(jacokin.load_robot(bare))
    without = tmp_path / "without.urdf"
    without.write_text(skeleton("a>l1 b>l2 c>l3 d>l4 e>l5 |left>finger_left[0,1] |right>finger_right[0,1]"))
    with pytest.raises(ModelError, match="its fingers have no collision shapes"):
        Gripper.of(jacokin.load_robot(without))
    hand = Gripper.of(load("panda", tmp_path))
    with pytest.raises(InvalidInputError, match=r"0.07 m is more than the hand spans, 0.068 m"):
        hand.opening_for(0.07)
