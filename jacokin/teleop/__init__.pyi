from jacokin.teleop.demonstrations import Demonstrations as Demonstrations
from jacokin.teleop.demonstrations import TaskArm as TaskArm
from jacokin.teleop.demonstrations import demonstrate as demonstrate
from jacokin.teleop.devices import Controller as Controller
from jacokin.teleop.devices import Device as Device
from jacokin.teleop.devices import Fingers as Fingers
from jacokin.teleop.devices import Keyboard as Keyboard
from jacokin.teleop.devices import Player as Player
from jacokin.teleop.devices import SpaceMouse as SpaceMouse
from jacokin.teleop.hand import HandOptions as HandOptions
from jacokin.teleop.session import Session as Session
from jacokin.teleop.session import lead as lead
from jacokin.teleop.streams import Stream as Stream
from jacokin.teleop.streams import make_stream as make_stream
from jacokin.teleop.teleop import Teleop as Teleop
from jacokin.teleop.teleop import TeleopStatus as TeleopStatus
from jacokin.teleop.teleop import TeleopStep as TeleopStep

__all__: list[str]
