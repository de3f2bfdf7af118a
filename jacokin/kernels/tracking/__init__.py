"""Ticks of the tracker. Read `run` first.

run       a whole tick, from where the arm is to where it is after it
tick      from where the arm is to a displacement of its joints
tasks     where frames are, what is missing to their targets, its Jacobian, and how that turns
problem   the squared error of all targets to second order, and its least value
limits    how far each joint may go: position, velocity and acceleration
near      what near shapes add: inequalities that keep them apart, and which of them are too near
watch     which pairs of shapes a displacement could bring near
rest      a step after which the arm comes to rest clear of what is near
aside     the least change of a step that keeps inequalities of where it leads
twist     how much of a twist the joints can follow
inverse   the damped inverse of a tool's Jacobian
reach     how much of a displacement keeps shapes apart, and whether the arm comes to rest from there
"""
