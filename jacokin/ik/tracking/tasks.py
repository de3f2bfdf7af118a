"""Targets turned into least squares: how far off a frame is, and how the joints change that.

Each aim gives rows W and e so that the displacement x of the joints is asked to meet W x = e, weights included, and
measures its own error in metres and radians. Poses and orientations use mink's `FrameTask`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import mink
import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.ik import pose_error
from jacokin.ik.pose_error import RADIAN_IN_METRES
from jacokin.model import poses

Array = NDArray[np.float64]

FAR = 100.0  # [m] from the base; nothing beyond is within reach, and its error would drown all else in the QP


def _in_sight(position: Array) -> Array:
    """The position (3,) [m], or if it is farther than `FAR` from the base, the one at `FAR` on the way there."""
    largest: float = max(map(abs, position.tolist()))  # a third of what numpy takes, at every tick
    if largest <= FAR:
        return position
    direction = position / largest  # whose norm does not overflow
    return np.asarray(FAR * direction / np.linalg.norm(direction))


class Aim(ABC):
    """One target on one site of the MuJoCo twin."""

    def __init__(self, site: int, weight: float) -> None:
        """Remember the site's number and the weight."""
        self._site = site
        self._weight = weight

    @abstractmethod
    def wanted(self, configuration: mink.Configuration) -> Array:
        """Weighted displacement e (k,) that would reach the target."""

    @abstractmethod
    def rows(self, configuration: mink.Configuration) -> Array:
        """Weighted rows W (k, dof)."""

    @abstractmethod
    def measure(self, data: mujoco.MjData) -> tuple[float, float]:
        """Distance [m] and angle [rad] to the target."""

    def walls(self, configuration: mink.Configuration) -> tuple[Array, Array] | None:
        """Half-spaces G x <= h that keep what is reached, or None."""
        return None

    def _jacobian(self, configuration: mink.Configuration) -> tuple[Array, Array]:
        """Linear and angular rows (3, dof) each, in the axes of the base."""
        linear = np.empty((3, configuration.nv))
        angular = np.empty((3, configuration.nv))
        mujoco.mj_jacSite(configuration.model, configuration.data, linear, angular, self._site)
        return linear, angular


class PoseAim(Aim):
    """Position and orientation, or orientation alone."""

    def __init__(self, site: int, weight: float, name: str, *, orientation_only: bool = False) -> None:
        """Build mink's task, which wants the site's name."""
        super().__init__(site, weight)
        self._orientation_only = orientation_only
        linear = 0.0 if orientation_only else weight
        self._task = mink.FrameTask(name, "site", linear, weight * RADIAN_IN_METRES)
        self._cost = np.array([linear] * 3 + [weight * RADIAN_IN_METRES] * 3)
        self._pose = pin.SE3.Identity()
        self._position, self._rotation = self._pose.translation, self._pose.rotation

    def set(self, pose: pin.SE3) -> None:
        """Aim at T_base_frame."""
        self._position, self._rotation = pose.translation, pose.rotation
        self._task.set_target(mink.SE3(np.concatenate([poses.quat_wxyz(self._rotation), _in_sight(self._position)])))

    def wanted(self, configuration: mink.Configuration) -> Array:
        """Weighted SE(3) logarithm of the way to the target."""
        return np.asarray(-self._cost * self._task.compute_error(configuration))

    def rows(self, configuration: mink.Configuration) -> Array:
        """Weighted Jacobian of that logarithm."""
        return np.asarray(self._cost[:, None] * self._task.compute_jacobian(configuration))

    def measure(self, data: mujoco.MjData) -> tuple[float, float]:
        """Distance and angle."""
        rotation = data.site_xmat[self._site].reshape(3, 3)
        angle = pose_error.rotation_angle(rotation.T @ self._rotation)
        if self._orientation_only:
            return 0.0, angle
        return math.hypot(*(data.site_xpos[self._site] - self._position).tolist()), angle


class PositionAim(Aim):
    """Position alone."""

    def __init__(self, site: int, weight: float) -> None:
        """Start at the origin; `set` comes before use."""
        super().__init__(site, weight)
        self._position = self._sought = np.zeros(3)

    def set(self, position: Array) -> None:
        """Aim at a position (3,) [m]."""
        self._position, self._sought = position, _in_sight(position)

    def wanted(self, configuration: mink.Configuration) -> Array:
        """Weighted way to the position."""
        return np.asarray(self._weight * (self._sought - configuration.data.site_xpos[self._site]))

    def rows(self, configuration: mink.Configuration) -> Array:
        """Weighted linear Jacobian."""
        return self._weight * self._jacobian(configuration)[0]

    def measure(self, data: mujoco.MjData) -> tuple[float, float]:
        """Distance; the orientation is free."""
        return math.hypot(*(data.site_xpos[self._site] - self._position).tolist()), 0.0


class AxisAim(Aim):
    """One axis of the frame along a direction, by the shortest turn."""

    def __init__(self, site: int, weight: float) -> None:
        """Start with z up; `set` comes before use."""
        super().__init__(site, weight)
        self._axis = self._direction = np.array([0.0, 0.0, 1.0])

    def set(self, axis: Array, direction: Array) -> None:
        """Aim a unit axis (3,) of the frame along a unit direction (3,) of the base."""
        self._axis, self._direction = axis, direction

    def _now(self, data: mujoco.MjData) -> tuple[Array, Array, float]:
        """Where the axis points, the rotation vector to the direction, and its angle."""
        points = data.site_xmat[self._site].reshape(3, 3) @ self._axis
        turn = np.cross(points, self._direction)
        sine, cosine = float(np.linalg.norm(turn)), float(points @ self._direction)
        angle = math.atan2(sine, cosine)
        if sine < 1e-12:  # aligned, or opposite: any perpendicular axis does
            turn = np.cross(points, np.eye(3)[int(np.argmin(np.abs(points)))])
            sine = float(np.linalg.norm(turn))
        return points, turn * (angle / sine), angle

    def wanted(self, configuration: mink.Configuration) -> Array:
        """Weighted rotation vector of the shortest turn."""
        return self._weight * RADIAN_IN_METRES * self._now(configuration.data)[1]

    def rows(self, configuration: mink.Configuration) -> Array:
        """Weighted angular Jacobian without the rotation about the axis."""
        points = self._now(configuration.data)[0]
        angular = self._jacobian(configuration)[1]
        return self._weight * RADIAN_IN_METRES * (angular - np.outer(points, points @ angular))

    def measure(self, data: mujoco.MjData) -> tuple[float, float]:
        """Angle between axis and direction."""
        return 0.0, self._now(data)[2]


class RegionAim(Aim):
    """Position inside a box: pulled in from outside, kept in once inside."""

    def __init__(self, site: int, weight: float) -> None:
        """Start with all of space; `set` comes before use."""
        super().__init__(site, weight)
        self._lower, self._upper = np.full(3, -np.inf), np.full(3, np.inf)

    def set(self, lower: Array, upper: Array) -> None:
        """Aim at the box between two corners (3,) [m]."""
        self._lower, self._upper = lower, upper

    def _way(self, data: mujoco.MjData) -> Array:
        position = data.site_xpos[self._site]
        return np.asarray(np.clip(position, self._lower, self._upper) - position)

    def wanted(self, configuration: mink.Configuration) -> Array:
        """Weighted way to the nearest point of the box."""
        return self._weight * self._way(configuration.data)

    def rows(self, configuration: mink.Configuration) -> Array:
        """Weighted linear Jacobian along the axes of the base in which the frame is outside."""
        outside = (self._way(configuration.data) != 0.0).astype(np.float64)
        return np.asarray(self._weight * outside[:, None] * self._jacobian(configuration)[0])

    def walls(self, configuration: mink.Configuration) -> tuple[Array, Array] | None:
        """Faces of the box the frame must not pass, along the axes in which it is inside."""
        position = configuration.data.site_xpos[self._site]
        linear = self._jacobian(configuration)[0]
        normals = np.vstack([linear, -linear])
        gaps = np.concatenate([self._upper - position, position - self._lower])
        use = (gaps >= 0.0) & np.isfinite(gaps)
        return (normals[use], gaps[use]) if use.any() else None

    def measure(self, data: mujoco.MjData) -> tuple[float, float]:
        """Distance to the box."""
        return float(np.linalg.norm(self._way(data))), 0.0
