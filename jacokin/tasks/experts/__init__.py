"""Scripted policies that solve tasks. Read `expert` first, then `driver`.

expert         `expert(name)`, the scripts that reach and lift, noise and mistakes that scripts have to mend
bricks         the scripts that place and stack
driver         the arm as a script sees it, and its motions
grasps         where the hand takes a brick
"""
