from jacokin.twin.arm import SimulatedArm as SimulatedArm
from jacokin.twin.arm import State as State
from jacokin.twin.faults import Faults as Faults
from jacokin.twin.following import Tolerances as Tolerances
from jacokin.twin.following import TrajectoryController as TrajectoryController
from jacokin.twin.goals import Goal as Goal
from jacokin.twin.goals import GoalStatus as GoalStatus
from jacokin.twin.goals import Record as Record
from jacokin.twin.kinova import KinovaDriver as KinovaDriver

__all__: list[str]
