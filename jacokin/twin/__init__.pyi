from jacokin.twin.arm import ArmState as ArmState
from jacokin.twin.arm import GoalStatus as GoalStatus
from jacokin.twin.arm import Record as Record
from jacokin.twin.arm import SimulatedArm as SimulatedArm
from jacokin.twin.arm import TwinGoal as TwinGoal
from jacokin.twin.faults import Faults as Faults
from jacokin.twin.following import Tolerances as Tolerances
from jacokin.twin.following import TrajectoryController as TrajectoryController
from jacokin.twin.kinova import KinovaDriver as KinovaDriver

__all__: list[str]
