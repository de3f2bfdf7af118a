"""Dynamics that are more than one call of Pinocchio: payloads, the wrench behind joint torques, many at once.

The equation of motion is M(q) a + C(q, v) v + g(q) = torque + J(q)^T external, with the torques of the motors and a
wrench of the surroundings. M includes armature where the description has one (an MJCF may, a URDF cannot); damping, dry
friction and limits are not part of it. Gravity is another one where the base is mounted at an angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array, Sealed
from jacokin.errors import InvalidInputError, ModelError
from jacokin.kernels.configurations.arm import LANES, Arm
from jacokin.kernels.configurations.dynamics import Bodies, MassWork, TorqueWork, find_mass_matrices, find_torques
from jacokin.kernels.library import Call
from jacokin.model import checks, kinematics, poses

SINGULAR = 1e-6  # of the largest singular value: below, 1 N m of error in a torque is a million times that in a wrench
BODY = 10  # parameters of a body: mass, mass times centre of mass (3), inertia about the frame (6)
POSSIBLE = 1e-9  # of the largest moment: rounding that an inertia may miss the triangle inequality by
TOO_LARGE = "the arguments are too large: the answer does not fit in floating-point numbers"


@dataclass(frozen=True, slots=True, eq=False)
class ExternalWrench(Sealed):
    """The wrench at a frame that explains joint torques; arrays are read-only."""

    wrench: Array
    """(6,) of the surroundings on the arm, at the frame's origin: force [N], then torque [N m]; least where unknown."""
    covariance: Array
    """(6, 6) of `wrench`, in [N^2], [N^2 m] and [N^2 m^2]; without `unobservable`, along which nothing is known."""
    unobservable: Array
    """(k, 6) unit wrenches that no joint feels, as the frame cannot move along them; k = 0 away from singularities."""
    joint_torque: Array
    """(dof,) torques that the surroundings exert on the joints [N m]."""
    residual: Array
    """(dof,) the part of `joint_torque` [N m] that no wrench at this frame explains."""


def has_moving_masses(model: pin.Model) -> bool:
    """Whether a joint moves a mass."""
    return any(body.mass > 0.0 for body in list(model.inertias)[1:])


def gravity_change(model: pin.Model, data: pin.Data, q: Array, base: pin.SE3 | ArrayLike) -> Array:
    """Joint torques (dof,) [N m] by which `gravity` differs when the base is mounted at another angle.

    Args:
        model: the arm.
        data: working memory.
        q: (dof,) [rad].
        base: T_world_base, a pose (4, 4) or a `pin.SE3`; the world's gravity points along -z and is as strong as that
            of the description.

    Raises:
        InvalidInputError: not a pose.
    """
    change = gravity(model, None) - gravity(model, base)
    com_jacobian = np.asarray(pin.jacobianCenterOfMass(model, data, q)).reshape(3, model.nv)
    return np.asarray(data.mass[0] * com_jacobian.T @ change)


def gravity(model: pin.Model, base: pin.SE3 | ArrayLike | None) -> Array:
    """The acceleration of free fall (3,) [m/s^2] in base axes, with a base as in `gravity_change`; None: as described.

    Raises:
        InvalidInputError: not a pose.
    """
    described = np.array(model.gravity.linear)
    if base is None:
        return described
    rotation = poses.matrix_of(base, "base")[:3, :3]
    return np.asarray(rotation.T @ np.array([0.0, 0.0, -np.linalg.norm(described)]))


def centre_of_mass(model: pin.Model, data: pin.Data, q: Array) -> Array:
    """Centre of mass (3,) of all links [m], those fixed to the base included, which Pinocchio leaves out.

    Raises:
        ModelError: no link has a mass.
    """
    moving = pin.centerOfMass(model, data, q, False)
    fixed = model.inertias[0]
    total = data.mass[0] + fixed.mass
    if not total > 0.0:
        raise ModelError(f"{model.name}: the description gives no masses")
    # Without moving masses Pinocchio divides by zero.
    moment = data.mass[0] * moving if data.mass[0] > 0.0 else np.zeros(3)
    return np.asarray((moment + fixed.mass * fixed.lever) / total)


def loaded(model: pin.Model, frame_id: int, mass: float, com: Array, inertia: ArrayLike | None) -> pin.Model:
    """A copy of the model with a body fixed to a frame.

    Args:
        model: the arm, which stays as it is.
        frame_id: the frame.
        mass: [kg].
        com: (3,) centre of mass in the frame [m].
        inertia: (3, 3) about the centre of mass, in the frame's axes [kg m^2]; None for a point.

    Raises:
        InvalidInputError: an inertia that no body has.
    """
    tensor = np.zeros((3, 3)) if inertia is None else _symmetric("inertia", inertia, 3, "kg m^2")
    wrong = impossible_moments(tensor)
    if wrong:
        raise InvalidInputError(f"inertia is one that no body has: {wrong}")
    copy = pin.Model(model)
    frame = copy.frames[frame_id]
    copy.appendBodyToJoint(frame.parentJoint, pin.Inertia(mass, com, tensor), frame.placement)
    return copy


def reweighed(model: pin.Model, parameters: Array) -> pin.Model:
    """A copy of the model with bodies of other parameters (joints, 10).

    Raises:
        InvalidInputError: a body that cannot exist.
    """
    copy = pin.Model(model)
    for number, row in enumerate(parameters):
        least = np.linalg.eigvalsh(pseudo_inertia(row))[0]
        if not row[0] > 0.0 or least < -POSSIBLE * row[0]:
            raise InvalidInputError(
                f"parameters[{number}] are those of no body: the mass must be > 0 and the pseudo-inertia positive "
                f"semidefinite; its least eigenvalue is {least:.3g}"
            )
        copy.inertias[number + 1] = pin.Inertia.FromDynamicParameters(row)
    return copy


def pseudo_inertia(body: Array) -> Array:
    """(4, 4) second moments of the density of a body (10,): positive definite if a body can have these parameters."""
    return np.asarray(pin.PseudoInertia.FromDynamicParameters(body).toMatrix())


def impossible_moments(tensor: Array) -> str:
    """Why no body has an inertia (3, 3) about its centre of mass [kg m^2]; "" where one may."""
    least, middle, most = np.linalg.eigvalsh(tensor)
    if least >= -POSSIBLE * most and least + middle >= most * (1.0 - POSSIBLE):
        return ""
    return (
        "its principal moments must be >= 0, and none larger than the sum of the other two, got "
        f"{least:.6g}, {middle:.6g}, {most:.6g} kg m^2"
    )


def wrench_of(jacobian: Array, joint_torque: Array, torque_covariance: ArrayLike | None) -> ExternalWrench:
    """The wrench whose joint torques J^T wrench come nearest to those given, by the covariance of their errors.

    Args:
        jacobian: (6, dof).
        joint_torque: (dof,) of the surroundings [N m].
        torque_covariance: (dof, dof) of the errors [N^2 m^2]; None for independent ones of 1 N m.

    Raises:
        InvalidInputError: a covariance that is not symmetric and positive definite, or torques too large.
    """
    dof = len(joint_torque)
    covariance = np.eye(dof)
    if torque_covariance is not None:
        covariance = _symmetric("torque_covariance", torque_covariance, dof, "N^2 m^2")
    try:
        factor = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        raise InvalidInputError("torque_covariance must be positive definite") from None
    left, values, right = np.linalg.svd(np.linalg.solve(factor, jacobian.T))
    known = int(np.sum(values > SINGULAR * values[0])) if values[0] > 0.0 else 0
    gain = right[:known].T / values[:known]
    with np.errstate(over="ignore", invalid="ignore"):
        wrench = gain @ (left[:, :known].T @ np.linalg.solve(factor, joint_torque))
        residual = joint_torque - jacobian.T @ wrench
    if not np.isfinite(residual).all():
        raise InvalidInputError(TOO_LARGE)
    return ExternalWrench(
        wrench=checks.read_only(wrench),
        covariance=checks.read_only(gain @ gain.T),
        unobservable=checks.read_only(right[known:]),
        joint_torque=checks.read_only(joint_torque),
        residual=checks.read_only(residual),
    )


def operational_space_inertia(model: pin.Model, jacobian: Array, mass_matrix: Array) -> Array:
    """(J M^-1 J^T)^-1, from singular values: near a singularity the inverse of the product loses twice the digits.

    Source: Khatib, A unified approach for motion and force control of robot manipulators: the operational space
    formulation, IEEE Journal on Robotics and Automation 3(1), 1987.

    Raises:
        InvalidInputError: the frame cannot move in all six directions here.
        ModelError: a joint moves no mass.
    """
    _, values, right = np.linalg.svd(np.linalg.solve(_factor(model, mass_matrix), jacobian.T))
    if len(values) < len(jacobian) or not values[-1] > SINGULAR * values[0]:
        stuck = right[-1]
        raise InvalidInputError(
            "operational_space_inertia does not exist here: the frame cannot move along (linear, angular) "
            f"{np.round(stuck, 3).tolist()}"
        )
    scaled = right.T / values
    return np.asarray(scaled @ scaled.T)


def answered(model: pin.Model, data: pin.Data, q: Array, result: Array) -> Array:
    """A result that is finite.

    Raises:
        ModelError: it is not, because a joint moves no mass.
        InvalidInputError: it is not, because the arguments are too large.
    """
    if not math.isfinite(sum(result.ravel().tolist())) and not np.isfinite(result).all():
        _factor(model, pin.crba(model, data, q).reshape(model.nv, model.nv))
        raise InvalidInputError(TOO_LARGE)
    return result


def all_answered(model: pin.Model, q: Array, results: Array) -> Array:
    """Results of configurations (n, dof) that are finite.

    Raises:
        ModelError: one is not, because a joint moves no mass.
        InvalidInputError: one is not, because the arguments are too large.
    """
    if not np.isfinite(results).all():
        row = int(np.argmin(np.isfinite(results.reshape(len(results), -1)).all(axis=1)))
        answered(model, model.createData(), q[row], results[row])
    return results


def _factor(model: pin.Model, mass_matrix: Array) -> Array:
    """Cholesky's factor of the mass matrix.

    Raises:
        ModelError: there is none.
    """
    try:
        return np.asarray(np.linalg.cholesky(mass_matrix))
    except np.linalg.LinAlgError:
        raise ModelError(f"{model.name}: the description gives no masses that a joint moves") from None


def _symmetric(name: str, value: ArrayLike, size: int, unit: str) -> Array:
    """A finite symmetric matrix (size, size).

    Raises:
        InvalidInputError: anything else.
    """
    matrix = checks.matrix(name, value, size, unit)
    if len(matrix) != size:
        raise InvalidInputError(f"{name} must have shape ({size}, {size}) [{unit}], got shape {matrix.shape}")
    half = 0.5 * matrix
    if np.abs(half - half.T).max() > 1e-9 * np.abs(half).max():  # more than rounding leaves in a matrix of a file
        raise InvalidInputError(f"{name} must be symmetric, got {matrix.tolist()}")
    return half + half.T


def bodies_of(model: pin.Model) -> Bodies:
    """What the joints of a model move, in the axes of `arm_of`."""
    own = kinematics.own_axes(model)
    rows = [own[j].inverse().act(model.inertias[j]).toDynamicParameters() for j in range(1, model.njoints)]
    return Bodies(np.array(rows).reshape(model.nv, 10), np.array(model.armature, dtype=np.float64))


def torques(arm: Arm, bodies: Bodies, q: Array, v: Array, a: Array, gravity: Array) -> Array:
    """Joint torques (n, dof) of motions (n, dof), under a gravity (3,) in the base [m/s^2]."""
    written = np.empty(q.shape)
    work = TorqueWork(
        arm,
        bodies,
        q.reshape(-1),
        v.reshape(-1),
        a.reshape(-1),
        np.array(gravity, dtype=np.float64),
        kinematics.block_of(arm),
        np.empty((2, LANES)),
        np.empty((9, LANES)),
        np.empty((len(arm.sliding), 6, LANES)),
        written.reshape(-1),
    )
    Call(find_torques, work)()
    return written


def mass_matrices(arm: Arm, bodies: Bodies, q: Array) -> Array:
    """Mass matrices (n, dof, dof) at configurations (n, dof)."""
    written = np.empty((*q.shape, q.shape[1]))
    work = MassWork(
        arm,
        bodies,
        q.reshape(-1),
        kinematics.block_of(arm),
        np.empty((10, LANES)),
        np.empty((6, LANES)),
        np.empty(LANES),
        written.reshape(-1),
    )
    Call(find_mass_matrices, work)()
    return written
