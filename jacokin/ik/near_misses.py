"""`NearMisses`: configurations within the limits that meet a target within the tolerances, where none meets it exactly.

A little beyond a fold of the arm, such as the edge of its reach, no branch exists, and yet the fold itself may miss the
target by less than the tolerances. So it is with a branch that is a little outside the limits. Such a target is near to
targets that are reached: it is moved a little to and fro, and from what reaches those, or nearly so, least squares
within the limits lead back to it. Far from folds and limits there is nothing to start from, which is seen at once.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik.preferences import copies_to_try, with_ties
from jacokin.ik.targets import Request, TargetPose
from jacokin.ik.verification import Verifier
from jacokin.kernels.closest import BOUND_PASSES, LONGEST_STEP
from jacokin.model import angles
from jacokin.model.many_configurations import TargetRows

#: Directions that no structured target has, so that each crosses a fold; moves go along them to and fro.
DIRECTIONS = (
    (0.42, -0.28, 0.52, 0.35, 0.54, -0.25),
    (-0.17, 0.62, 0.23, 0.49, -0.33, 0.43),
    (0.38, 0.41, -0.24, -0.21, 0.35, 0.68),
)
#: A fold bends: what reaches a moved target is at most this many times the root of the move from what meets the target.
BEND = 10.0
MESSAGE = "within the tolerances of a target that nothing meets exactly"
#: Starts at most, and steps of each.
STARTS, STEPS = 96, 40
#: Of the least squares [m^2 / rad^2]: at first, bounds, and factors after a step that helps and one that does not.
DAMPING, LEAST_DAMPING, MOST_DAMPING, LESS_DAMPING, MORE_DAMPING = 1e-6, 1e-14, 1e2, 0.1, 8.0
#: Steps that shrink errors by a smaller part help no more, after so many of them.
SETTLED, PATIENCE = 1e-3, 6
#: Errors up to this many times the tolerances are weighed anew: where one is too large, the other may be small.
UNEQUAL = 1.5
#: Of the looser tolerance [m/rad] or [rad/m] at least: with less the method does not see what it does to that error.
LEAST_WEIGHT = 3e-4


class NearMisses:
    """The search for one robot, frame and tool; immutable, and may be shared between threads.

    Attributes:
        tolerance: the larger one of a success, of position and of orientation [m] or [rad].
        near: [rad] how far what reaches a moved target may be outside the limits to be a start.
    """

    def __init__(self, verifier: Verifier, size: float, ways: int) -> None:
        """Take the arm; its joints are read when first needed.

        Args:
            verifier: the arm, and the tolerances.
            size: of the moves, in tolerances: large ones cross folds that lie nearly along a direction, small ones lead
                less far from what meets the target.
            ways: directions of the moves.
        """
        self._verifier = verifier
        self._tolerances = verifier.options.position_tolerance, verifier.options.orientation_tolerance
        self.tolerance = max(self._tolerances)
        self._move, self._ways = min(size * self.tolerance, 0.03), ways  # [m] and [rad]
        self.near = BEND * math.sqrt(self._move)

    @functools.cached_property
    def _moves(self) -> Array:
        """By which targets are moved (m, 4, 4)."""
        steps = [sign * self._move * np.array(way) for way in DIRECTIONS[: self._ways] for sign in (1.0, -1.0)]
        return np.array([pin.exp6(step).homogeneous for step in steps])

    def moved(self, T: Array) -> Array:
        """A target (4, 4) moved a little to and fro, (m, 4, 4)."""
        return np.asarray(T @ self._moves)

    def find(self, request: Request, x: Array) -> Array:
        """What may meet the target, (m, dof) within the limits, in the order of the request's cost.

        Args:
            request: what was asked for.
            x: (k, dof) configurations that reach targets near to it, outside the limits or not, in any 2 pi copies
                [rad]. Where there is a free axis, the angle about it comes last, here and in what is returned.
        """
        if not len(x):
            return x
        robot, seed = self._verifier.robot, request.seed
        lower, upper = self._bounds(request.target)
        inside = angles.into_limits(x, lower, upper)
        outside = np.abs(angles.wrap_to_pi(x - inside)).max(axis=1)
        order = np.argsort(outside, kind="stable")[:STARTS]
        order = order[outside[order] <= self.near]
        if not len(order):
            return x[:0]
        found = self._settled(inside[order], outside[order], request.target, lower, upper)
        if not len(found):
            return found
        cost = with_ties(request.cost, seed)
        copies = copies_to_try(cost.copies, found[:, : robot.dof], seed, robot)
        rows = np.vstack([np.hstack([q, found[:, robot.dof :]]) for q in copies])
        rows = rows[~np.isnan(rows).any(axis=1)]
        return np.asarray(rows[np.argsort(cost(rows[:, : robot.dof]), kind="stable")])

    def _bounds(self, target: TargetPose) -> tuple[Array, Array]:
        """Lower and upper bounds of the joints, and of the angle about a free axis [rad]."""
        lower, upper, free = self._verifier.robot.lower, self._verifier.robot.upper, target.free_axis
        if free is None:
            return lower, upper
        low, high = (-np.inf, np.inf) if free.full_turn else free.range
        return np.append(lower, low), np.append(upper, high)

    def _settled(self, x: Array, outside: Array, target: TargetPose, lower: Array, upper: Array) -> Array:
        """Where least squares within bounds lead from rows (k, width); those that meet the target, or nearly so."""
        tolerance = np.repeat(self._tolerances, 3)
        scale = np.tile(np.maximum(tolerance.min() / tolerance, LEAST_WEIGHT), (len(x), 1))
        x, size = self._descended(x, outside, target, scale, lower, upper)
        x, size, scale = x[rows := size.max(axis=1) <= UNEQUAL], size[rows], scale[rows]
        uneven = size.max(axis=1) > 1.0
        if uneven.any():  # what is smaller weighs less: both errors are then of one size
            scale[uneven] *= np.repeat(np.sqrt(size[uneven] / size[uneven].max(axis=1, keepdims=True)), 3, axis=1)
            x[uneven], size[uneven] = self._descended(
                x[uneven], np.zeros(len(x[uneven])), target, scale[uneven], lower, upper
            )
        return x

    def _descended(
        self, x: Array, outside: Array, target: TargetPose, scale: Array, lower: Array, upper: Array
    ) -> tuple[Array, Array]:
        """Rows (k, width) after least squares with weights (k, 6), and their errors (k, 2) in tolerances.

        Levenberg's and Marquardt's method. Rows whose errors no curvature can make up for are left where they are: to
        first order they stay, and second derivatives matter as the square of what a step, or moving the row onto limits
        by (k,) [rad], changes. Mostly that is a regular branch outside the limits, and seen at once.
        """
        x, moved = x.copy(), outside**2
        slack = UNEQUAL * 2.0 * (scale[:, [0, 3]] * self._tolerances).max(axis=1)
        error, jacobian = self._linearised(x, target)
        value = np.linalg.norm(scale * error, axis=1)
        damping, waited, moving = np.full(len(x), DAMPING), np.zeros(len(x)), np.arange(len(x))
        for _ in range(STEPS):
            weight = scale[moving]
            rest, slopes = weight * error[moving], weight[:, :, None] * jacobian[moving]
            back = np.swapaxes(slopes, 1, 2)
            gradient = -(back @ rest[:, :, None])[:, :, 0]
            step = bounded_step(x[moving], gradient, back @ slopes, damping[moving], lower, upper)
            moved[moving] += np.einsum("ki,ki->k", step, step)
            left = np.linalg.norm(rest - (slopes @ step[:, :, None])[:, :, 0], axis=1)
            # 4 m/rad^2 is more than the second derivative of any pose of the tool.
            hopeful = (left <= 4.0 * moved[moving] + slack[moving]) | (damping[moving] > DAMPING)
            moving, step, weight = moving[hopeful], step[hopeful], weight[hopeful]
            if not len(moving):
                break
            tried = np.clip(x[moving] + step, lower, upper)
            new_error, new_jacobian = self._linearised(tried, target)
            new_value = np.linalg.norm(weight * new_error, axis=1)
            better = new_value < value[moving]
            waited[moving] = np.where(new_value < (1.0 - SETTLED) * value[moving], 0.0, waited[moving] + 1.0)
            factor = np.where(better, LESS_DAMPING, MORE_DAMPING)
            damping[moving] = np.clip(damping[moving] * factor, LEAST_DAMPING, MOST_DAMPING)
            taken = moving[better]
            x[taken], error[taken], jacobian[taken] = tried[better], new_error[better], new_jacobian[better]
            value[taken] = new_value[better]
            moved[taken] = 0.0
            moving = moving[waited[moving] <= PATIENCE]
        return x, self._sizes(error)

    def _sizes(self, error: Array) -> Array:
        """Position and orientation errors (k, 2) in tolerances, of errors (k, 6)."""
        return np.asarray(np.linalg.norm(error.reshape(-1, 2, 3), axis=2) / self._tolerances)

    def _linearised(self, x: Array, target: TargetPose) -> tuple[Array, Array]:
        """Errors (k, 6) and how they shrink with each coordinate (k, 6, width); none of an orientation that is free."""
        free = target.free_axis
        axis = None if free is None else np.broadcast_to(free.axis, (len(x), 3))
        error, jacobian = self._verifier.chain.linearise(
            x, TargetRows(np.broadcast_to(target.matrix, (len(x), 4, 4)), axis)
        )
        if target.position_only:
            error[:, 3:] = jacobian[:, 3:] = 0.0
        return error, jacobian


def bounded_step(q: Array, gradient: Array, curvature: Array, damping: Array, lower: Array, upper: Array) -> Array:
    """Steps (k, dof) from q (k, dof) to the minimum of a quadratic model; joints that would pass a limit end on it.

    Args:
        q: (k, dof) within the limits.
        gradient: (k, dof).
        curvature: (k, dof, dof) positive semidefinite.
        damping: (k,) added to its diagonal.
        lower: (dof,) limits; -inf for none.
        upper: (dof,) limits; inf for none.
    """
    unit = np.eye(q.shape[1])
    matrix = curvature + damping[:, None, None] * unit
    held = ((q <= lower) & (gradient > 0.0)) | ((q >= upper) & (gradient < 0.0))
    step = np.zeros_like(q)
    for _ in range(BOUND_PASSES):
        given = np.where(held, step, 0.0)
        rest = gradient + (matrix @ given[:, :, None])[:, :, 0]
        free = ~held
        reduced = np.where(free[:, :, None] & free[:, None], matrix, unit)
        solved = np.linalg.solve(reduced, np.where(held, 0.0, -rest)[:, :, None])[:, :, 0]
        step = np.where(held, given, solved)
        past = ((q + step < lower) | (q + step > upper)) & free
        if not past.any():
            break
        step = np.where(past, np.clip(q + step, lower, upper) - q, step)
        held = held | past
    longest = np.abs(step).max(axis=1, keepdims=True)
    return np.asarray(step * np.minimum(1.0, LONGEST_STEP / np.maximum(longest, 1e-300)))
