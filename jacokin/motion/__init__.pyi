from jacokin.motion.clearance import Clearance as Clearance
from jacokin.motion.clearance import path_clearance as path_clearance
from jacokin.motion.free_motion.plan_motion import plan_motion as plan_motion
from jacokin.motion.grasps import Grasp as Grasp
from jacokin.motion.joint_motion import move_joints as move_joints
from jacokin.motion.planning.plan import plan_path as plan_path
from jacokin.motion.plot import plot_path as plot_path
from jacokin.motion.track import track_path as track_path
from jacokin.motion.tracking.problem import LimitDistance as LimitDistance
from jacokin.motion.tracking.problem import Manipulability as Manipulability
from jacokin.motion.tracking.problem import Objective as Objective
from jacokin.motion.tracking.problem import Posture as Posture
from jacokin.motion.tracking.targets import AxisTarget as AxisTarget
from jacokin.motion.tracking.targets import OrientationTarget as OrientationTarget
from jacokin.motion.tracking.targets import PoseTarget as PoseTarget
from jacokin.motion.tracking.targets import PositionTarget as PositionTarget
from jacokin.motion.tracking.targets import RegionTarget as RegionTarget
from jacokin.motion.tracking.tracker import Tracker as Tracker
from jacokin.motion.tracking.tracker import TrackerStatus as TrackerStatus
from jacokin.motion.tracking.tracker import TrackerStep as TrackerStep
from jacokin.motion.trajectory import BranchReport as BranchReport
from jacokin.motion.trajectory import Goal as Goal
from jacokin.motion.trajectory import JointMotion as JointMotion
from jacokin.motion.trajectory import MotionStatus as MotionStatus
from jacokin.motion.trajectory import PathResult as PathResult

__all__: list[str]
