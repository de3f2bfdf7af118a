"""Arms with grippers of one jaw, of two slides and of hinges that follow one another, written for tests.

Joints and limits of the arms are those that their makers publish; the shapes of the grippers are boxes of about the
size of the real ones.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from jacokin import Robot
from tests.robot_files import joint, load_text
from tests.seven_joint_arms import ARMS, Placement

#: The five joints of an SO-101 (so101_new_calib.urdf of TheRobotStudio), which turn about z, and its tool; angles have
#: the digits of the file.
SO101: list[Placement] = [
    ((0.0388353, 0.0, 0.0624), (3.14159, 0.0, -3.14159)),
    ((-0.0303992, -0.0182778, -0.0542), (-1.5708, -1.5708, 0.0)),
    ((-0.11257, -0.028, 0.0), (0.0, 0.0, 1.5708)),
    ((-0.1349, 0.0052, 0.0), (0.0, 0.0, -1.5708)),
    ((0.0, -0.0611, 0.0181), (1.5708, 0.0486795, 3.14159)),
    ((-0.0079, -0.000218121, -0.0981274), (0.0, 3.14159, 0.0)),
]
SO101_NAMES = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
SO101_LIMITS = [(-1.91986, 1.91986), (-1.74533, 1.74533), (-1.69, 1.69), (-1.65806, 1.65806), (-2.74385, 2.84121)]


def link(name: str, *boxes: tuple[Sequence[float], Sequence[float]]) -> str:
    """A link of boxes, each its size and the place of its middle [m]."""
    shapes = "".join(
        f'<collision><origin xyz="{x} {y} {z}"/><geometry><box size="{a} {b} {c}"/></geometry></collision>'
        for (a, b, c), (x, y, z) in boxes
    )
    inertial = (
        '<inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    return f'<link name="{name}">{inertial}{shapes}</link>'


def so101_text() -> str:
    """An SO-101: its joints, a body of boxes, one jaw that stands and one on a hinge that opens by 100 degrees."""
    parts, at = [link("base_link", ((0.08, 0.08, 0.04), (-0.02, 0.0, 0.02)))], "base_link"
    names = ("shoulder_link", "upper_arm_link", "lower_arm_link", "wrist_link", "gripper_link")
    boxes: list[list[tuple[Sequence[float], Sequence[float]]]] = [
        [((0.04, 0.04, 0.03), (0.0, 0.0, -0.02))],
        [((0.11, 0.03, 0.03), (-0.055, -0.01, 0.0))],
        [((0.12, 0.03, 0.03), (-0.065, 0.0, 0.0))],
        [((0.03, 0.04, 0.03), (0.0, -0.03, 0.018))],
        [((0.05, 0.03, 0.02), (0.0, 0.0, -0.01)), ((0.008, 0.02, 0.085), (-0.0119, 0.0, -0.0625))],
    ]
    for k, name in enumerate(names):
        xyz, rpy = SO101[k]
        parts += [link(name, *boxes[k]), joint(SO101_NAMES[k], at, name, xyz, rpy=rpy, limits=SO101_LIMITS[k])]
        at = name
    parts += [
        link("gripper_frame_link"),
        joint("gripper_frame_joint", at, "gripper_frame_link", SO101[-1][0], rpy=SO101[-1][1], kind="fixed"),
        link("moving_jaw_link", ((0.008, 0.085, 0.02), (-0.0221, -0.0375, 0.0188))),
        joint(
            "gripper",
            at,
            "moving_jaw_link",
            (0.0202, 0.0188, -0.0234),
            rpy=(1.5708, 0.0, 0.0),
            limits=(-0.174533, 1.74533),
        ),
    ]
    return f'<robot name="so101">{"".join(parts)}</robot>'


def panda_text() -> str:
    """A Panda with its hand: two fingers that slide by 40 mm each; as its file has it, neither follows the other."""
    placements, limits = ARMS["panda"]
    parts, at = [link("link0", ((0.15, 0.15, 0.1), (0.0, 0.0, 0.05)))], "link0"
    for k in range(7):
        xyz, rpy = placements[k]
        given = limits[k]
        low, high = given if isinstance(given, tuple) else (-float(given or 0.0), float(given or 0.0))
        shape = ((0.06, 0.06, 0.06), (0.0, 0.0, 0.0))
        parts += [
            link(f"link{k + 1}", shape),
            joint(f"joint{k + 1}", at, f"link{k + 1}", xyz, rpy=rpy, limits=(low, high)),
        ]
        at = f"link{k + 1}"
    parts += [
        link("hand", ((0.04, 0.2, 0.06), (0.0, 0.0, 0.03))),
        joint("hand_joint", at, "hand", (0.0, 0.0, 0.107), rpy=(0.0, 0.0, -math.pi / 4), kind="fixed"),
        link("hand_tcp"),
        joint("tcp_joint", "hand", "hand_tcp", (0.0, 0.0, 0.1034), kind="fixed"),
        link("leftfinger", ((0.02, 0.014, 0.054), (0.0, 0.007, 0.027))),
        link("rightfinger", ((0.02, 0.014, 0.054), (0.0, -0.007, 0.027))),
        joint(
            "finger_joint1", "hand", "leftfinger", (0, 0, 0.0584), kind="prismatic", axis=(0, 1, 0), limits=(0, 0.04)
        ),
        joint(
            "finger_joint2", "hand", "rightfinger", (0, 0, 0.0584), kind="prismatic", axis=(0, -1, 0), limits=(0, 0.04)
        ),
    ]
    return f'<robot name="panda">{"".join(parts)}</robot>'


def mimicking_text() -> str:
    """The same arm with two fingers on hinges, 140 mm of which one follows the other with the sign of its axis.

    As in the files of Robotiq's grippers the fingers are open at zero, and pads stay parallel: each tip turns back.
    """
    text = panda_text()
    head = text[: text.index('<link name="leftfinger">')]
    parts = []
    for side, sign in (("left", 1.0), ("right", -1.0)):
        follow = '<mimic joint="finger_joint" multiplier="{}"/>'
        name = "finger_joint" if side == "left" else "right_outer_knuckle_joint"
        more = "" if side == "left" else follow.format(-1.0)
        limits = (0.0, 0.8) if side == "left" else (-0.8, 0.0)
        parts += [
            link(f"{side}_knuckle", ((0.02, 0.012, 0.04), (0.0, 0.01 * sign, 0.03))),
            joint(name, "hand", f"{side}_knuckle", (0, 0.03 * sign, 0.065), axis=(1, 0, 0), limits=limits, more=more),
            link(f"{side}_pad", ((0.02, 0.01, 0.04), (0.0, 0.0, 0.02))),
            joint(
                f"{side}_tip_joint", f"{side}_knuckle", f"{side}_pad", (0, 0.015 * sign, 0.05), axis=(1, 0, 0),
                limits=(-0.9, 0.9), more=follow.format(-sign),
            ),
        ]  # fmt: skip
    return f"{head}{''.join(parts)}</robot>"


TEXTS = {"so101": so101_text, "panda": panda_text, "mimicking": mimicking_text}


def load(name: str, folder: Path) -> Robot:
    """One of the arms, from a file in a folder."""
    return load_text(folder / f"{name}.urdf", TEXTS[name]())
