"""Commands, inverse kinematics and initial poses of an arm in a scene. Read `commands` first.

commands       velocities that move an arm or a site
site_ik        joint angles for a pose of a site; `queries` answers many at once, `collisions` tries them out
initializers   initial poses of the arm; `prop_placer` those of props
"""
