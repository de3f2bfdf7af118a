"""What the arm is: descriptions, frames, limits, forward kinematics and Jacobians. Read `robot` first.

robot, jacobians        the arm, its limits, kinematics and Jacobians
loading, descriptions   from a name, a URDF or an MJCF to the arm; the bundled robots and their table of numbers
home                    a configuration to start from
poses, angles, checks   building and checking poses, full turns, checks of arguments
many_configurations     kinematics of many configurations at once
mujoco_twin, contact    the same arm in MuJoCo; whether and how closely it comes to itself and to obstacles
obstacles, scene        shapes around the arm, one by one, from a file or from a MuJoCo model
comparison              how far two descriptions, or Pinocchio and MuJoCo, differ
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__, __file__)
