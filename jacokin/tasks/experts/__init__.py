"""Scripted policies that solve tasks. Read `expert` first, then `driver`.

expert         `expert(name)`, and the scripts that reach and lift
place, stack   the scripts that place and stack
disturbance    noise and mistakes that scripts have to mend
driver         the arm as a script sees it, and its motions
grasps         where the hand takes a brick
"""
