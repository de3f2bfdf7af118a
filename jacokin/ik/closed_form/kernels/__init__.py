"""The numerics of the closed form, as plain functions that numba compiles. Read `pose` first."""
