"""Following targets at a fixed rate within position and velocity limits. Read `tracker` first.

tracker        `Tracker`: one QP a tick
steps          what a tick says, and the counts of many
targets        what can be followed: poses, parts of them, regions
twist          a velocity of the tool that is followed instead
problem        the QP of a tick
joint_limits   how far each joint may go in a tick
moving         obstacles that move
avoidance      how collisions are avoided
"""
