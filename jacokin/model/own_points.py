"""`without_own_points`: of the points that a camera sees, those that are not on the arm itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.kernels.contact.near_points import find_near_points, make_near_work
from jacokin.kernels.contact.run import MARGIN_KEPT
from jacokin.kernels.library import Call
from jacokin.model import checks
from jacokin.model.obstacles import NOTHING_AROUND, checked_surroundings
from jacokin.model.point_cloud import PointCloud, checked_points
from jacokin.model.robot import Robot, SceneLike
from jacokin.model.surrounded import surround


def without_own_points(robot: Robot, q: ArrayLike, points: ArrayLike, margin: float, scene: SceneLike | None) -> Array:
    """The points that are farther from the arm than a margin; arguments and errors as of `Robot.without_own_points`."""
    q = robot.configuration(q)
    rows = np.ascontiguousarray(checked_points("points", points))
    margin = checks.non_negative("margin", margin, "m")
    around = NOTHING_AROUND if scene is None else checked_surroundings("scene", scene)
    measured_to = PointCloud("a point", np.zeros((1, 3)), 0.0)
    found = surround(robot, around._replace(obstacles=(measured_to,), allow=()))
    if found.arm_shapes == 0:
        raise ModelError(
            f"{robot.name}: the description has no collision shapes, so no point can be told to be its own"
        )
    call = Call(find_near_points, make_near_work(found.geometry, rows))
    call.work.contact.q[:] = q
    call.work.contact.numbers[MARGIN_KEPT] = margin
    call()
    return np.asarray(rows[call.work.near == 0])
