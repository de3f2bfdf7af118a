"""Straight lines between poses, sampled at the control rate.

Between two waypoints the position moves on a straight line and the orientation turns about one fixed axis by the short
way, both in proportion; the screw motion of SE(3) would bend the line.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation, Slerp

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.pose_error import rotation_angle
from jacokin.model import checks, poses

WHOLE_TICK = 1e-9  # a duration this near to whole ticks is whole; division rounds
MAX_TICKS = 10_000_000  # more than a day at 100 Hz: a speed or a step was mistyped


@dataclass(frozen=True, slots=True, eq=False)
class SampledPath:
    """Poses at the control rate.

    Attributes:
        poses: T_base_tool for every tick, the first one at t = 0.
        segment: (n,) which straight line each belongs to; the start belongs to the first.
    """

    poses: list[pin.SE3]
    segment: NDArray[np.intp]


def checked_waypoints(waypoints: Sequence[pin.SE3] | ArrayLike) -> list[pin.SE3]:
    """Two or more poses.

    Raises:
        InvalidInputError: fewer than two, or one is malformed; its number is named.
    """
    try:
        rows = list(waypoints)  # type: ignore[arg-type]  # whatever cannot be listed is refused below
    except TypeError as error:
        raise InvalidInputError(f"waypoints must be a sequence of poses, got {waypoints!r}") from error
    if len(rows) < 2:
        raise InvalidInputError(f"a path needs at least two waypoints, got {len(rows)}")
    return [poses.checked_pose(row, f"waypoints[{index}]") for index, row in enumerate(rows)]


def sample(waypoints: list[pin.SE3], speed: ArrayLike, angular_speed: ArrayLike, dt: float) -> SampledPath:
    """The straight lines through the waypoints, each at its own constant speed.

    Args:
        waypoints: at least two checked poses.
        speed: of the position [m/s], one for all segments or one for each.
        angular_speed: of the orientation [rad/s], as `speed`; a segment takes the longer of the two durations.
        dt: control step [s]; each segment takes whole ticks, so its speed is rounded down a little.

    Raises:
        InvalidInputError: a speed is not positive or there is one too many or too few, all waypoints are equal, or
            the path takes more than ten million ticks.
    """
    count = len(waypoints) - 1
    linear = checks.positive_vector("speed", speed, count, "m/s")
    angular = checks.positive_vector("angular_speed", angular_speed, count, "rad/s")
    found, segments = [waypoints[0]], [0]
    for index, (start, end) in enumerate(itertools.pairwise(waypoints)):
        way = end.translation - start.translation
        relative = start.rotation.T @ end.rotation
        duration = max(np.linalg.norm(way) / linear[index], rotation_angle(relative) / angular[index])
        ticks = int(np.ceil(min(duration / dt, 2.0 * MAX_TICKS) - WHOLE_TICK))
        if len(found) + ticks > MAX_TICKS:
            raise InvalidInputError(
                f"segment {index} takes {duration:.6g} s: more than {MAX_TICKS} ticks of {dt:.6g} s"
            )
        parts = np.arange(1, ticks + 1) / ticks
        found.extend(_on_line(start, end, parts))
        segments.extend([index] * ticks)
    if len(found) == 1:
        raise InvalidInputError("all waypoints are the same pose")
    return SampledPath(found, np.array(segments, dtype=np.intp))


def _on_line(start: pin.SE3, end: pin.SE3, parts: Array) -> list[pin.SE3]:
    """Poses at parts (n,) of the line, 0 at its start and 1 at its end."""
    between = Slerp([0.0, 1.0], Rotation.from_matrix(np.stack([start.rotation, end.rotation])))
    positions = start.translation + parts[:, None] * (end.translation - start.translation)
    rotations = between(parts).as_matrix()
    return [pin.SE3(rotation, position) for rotation, position in zip(rotations, positions, strict=True)]
