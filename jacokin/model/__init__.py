"""What the arm is: descriptions, frames, limits, forward kinematics and Jacobians. Read `robot` first.

robot, differential     the arm, its kinematics and Jacobians
loading, descriptions   from a name, a URDF or an MJCF to the arm; the bundled robots and their table of numbers
home                    a configuration to start from
poses, angles, checks   building and checking poses, full turns, arguments
mujoco_twin             the same arm in MuJoCo, and contact
obstacles, scenes       shapes around the arm
comparison              whether two descriptions, or Pinocchio and MuJoCo, agree
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from jacokin import lazy

if TYPE_CHECKING:
    from jacokin.model.comparison import CrossCheckReport as CrossCheckReport
    from jacokin.model.comparison import Deviation as Deviation
    from jacokin.model.comparison import crosscheck as crosscheck
    from jacokin.model.descriptions.bundled import DEFAULT_ROBOT as DEFAULT_ROBOT
    from jacokin.model.descriptions.bundled import NAMES as NAMES
    from jacokin.model.descriptions.bundled import urdf_folder as urdf_folder
    from jacokin.model.loading import load_robot as load_robot
    from jacokin.model.mujoco_twin.contact import SelfContact as SelfContact
    from jacokin.model.mujoco_twin.export import to_mujoco as to_mujoco
    from jacokin.model.pose_targets import pose as pose
    from jacokin.model.poses import quat_wxyz as quat_wxyz
    from jacokin.model.robot import Robot as Robot
    from jacokin.model.source import Source as Source

__all__, __getattr__, __dir__ = lazy.door(
    __name__,
    {
        "jacokin.model.robot": ("Robot",),
        "jacokin.model.source": ("Source",),
        "jacokin.model.loading": ("load_robot",),
        "jacokin.model.descriptions.bundled": (
            "DEFAULT_ROBOT",
            "NAMES",
            "urdf_folder",
        ),
        "jacokin.model.pose_targets": ("pose",),
        "jacokin.model.poses": ("quat_wxyz",),
        "jacokin.model.mujoco_twin.export": ("to_mujoco",),
        "jacokin.model.mujoco_twin.contact": ("SelfContact",),
        "jacokin.model.comparison": (
            "CrossCheckReport",
            "Deviation",
            "crosscheck",
        ),
    },
)
