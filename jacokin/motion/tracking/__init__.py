"""Following targets at a fixed rate within position and velocity limits. Read `tracker` first.

tracker        `Tracker`: one QP a tick
targets        what can be followed: poses, parts of them, regions
problem        the QP of a tick
joint_limits   how far each joint may go in a tick
avoidance      how collisions are avoided
"""
