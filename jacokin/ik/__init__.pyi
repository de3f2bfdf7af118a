from jacokin.chunks.execution import Progress as Progress
from jacokin.ik.batches.chunk import FileSummary as FileSummary
from jacokin.ik.batches.solve_file import solve_file as solve_file
from jacokin.ik.c_library import export_c as export_c
from jacokin.ik.files.csv_files import read_targets as read_targets
from jacokin.ik.files.targets import TargetFile as TargetFile
from jacokin.ik.results import BatchResult as BatchResult
from jacokin.ik.results import IKResult as IKResult
from jacokin.ik.results import Status as Status
from jacokin.ik.solutions.interval import Interval as Interval
from jacokin.ik.solutions.interval import IntervalEnd as IntervalEnd
from jacokin.ik.solutions.solution_set import SolutionSet as SolutionSet
from jacokin.ik.solver import IKSolver as IKSolver
from jacokin.ik.solver import solve_ik as solve_ik
from jacokin.ik.structures import Residual as Residual
from jacokin.ik.structures import Structure as Structure
from jacokin.ik.structures import structure as structure
from jacokin.kernels.library import warmup as warmup
from jacokin.model.obstacles import Box as Box
from jacokin.model.obstacles import Capsule as Capsule
from jacokin.model.obstacles import Cylinder as Cylinder
from jacokin.model.obstacles import Floor as Floor
from jacokin.model.obstacles import Obstacle as Obstacle
from jacokin.model.obstacles import Sphere as Sphere
from jacokin.model.poses import FreeAxis as FreeAxis
from jacokin.model.scene import Scene as Scene

__all__: list[str]
