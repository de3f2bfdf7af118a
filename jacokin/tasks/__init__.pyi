from jacokin.tasks.datasets.recording import RecordSummary as RecordSummary
from jacokin.tasks.datasets.recording import Replayed as Replayed
from jacokin.tasks.datasets.recording import record as record
from jacokin.tasks.datasets.recording import replay as replay
from jacokin.tasks.environment import Environment as Environment
from jacokin.tasks.environment import load as load
from jacokin.tasks.experts.expert import Expert as Expert
from jacokin.tasks.experts.expert import expert as expert
from jacokin.tasks.families import Lift as Lift
from jacokin.tasks.families import Place as Place
from jacokin.tasks.features import Feature as Feature
from jacokin.tasks.gym.environment import TaskEnv as TaskEnv
from jacokin.tasks.randomization import Randomization as Randomization
from jacokin.tasks.registry import names as names
from jacokin.tasks.registry import register as register
from jacokin.tasks.task import State as State
from jacokin.tasks.task import Task as Task

__all__: list[str]
