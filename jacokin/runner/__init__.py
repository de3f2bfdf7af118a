"""What plays motions on an arm: velocities in a closed loop on measured angles. Public names are imported from here.

Read `runner` first. No ROS is in here: `forwarder` is a program of its own, which speaks to ROS at the end of a pipe.

runner     `Runner`: from time and what is measured to velocities, or why it stopped
measuring  how late an arm is seen to move, measured as it begins; whether it stands, and where, with noise
motions    `Motion`, what it follows: `PlannedMotion` of a file, `LiveMotion` of a hand
links      `run`: a runner at 100 Hz and its `Link`: `TwinLink` to a simulated arm, `ProcessLink` to a forwarder
forwarder  the program beside the driver, for ROS 1 and 2; it needs Python 3.8 and ROS
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__)
