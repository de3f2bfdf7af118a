"""Poses where derivatives exist, and where they do not; what the tests of PyTorch and JAX share."""

from __future__ import annotations

import numpy as np

import jacokin
from jacokin import IKSolver, Robot
from jacokin.arrays import Array


def solver_with_tool(robot: Robot) -> IKSolver:
    """Of an arm that carries a turned tool."""
    return IKSolver(robot, tool=jacokin.pose([0.05, 0.03, 0.1], rpy=[0.2, -0.4, 0.7]), collision="ignore")


def reached_singular_and_out_of_reach(robot: Robot) -> tuple[Array, Array]:
    """Three configurations of an arm with a spherical wrist, the second one singular, and poses, the third too far."""
    straight = robot.home.copy()
    straight[4] = np.pi
    seeds = np.array([robot.home, straight, robot.home])
    poses = np.array([robot.forward_kinematics(q).homogeneous for q in seeds])
    poses[2, :3, 3] += 5.0
    return seeds, poses


def regular(solver: IKSolver, rng: np.random.Generator, size: int) -> tuple[Array, Array]:
    """Configurations (size, dof) that are not singular, and the poses (size, 4, 4) there."""
    rows = list[Array]()
    while len(rows) < size:
        q = solver.robot.sample(rng)
        if solver.robot.singular_values(q).min() > 0.05:
            rows.append(q)
    return np.array(rows), np.array([solver.verifier.tool_pose(q).homogeneous for q in rows])
