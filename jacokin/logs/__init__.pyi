from jacokin.logs.bag import Topic as Topic
from jacokin.logs.log import Log as Log
from jacokin.logs.log import Recording as Recording
from jacokin.logs.messages import JointRecord as JointRecord
from jacokin.logs.messages import PoseRecord as PoseRecord
from jacokin.logs.standstills import StandstillRule as StandstillRule
from jacokin.logs.standstills import Standstills as Standstills
from jacokin.logs.torque_rows import TorqueRows as TorqueRows

__all__: list[str]
