"""Kernels: plain functions on arrays, compiled to machine code. Read `closed_form/pose` first.

They take numbers and arrays, no robot and no file.

closed_form                          every branch of a six-joint Jaco at a pose
self_motion                          self-motions: all configurations with one free parameter
compiled                             from Python to machine code, kept on disk
vector, chain, limits, tolerances    what both have in common
"""
