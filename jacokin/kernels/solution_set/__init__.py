"""Sets of solutions with one parameter: the curves of a chain of seven joints at a pose. Read `trace` first.

curve    steps along one curve, and points between its nodes
trace    all curves through given solutions, each followed until it closes
within   what of them is within the limits
run      the entry points
"""
