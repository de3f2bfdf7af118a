"""Solution curves: all configurations of a chain with one joint more than a pose needs. Read `curve_family` first.

The chain is the seven-joint arm, or a six-joint arm whose tool may turn about one axis: that axis is joint 7 then. One
of the seven joints is the parameter. Plain functions that numba compiles, as in `kernels`.
"""
