"""Commands, inverse kinematics and initial poses of an arm in a scene. Read `commands` first.

commands       velocities that move an arm or a site
site_ik        joint angles for a pose of a site; its queries are answered one by one or many at once
initializers   initial poses of the arm and of props, free of collisions
"""
