"""Gradients of answers by implicit differentiation: how the joints follow a target that moves.

An answer closes a loop: the joints lead to the tool, and the turns that the target leaves free (about the axis of a
`FreeAxis`, about every axis of a position) lead from there back to the target. Along it, for small motions,

    A [dq, da] = twist of the target,    A = [J, -turns],

where J is the Jacobian of the tool and da are the free turns. Six columns make A square, and its inverse holds the
gradient. With seven the answers are a curve, along which a parameter is free: a joint, or the free turn. The gradient
holds it; along the curve, the six others follow it as A says with the target at rest. Where A without the parameter is
singular, two branches meet and nothing follows smoothly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, SingularAnswerError
from jacokin.ik.results import IKResult
from jacokin.ik.verification import Verifier
from jacokin.model import checks, kinematics
from jacokin.model.robot import Robot

#: Freedoms that a target pose takes.
POSE = 6
#: [m/rad or rad/rad] Below this singular value there is no gradient: an answer is within 1e-6 m and 1e-6 rad of its
#: target, which leaves its joints undetermined by a radian there.
SINGULAR = 1e-6


class Loop(NamedTuple):
    """The loop that an answer closes, for small motions."""

    A: Array
    """(6, 6) twists of the target, local_world_aligned, for unit rates of the columns that move."""
    moving: Array
    """(6,) which columns those are: joints, then turns that the target leaves free."""
    held: int | None
    """The column of the parameter; None where the answers are points."""
    along: Array
    """(6,) its twist; zero where there is none."""
    T: pin.SE3
    """Pose of the tool in the base."""


def target_gradient(verifier: Verifier, result: IKResult, parameter: str | None, reference: str) -> Array:
    """Derivative (dof, 6) of an answer by the twist of its target in a reference frame, as `IKSolver.gradient` says.

    `parameter` names the joint that is the parameter of the curves of a pose.
    """
    kinematics.reference_frame(reference)
    loop, twists = _loop(verifier, result, parameter), np.eye(POSE)
    if reference == "local":
        twists = np.kron(np.eye(2), loop.T.rotation)
    elif reference == "world":
        twists = _moved(loop.T.translation)
    return _follow(verifier.robot, loop, twists)


def parameter_gradient(verifier: Verifier, result: IKResult, parameter: str | None) -> Array:
    """Derivative (dof,) of an answer by the parameter of its curve.

    Raises:
        InvalidInputError: the target has separate solutions.
    """
    loop, robot = _loop(verifier, result, parameter), verifier.robot
    if loop.held is None:
        raise InvalidInputError(
            "result has no free parameter to move along: its target has separate solutions, not a curve of them"
        )
    gradient = _follow(robot, loop, -loop.along)
    if loop.held < robot.dof:
        gradient[loop.held] = 1.0
    return gradient


def pull_back(verifier: Verifier, q: ArrayLike, cotangents: ArrayLike, parameter: str | None) -> Array:
    """Derivatives (n, 4, 4) by poses of a function with derivatives `cotangents` (n, dof) by their answers q (n, dof).

    NaN where an answer is singular.

    Raises:
        InvalidInputError: malformed.
    """
    robot, none = verifier.robot, np.empty((0, 3))
    rows = checks.matrix("q", q, robot.dof, "rad")
    weights = checks.array("cotangents", cotangents, f"rows of {robot.dof} numbers")
    if weights.shape != rows.shape:
        raise InvalidInputError(f"cotangents must have the shape of q, {rows.shape}, got shape {weights.shape}")
    held, found = _held(robot, none, parameter), np.zeros((len(rows), 4, 4))
    for row in np.flatnonzero((weights != 0.0).any(axis=1)).tolist():
        loop = _closed(verifier, rows[row], none, held)
        if _smallest(loop.A) < SINGULAR:
            found[row, :3] = np.nan
            continue
        v, w = np.linalg.solve(loop.A.T, weights[row, loop.moving]).reshape(2, 3)
        # The tool turns by dw where S(dw) = dR R^T, and w . dw = sum(S(w) * dR R^T) / 2.
        found[row, :3, 3], found[row, :3, :3] = v, 0.5 * pin.skew(w) @ loop.T.rotation
    return found


def _loop(verifier: Verifier, result: IKResult, parameter: str | None) -> Loop:
    """The loop that a result closes.

    Raises:
        InvalidInputError: not a success, not of this arm, or of a target that does not determine the joints.
    """
    checks.instance("result", result, IKResult, "an IKResult")
    robot = verifier.robot
    if not result.success:
        raise InvalidInputError(f"result must be a success: {result.status.name}, {result.message}")
    if len(result.q) != robot.dof:
        raise InvalidInputError(f"result is of another arm: it has {len(result.q)} joints, {robot.name} {robot.dof}")
    axes = np.empty((0, 3)) if result.free_axes is None else result.free_axes
    return _closed(verifier, result.q, axes, _held(robot, axes, parameter))


def _held(robot: Robot, axes: Array, parameter: str | None) -> int | None:
    """Which column is the parameter: the turn about a free axis, or a joint; None where the answers are points.

    Raises:
        InvalidInputError: the answers are neither points nor curves, or they are curves without a parameter.
    """
    freedoms = robot.dof + len(axes)
    if freedoms == POSE:
        return None
    if freedoms == POSE + 1 and len(axes) == 1:
        return robot.dof
    if freedoms == POSE + 1 and not len(axes) and parameter is not None:
        return robot.joint_index(parameter)
    target = {0: "a pose", 1: "a FreeAxis", 3: "a position"}[len(axes)]
    if freedoms < POSE:
        reason = f"the {robot.dof} joints of {robot.name} cannot follow every motion of {target}"
    else:
        reason = f"{target} leaves {freedoms - POSE} of the {robot.dof} joints of {robot.name} undetermined"
    raise InvalidInputError(
        f"no gradient: {reason}. There is one at a pose of six joints, of five about a FreeAxis and of three at a "
        "position, and with the parameter held at a pose of seven and of six about a FreeAxis"
    )


def _closed(verifier: Verifier, q: Array, axes: Array, held: int | None) -> Loop:
    """The loop at a configuration (dof,), with the axes (k, 3) of the tool about which the target leaves it free."""
    robot, tool = verifier.robot, verifier.tool
    J, T = robot.jacobian(q, verifier.frame), pin.SE3(verifier.tool_pose(q))
    if tool is not None:
        J = _moved(T.rotation @ tool.rotation.T @ tool.translation) @ J
    columns = np.hstack([J, np.vstack([np.zeros((3, len(axes))), -T.rotation @ axes.T])])
    moving = np.array([column for column in range(columns.shape[1]) if column != held])
    return Loop(columns[:, moving], moving, held, np.zeros(POSE) if held is None else columns[:, held], T)


def _moved(lever: Array) -> Array:
    """(6, 6): the twist of a point from that of another, which is a lever (3,) [m] away, in the same axes."""
    return np.asarray(pin.SE3(np.eye(3), -lever).toActionMatrix())


def _smallest(A: Array) -> float:
    return float(np.linalg.svd(A, compute_uv=False)[-1])


def _follow(robot: Robot, loop: Loop, twists: Array) -> Array:
    """Rates (dof, ...) of the joints for twists (6, ...) of the target; zero for a joint that is held.

    Raises:
        SingularAnswerError: the joints cannot follow every twist.
    """
    smallest = _smallest(loop.A)
    if smallest < SINGULAR:
        held = "" if loop.held is None else f" with {(*robot.joint_names, 'the free angle')[loop.held]} held"
        raise SingularAnswerError(
            f"no gradient: the answer is singular{held}, smallest singular value {smallest:.3g}; the joints cannot "
            "follow every motion of the target there",
            smallest,
        )
    rates = np.zeros((POSE + 1, *twists.shape[1:]))
    rates[loop.moving] = np.linalg.solve(loop.A, twists)
    return rates[: robot.dof]
