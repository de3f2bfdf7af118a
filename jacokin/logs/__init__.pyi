from jacokin.logs.bag import Topic as Topic
from jacokin.logs.log import Log as Log
from jacokin.logs.log import Recording as Recording
from jacokin.logs.messages import JointRecord as JointRecord
from jacokin.logs.messages import PoseRecord as PoseRecord
from jacokin.logs.rows import StandstillRule as StandstillRule
from jacokin.logs.rows import Standstills as Standstills
from jacokin.logs.rows import TorqueRows as TorqueRows

__all__: list[str]
