from jacokin.runner.links import ProcessLink as ProcessLink
from jacokin.runner.links import TwinLink as TwinLink
from jacokin.runner.links import run as run
from jacokin.runner.motions import LiveMotion as LiveMotion
from jacokin.runner.motions import PlannedMotion as PlannedMotion
from jacokin.runner.runner import Measured as Measured
from jacokin.runner.runner import Runner as Runner
from jacokin.runner.runner import RunnerOptions as RunnerOptions
from jacokin.runner.runner import RunnerStatus as RunnerStatus
from jacokin.runner.runner import RunnerStep as RunnerStep

__all__: list[str]
