"""Motion: how the arm gets there. Everything public is imported from here; read `tracking/tracker` first.

tracking            following targets at a fixed rate, one QP a tick
track_path          following a path of poses with the tracker
planning            `plan_path`: the best branch at every place of a path, before anything moves
joint_motion        from one configuration to another in the least time
path_result, files  trajectories as arrays and as files
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__, __file__)
