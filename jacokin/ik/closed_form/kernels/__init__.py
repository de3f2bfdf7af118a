"""The numerics of the closed form, as plain functions that numba compiles. Read `pose` first.

The functions below `batch.solve_targets` allocate no arrays and copy them number by number: compiled, they then need
nothing but the C library.
"""
