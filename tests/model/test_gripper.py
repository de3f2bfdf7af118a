"""`Gripper.of`: the room between the pads, and where it is, are what the numbers of the descriptions say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin.errors import InvalidInputError, ModelError
from jacokin.model import Gripper
from jacokin.model.gripper import JACO
from jacokin.model.mujoco_twin import shapes_of_links, to_spec
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


def fingers_of_slides(ranges: tuple[str, str], more: str = "", wheel: str = "") -> str:
    """An MJCF of six joints and two fingers that slide along y, 6 mm thick, whose faces meet at zero."""
    arm = "".join(
        f'<body name="l{i}" pos="0 0 0.1"><joint name="j{i}" axis="0 {i % 2} {(i + 1) % 2}" range="-2 2"/>'
        '<geom size="0.01"/>'
        for i in range(6)
    )
    finger = (
        '<body name="{0}" pos="0 0 0.05"><joint name="{0}" type="slide" axis="0 1 0" range="{1}"/>'
        '<geom type="box" size="0.01 0.003 0.02" pos="0 {2} 0.03"/></body>'
    )
    left, right = finger.format("left", ranges[0], 0.003), finger.format("right", ranges[1], -0.003)
    return (
        f'<mujoco><compiler angle="radian"/><worldbody>{arm}<site name="attachment_site" pos="0 0 0.05"/>'
        f"{wheel}{left}{right}{'</body>' * 6}</worldbody>{more}</mujoco>"
    )


COUPLED = '<equality><joint joint1="{}" joint2="{}" polycoef="{} {} 0 0 0"/></equality>'
MOTOR = '<actuator><position joint="{}" kp="1"/></actuator>'


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("ranges", "more", "opened", "offset", "slope"),
    [
        (("0 0.04", "-0.04 0"), COUPLED.format("left", "right", 0, -1) + MOTOR.format("left"), 0.04, 0.0, 2.0),
        (("0 0.04", "-0.04 0"), COUPLED.format("left", "right", 0, -1) + MOTOR.format("right"), -0.04, 0.0, -2.0),
        (("0 0.04", "-0.04 0"), COUPLED.format("right", "left", 0, -1), 0.04, 0.0, 2.0),
        (("0.01 0.04", "-0.04 -0.01"), "", 0.04, 0.0, 2.0),  # coupled by a driver that the file does not have
        (("0.01 0.04", "-0.05 0.02"), COUPLED.format("right", "left", 0.01, -1), 0.04, -0.01, 2.0),
        (("0 0.04", "-0.02 0"), COUPLED.format("right", "left", 0, -0.5), 0.04, 0.0, 1.5),
        (("0 0.04", "-0.02 0"), COUPLED.format("right", "left", 0, -0.5) + MOTOR.format("right"), -0.02, 0.0, -3.0),
    ],
)
def test_fingers_that_an_mjcf_couples(
    tmp_path: Path, ranges: tuple[str, str], more: str, opened: float, offset: float, slope: float
) -> None:
    """The room is linear in the value, which is that of the joint with the motor, else of MuJoCo's second one."""
    path = tmp_path / "arm.xml"
    path.write_text(fingers_of_slides(ranges, more))
    hand = Gripper.of(jacokin.load_robot(path))
    assert hand.openings[-1] == pytest.approx(opened)
    np.testing.assert_allclose(hand.widths, offset + slope * hand.openings, atol=1e-9)


def test_a_wheel_of_the_drive_opens_nothing(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    wheel = '<body name="wheel"><joint name="spins"/><geom size="0.005"/></body>'
    path.write_text(fingers_of_slides(("0 0.04", "-0.04 0"), COUPLED.format("right", "left", 0, -1), wheel))
    assert Gripper.of(jacokin.load_robot(path)).widths[-1] == pytest.approx(0.08)


def test_a_palm_between_the_fingers_is_seen(tmp_path: Path) -> None:
    """Pads from 6 to 10 cm ahead of the last joint, and a palm that ends at 7 cm between them."""
    path = tmp_path / "arm.xml"
    palm = '<geom type="box" size="0.005 0.02 0.035" pos="0 0 0.035"/>'
    path.write_text(fingers_of_slides(("0 0.04", "-0.04 0"), COUPLED.format("right", "left", 0, -1), palm))
    hand = Gripper.of(jacokin.load_robot(path))
    assert hand.depth == pytest.approx(0.02, abs=1e-3)
    assert hand.palm == pytest.approx(0.01, abs=1e-9)
    path.write_text(fingers_of_slides(("0 0.04", "-0.04 0"), COUPLED.format("right", "left", 0, -1)))
    assert Gripper.of(jacokin.load_robot(path)).palm > 0.05  # up to the shape of the last link


def test_a_joint_of_whole_turns_tells_nothing(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(
        fingers_of_slides(("0 0.04", "-0.04 0")).replace('"slide"', '"hinge"').replace('range="0 0.04"', "")
    )
    path.write_text(path.read_text().replace('range="-0.04 0"', 'range="-6.28 6.28"'))
    with pytest.raises(ModelError, match="joint 'right' has no limits, or a whole turn; write those of the fingers"):
        Gripper.of(jacokin.load_robot(path))


def test_a_joint_that_follows_a_follower_is_where_the_first_one_has_it(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    text = skeleton("j1>l1 j2>l2 j3>l3 j4>l4 j5>l5 |a>fa{0,0.04} |b>fb{0,0.04} |c>fc{0,0.04}")
    for joint, leader, multiplier in (("b", "c", -1), ("c", "a", 0.5)):
        mimic = f'<mimic joint="{leader}" multiplier="{multiplier}" offset="0.01"/>'
        head, _, tail = text.partition(f'<joint name="{joint}"')
        text = f'{head}<joint name="{joint}"{tail.replace("</joint>", f"{mimic}</joint>", 1)}'
    path.write_text(text)
    robot = jacokin.load_robot(path, locked={"a": 0.004})
    assert dict(robot.source.locked) == pytest.approx({"a": 0.004, "c": 0.012, "b": 0.0})  # -0.012 + 0.01, clipped


LOOP = """<body name="{0}_driver" pos="{1} 0 0.03"><joint name="{0}_driver" axis="0 {2} 0" range="0 0.8"/>
  <geom size="0.002"/>
  <body name="{0}_pad" pos="0 0 0.05"><joint name="{0}_pad" axis="0 1 0" range="-2 2"/>
    <geom type="box" size="0.002 0.01 0.015" pos="0 0 0.02"/></body></body>
<body name="{0}_bar" pos="{3} 0 0.03"><joint name="{0}_bar" axis="0 1 0" range="-2 2"/>
  <geom size="0.002" pos="0 0 0.05"/></body>"""


@pytest.mark.one_quick
@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
def test_closed_loops_keep_the_pads_parallel(tmp_path: Path, jacobian: str) -> None:
    """Two parallelograms of bars 5 cm long: each pad moves by 5 cm times the sine of the driver's angle."""
    text = fingers_of_slides(("0 1", "0 1"))
    left, right = LOOP.format("left", -0.04, 1, -0.055), LOOP.format("right", 0.04, -1, 0.055)
    head, tail = text[: text.index('<body name="left"')], "</body>" * 6
    loops = "".join(
        f'<connect body1="{side}_pad" body2="{side}_bar" anchor="{x} 0 0"/>'
        for side, x in (("left", -0.015), ("right", 0.015))
    )
    coupled = '<joint joint1="right_driver" joint2="left_driver"/>'
    path = tmp_path / "arm.xml"
    path.write_text(
        head.replace("<compiler", f'<option jacobian="{jacobian}"/><compiler') + left + right + tail
        + f"</worldbody><equality>{loops}{coupled}</equality>{MOTOR.format('left_driver')}</mujoco>"
    )  # fmt: skip
    hand = Gripper.of(jacokin.load_robot(path))
    assert hand.openings[-1] == pytest.approx(0.0)
    np.testing.assert_allclose(hand.widths, 0.076 - 0.1 * np.sin(hand.openings), atol=1e-5)


ADAPTING = """<body name="{0}_driver" pos="{1} 0 0.03"><joint name="{0}_driver" axis="0 {2} 0" range="0 0.8"/>
  <geom size="0.002"/>
  <body name="{0}_tip" pos="0 0 0.05"><joint name="{0}_tip" axis="0 {2} 0" range="-1 0"/><geom size="0.002"/></body>
</body>
<body name="{0}_bar" pos="{3} 0 0.03">
  <joint name="{0}_bar" axis="0 {2} 0" range="-0.5 1.5" stiffness="0.1" springref="{4}"/><geom size="0.002"/>
  <body name="{0}_pad" pos="0 0 0.06"><joint name="{0}_pad" axis="0 1 0" range="-2 2"/>
    <geom type="box" size="0.002 0.01 0.015" pos="{5} 0 0.02"/></body></body>"""


@pytest.mark.slow
def test_a_spring_and_a_limit_hold_a_finger_that_adapts(tmp_path: Path) -> None:
    """A driver of two pieces, the outer one of which a spring presses against its limit: bars of 6 cm in one piece."""
    text = fingers_of_slides(("0 1", "0 1"))
    left = ADAPTING.format("left", -0.04, 1, -0.055, 2.0, 0.015)
    right = ADAPTING.format("right", 0.04, -1, 0.055, 2.0, -0.015)
    loops = "".join(f'<connect body1="{side}_tip" body2="{side}_pad" anchor="0 0 0.01"/>' for side in ("left", "right"))
    coupled = '<joint joint1="right_driver" joint2="left_driver"/>'
    path = tmp_path / "arm.xml"
    path.write_text(
        text[: text.index('<body name="left"')] + left + right + "</body>" * 6
        + f"</worldbody><equality>{loops}{coupled}</equality>{MOTOR.format('left_driver')}</mujoco>"
    )  # fmt: skip
    hand = Gripper.of(jacokin.load_robot(path))
    np.testing.assert_allclose(hand.widths[1:], 0.076 - 0.12 * np.sin(hand.openings[1:]), atol=1e-5)


def test_what_is_only_drawn_is_no_shape_of_a_hand(tmp_path: Path) -> None:
    """A link of a cover that is drawn and does not collide has no name that contact could be allowed for."""
    path = tmp_path / "arm.xml"
    cover = '<body name="cover"><geom size="0.01" contype="0" conaffinity="0"/></body>'
    path.write_text(fingers_of_slides(("0 0.04", "-0.04 0"), "", cover))
    links = shapes_of_links(jacokin.load_robot(path))
    assert {"left", "right"} <= links.keys()
    assert "cover" not in links


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("openings", [1.0, 0.5, 0.7], "openings must be from shut to open"),
        ("openings", [0.2], r"openings must have shape \(2,\)"),
        ("widths", [0.1, 0.05, 0.0], "widths must be growing from shut to open"),
        ("widths", [0.0, 0.1], r"widths must have shape \(3,\)"),
        ("widths", ["0", "1", "2"], "widths must be numbers"),
        ("middles", [0.0, np.nan, 0.0], "middles must be finite"),
        ("pads", [0.0, 0.0, 0.1], r"pads must be"),
        ("frame", 3, "frame must be"),
        ("depth", -0.01, "depth must be"),
        ("palm", np.nan, "palm must be"),
    ],
)
def test_numbers_of_ones_own_are_checked_and_copied(name: str, value: Any, message: str) -> None:
    given: dict[str, Any] = {
        "frame": "tool", "pads": pin.SE3.Identity(), "openings": np.array([1.0, 0.5, 0.0]),
        "widths": np.array([0.0, 0.05, 0.1]), "middles": np.zeros(3), "depth": 0.01, "ahead": 0.01,
    }  # fmt: skip
    hand = Gripper(**given)
    given["widths"] *= 2.0
    given["pads"].translation = np.ones(3)
    assert hand.widths.tolist() == [0.0, 0.05, 0.1]
    assert not hand.pads.translation.any()
    with pytest.raises(InvalidInputError, match=message):
        Gripper(**{**given, name: value})
