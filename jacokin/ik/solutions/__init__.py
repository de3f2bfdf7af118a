"""Sets of solutions: everything that reaches a target, as points or as curves along which one parameter is free.

Read `solution_set` first.

solution_set     the answer: what points and curves have in common; what is along one curve, from start to stop of
                 the parameter
points           configurations where no parameter is free
curve_set        intervals of the parameter on each branch
picture          a set drawn
search           from a target to its curves, and to the member that is wanted
curve_arm        the arm as the kernels of `kernels.solution_set` see it, and their calls
members, least   what an interval runs along and its members, each verified, and the one of the least cost
"""
