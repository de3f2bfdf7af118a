"""What all solvers of one robot, frame and tool share, whatever is around the arm: made once, and kept by the robot.

Measuring the structure of an arm takes 2 to 100 ms, and its compiled twin for the QP 5 ms.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import StructureError
from jacokin.ik.closed_form import ClosedForm
from jacokin.ik.options import SolverOptions
from jacokin.ik.solutions import curve_arm
from jacokin.ik.solutions.curve_arm import CurveArm
from jacokin.ik.verification import Verifier
from jacokin.ik.virtual_joints import VirtualJoints
from jacokin.model.robot import Robot

if TYPE_CHECKING:
    import mujoco

ToolKey: TypeAlias = tuple[float, ...] | None
TOOL_SITE = "jacokin_tool"


def closed_form(verifier: Verifier) -> ClosedForm | StructureError:
    """The closed form of six joints, or why there is none."""
    snap = verifier.options.limit_snap
    return verifier.robot.once(_closed_form, verifier.frame, _key(verifier.tool), snap)


def about_axis(verifier: Verifier) -> CurveArm:
    """What finds the curves of six joints about a free axis.

    Raises:
        StructureError: there is no closed form.
    """
    snap = verifier.options.limit_snap
    return verifier.robot.once(_about_axis, verifier.frame, _key(verifier.tool), snap)


def at_poses(verifier: Verifier) -> CurveArm | StructureError:
    """What finds the curves of seven joints at a pose, or why nothing does."""
    return verifier.robot.once(_at_poses, verifier.frame, _key(verifier.tool))


def virtual_joints(
    verifier: Verifier, axis: tuple[float, ...] | None, position_only: bool
) -> VirtualJoints | StructureError:
    """What finds the configurations of three to five joints at targets of one kind, or why nothing does."""
    options, tool = verifier.options, _key(verifier.tool)
    found = verifier.robot.once(_virtual_joints, verifier.frame, tool, axis, position_only, options.limit_snap)
    return found if isinstance(found, StructureError) else found.measured_by(verifier)


def twin_with_tool(verifier: Verifier) -> mujoco.MjModel:
    """The robot's twin in MuJoCo with a site `TOOL_SITE` where the tool is; not to be changed."""
    return verifier.robot.once(_twin_with_tool, verifier.frame, _key(verifier.tool))


def _key(tool: pin.SE3 | None) -> ToolKey:
    return None if tool is None else tuple(tool.homogeneous.ravel().tolist())


def _verifier(robot: Robot, frame: str, tool: ToolKey) -> Verifier:
    """What knows robot, frame and tool, and nothing around them."""
    placed = None if tool is None else pin.SE3(np.array(tool).reshape(4, 4))
    return Verifier(robot, frame, placed, SolverOptions(collision="ignore"))


def _closed_form(robot: Robot, frame: str, tool: ToolKey, snap: float) -> ClosedForm | StructureError:
    known = _verifier(robot, frame, tool)
    try:
        return ClosedForm(robot.pin_model, known.frame_id, known.tool, robot.lower, robot.upper, limit_snap=snap)
    except StructureError as error:
        return error.with_traceback(None)


def _about_axis(robot: Robot, frame: str, tool: ToolKey, snap: float) -> CurveArm:
    form = robot.once(_closed_form, frame, tool, snap)
    if isinstance(form, StructureError):
        raise form.with_traceback(None)
    return curve_arm.about_axis(form, robot)


def _at_poses(robot: Robot, frame: str, tool: ToolKey) -> CurveArm | StructureError:
    try:
        return curve_arm.at_poses(_verifier(robot, frame, tool))
    except StructureError as error:
        return error.with_traceback(None)


def _virtual_joints(
    robot: Robot, frame: str, tool: ToolKey, axis: tuple[float, ...] | None, position_only: bool, snap: float
) -> VirtualJoints | StructureError:
    along: Array | None = None if axis is None else np.array(axis)
    try:
        return VirtualJoints(_verifier(robot, frame, tool), along, position_only=position_only, limit_snap=snap)
    except StructureError as error:
        return error.with_traceback(None)


def _twin_with_tool(robot: Robot, frame: str, tool: ToolKey) -> mujoco.MjModel:
    from jacokin.model import poses
    from jacokin.model.mujoco_twin import body_of_joint, to_spec

    known, spec = _verifier(robot, frame, tool), to_spec(robot)
    placed = robot.pin_model.frames[known.frame_id]
    T_joint_tool = placed.placement if known.tool is None else placed.placement * known.tool
    body = spec.body(body_of_joint(placed.parentJoint))
    body.add_site(name=TOOL_SITE, pos=T_joint_tool.translation, quat=poses.quaternion(T_joint_tool.rotation))
    return spec.compile()
