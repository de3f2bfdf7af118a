"""What the arm is: descriptions, frames, limits, forward kinematics and Jacobians. Read `robot` first.

robot, differential     the arm, its kinematics and Jacobians
loading, descriptions   from a name, a URDF or an MJCF to the arm; the bundled robots and their table of numbers
home                    a configuration to start from
poses, angles, checks   building and checking poses, full turns, arguments
mujoco_twin             the same arm in MuJoCo, and contact
obstacles, scenes       shapes around the arm
comparison              whether two descriptions, or Pinocchio and MuJoCo, agree
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__, __file__)
