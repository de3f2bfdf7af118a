"""Following targets at a fixed rate within position, velocity and acceleration limits. Read `tracker` first.

tracker        `Tracker`: a tick
ticks          the kernels of a tick, with the arrays they work on
problem        what is missing to the targets of a tick: their error to second order, and the QP within limits
joint_limits   how far each joint may go in a tick
twist          following a twist, in its direction or slower
targets        what can be followed: poses, parts of them, regions
avoidance      how collisions are avoided
moving         obstacles that move
steps          what a tick says, and the counts of many
"""
