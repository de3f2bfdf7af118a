"""A hand that leads the arm: teleoperation. Everything public is imported from here; read `teleop` first.

teleop    `Teleop`: poses or twists of a hand device to joint commands, with a clutch and a watchdog
hand      what a hand device says, in its own frame: checks, dead band, filter; the box that it stays in
streams   recorded streams: made by code, read from files
devices   space mouse, keyboard, gamepad, and recorded streams as devices; the fingers that their keys move
session   `lead`: a device leads the arm for some time, and what came of it
demonstrations  `demonstrate`: episodes of a task whose simulated arm (`TaskArm`) a hand leads, as data sets
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__)
