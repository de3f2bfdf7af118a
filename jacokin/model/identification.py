"""What an arm carries (`identify_payload`) or weighs itself (`identify_arm`), and its friction, from logs of torques.

Torques are linear in the parameters of the bodies: mass, first moment and inertia, ten of each. Least squares finds the
combinations that a log says something about, the base parameters (Gautier and Khalil, Direct calculation of minimum set
of inertial parameters of serial robots, IEEE Transactions on Robotics and Automation 6(3), 1990). A body can have ten
such numbers if its pseudo-inertia is positive definite (Wensing, Kim and Slotine, Linear matrix inequalities for
physically consistent inertial parameter identification, RA-L 3(1), 2018). Such numbers are a convex set; the
best of it are found by Newton's method with a barrier.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array, Sealed
from jacokin.errors import InvalidInputError, ModelError
from jacokin.model import checks, dynamics
from jacokin.model.dynamics import BODY, pseudo_inertia
from jacokin.model.robot import Robot, checked_robot

IDENTIFIED = 1e-6  # of the largest singular value, columns scaled to one: below, rounding decides
SIZE = 0.1  # [m] of a body to start from
BODY_SCALE = np.array([1.0, *[SIZE] * 3, *[SIZE**2] * 6])  # of a body's parameters, for 1 kg
NOISE_FLOOR = 1e-6  # of the torques: a log is never taken as more exact


@dataclass(frozen=True, slots=True, eq=False)
class PayloadEstimate(Sealed):
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
        ModelError: the description gives no masses, so that the body would be found to weigh what the arm does.
    """
    checked_robot("robot", robot).check_masses()
    carried = robot.pin_model.frames[robot.frame_id(frame)]
    log = _checked_log(robot, q, v, a, torque)
    if carried.parentJoint == 0:
        raise InvalidInputError(f"frame {carried.name!r} does not move: the log says nothing about a body there")
    joint = carried.parentJoint - 1
    bodies, friction, own = _regressors(robot, log)
    system = _stacked(bodies[:, :, BODY * joint : BODY * (joint + 1)], friction, log)
    right = (log[3] - own).ravel()
    _check_size(system, right)
    found, covariance, unidentified, residual = _least_squares(system, right)
    projected = not _possible(found[:BODY])
    if projected:
        mass = max(found[0], 1e-3)  # [kg]
        ball = np.array([[mass, 0.0, 0.0, 0.0, *(mass * SIZE**2 * np.array([2.0, 0.0, 2.0, 0.0, 0.0, 2.0]))]])
        noise = max(residual, NOISE_FLOOR * float(np.sqrt(np.mean(right**2))))
        found = _nearest_possible(system / noise, right / noise, found, ball)
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


@dataclass(frozen=True, slots=True, eq=False)
class ArmEstimate(Sealed):
    """Bodies and friction of an arm that explain a log; sigmas are standard deviations, arrays read-only.

    A body is all that a joint moves up to the next one, in Pinocchio's frame of that joint. Its ten parameters are mass
    [kg], mass times centre of mass (3) [kg m], and inertia about the frame xx, xy, yy, xz, yz, zz [kg m^2].
    """

    robot: Robot
    """The arm with these bodies, without friction."""
    parameters: Array
    """(dof, 10) of the bodies, ones that can exist."""
    parameters_sigma: Array
    """(dof, 10) by the log and by how far the description is trusted."""
    viscous: Array
    """(dof,) viscous friction [N m s/rad]."""
    coulomb: Array
    """(dof,) dry friction [N m]."""
    viscous_sigma: Array
    """(dof,) [N m s/rad]."""
    coulomb_sigma: Array
    """(dof,) [N m]."""
    combinations: Array
    """(r, dof, 10) the combinations of parameters that the log says something about, the best known first."""
    values: Array
    """(r,) their values by the log alone; independent of each other."""
    values_sigma: Array
    """(r,) of `values`, by the log alone; one without a unit is one of what the description is trusted by."""
    unidentified: int
    """How many combinations of bodies and friction the log says nothing about: there the description stands."""
    projected: bool
    """Whether the best parameters were those of no bodies, and the nearest possible ones were taken."""
    residual: float
    """Root mean square of the torques left unexplained [N m]."""


def identify_arm(
    robot: Robot, q: ArrayLike, v: ArrayLike, a: ArrayLike, torque: ArrayLike, *, trust: float = 1.0
) -> ArmEstimate:
    """Fit the bodies of an arm, and viscous and dry friction of every joint, to a log.

    Only combinations of the parameters show in torques, 36 of 60 on six joints: the least-squares estimate is joined by
    the description, which counts as off by a part `trust` of each body's mass, of that mass 0.1 m away, and of the
    inertia that it then has. Where the log says much the description has no say, and where it says nothing it stands.
    Errors of the torques are taken as independent and equally large. Armature is that of the description.

    Args:
        robot: the arm as described.
        q: (n, dof) joint angles [rad].
        v: (n, dof) joint velocities [rad/s].
        a: (n, dof) joint accelerations [rad/s^2].
        torque: (n, dof) torques of the motors [N m], friction included.
        trust: relative standard deviation of the description.

    Raises:
        InvalidInputError: malformed, too large, of different lengths or too short.
        ModelError: the description gives no masses.
    """
    checked_robot("robot", robot)
    log = _checked_log(robot, q, v, a, torque)
    trusted = checks.positive("trust", trust)
    bodies, friction, _ = _regressors(robot, log)
    system = _stacked(bodies, friction, log)
    right = (log[3] - robot.pin_model.armature * log[2]).ravel()
    _check_size(system, right)

    count, described = BODY * robot.dof, _described(robot)
    scale = np.ones(system.shape[1])
    scale[:count] = trusted * (described[:, :1] * BODY_SCALE).ravel()
    combinations, values, sizes, unexplained, friction_known = _base_parameters(system, right, scale[:count])
    unidentified = system.shape[1] - len(values) - friction_known
    spare = len(right) - len(values) - friction_known
    floor = NOISE_FLOOR * float(np.sqrt(np.mean(right**2)))
    noise = max(float(np.sqrt(unexplained / spare)), floor, np.finfo(float).tiny)

    # The log in units of its noise, then the description in units of its own.
    wide = np.eye(count, system.shape[1])
    weighted = np.vstack((system * scale / noise, wide))
    goal = np.concatenate((right / noise, described.ravel() / scale[:count]))
    orthogonal, small = np.linalg.qr(weighted)
    target = orthogonal.T @ goal
    inverse = np.linalg.pinv(small, rcond=np.finfo(float).eps)
    found, sigma = scale * (inverse @ target), scale * np.linalg.norm(inverse, axis=1)
    projected = not all(_possible(body) for body in found[:count].reshape(-1, BODY))
    if projected:
        found = _nearest_possible(small / scale, target, found, described)
    left_over = right - system @ found
    parameters, viscous, coulomb = np.split(found, (count, count + robot.dof))
    _, viscous_sigma, coulomb_sigma = np.split(sigma, (count, count + robot.dof))
    return ArmEstimate(
        robot=robot.with_bodies(parameters.reshape(-1, BODY)),
        parameters=checks.read_only(parameters.reshape(-1, BODY)),
        parameters_sigma=checks.read_only(sigma[:count].reshape(-1, BODY)),
        viscous=checks.read_only(viscous),
        coulomb=checks.read_only(coulomb),
        viscous_sigma=checks.read_only(viscous_sigma),
        coulomb_sigma=checks.read_only(coulomb_sigma),
        combinations=checks.read_only(combinations.reshape(-1, robot.dof, BODY)),
        values=checks.read_only(values),
        values_sigma=checks.read_only(noise / sizes),
        unidentified=unidentified,
        projected=projected,
        residual=float(np.sqrt(np.mean(left_over**2))),
    )


def _checked_log(robot: Robot, q: ArrayLike, v: ArrayLike, a: ArrayLike, torque: ArrayLike) -> list[Array]:
    """Four arrays (n, dof).

    Raises:
        InvalidInputError: malformed, or of different lengths.
    """
    log = [
        checks.matrix("q", q, robot.dof, "rad"),
        checks.matrix("v", v, robot.dof, "rad/s"),
        checks.matrix("a", a, robot.dof, "rad/s^2"),
        checks.matrix("torque", torque, robot.dof, "N m"),
    ]
    if len({len(rows) for rows in log}) > 1:
        raise InvalidInputError(f"q, v, a and torque must have the same length, got {[len(rows) for rows in log]}")
    return log


def _regressors(robot: Robot, log: list[Array]) -> tuple[Array, Array, Array]:
    """Matrices (n, dof, 10 dof) of the bodies and (n, dof, 2 dof) of friction; torques (n, dof) as described."""
    model, data, n = robot.pin_model, robot.pin_model.createData(), robot.dof
    q, v, a, _ = log
    bodies, friction, own = np.empty((len(q), n, BODY * n)), np.zeros((len(q), n, 2 * n)), np.empty((len(q), n))
    joint = np.arange(n)
    friction[:, joint, joint], friction[:, joint, n + joint] = v, np.sign(v)
    for row, (at, velocity, acceleration) in enumerate(zip(q, v, a, strict=True)):
        own[row] = pin.rnea(model, data, at, velocity, acceleration)
        bodies[row] = pin.computeJointTorqueRegressor(model, data, at, velocity, acceleration)
    return bodies, friction, own


def _stacked(bodies: Array, friction: Array, log: list[Array]) -> Array:
    """Both as one matrix (n dof, parameters).

    Raises:
        InvalidInputError: it has no more rows than columns.
    """
    system = np.concatenate((bodies, friction), axis=2)
    rows, columns = log[0].size, system.shape[2]
    if rows <= columns:
        raise InvalidInputError(f"the log is too short: it has no more numbers than the {columns} parameters")
    return system.reshape(rows, columns)


def _check_size(system: Array, right: Array) -> None:
    """Refuse numbers whose squares do not fit."""
    if not max(np.abs(system).max(), np.abs(right).max()) < 1e100:
        raise InvalidInputError(dynamics.TOO_LARGE)


def _base_parameters(system: Array, right: Array, scale: Array) -> tuple[Array, Array, Array, float, int]:
    """Combinations (r, n) of parameters of bodies that show beside friction, and their values (r,).

    Each combination is a unit vector in units of `scale`, and orthogonal to the others, so that their errors are
    independent.

    Returns:
        Combinations, values, by how much each value shows in torques (r,), the sum of the squares left unexplained, and
        how many parameters of friction show.
    """
    count = len(scale)
    rubbing, sizes, _ = np.linalg.svd(system[:, count:], full_matrices=False)
    friction = rubbing[:, sizes > IDENTIFIED * sizes[0]] if sizes[0] > 0.0 else rubbing[:, :0]
    scaled = system[:, :count] * scale
    left, sizes, axes = np.linalg.svd(scaled - friction @ (friction.T @ scaled), full_matrices=False)
    known = int(np.sum(sizes > IDENTIFIED * sizes[0]))
    explained = left[:, :known].T @ right
    rest = right - friction @ (friction.T @ right) - left[:, :known] @ explained
    return axes[:known] / scale, explained / sizes[:known], sizes[:known], float(rest @ rest), friction.shape[1]


def _described(robot: Robot) -> Array:
    """(dof, 10) parameters of the bodies as described, of points made a little larger.

    Raises:
        ModelError: a body has no mass.
    """
    bodies = np.array([inertia.toDynamicParameters() for inertia in list(robot.pin_model.inertias)[1:]])
    if not (bodies[:, 0] > 0.0).all():
        raise ModelError(
            f"{robot.name}: the description gives no mass to what {robot.joint_names[int(bodies[:, 0].argmin())]} moves"
        )
    bodies[:, [4, 6, 9]] += 1e-9  # [kg m^2]: a point has no density to start from
    return bodies


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
    """Whether a body can have these parameters."""
    return bool(np.linalg.eigvalsh(pseudo_inertia(body))[0] > 0.0)


def _nearest_possible(system: Array, right: Array, found: Array, start: Array) -> Array:
    """The parameters of bodies that explain the log best, friction included.

    Newton's method for the sum of squares less a multiple of the log-determinants of the pseudo-inertias, which keep
    the bodies possible; the multiple shrinks until they cost nothing (Boyd and Vandenberghe, Convex Optimization,
    2004, section 11.3).

    Args:
        system: (rows, parameters), bodies before friction, in units of the errors of `right`.
        right: (rows,).
        found: the best parameters of all, for friction.
        start: (k, 10) possible bodies to start from.
    """
    count = start.size
    scale = np.ones(len(found))
    scale[:count] = (start[:, :1] * BODY_SCALE).ravel()
    orthogonal, small = np.linalg.qr(system * scale)
    target = orthogonal.T @ right
    directions = np.array([pseudo_inertia(axis) for axis in np.eye(BODY)])
    units = scale[:count].reshape(-1, BODY)[:, :, np.newaxis, np.newaxis] * directions  # (k, 10, 4, 4)

    def cost(x: Array, weight: float) -> float:
        try:
            factors = np.linalg.cholesky(np.einsum("kp,kpij->kij", x[:count].reshape(-1, BODY), units))
        except np.linalg.LinAlgError:
            return np.inf
        missed = small @ x - target
        spread = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum()
        return float(0.5 * missed @ missed - 2.0 * weight * spread)

    x = np.concatenate((start.ravel(), found[count:])) / scale
    squares = small.T @ small
    for weight in np.logspace(2, -8, 11).tolist():  # of the barrier, in squares of the noise
        for _ in range(50):
            inverse = np.linalg.inv(np.einsum("kp,kpij->kij", x[:count].reshape(-1, BODY), units))
            turned = np.einsum("kij,kpjl->kpil", inverse, units)
            gradient, hessian = small.T @ (small @ x - target), squares.copy()
            gradient[:count] -= weight * np.einsum("kpii->kp", turned).ravel()
            for body, block in enumerate(np.einsum("kpij,kqji->kpq", turned, turned)):
                rows = slice(BODY * body, BODY * (body + 1))
                hessian[rows, rows] += weight * block
            step = np.linalg.lstsq(hessian, -gradient)[0]
            descent, before, part = float(gradient @ step), cost(x, weight), 1.0
            if -descent < 1e-3 * weight:
                break
            while part > 1e-9 and not cost(x + part * step, weight) <= before + 0.1 * part * descent:
                part *= 0.5
            if part <= 1e-9:
                break
            x = x + part * step
    return np.asarray(x * scale)
