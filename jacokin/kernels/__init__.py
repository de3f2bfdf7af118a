"""Kernels: plain functions on arrays, compiled to machine code. They take numbers and arrays, no robot and no file.

closed_form    every branch of a six-joint Jaco at a pose; read `closed_form/pose` first
self_motion    self-motions: all configurations with one free parameter; read `self_motion/intervals` first
compiled       from Python to machine code, kept on disk
vector, chain, limits, tolerances    what both have in common
"""
