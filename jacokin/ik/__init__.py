"""Inverse kinematics: how the arm reaches a pose. Everything public is imported from here; read `solver` first.

solver              poses to joint angles
closed_form         every branch of a six-joint Jaco
families            self-motions: all configurations where one parameter is free
qp                  quadratic programs, for what the closed form does not cover
closest             the closest configuration to a pose that cannot be reached
files               files of target poses and of answers
batches             many targets, and files of any length, through any executor
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__, __file__)
