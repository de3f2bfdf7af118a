"""The distance of a configuration to a target, with its first and second derivatives, for many configurations at once.

The measure is |p| + w |a|: position error p [m], weight w [m/rad], rotation vector a of the orientation error [rad].
It has a kink where either vanishes, and its minima often lie there: the position exactly met, the orientation not, or
the other way round. With |x| = sqrt(x x + e e) the kinks are smooth but sharp, and Newton's method overshoots. So the
unit vectors u = p / |p| and v = a / |a| are kept as unknowns of their own, in which the equations u |p| = p are nearly
linear: the primal-dual Newton method of Chan, Golub and Mulet (A nonlinear primal-dual method for total
variation-based image restoration, SIAM J. Sci. Comput. 20(6), 1999). At a kink u and v are the multipliers.

Second derivatives, for joint i at or before joint j (axes z, linear velocities l of the tool, both at unit rate):

    of the position                 z_i x l_j
    of the rotation, composed       (z_i x z_j) / 2, from the product of exponentials
    of the angle, by a rotation     (1 - n n^T) cot(angle / 2) / 2
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.closest.chain import Chain, angle_and_axis, cross
from jacokin.ik.pose_error import RADIAN_IN_METRES
from jacokin.ik.targets import TargetPose

SMALL_ANGLE = 1e-4  # [rad] below it the series of x cot(x) is exact in double precision


class Points(NamedTuple):
    """The measure and its derivatives at k configurations."""

    q: Array
    """(k, dof) [rad]."""
    value: Array
    """(k,) the smoothed measure [m]."""
    gradient: Array
    """(k, dof)."""
    hessian: Array
    """(k, dof, dof)."""
    linear: Array
    """(k, dof, 3) and angular: velocities of the tool at unit rates."""
    angular: Array
    position: Array
    """(k, 3) p / |p|, and |p| (k,)."""
    distance: Array
    rotation: Array
    """(k, 3) a / |a|, and |a| (k,)."""
    angle: Array
    axis: Array
    """(k, 3) of the orientation error."""
    half_cotangent: Array
    """(k,) x cot(x) at half the angle."""

    def at(self, rows: NDArray[np.intp]) -> Self:
        """Some of the configurations."""
        return type(self)(*(column[rows] for column in self))

    def updated(self, rows: NDArray[np.bool_], other: Self) -> Self:
        """Those of another one in some rows."""
        return type(self)(
            *(np.where(rows.reshape(-1, *[1] * (old.ndim - 1)), new, old) for old, new in zip(self, other, strict=True))
        )


class Duals(NamedTuple):
    """The unit vectors u and v (k, 3); inside the unit ball at a kink."""

    position: Array
    rotation: Array


class Measure:
    """The measure of one chain and target."""

    def __init__(self, chain: Chain, target: TargetPose) -> None:
        """Take over the target; a free orientation weighs nothing."""
        self._chain = chain
        self._target = target
        self._weight = 0.0 if target.position_only else RADIAN_IN_METRES
        dof = np.arange(chain.dof)
        self._first = np.minimum(dof[:, None], dof), np.maximum(dof[:, None], dof)

    def exact(self, q: Array) -> Array:
        """(k,) without smoothing [m]."""
        placed = self._chain.placements(q)
        away = placed.position - self._target.position
        distance = np.sqrt(np.einsum("ki,ki->k", away, away))
        if not self._weight:
            return np.asarray(distance)
        return np.asarray(distance + self._weight * angle_and_axis(placed.rotation @ self._target.rotation.T)[0])

    def points(self, q: Array, smoothing: float, duals: Duals | None = None, *, convex: bool = False) -> Points:
        """The smoothed measure and its derivatives.

        Args:
            q: (k, dof).
            smoothing: e of the position [m]; that of the angle is as much in the measure.
            duals: u and v; None for those that belong to `q`.
            convex: leave out what makes the Hessian indefinite: a bound from above that is quadratic in the errors.
        """
        _, _, linear, angular = placed = self._chain.placements(q)
        away = placed.position - self._target.position
        distance = np.sqrt(np.einsum("ki,ki->k", away, away) + smoothing**2)
        towards = away / distance[:, None]
        angle, axis = angle_and_axis(placed.rotation @ self._target.rotation.T)
        smooth_angle = np.sqrt(angle**2 + (smoothing / RADIAN_IN_METRES) ** 2)
        turn = axis * (angle / smooth_angle)[:, None]
        half = 0.5 * angle
        half_cotangent = np.where(
            angle < SMALL_ANGLE, 1.0 - half * half / 3.0, half / np.tan(np.maximum(half, SMALL_ANGLE / 4.0))
        )
        u, v = (towards, turn) if duals is None else duals
        g_position, g_rotation = _along(linear, towards), _along(angular, turn)
        h_position = linear @ linear.transpose(0, 2, 1)
        h_rotation = angular @ angular.transpose(0, 2, 1)
        if convex:
            h_position = h_position / distance[:, None, None]
            h_rotation = h_rotation / smooth_angle[:, None, None]
        else:
            first, last = self._first
            h_position = (h_position - _symmetric(_along(linear, u), g_position)) / distance[:, None, None]
            h_position += (cross(u[:, None], angular) @ linear.transpose(0, 2, 1))[:, first, last]
            about = _along(angular, axis)
            about = about[:, :, None] * about[:, None]
            h_rotation = half_cotangent[:, None, None] * (h_rotation - about) + about
            h_rotation = (h_rotation - _symmetric(_along(angular, v), g_rotation)) / smooth_angle[:, None, None]
            h_rotation += 0.5 * (cross(v[:, None], angular) @ angular.transpose(0, 2, 1))[:, first, last]
        weight = self._weight
        return Points(
            q=q,
            value=distance + weight * smooth_angle,
            gradient=g_position + weight * g_rotation,
            hessian=h_position + weight * h_rotation,
            linear=linear,
            angular=angular,
            position=towards,
            distance=distance,
            rotation=turn,
            angle=smooth_angle,
            axis=axis,
            half_cotangent=half_cotangent,
        )


def duals_after(points: Points, duals: Duals, step: Array) -> Duals:
    """The unit vectors after a step (k, dof), by their linearised equations; kept in the unit ball."""
    moved = (step[:, None] @ points.linear)[:, 0]
    turned = (step[:, None] @ points.angular)[:, 0]
    about = np.einsum("ki,ki->k", points.axis, turned)[:, None] * points.axis
    bent = about + points.half_cotangent[:, None] * (turned - about)
    bent -= 0.5 * cross(points.rotation * points.angle[:, None], turned)
    return Duals(
        _dual(points.position, points.distance, duals.position, moved),
        _dual(points.rotation, points.angle, duals.rotation, bent),
    )


def _dual(unit: Array, length: Array, dual: Array, change: Array) -> Array:
    new = unit + (change - dual * np.einsum("ki,ki->k", unit, change)[:, None]) / length[:, None]
    return np.asarray(new / np.maximum(1.0, np.sqrt(np.einsum("ki,ki->k", new, new)))[:, None])


def _along(rows: Array, direction: Array) -> Array:
    """(k, dof) components of rows (k, dof, 3) along directions (k, 3)."""
    return np.asarray((rows @ direction[:, :, None])[:, :, 0])


def _symmetric(a: Array, b: Array) -> Array:
    """Symmetric parts of the outer products of (k, dof) and (k, dof)."""
    product = a[:, :, None] * b[:, None]
    return np.asarray(0.5 * (product + product.transpose(0, 2, 1)))
