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
from jacokin.model import checks, poses
from jacokin.model.poses import rotation_angle
from jacokin.motion.timing import Profile

WHOLE_TICK = 1e-9  # a duration this near to whole ticks is whole; division rounds
MAX_TICKS = 10_000_000  # more than a day at 100 Hz: a speed or a step was mistyped


@dataclass(frozen=True, slots=True, eq=False)
class SampledPath:
    """Poses at the control rate.

    Attributes:
        poses: T_base_tool for every tick, the first one at t = 0.
        segment: (n,) which straight line each belongs to; the start belongs to the first.
        part: (n,) how far along its line each is, 0 to 1.
    """

    poses: list[pin.SE3]
    segment: NDArray[np.intp]
    part: Array


def checked_waypoints(waypoints: Sequence[pin.SE3] | ArrayLike) -> list[pin.SE3]:
    """Two or more poses.

    Raises:
        InvalidInputError: fewer than two, or one is malformed (its number is named), or all are the same.
    """
    try:
        rows = list(waypoints)  # type: ignore[arg-type]  # whatever cannot be listed is refused below
    except TypeError as error:
        raise InvalidInputError(f"waypoints must be a sequence of poses, got {checks.shown(waypoints)}") from error
    if len(rows) < 2:
        raise InvalidInputError(f"a path needs at least two waypoints, got {len(rows)}")
    found = [poses.checked_pose(row, f"waypoints[{index}]") for index, row in enumerate(rows)]
    if all(_length(start, end) == (0.0, 0.0) for start, end in itertools.pairwise(found)):
        raise InvalidInputError("all waypoints are the same pose")
    return found


def durations(waypoints: list[pin.SE3], speed: ArrayLike, angular_speed: ArrayLike) -> Array:
    """How long each line takes at constant speed (n - 1,) [s]: the longer of position and orientation.

    Args:
        waypoints: at least two checked poses.
        speed: of the position [m/s], one for all lines or one for each.
        angular_speed: of the orientation [rad/s], as `speed`.

    Raises:
        InvalidInputError: a speed is not positive, or there is one too many or too few.
    """
    lengths = np.array([_length(start, end) for start, end in itertools.pairwise(waypoints)])
    return durations_of(lengths, speed, angular_speed)


def durations_of(lengths: Array, speed: ArrayLike, angular_speed: ArrayLike) -> Array:
    """As `durations`, for lines of known length and angle (n - 1, 2) [m] and [rad]."""
    count = len(lengths)
    linear = checks.positive_vector("speed", speed, count, "m/s")
    angular = checks.positive_vector("angular_speed", angular_speed, count, "rad/s")
    with np.errstate(over="ignore"):  # an infinite duration is refused when it is counted in ticks
        return np.maximum(lengths[:, 0] / linear, lengths[:, 1] / angular)


def sample(waypoints: list[pin.SE3], profiles: Sequence[Profile], dt: float) -> SampledPath:
    """The straight lines through the waypoints.

    Args:
        waypoints: at least two checked poses.
        profiles: how each line is run through in time; each takes whole ticks, rounded up, and is slowed down to that.
        dt: control step [s].

    Raises:
        InvalidInputError: the path takes more than ten million ticks, or less than one.
    """
    check_ticks(np.array([profile.duration for profile in profiles]), dt)
    found, segments, parts = [waypoints[0]], [np.zeros(1, dtype=np.intp)], [np.zeros(1)]
    for index, ((start, end), profile) in enumerate(zip(itertools.pairwise(waypoints), profiles, strict=True)):
        if profile.duration == 0.0:
            continue
        ticks = max(1, int(np.ceil(profile.duration / dt - WHOLE_TICK)))
        part = profile.parts(np.arange(1, ticks + 1) / ticks)
        found.extend(_on_line(start, end, part))
        segments.append(np.full(ticks, index, dtype=np.intp))
        parts.append(part)
    segment = np.concatenate(segments)
    segment.setflags(write=False)
    return SampledPath(found, segment, np.concatenate(parts))


def check_ticks(durations: Array, dt: float) -> None:
    """Refuse a path that takes too many ticks of `dt` [s], or none; durations of its lines (n - 1,) [s].

    Raises:
        InvalidInputError: names the longest segment.
    """
    total = float(durations.sum())
    if not total / dt <= MAX_TICKS:
        raise InvalidInputError(
            f"the path takes {total:.6g} s, most of it segment {int(np.argmax(durations))}: more than {MAX_TICKS} "
            f"ticks of {dt:.6g} s"
        )
    if total < dt * (1.0 - WHOLE_TICK):
        raise InvalidInputError(f"the path takes {total:.6g} s, less than one control step of {dt:.6g} s")


def _length(start: pin.SE3, end: pin.SE3) -> tuple[float, float]:
    """Distance [m] and angle [rad] between two poses."""
    return (
        float(np.linalg.norm(end.translation - start.translation)),
        rotation_angle(start.rotation.T @ end.rotation),
    )


def _on_line(start: pin.SE3, end: pin.SE3, parts: Array) -> list[pin.SE3]:
    """Poses at parts (n,) of the line, 0 at its start and 1 at its end."""
    between = Slerp([0.0, 1.0], Rotation.from_matrix(np.stack([start.rotation, end.rotation])))
    positions = start.translation + parts[:, None] * (end.translation - start.translation)
    rotations = between(parts).as_matrix()
    return [pin.SE3(rotation, position) for rotation, position in zip(rotations, positions, strict=True)]
