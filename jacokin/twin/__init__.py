"""Kinova's driver, simulated: a node that clients take for it. Everything public is imported from here.

Read `kinova` first.

kinova         `KinovaDriver`: what kinova-ros' driver and the base of the arm do
following      `TrajectoryController`: what ros2_control does with goals and velocities
arm            `SimulatedArm`: MuJoCo's arm behind both; `ArmController`, what they have in common, their `TwinGoal`,
               and the `Record` of what was done
faults         `Faults`: lag, loss and stalls between them, drawn from a seed
nodes          `Ticker`, as time passes, and cameras of a scene
ros1, ros2     the nodes, which alone import ROS
ros1_messages  messages that Debian has no package of
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__)
