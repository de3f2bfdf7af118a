from jacokin.tasks.environment import Environment as Environment
from jacokin.tasks.environment import load as load
from jacokin.tasks.experts.expert import Expert as Expert
from jacokin.tasks.experts.expert import expert as expert
from jacokin.tasks.gym.environment import TaskEnv as TaskEnv
from jacokin.tasks.randomization import Randomization as Randomization
from jacokin.tasks.registry import names as names
from jacokin.tasks.task import Task as Task

__all__: list[str]
