"""Observables of the Jaco arm and of its hand."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks
from jacokin.model.angles import nearest_copy, wrap_to_turn
from jacokin.mujoco_bridge.observables.observable import Bound, JointsObservables, MJCFFeature, Observable, observable
from jacokin.mujoco_bridge.simulation.physics import Physics


class JacoArmObservables(JointsObservables):
    """Joint positions as (sin, cos), joint velocities, joint torques."""

    @observable
    def joints_pos(self) -> Observable:
        """Joint angles as pairs (sin, cos), (n, 2): bounded, though most joints have no limits.

        ``angles_from_sin_cos`` converts them to angles.
        """
        joints = Bound(self._entity.joints)

        def read(physics: Physics) -> NDArray[np.float64]:
            return sin_cos(joints(physics).qpos)

        return Observable(read)

    @observable
    def joints_torque(self) -> Observable:
        """Torques about the joint axes, (n,) [N m].

        Each 3-axis sensor projected on the axis of its joint. The sensor measures what the child body exerts on its
        parent, so an external torque on the child has the opposite sign here.
        """
        sensors = Bound(self._entity.joint_torque_sensors)
        joints = Bound(self._entity.joints)

        def read(physics: Physics) -> NDArray[np.float64]:
            torques: NDArray[np.float64] = np.vecdot(sensors(physics).sensordata, joints(physics).axis)
            return torques

        return Observable(read)


class TwoFingerHandObservables(JointsObservables):
    """Finger positions and velocities, pose of the grip site: the hand with two fingers has no pinch site."""

    @observable
    def grip_site_pos(self) -> Observable:
        """Position of the grip site in the world, (3,) [m]."""
        return MJCFFeature("xpos", self._entity.grip_site)

    @observable
    def grip_site_rmat(self) -> Observable:
        """Rotation matrix R_world_gripsite in row-major order, (9,)."""
        return MJCFFeature("xmat", self._entity.grip_site)


class JacoHandObservables(JointsObservables):
    """Finger positions and velocities, pose of the pinch site."""

    @observable
    def pinch_site_pos(self) -> Observable:
        """Position of the pinch site in the world, (3,) [m]."""
        return MJCFFeature("xpos", self._entity.pinch_site)

    @observable
    def pinch_site_rmat(self) -> Observable:
        """Rotation matrix R_world_pinchsite in row-major order, (9,)."""
        return MJCFFeature("xmat", self._entity.pinch_site)


def sin_cos(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pairs (sin, cos) of angles (...) [rad], (..., 2); `angles_from_sin_cos` undoes it."""
    pairs = np.empty((*angles.shape, 2))
    np.sin(angles, out=pairs[..., 0])
    np.cos(angles, out=pairs[..., 1])
    return pairs


def angles_from_sin_cos(sin_cos: ArrayLike, near: ArrayLike | None = None) -> NDArray[np.float64]:
    """Return the joint angles of (sin, cos) pairs.

    A pair determines an angle up to full turns. The angle in [0, 2 pi) is returned, where the ranges of joints 2 and
    3 lie, and to which ``set_site_to_xpos`` wraps the joints without limits.

    Args:
        sin_cos: pairs (..., 2), sine first; pairs of another norm than 1 are allowed.
        near: angles (...) [rad]; each result is the one nearest to its own of these, up to full turns.

    Returns:
        Angles (...) [rad].

    Raises:
        InvalidInputError: a wrong shape, a value that is not finite, or a pair (0, 0), as in a buffer padded with
            zeros.
    """
    try:
        pairs = checks.numbers(sin_cos)
        reference = None if near is None else checks.numbers(near)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"sin_cos and near must be numbers: {error}") from None
    if pairs.ndim < 1 or pairs.shape[-1] != 2:
        raise InvalidInputError(f"sin_cos must have the shape (..., 2), got {pairs.shape}")
    if not np.isfinite(pairs).all():
        raise InvalidInputError("sin_cos must be finite")
    if not pairs.any(axis=-1).all():
        raise InvalidInputError("sin_cos contains a pair (0, 0), which has no angle")
    angles = np.arctan2(pairs[..., 0], pairs[..., 1])
    if reference is None:
        return wrap_to_turn(angles)
    if not np.isfinite(reference).all() or reference.shape != angles.shape:
        raise InvalidInputError(f"near must be finite angles of the shape {angles.shape}, got {shown(reference)}")
    return np.asarray(nearest_copy(angles, reference))
