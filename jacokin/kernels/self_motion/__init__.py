"""Self-motions: the curves of all configurations of a redundant arm that reach one pose. Read `intervals` first.

The arm has one parameter more than the pose needs: a seventh joint, or an axis that the tool may turn about.

intervals              the entry point
slices, seven_joints   all configurations at given values of the parameter
graph, follow, gaps    joining them to curves: directly, by following a curve, and where it lies between two slices
arcs, limit_cuts       cutting the curves where the parameter turns back, and where joints pass their limits
census                 whether they are all that there is, counted in closed form
straight_wrist         where the outer axes of the wrist are one line, from equations of its own
nearest, sweep         the member nearest to a seed
members                a first look, at some values of the parameter alone
"""
