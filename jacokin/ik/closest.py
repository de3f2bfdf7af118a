"""`ClosestSearch`: the configuration within the limits that comes closest to a target that is not reached.

Random configurations are drawn, and the nearest of them descend, together with those that the caller has. After each
stage the worse ones are dropped, and those that have met. Most minima are reached from many starts, so that the least
one is seldom missed; `python -m benchmarks.closest` counts how often.

A descent is Newton's method within the limits on a measure of the distance (`Measure`). A step solves a quadratic model
inside the limits. It is taken when the measure shrinks; otherwise it is damped more, as Levenberg and Marquardt do.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik import seeds
from jacokin.ik.diagnosis import Outcome
from jacokin.ik.results import IKResult, Status
from jacokin.ik.targets import RADIAN_IN_METRES, Request, TargetPose
from jacokin.ik.verification import Candidate, Effort, Verifier
from jacokin.model import angles
from jacokin.model.many_configurations import Chain, angle_and_axis, cross

SMALL_ANGLE = 1e-4  # [rad] below it the series of x cot(x) is exact in double precision
DAMPING = 3e-3  # of the first step, in the unit of the Hessian [m / rad^2]
LEAST_DAMPING, MOST_DAMPING = 1e-7, 1e4
LESS_DAMPING, MORE_DAMPING = 0.2, 4.0  # factors after a step that the model predicted well, and badly
GOOD_MODEL, BAD_MODEL = 0.7, 0.25  # parts of the predicted progress that were made
LONGEST_STEP = 1.0  # [rad] a quadratic model says nothing beyond
BOUND_PASSES = 2  # times that joints which pass a limit are held there and the others solved again
SETTLED = 1e-8  # [m] less progress of the nearest descent in `PATIENCE` steps ends a stage
PATIENCE = 8

DRAWN = 1000  # random configurations that are measured
STARTS = 112  # nearest ones that descend
COARSE = 1e-2  # [m] smoothing of the first stage, which only gets near
FINE = 1e-6  # [m] smoothing of the others: as much may be missing in the end
SAME = 1e-2  # [rad] descents nearer than this to each other have met

REACH_SLACK = 1e-3  # [m] more than any tolerance: a bound that can be trusted
FARTHEST = 10.0  # arm lengths: from there on only the direction to the target matters


class DescentStage(NamedTuple):
    """How the descents go on for a while."""

    convex: bool
    """On the bound of the measure that is quadratic in the errors: robust, and slow near the end."""
    smoothing: float
    """Of the measure [m]."""
    steps: int
    """At most."""
    kept: int
    """How many descents go on to the next stage."""


STAGES = (
    DescentStage(True, COARSE, steps=6, kept=36),
    DescentStage(False, FINE, steps=10, kept=12),
    DescentStage(False, FINE, steps=25, kept=3),
    DescentStage(False, FINE, steps=80, kept=1),
)


class ClosestSearch:
    """The search for one robot, frame and tool; immutable, and may be shared between threads."""

    def __init__(self, verifier: Verifier) -> None:
        """Take the arm; its joints are read when first needed."""
        self._verifier = verifier
        self._robot = verifier.robot
        self._circular = verifier.robot.unlimited & ~verifier.robot.sliding

    @functools.cached_property
    def reach(self) -> ReachBound:
        """What the tool cannot leave."""
        return ReachBound(self._verifier)

    @functools.cached_property
    def _chain(self) -> Chain:
        return Chain(self._robot, self._verifier.frame_id, self._verifier.tool)

    def solve(
        self, request: Request, outcome: Outcome, nearby: Sequence[Array], before: Effort | None = None
    ) -> IKResult:
        """The closest configuration, or the seed where none is asked for; a success after all if it is one.

        Where it is not known whether the target is reached, it is looked for in any case: the status does not depend on
        what is asked for.

        Args:
            request: what was asked for, with a pose or a position as its target.
            outcome: why it is not reached.
            nearby: configurations (dof,) within the limits to descend from, besides the seed and random ones.
            before: what was tried already; its counts go on.
        """
        verifier, target, seed = self._verifier, request.target, request.seed
        message = request.message(outcome.message)
        if not request.closest and outcome.status is not Status.NO_CONVERGENCE:
            return verifier.result(Candidate(seed, target, ""), outcome.status, message)
        found, effort = self.find(self.reach.pulled_in(target), [*nearby, seed], request.generator())
        if before is not None:
            effort = Effort(effort.iterations + before.iterations, effort.starts + before.starts, before.qp_solver)
        q = angles.nearest_copy(found, seed, self._circular)
        closest = Candidate(q, target, "found while looking for the closest configuration", effort=effort)
        result = verifier.select([closest], request, "")
        if result is not None and result.success:
            return result
        if not request.closest:
            return verifier.result(Candidate(seed, target, ""), outcome.status, message)
        return verifier.result(closest, outcome.status, message, touching=verifier.touching(q))

    def find(self, target: TargetPose, first: Sequence[Array], rng: np.random.Generator) -> tuple[Array, Effort]:
        """The configuration (dof,) within the limits of the least measure that descents end in, and what they took.

        Args:
            target: what to come close to.
            first: configurations (dof,) within the limits to descend from in any case.
            rng: draws the others.
        """
        measure = Measure(self._chain, target)
        drawn = seeds.random_configurations(self._robot, DRAWN, rng)
        state = begin(np.vstack([*first, drawn[np.argsort(measure.exact(drawn))[:STARTS]]]))
        starts, steps = len(state.q), 0
        for stage in STAGES:
            taken, state = descend(measure, state, stage, self._robot.lower, self._robot.upper)
            steps += taken * len(state.q)
            state = state.at(self._nearest(state.q, measure.exact(state.q), stage.kept))
        return state.q[0], Effort(steps, starts)

    def _nearest(self, q: Array, value: Array, most: int) -> NDArray[np.intp]:
        """The configurations with the least measure that differ from each other, the least one first."""
        chosen: list[int] = []
        for index in np.argsort(value).tolist():
            apart = angles.nearest_copy(q[chosen], q[index], self._circular) - q[index]
            if (np.abs(apart).max(axis=1) > SAME).all():
                chosen.append(index)
                if len(chosen) == most:
                    break
        return np.array(chosen)


class ReachBound:
    """A ball around the origin of joint 1 that the tool cannot leave: the links laid end to end."""

    def __init__(self, verifier: Verifier) -> None:
        """Add up the links; the radius is infinite when a sliding joint has no limits."""
        model, robot = verifier.robot.pin_model, verifier.robot
        lengths = [float(np.linalg.norm(model.jointPlacements[joint].translation)) for joint in range(2, model.njoints)]
        placed = model.frames[verifier.frame_id].placement
        tip = placed if verifier.tool is None else placed * verifier.tool
        lengths.append(float(np.linalg.norm(tip.translation)))
        lengths.extend(np.maximum(np.abs(robot.lower), np.abs(robot.upper))[robot.sliding].tolist())
        self._shoulder: Array = np.array(model.jointPlacements[1].translation)
        self._radius = sum(lengths)

    def exceeded(self, target: TargetPose) -> Outcome | None:
        """When the target is provably out of reach, whatever the joint angles."""
        if math.hypot(*(target.position - self._shoulder).tolist()) <= self._radius + REACH_SLACK:
            return None
        return Outcome(Status.UNREACHABLE, "the target is farther away than the arm is long")

    def pulled_in(self, target: TargetPose) -> TargetPose:
        """A target very far away, moved along the line of sight to where its errors are still exact to a micrometre."""
        away = target.position - self._shoulder
        distance = math.hypot(*away.tolist())
        if not distance > FARTHEST * self._radius:
            return target
        return target.moved_to(self._shoulder + away / distance * (FARTHEST * self._radius))


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
    """The distance of a configuration to a target, with its first and second derivatives, for many at once.

    The measure is |p| + w |a|: position error p [m], weight w [m/rad], rotation vector a of the orientation error
    [rad]. It has a kink where either vanishes, and its minima often lie there: the position exactly met, the
    orientation not, or the other way round. With |x| = sqrt(x x + e e) the kinks are smooth but sharp, and Newton's
    method overshoots.
    So the unit vectors u = p / |p| and v = a / |a| are kept as unknowns of their own, in which the equations u |p| = p
    are nearly linear: the primal-dual Newton method of Chan, Golub and Mulet (A nonlinear primal-dual method for total
    variation-based image restoration, SIAM J. Sci. Comput. 20(6), 1999). At a kink u and v are the multipliers.

    Second derivatives, for joint i at or before joint j (axes z, linear velocities l of the tool, both at unit rate):

        of the position                 z_i x l_j
        of the rotation, composed       (z_i x z_j) / 2, from the product of exponentials
        of the angle, by a rotation     (1 - n n^T) cot(angle / 2) / 2
    """

    def __init__(self, chain: Chain, target: TargetPose) -> None:
        """Take the target; a free orientation weighs nothing."""
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


class DescentState(NamedTuple):
    """What k descents go on with."""

    q: Array
    """(k, dof)."""
    duals: Duals | None
    """None for those that belong to `q`."""
    damping: Array
    """(k,)."""

    def at(self, rows: NDArray[np.intp]) -> DescentState:
        """Some of the descents."""
        duals = None if self.duals is None else Duals(*(column[rows] for column in self.duals))
        return DescentState(self.q[rows], duals, self.damping[rows])


def begin(q: Array) -> DescentState:
    """Descents from configurations (k, dof)."""
    return DescentState(q, None, np.full(len(q), DAMPING))


def descend(
    measure: Measure, state: DescentState, stage: DescentStage, lower: Array, upper: Array
) -> tuple[int, DescentState]:
    """The descents after the steps of a stage, and how many steps those were."""
    points = measure.points(state.q, stage.smoothing, state.duals, convex=stage.convex)
    duals = state.duals or Duals(points.position, points.rotation)
    curvature = _positive(points.hessian, stage)
    damping = state.damping
    best = [np.inf] * PATIENCE
    for taken in range(stage.steps):
        best.append(float(points.value.min()))
        if best[-1 - PATIENCE] - best[-1] < SETTLED:
            return taken, DescentState(points.q, duals, damping)
        step = bounded_step(points.q, points.gradient, curvature, damping, lower, upper)
        moved = np.clip(points.q + step, lower, upper)
        step = moved - points.q
        new_duals = duals_after(points, duals, step)
        new = measure.points(moved, stage.smoothing, new_duals, convex=stage.convex)
        predicted = -(points.gradient * step).sum(1) - 0.5 * ((step[:, None] @ curvature)[:, 0] * step).sum(1)
        ratio = (points.value - new.value) / np.maximum(predicted, 1e-300)
        better = new.value < points.value
        points = points.updated(better, new)
        duals = Duals(*(np.where(better[:, None], new, old) for old, new in zip(duals, new_duals, strict=True)))
        curvature = np.where(better[:, None, None], _positive(new.hessian, stage), curvature)
        damping = np.where(ratio > GOOD_MODEL, np.maximum(LESS_DAMPING * damping, LEAST_DAMPING), damping)
        damping = np.where(ratio < BAD_MODEL, np.minimum(MORE_DAMPING * damping, MOST_DAMPING), damping)
    if stage.convex:  # its damping and vectors mean little to the measure itself
        return stage.steps, begin(points.q)
    return stage.steps, DescentState(points.q, duals, damping)


def _positive(hessian: Array, stage: DescentStage) -> Array:
    """Hessians with their eigenvalues made positive: saddle points repel."""
    if stage.convex:
        return hessian
    values, vectors = np.linalg.eigh(hessian)
    return np.asarray((vectors * np.abs(values)[:, None]) @ vectors.transpose(0, 2, 1))


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
