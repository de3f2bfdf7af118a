"""`derive_bound`: how far the tool can be from a sample that is reached, between grid points and orientations.

The arm has its tool somewhere, its wrist (where the last two axes meet) at a distance L from it. Turning the tool about
the wrist to the nearest orientation of the set, which is within the covering angle a of the set, moves it by no more
than 2 L sin(a / 2). From there, where the positions reached with this orientation leave room for a circle of radius h
that touches the tool, the circle holds a position of the grid if h is half the diagonal of a cell, and that is at most
2 h away. Together: 2 h + 2 L sin(a / 2).

That supposes that the wrist can turn, and that there is room; both fail at corners of the workspace of some arms, where
tests with random configurations find that the bound holds with a wide margin.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from jacokin.arrays import Array
from jacokin.ik.solver import IKSolver
from jacokin.model.many_configurations import Chain
from jacokin.reachability.orientations import Orientations
from jacokin.reachability.samples import Samples

PARALLEL = 1e-9  # sine of an angle between axes that do not meet


def derive_bound(samples: Samples, solver: IKSolver) -> float | None:
    """The bound [m]; None where the orientations are some that were chosen and not spread over all."""
    angle = covering_angle(samples.orientations, samples.symmetries.tool_axis)
    if angle is None:
        return None
    half = 0.5 * samples.grid.spacing * math.sqrt(len(samples.shape))
    return 2.0 * half + 2.0 * lever(solver) * math.sin(0.5 * angle)


def covering_angle(orientations: Orientations, tool_axis: Array | None) -> float | None:
    """The largest angle [rad] from any orientation to the nearest one of the set; None if half a turn is not covered.

    Exact: the directions farthest from points on a sphere are the normals of the faces of their convex hull. Rotations
    are points on the sphere of unit quaternions, two for each, at half their angles.

    Args:
        orientations: the set.
        tool_axis: (3,) where only the direction of this axis counts; None where all of the rotation does.
    """
    if orientations.axes is not None:
        return None
    if tool_axis is not None:
        points = orientations.rotations @ tool_axis
    else:
        quats = orientations.quats_wxyz / np.linalg.norm(orientations.quats_wxyz, axis=1, keepdims=True)
        points = np.concatenate([quats, -quats])
    try:
        nearest = -ConvexHull(points).equations[:, -1].max()
    except (QhullError, ValueError):  # too few, or all in one plane
        return None
    if nearest <= 0.0:
        return None
    return (1.0 if tool_axis is not None else 2.0) * math.acos(min(1.0, nearest))


def lever(solver: IKSolver) -> float:
    """Distance [m] from the tool to where the last two axes meet, or come nearest to each other."""
    robot = solver.robot
    chain = Chain(robot, robot.frame_id(solver.frame), solver.tool)
    tool, _, linear, angular = (column[0] for column in chain.placements(robot.home[None]))
    axes = angular[-2:]
    points = tool + np.cross(axes, linear[-2:])  # nearest to the tool on each axis
    across = np.cross(axes[0], axes[1])
    if np.linalg.norm(across) < PARALLEL:
        return float(np.linalg.norm(np.cross(axes[1], tool - points[1])))
    along = float(np.cross(points[0] - points[1], axes[0]) @ np.cross(axes[1], axes[0])) / float(across @ across)
    return float(np.linalg.norm(tool - (points[1] + along * axes[1])))
