from jacokin.logs.bag import Topic as Topic
from jacokin.logs.log import Log as Log
from jacokin.logs.log import Recording as Recording
from jacokin.logs.log import StandstillRule as StandstillRule
from jacokin.logs.log import Standstills as Standstills
from jacokin.logs.log import TorqueRows as TorqueRows
from jacokin.logs.messages import JointRecord as JointRecord
from jacokin.logs.messages import PoseRecord as PoseRecord

__all__: list[str]
