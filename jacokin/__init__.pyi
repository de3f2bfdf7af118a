from jacokin.errors import JacokinError as JacokinError
from jacokin.ik.results import IKResult as IKResult
from jacokin.ik.results import Status as Status
from jacokin.ik.solver import IKSolver as IKSolver
from jacokin.ik.solver import solve_ik as solve_ik
from jacokin.kernels.library import warmup as warmup
from jacokin.model.comparison import crosscheck as crosscheck
from jacokin.model.loading import load_robot as load_robot
from jacokin.model.poses import FreeAxis as FreeAxis
from jacokin.model.poses import pose as pose
from jacokin.model.robot import Robot as Robot
from jacokin.motion.free_motion.plan_motion import plan_motion as plan_motion
from jacokin.motion.planning.plan import plan_path as plan_path
from jacokin.motion.tracking.tracker import Tracker as Tracker

__version__: str
ROOMS: tuple[str, ...]

__all__: list[str]
