"""`solver_file`: a solver as the file that the C library reads, see ``jacokin/include/jacokin_ik.h``.

The layout stands in ``jacokin/kernels/c/solver.c``, beside the function that reads it.
"""

from __future__ import annotations

import struct

import numpy as np

from jacokin.errors import InvalidInputError
from jacokin.ik.geometry import measure_seven
from jacokin.ik.solver import IKSolver

MAGIC = b"jacokin\0"
VERSION = 1
#: What the file is called: the robot's name and this.
ENDING = ".jacokin"


def solver_file(solver: IKSolver) -> bytes:
    """The numbers of a solver's robot, frame, tool, limits and tolerances.

    Raises:
        InvalidInputError: the solver looks for contact, or solves by the QP only, which the C library does not do.
        StructureError: the robot has no closed form.
    """
    robot, verifier = solver.robot, solver.verifier
    options = verifier.options
    if verifier.looks_for_contact:
        raise InvalidInputError("the C library does not look for contact; use collision='ignore'")
    if solver.method == "qp":
        raise InvalidInputError("the C library solves by the closed form only; use method='auto'")
    if solver.has_families:
        geometry = measure_seven(robot.pin_model, verifier.frame_id, verifier.tool)
        chain, constants = geometry.chain, geometry.arm
    else:
        chain, constants, _ = solver.closed_form().constants
    tolerances = [options.limit_snap, options.position_tolerance, options.orientation_tolerance]
    numbers = np.concatenate([chain.ravel(), constants, robot.lower, robot.upper, robot.home, tolerances])
    names = [robot.name, robot.base, solver.frame, *robot.joint_names]
    text = b"".join(name.encode() + b"\0" for name in names)
    head = MAGIC + struct.pack("<3I", VERSION, robot.dof, len(text))
    contents = head + numbers.astype("<f8").tobytes() + text
    return contents + struct.pack("<Q", check_sum(contents))


def check_sum(contents: bytes) -> int:
    """FNV-1a, 64 bits."""
    value = 14695981039346656037
    for byte in contents:
        value = (value ^ byte) * 1099511628211 & 0xFFFFFFFFFFFFFFFF
    return value
