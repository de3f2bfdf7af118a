"""`identify_payload`: what an arm carries and how its joints rub, from a log of its motion and torques."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks, dynamics
from jacokin.model.robot import Robot, checked_robot

BODY = 10  # parameters of a body: mass, mass times centre of mass (3), inertia about the frame (6)
IDENTIFIED = 1e-6  # of the largest singular value, columns scaled to one: below, rounding decides
SMALL_MASS, SIZE = 1e-3, 0.1  # [kg], [m] of a body to start from
LARGEST = 1e100  # squares of what a log makes of its numbers must fit into floating-point numbers


@dataclass(frozen=True, slots=True, eq=False)
class PayloadEstimate:
    """A body and friction that explain a log; sigmas are standard deviations, arrays read-only."""

    mass: float
    """[kg]."""
    com: Array
    """(3,) centre of mass in the frame [m]."""
    inertia: Array
    """(3, 3) about the centre of mass, in the frame's axes [kg m^2]; one that a body can have."""
    mass_sigma: float
    """[kg]."""
    com_sigma: Array
    """(3,) [m]."""
    viscous: Array
    """(dof,) viscous friction [N m s/rad]."""
    coulomb: Array
    """(dof,) dry friction [N m]."""
    viscous_sigma: Array
    """(dof,) [N m s/rad]."""
    coulomb_sigma: Array
    """(dof,) [N m]."""
    unidentified: int
    """Number of combinations of parameters that the log says nothing about; sigmas leave them out."""
    projected: bool
    """Whether the best parameters were those of no body, and the nearest possible ones were taken."""
    residual: float
    """Root mean square of the torques left unexplained [N m]."""


def identify_payload(
    robot: Robot, q: ArrayLike, v: ArrayLike, a: ArrayLike, torque: ArrayLike, *, frame: str | None = None
) -> PayloadEstimate:
    """Fit a body at a frame, and viscous and dry friction of every joint, to a log by least squares.

    Errors of the torques are taken as independent and equally large: sigmas do not know of a model that is wrong.
    Noise in `a` makes inertias too small: smooth velocities, and torques in the same way, before differentiating.
    Sigmas are those of the fit before it is made possible (`projected`).

    Args:
        robot: the arm without the body.
        q: (n, dof) joint angles [rad].
        v: (n, dof) joint velocities [rad/s].
        a: (n, dof) joint accelerations [rad/s^2].
        torque: (n, dof) torques of the motors [N m], friction included.
        frame: what carries the body; None for the default frame.

    Raises:
        InvalidInputError: malformed, too large, of different lengths, too short, or a frame that does not move.
        UnknownNameError: no such frame.
    """
    checked_robot("robot", robot)
    carried = robot.pin_model.frames[robot.frame_id(frame)]
    log = [
        checks.matrix("q", q, robot.dof, "rad"),
        checks.matrix("v", v, robot.dof, "rad/s"),
        checks.matrix("a", a, robot.dof, "rad/s^2"),
        checks.matrix("torque", torque, robot.dof, "N m"),
    ]
    lengths = {len(rows) for rows in log}
    if len(lengths) > 1:
        raise InvalidInputError(f"q, v, a and torque must have the same length, got {[len(rows) for rows in log]}")
    if carried.parentJoint == 0:
        raise InvalidInputError(f"frame {carried.name!r} does not move: the log says nothing about a body there")
    columns = BODY + 2 * robot.dof
    if lengths.pop() * robot.dof <= columns:
        raise InvalidInputError(f"the log is too short: it has no more numbers than the {columns} parameters")

    system, right = _regressor(robot, carried.parentJoint, *log)
    if not max(np.abs(system).max(), np.abs(right).max()) < LARGEST:
        raise InvalidInputError(dynamics.TOO_LARGE)
    found, covariance, unidentified, residual = _least_squares(system, right)
    projected = not _possible(found[:BODY])
    if projected:
        found = _nearest_possible(system, right, found)
    body = pin.Inertia.FromDynamicParameters(found[:BODY])
    held = carried.placement.actInv(body)
    # The centre of mass is the first moment over the mass.
    slope = np.hstack((-np.reshape(body.lever, (3, 1)), np.eye(3))) / body.mass
    com_covariance = carried.placement.rotation.T @ slope @ covariance[:4, :4] @ slope.T @ carried.placement.rotation
    sigma = np.sqrt(covariance.diagonal())
    viscous, coulomb = slice(BODY, BODY + robot.dof), slice(BODY + robot.dof, None)
    return PayloadEstimate(
        mass=float(held.mass),
        com=checks.read_only(held.lever),
        inertia=checks.read_only(held.inertia),
        mass_sigma=float(sigma[0]),
        com_sigma=checks.read_only(np.sqrt(com_covariance.diagonal())),
        viscous=checks.read_only(found[viscous]),
        coulomb=checks.read_only(found[coulomb]),
        viscous_sigma=checks.read_only(sigma[viscous]),
        coulomb_sigma=checks.read_only(sigma[coulomb]),
        unidentified=unidentified,
        projected=projected,
        residual=residual,
    )


def _regressor(robot: Robot, joint: int, q: Array, v: Array, a: Array, torque: Array) -> tuple[Array, Array]:
    """Matrix and right side of what the arm alone does not explain: body in the joint's frame, then friction."""
    model, data, n = robot.pin_model, robot.pin_model.createData(), robot.dof
    system, right = np.zeros((len(q), n, BODY + 2 * n)), np.empty((len(q), n))
    body = slice(BODY * (joint - 1), BODY * joint)
    for row, (at, velocity, acceleration) in enumerate(zip(q, v, a, strict=True)):
        right[row] = torque[row] - pin.rnea(model, data, at, velocity, acceleration)
        full = np.asarray(pin.computeJointTorqueRegressor(model, data, at, velocity, acceleration)).reshape(n, -1)
        system[row, :, :BODY] = full[:, body]
        system[row, :, BODY : BODY + n] = np.diag(velocity)
        system[row, :, BODY + n :] = np.diag(np.sign(velocity))
    return system.reshape(-1, BODY + 2 * n), right.ravel()


def _least_squares(system: Array, right: Array) -> tuple[Array, Array, int, float]:
    """Parameters, covariance, number of unidentified combinations, root mean square of the residual."""
    scale = np.linalg.norm(system, axis=0)
    scale[scale == 0.0] = 1.0
    left, values, axes = np.linalg.svd(system / scale, full_matrices=False)
    known = int(np.sum(values > IDENTIFIED * values[0]))
    gain = (axes[:known].T / values[:known]) / scale[:, np.newaxis]
    found = gain @ (left[:, :known].T @ right)
    left_over = float(np.sum((right - system @ found) ** 2))
    variance = left_over / (len(right) - known)
    return found, variance * gain @ gain.T, len(values) - known, float(np.sqrt(left_over / len(right)))


def _possible(body: Array) -> bool:
    """Whether a body can have these parameters: its pseudo-inertia is positive definite."""
    mass, moment = body[0], body[1:4]
    xx, xy, yy, xz, yz, zz = body[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    pseudo = np.empty((4, 4))
    pseudo[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    pseudo[:3, 3] = pseudo[3, :3] = moment
    pseudo[3, 3] = mass
    return bool(np.linalg.eigvalsh(pseudo)[0] > 0.0)


def _nearest_possible(system: Array, right: Array, found: Array) -> Array:
    """The parameters of a body that explain the log best, friction included.

    Every vector of log-Cholesky parameters is that of a body (Rucker and Wensing, Smooth parameterization of
    rigid-body inertia, RA-L 7(2), 2022).
    """
    orthogonal, small = np.linalg.qr(system)
    target = orthogonal.T @ right

    def missed(x: Array) -> Array:
        body = pin.LogCholeskyParameters(x[:BODY]).toDynamicParameters()
        return np.asarray(small @ np.concatenate((body, x[BODY:])) - target)

    start = np.concatenate(
        ([0.5 * np.log(max(found[0], SMALL_MASS))], np.full(3, np.log(SIZE)), np.zeros(6), found[BODY:])
    )
    with np.errstate(over="ignore", invalid="ignore"):  # of steps that are tried and not taken
        x = least_squares(missed, start, x_scale="jac").x
    return np.concatenate((pin.LogCholeskyParameters(x[:BODY]).toDynamicParameters(), x[BODY:]))
