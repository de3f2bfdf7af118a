"""Two joints that turn freely, and what of a pose does not matter because of them.

Joint 1 turns about the vertical through the origin of the base: with a pose, all poses are reached that come from it by
turning about that line. The last joint turns about a line through the origin of the tool: with a pose, all are reached
that come from it by turning the tool about that line. A map then needs r and z of a position instead of x, y and z, and
the direction of an axis instead of an orientation: four numbers instead of six.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.solver import IKSolver

TOLERANCE = 1e-9  # [m] and [rad] that an axis may be off: a thousandth of the tolerance of a solution


@dataclass(frozen=True, slots=True, eq=False)
class Symmetries:
    """What does not matter.

    Attributes:
        turns: whether poses may be turned about the z axis of the base.
        tool_axis: (3,) axis of the tool about which poses may be turned, a unit vector in its frame; None if none.
    """

    turns: bool
    tool_axis: Array | None


NONE = Symmetries(turns=False, tool_axis=None)


def of_solver(solver: IKSolver) -> Symmetries:
    """The symmetries of an arm, frame and tool, without obstacles and self-contact."""
    robot = solver.robot
    pose = robot.forward_kinematics(robot.home, solver.frame)
    jacobian = robot.jacobian(robot.home, solver.frame)
    position, rotation = pose.translation, pose.rotation
    velocity, angular = jacobian[:3].copy(), jacobian[3:]
    if solver.tool is not None:
        arm = rotation @ solver.tool.translation
        position = position + arm
        velocity += np.cross(angular.T, arm).T
        rotation = rotation @ solver.tool.rotation
    # A joint whose axis passes through a point moves it by the cross product of the axis with the way to the tool.
    about_z = np.cross(angular[:, 0], position)[:2]
    turns = bool(
        robot.unlimited[0]
        and np.abs(angular[:2, 0]).max() < TOLERANCE
        and np.abs(velocity[:2, 0] - about_z).max() < TOLERANCE
        and np.abs(velocity[2, 0]) < TOLERANCE
    )
    rolls = bool(robot.unlimited[-1] and not robot.sliding[-1] and np.abs(velocity[:, -1]).max() < TOLERANCE)
    return Symmetries(turns, np.asarray(rotation.T @ angular[:, -1]) if rolls else None)
