"""What the arm is: descriptions, frames, limits, kinematics and dynamics. Read `robot` first.

robot                   the arm, its limits, kinematics and dynamics
kinematics              axes of joints, reference frames of Jacobians, many configurations at once, by kernels
dynamics                payloads, tilted bases, the wrench behind joint torques, many configurations at once
contact_observer        contact noticed from joint torques
identification          payload and friction from a log
loading, descriptions   from a name, a URDF or an MJCF to the arm and its home; the bundled robots and their numbers
measured_arm            how far one arm is from its description, and the file that says so
written_descriptions    the URDF or MJCF of a calibrated arm
poses, angles, checks   building and checking poses, full turns, checks of arguments
many_configurations     errors against many poses, and Newton's method
mujoco_twin             the same arm in MuJoCo
obstacles, scene        shapes around the arm, one by one, from a file or from a MuJoCo model; shapes that it holds
point_cloud             points as an obstacle, as cameras see them; their files, depth images
gripper                 the gripper that an arm carries, measured on its shapes
own_shapes              the arm's shapes, read once
surrounded              the arm's shapes among those of a scene, the pairs whose contact counts; points not on the arm
contact, contact_arrays whether and how closely the arm comes to itself, to obstacles and to another robot while both
                        move; the shapes for the kernels
comparison              how far two descriptions, or Pinocchio and MuJoCo, differ
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__)
