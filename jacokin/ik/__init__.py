"""Inverse kinematics: how the arm reaches a pose. Everything public is imported from here; read `solver` first.

solver, options          poses to joint angles; the solver's options, and every tolerance with its reason
targets, seeds           what is asked for, and where solving starts
closed_form, geometry    every branch of a six-joint Jaco; whether an arm is built like one
structures               how an arm's axes are placed; what any other arm of six joints is solved with
forms                    what all solvers of one robot, frame and tool share
fixed_joints             arms of more than six joints, all but six held: every branch
few_joints               arms of three to five turning joints: every point of a target
virtual_joints           freedoms of a target as joints, so that those arms are chains of six
solutions                `SolutionSet`: everything that reaches a target, points or curves
turned                   seven joints at a pose that may turn about an axis: one configuration
local_search             descents from many starts, for what the closed form does not cover, and for positions
qp, qp_backend           descents by mink's quadratic programs, and the solvers of those
closest                  the closest configuration to a pose that cannot be reached
near_misses              configurations within the tolerances of a target that none meets exactly
preferences              `prefer=`: which of several configurations is the best
verification, diagnosis  the check behind every success; the status of everything else
results                  statuses and results
gradients                how the joints of an answer follow a target that moves
differentiable           a solver for automatic differentiation, `jacokin.torch` and `jacokin.jax`
files                    files of target poses and of answers
batches                  many targets, and files of any length, through any executor
c_library                a solver for C programs
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__)
