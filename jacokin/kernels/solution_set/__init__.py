"""Sets of solutions with one parameter: the curves of a chain of seven joints at a pose. Read `trace` first.

curve          steps along one curve, and points between its nodes
trace          all curves through given solutions, each followed until it closes
slices         all solutions at one value of the parameter: six joints at a pose
seven_joints   the same of seven joints built like a Jaco's, in closed form, and where they meet
end_wrist      and of six joints with a spherical wrist at an end, whose target turns
near_seed      of both, the chords beside which the nearest to a seed is
same_axis      curves along which the parameter and the joint next to it turn about one axis
surface        the equation of six joints along the parameter, as one polynomial of both
pairs          how far complex solutions of six joints are from real ones
whole_solutions   complex solutions in two angles, where roots are too near to each other
all_roots      all complex roots of the characteristic function at once
islands        at which values to look for solutions, by the characteristic function
meeting        the other curve where two meet
within         what of the curves is within the limits
starts         from points beside curves to these, by the least steps
run            from a target to all of it: the entry point
nearest        points of the pieces: where the parameter has a value, and nearest to a seed
"""
