"""Inverse kinematics: how the arm reaches a pose. Everything public is imported from here; read `solver` first.

solver, batch       poses to joint angles, one or many
closed_form         every branch of a six-joint Jaco
families            all configurations where one parameter is free
qp                  quadratic programs, for what the closed form does not cover
closest             the closest configuration to a pose that cannot be reached
tracking            following targets at a fixed rate
paths               joint trajectories along poses and between configurations: tracked or planned
planning            the parts of `plan_path`
files               files of target poses and of answers
batches             files of any length, through any executor
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from jacokin import lazy

if TYPE_CHECKING:
    from jacokin.ik.batches.progress import Progress as Progress
    from jacokin.ik.batches.solve_file import solve_file as solve_file
    from jacokin.ik.batches.summary import FileSummary as FileSummary
    from jacokin.ik.closed_form import warmup as warmup
    from jacokin.ik.families.family import Family as Family
    from jacokin.ik.families.interval import Interval as Interval
    from jacokin.ik.families.interval import IntervalEnd as IntervalEnd
    from jacokin.ik.files.target_rows import TargetFile as TargetFile
    from jacokin.ik.files.targets_csv import read_targets as read_targets
    from jacokin.ik.one_pose import solve_ik as solve_ik
    from jacokin.ik.paths.clearances import PathClearance as PathClearance
    from jacokin.ik.paths.clearances import path_clearance as path_clearance
    from jacokin.ik.paths.joint_motion import JointMotion as JointMotion
    from jacokin.ik.paths.joint_motion import move_joints as move_joints
    from jacokin.ik.paths.plan import plan_path as plan_path
    from jacokin.ik.paths.plot import plot_path as plot_path
    from jacokin.ik.paths.result import BranchReport as BranchReport
    from jacokin.ik.paths.result import PathResult as PathResult
    from jacokin.ik.paths.track import track_path as track_path
    from jacokin.ik.results import BatchResult as BatchResult
    from jacokin.ik.results import Branches as Branches
    from jacokin.ik.results import IKResult as IKResult
    from jacokin.ik.results import Status as Status
    from jacokin.ik.solver import IKSolver as IKSolver
    from jacokin.ik.tracking.clearance import Clearance as Clearance
    from jacokin.ik.tracking.objectives import LimitDistance as LimitDistance
    from jacokin.ik.tracking.objectives import Manipulability as Manipulability
    from jacokin.ik.tracking.objectives import Objective as Objective
    from jacokin.ik.tracking.objectives import Posture as Posture
    from jacokin.ik.tracking.result import TrackerStatus as TrackerStatus
    from jacokin.ik.tracking.result import TrackerStep as TrackerStep
    from jacokin.ik.tracking.targets import AxisTarget as AxisTarget
    from jacokin.ik.tracking.targets import OrientationTarget as OrientationTarget
    from jacokin.ik.tracking.targets import PoseTarget as PoseTarget
    from jacokin.ik.tracking.targets import PositionTarget as PositionTarget
    from jacokin.ik.tracking.targets import RegionTarget as RegionTarget
    from jacokin.ik.tracking.tracker import Tracker as Tracker
    from jacokin.model.obstacles import Box as Box
    from jacokin.model.obstacles import Capsule as Capsule
    from jacokin.model.obstacles import Cylinder as Cylinder
    from jacokin.model.obstacles import Floor as Floor
    from jacokin.model.obstacles import Obstacle as Obstacle
    from jacokin.model.obstacles import Sphere as Sphere
    from jacokin.model.pose_targets import FreeAxis as FreeAxis
    from jacokin.model.scenes.scene import Scene as Scene

__all__, __getattr__, __dir__ = lazy.door(
    __name__,
    {
        "jacokin.ik.solver": ("IKSolver",),
        "jacokin.ik.one_pose": ("solve_ik",),
        "jacokin.ik.results": (
            "BatchResult",
            "Branches",
            "IKResult",
            "Status",
        ),
        "jacokin.ik.closed_form": ("warmup",),
        "jacokin.ik.families.family": ("Family",),
        "jacokin.ik.families.interval": ("Interval", "IntervalEnd"),
        "jacokin.ik.tracking.tracker": ("Tracker",),
        "jacokin.ik.tracking.result": (
            "TrackerStatus",
            "TrackerStep",
        ),
        "jacokin.ik.tracking.targets": (
            "AxisTarget",
            "OrientationTarget",
            "PoseTarget",
            "PositionTarget",
            "RegionTarget",
        ),
        "jacokin.ik.tracking.objectives": (
            "LimitDistance",
            "Manipulability",
            "Objective",
            "Posture",
        ),
        "jacokin.ik.tracking.clearance": ("Clearance",),
        "jacokin.model.obstacles": (
            "Box",
            "Capsule",
            "Cylinder",
            "Floor",
            "Obstacle",
            "Sphere",
        ),
        "jacokin.model.pose_targets": ("FreeAxis",),
        "jacokin.model.scenes.scene": ("Scene",),
        "jacokin.ik.batches.progress": ("Progress",),
        "jacokin.ik.batches.solve_file": ("solve_file",),
        "jacokin.ik.paths.plan": ("plan_path",),
        "jacokin.ik.paths.clearances": (
            "PathClearance",
            "path_clearance",
        ),
        "jacokin.ik.batches.summary": ("FileSummary",),
        "jacokin.ik.files.target_rows": ("TargetFile",),
        "jacokin.ik.files.targets_csv": ("read_targets",),
        "jacokin.ik.paths.track": ("track_path",),
        "jacokin.ik.paths.result": (
            "BranchReport",
            "PathResult",
        ),
        "jacokin.ik.paths.plot": ("plot_path",),
        "jacokin.ik.paths.joint_motion": (
            "JointMotion",
            "move_joints",
        ),
    },
)
