"""Motion: how the arm gets there. Everything public is imported from here; read `tracking/tracker` first.

tracking           following targets at a fixed rate
track              `track_path`: following a path of poses with the tracker, from the start that makes it possible
planning           `plan_path`: the best branch at every place of a path, before anything moves
free_motion        `plan_motion`: from a configuration to a goal without contact
grasps             ways to grasp boxes, cylinders and spheres
joint_motion       `move_joints`: from one configuration to another in the least time
path, timing       lines between poses, and when each place of a course is passed, within limits of torque, too
rows               positions, velocities and accelerations of a motion, as controllers take them, and at one time
trajectory, files  joint angles over time, and their files
clearance, plot    how far a trajectory stays from a scene; its picture
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__)
