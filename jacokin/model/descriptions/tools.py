"""Where an arm ends and its tool begins: joints that move only a gripper or a camera, and frames that tools have.

A joint of the tool is known by its name, by that of the link it moves, or by how little it moves. Joints of arms must
never be taken for one, so that doubts are settled for the arm: `--tip` and `tip=` take in what is left out.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

FRAME_TYPES = (pin.FrameType.BODY, pin.FrameType.OP_FRAME)

#: Names of frames at which tools are solved, the first first; what stands in front does not count ("left_tool0").
TOOL_FRAMES = (
    "end_effector",  # Kinova's
    "tool0",  # ROS-Industrial's
    "end_effector_link",
    "end_effector_frame",
    "gripper_frame_link",  # of the SO-101
    "gripperframe",
    "hand_tcp",  # Franka's
    "grasptarget",
    "gripper_tcp",
    "tcp",
    "tcp_link",
    "tcp_frame",
    "tool_center_point",
    "grasp_frame",
    "grasping_frame",
    "grasp_link",
    "grasp_site",
    "pinch_site",
    "pinchsite",
    "pinch",
    "grip_site",
    "ee_gripper_link",
    "attachment_site",  # of MuJoCo Menagerie
    "attachment",
    "eef",
    "link_eef",
    "eef_link",
    "ee_link",
    "ee_site",
    "ee_frame",
    "ee",
    "tool_frame",
    "tool_link",
    "tool",
    "flange",
    "flange_link",
    "link8",  # the flange of Franka's arms
    "hand",
    "hand_link",
    "gripper",
    "gripper_link",
)

SURE = ("jaw", "finger", "claw", "knuckle", "thumb")  # no joint of an arm moves one of these alone
# Words of a joint or a link that turns or carries the gripper.
TURNING = frozenset((
    "roll", "pitch", "yaw", "rotate", "rotation", "rot", "wrist", "twist", "swivel", "spin", "turn", "flex", "elbow",
    "shoulder", "forearm",
))  # fmt: skip
NARROW = 2.25  # [rad] no joint of an arm turns so little at its end; jaws turn 1.6 to 2.2
WIDE = 5.2  # [rad] 300 degrees: no jaw turns so far
SLIDES_AFTER = 4  # turning joints, of which a SCARA arm has three

_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")
_AXIS = re.compile(r"(?<![A-Za-z])[xyzXYZ]$|(?<=[a-z])[XYZ]$")  # "gripper_z", "GripperZ"


class LeftOut(NamedTuple):
    """A joint at the end of a chain that moves only a tool."""

    joint: int
    """Its number in the model."""
    why: str
    """What it moves, and how that is known: "moves only the gripper 'jaw', by its name"."""


def joints_of_tool(model: pin.Model, chain: Sequence[int], leaders: Mapping[str, str]) -> list[LeftOut]:
    """The joints at the end of a chain that move only a tool, the outermost first.

    Args:
        model: the whole robot.
        chain: numbers of joints, from the base to where the tree branches or ends.
        leaders: which joint a joint follows, by name.
    """
    kept, found = list(chain), list[LeftOut]()
    while why := _why_of_tool(model, kept, leaders):
        found.append(LeftOut(kept.pop(), why))
    return found if len(kept) >= 3 else []  # what would keep fewer is a gripper or a finger itself


def is_finger(model: pin.Model, joint: int) -> bool:
    """Whether the name of a joint, or of the link that it moves, is that of a finger."""
    return any(word in name.lower() for word in SURE for name in (str(model.names[joint]), _link(model, joint)))


def is_torso(model: pin.Model, joint: int) -> bool:
    """Whether a joint that carries an arm and something else may be one of a torso: it slides, or is called so."""
    named = "torso" in str(model.names[joint]).lower() or "torso" in _link(model, joint).lower()
    return model.joints[joint].nv != 1 or slides(model, joint) or named


def _why_of_tool(model: pin.Model, chain: Sequence[int], leaders: Mapping[str, str]) -> str | None:
    """Why the last joint of a chain is one of the tool; None where it is one of the arm."""
    if len(chain) == 1:
        return None
    name = str(model.names[chain[-1]])
    names = [str(model.names[joint]) for joint in chain]
    if leaders.get(name) in names[:-1]:  # it is of the tool where the joint that it follows is
        before = chain[: names.index(leaders[name]) + 1]
        return f"follows joint {leaders[name]!r}" if _why_of_tool(model, before, leaders) else None
    return _by_name(model, chain) or _by_motion(model, chain)


def _by_name(model: pin.Model, chain: Sequence[int]) -> str | None:
    """Whether names say that the last joint moves a tool; words that the whole arm is called by say nothing."""
    joint, link = model.names[chain[-1]], _link(model, chain[-1])
    if _turns(joint):
        return None
    joints = [model.names[each] for each in chain[:-1]]
    links = [_link(model, each) for each in chain[:-1]]
    travel = _travel(model, chain[-1])
    tool = _surely_named(joint, link, joints, links, travel)
    if tool is None:
        narrow = slides(model, chain[-1]) or travel <= NARROW
        at_end = not _carries_tool_frame(model, chain[-1])
        tool = _likely_named(joint, link, joints, links, travel, narrow=narrow, at_end=at_end)
    if tool is None:
        return None
    return f"moves only the {tool} {link!r}, by its name" if link else f"moves only the {tool} by its name"


def _surely_named(joint: str, link: str, joints: Sequence[str], links: Sequence[str], travel: float) -> str | None:
    """What a joint or its link is called that only tools have; None for nothing of that kind."""
    for word in SURE:
        if _says(joint, word, joints) or (_says(link, word, links) and travel < WIDE and not _stands(link)):
            return word
    return None


def _likely_named(
    joint: str, link: str, joints: Sequence[str], links: Sequence[str], travel: float, *, narrow: bool, at_end: bool
) -> str | None:
    """What a joint or its link is called that tools have, and parts of wrists too; None for nothing of a tool.

    Args:
        joint: its name.
        link: name of the link that it moves.
        joints: names of the joints before it.
        links: names of the links that they move.
        travel: from limit to limit [rad] or [m].
        narrow: whether it slides or turns less than joints of an arm do.
        at_end: whether the frames that tools have are not on it alone.
    """
    # Links of wrists are called so, and joints that turn the gripper.
    for word, what in (("grip", "gripper"), ("camera", "camera")):
        if "moving" in _words(link) and _says(link, word, links):  # of two parts, the other one stands
            return what
        if _says(joint, word, joints) and (narrow or (at_end and (travel < WIDE or what == "camera"))):
            return what
        if _says(link, word, links) and narrow and not _stands(link):
            return what
    return None


def _by_motion(model: pin.Model, chain: Sequence[int]) -> str | None:
    """Whether the last joint moves so little that it cannot be one of the arm: a slide, or a light part on one side."""
    at, before = chain[-1], chain[:-1]
    travel = _travel(model, at)
    weights = [model.inertias[joint].mass for joint in chain]
    light = weights[-1] <= 0.06 * sum(weights) and weights[-1] <= 0.5 * weights[-2]
    if _turns(model.names[at]) or _carries_tool_frame(model, at):
        return None
    if slides(model, at):
        turning = sum(not slides(model, joint) for joint in before)
        # The quills of SCARA arms slide farther, and after fewer joints.
        return f"slides only {1e3 * travel:.0f} mm" if travel <= 0.12 and turning >= SLIDES_AFTER and light else None
    low, high = limits_of(model, at)
    near, far = sorted((abs(low), abs(high)))
    one_sided = low <= near and high >= -near and far >= 4.0 * near
    travels = sorted(_travel(model, joint) for joint in before)
    usual = 0.5 * (travels[(len(travels) - 1) // 2] + travels[len(travels) // 2])  # the median; NumPy's loads much
    if travel <= min(NARROW, 0.8 * usual) and one_sided and light and weights[-1] > 0.0 and len(before) > SLIDES_AFTER:
        return f"turns only {np.degrees(travel):.0f} degrees and moves only {1e3 * weights[-1]:.0f} g"
    return None


def _says(name: str, word: str, others: Sequence[str]) -> bool:
    """Whether a name has a word that not all the others have, too."""
    return word in name.lower() and not all(word in other.lower() for other in others)


def _words(name: str) -> frozenset[str]:
    return frozenset(word.lower() for word in _WORD.findall(name))


def _turns(name: str) -> bool:
    """Whether a joint is called as those are that turn the gripper."""
    return bool(_words(name) & TURNING or _AXIS.search(name))


def _stands(link: str) -> bool:
    """Whether a link is called as those are that carry a gripper or a camera."""
    standing = ("base", "fixed", "static", "palm", "mount", "body", "housing", "holder")
    return not _words(link).isdisjoint((*standing, *TURNING))


def slides(model: pin.Model, joint: int) -> bool:
    """Whether a joint slides, and does not turn."""
    return "JointModelP" in model.joints[joint].shortname()


def limits_of(model: pin.Model, joint: int) -> tuple[float, float]:
    """Lower and upper limit of a joint; infinite where it has none, as a continuous one."""
    kind = model.joints[joint]
    if kind.nq != 1:
        return -np.inf, np.inf
    return float(model.lowerPositionLimit[kind.idx_q]), float(model.upperPositionLimit[kind.idx_q])


def _travel(model: pin.Model, joint: int) -> float:
    low, high = limits_of(model, joint)
    return high - low


def _link(model: pin.Model, joint: int) -> str:
    """Name of the first link that a joint moves; "" for none."""
    for frame in list(model.frames)[1:]:
        if frame.parentJoint == joint and frame.type == pin.FrameType.BODY:
            return str(frame.name)
    return ""


def _carries_tool_frame(model: pin.Model, joint: int) -> bool:
    """Whether a frame that is called as tools are is on a joint, and none on the joint before it."""
    before = model.parents[joint]
    return any(map(_rank, frames_on(model, joint))) and not any(map(_rank, frames_on(model, before)))


def frames_on(model: pin.Model, joint: int) -> list[str]:
    """Names of the links, bodies and sites that a joint carries."""
    return [
        str(frame.name) for frame in list(model.frames)[1:] if frame.parentJoint == joint and frame.type in FRAME_TYPES
    ]


def usual_tools(names: Sequence[str]) -> list[str]:
    """Those of some frames that are called as tools are, the most usual first; all of them where none is."""
    ranked = [(rank, name) for name in names if (rank := _rank(name))]
    return [name for _, name in sorted(ranked, key=lambda each: each[0])] or list(names)


def _rank(name: str) -> tuple[int, int] | None:
    """Where a name stands in `TOOL_FRAMES`, whole names before endings; None where it does not."""
    plain = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
    for place, tool in enumerate(TOOL_FRAMES, 1):
        if plain == tool:
            return place, 0
        if plain.endswith(tool) and not plain[-len(tool) - 1].isalpha():
            return place, 1
    return None
