"""`Members`: what configurations of one target have in common, however its set was found; each is verified."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import JacokinError
from jacokin.ik.seeds import seed_within_limits
from jacokin.ik.solutions.curve_arm import DIMENSIONS, CurveProblem
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Candidate, Verifier
from jacokin.kernels.branches import SEED_STEPS
from jacokin.kernels.solution_set.curve import RESIDUAL, RESOLUTION
from jacokin.kernels.solution_set.starts import STARTING_STEPS
from jacokin.kernels.tolerances import (
    ALONE_PIVOT,
    CLOSURE,
    FIRST_SEED_WEIGHT,
    LEAST_SEED_WEIGHT,
    SEED_STEP,
    SEED_WEIGHT_FACTOR,
    SMALLEST_PIVOT,
)
from jacokin.model import angles
from jacokin.model.angles import TURN
from jacokin.model.many_configurations import TargetRows
from jacokin.model.robot import Robot

#: [rad] distance in joint space between guesses along a track.
GUESS_SPACING = 0.05


class CurveTrack:
    """A run of configurations; angles are in any 2 pi equivalent, and the coordinate counts chords between nodes.

    Attributes:
        start: least value of the parameter [rad].
        stop: largest value [rad].
        nodes: (m, 14) points and unit tangents.
    """

    __slots__ = ("_problem", "_turns", "nodes", "start", "stop")

    def __init__(self, problem: CurveProblem, nodes: Array, least: float) -> None:
        """Take the nodes of a piece, and the least value of the parameter: by whole turns it starts from there on."""
        self._problem, self.nodes = problem, nodes
        first, last = nodes.item(0, problem.arm.parameter), nodes.item(-1, problem.arm.parameter)
        if last - first < RESOLUTION:
            last = first
        self._turns = -TURN * math.floor((first - least + RESOLUTION) / TURN) if math.isfinite(least) else 0.0
        self.start, self.stop = first + self._turns, last + self._turns

    def at(self, parameter: float) -> Array:
        """(dof,) the configuration where the parameter has a value in [start, stop]."""
        nodes, index = self.nodes, self._problem.arm.parameter
        if parameter <= self.start or parameter >= self.stop:
            return self._joints(nodes[0 if parameter <= self.start else -1, :DIMENSIONS])
        p = parameter - self._turns
        chord = int(np.searchsorted(nodes[:, index], p)) - 1
        chord = min(max(chord, 0), len(nodes) - 2)
        return self._joints(self._problem.at(nodes[chord : chord + 2], p))

    def nearest(self, seed: Array, lower: Array, upper: Array) -> tuple[float, Array] | None:
        """Parameter and configuration (dof,) nearest to a seed (dof,), in the equivalents within the limits (dof,).

        Where the parameter nearly stands still, as along the circle of a nearly straight wrist, it may pass an end.
        """
        x = self._problem.nearest_on(self.nodes, seed)
        if x is None:
            return None
        p, parameters = x.item(self._problem.arm.parameter), self.nodes[:, self._problem.arm.parameter] + self._turns
        p += TURN * round((0.5 * (self.start + self.stop) - p) / TURN)
        low, high = min(self.start, parameters.min()), max(self.stop, parameters.max())
        return float(np.clip(p, low, high)), np.clip(self._joints(x), lower, upper)

    def configurations(self, coordinates: Array) -> Array:
        """(m, dof) at coordinates (m,), as exact as `guesses`."""
        return self._joints(_points_at(self.nodes, coordinates))

    def polyline(self) -> tuple[Array, Array]:
        """Values of the parameter (m,) in order, and configurations there (m, dof), as exact as `guesses`."""
        return polylines([self])[:2]

    def point(self, coordinate: float) -> tuple[float, Array]:
        """Parameter and configuration (dof,) at a coordinate, exactly."""
        if self.stop > self.start:
            p = _number_at(self.nodes, coordinate, self._problem.arm.parameter) + self._turns
            p = min(max(p, self.start), self.stop)
            return p, self.at(p)
        (x,) = _points_at(self.nodes, np.array([coordinate]))
        return self.start, self._joints(x)

    def configuration(self, coordinate: float) -> Array:
        """The configuration (dof,) at a coordinate, exactly."""
        return self.point(coordinate)[1]

    def _joints(self, x: Array) -> Array:
        """(..., dof) of points (..., 7)."""
        return x[..., : self._problem.arm.dof]


def polylines(tracks: Sequence[CurveTrack], spacing: float = GUESS_SPACING) -> tuple[Array, Array, NDArray[np.intp]]:
    """Values of the parameter (m,) and configurations there (m, dof) along tracks, one after another, in order.

    At most a spacing apart [rad], as exact as `guesses`. And where each begins, with the end of the last (tracks + 1,).
    """
    _, points, begins = _spread(tracks, spacing)
    arm = tracks[0]._problem.arm
    p = points[:, arm.parameter].copy()
    for track, start, end in zip(tracks, begins[:-1].tolist(), begins[1:].tolist(), strict=True):
        p[start:end] = np.clip(np.maximum.accumulate(p[start:end]) + track._turns, track.start, track.stop)
    return p, points[:, : arm.dof], begins


def guesses(tracks: Sequence[CurveTrack]) -> tuple[Array, Array, NDArray[np.intp]]:
    """Coordinates (m,) along tracks, one after another, each in order, and configurations there (m, dof).

    To about 1e-4 rad; ends and nodes exactly. And where each begins, with the end of the last (tracks + 1,).
    """
    places, points, begins = _spread(tracks)
    lengths = [len(track.nodes) for track in tracks]
    return places - np.repeat(np.cumsum(lengths) - lengths, np.diff(begins)), tracks[0]._joints(points), begins


def places_along(lengths: Array, spacing: float) -> Array:
    """Places (m,) at most a spacing apart along chords of lengths (n,): the number of a chord and a share of it, added.

    Without the end of the last one.
    """
    counts = np.maximum(1, np.ceil(lengths / spacing).astype(np.intp))
    chord = np.repeat(np.arange(len(counts)), counts)
    return np.asarray(chord + (np.arange(len(chord)) - (np.cumsum(counts) - counts)[chord]) / counts[chord])


def _spread(tracks: Sequence[CurveTrack], spacing: float = GUESS_SPACING) -> tuple[Array, Array, NDArray[np.intp]]:
    """Places (m,) along the nodes of all tracks, and points there (m, 7), by the cubics between the nodes.

    And where each track begins, with the end of the last (tracks + 1,).
    """
    nodes, ends = np.concatenate([track.nodes for track in tracks]), np.cumsum([len(track.nodes) for track in tracks])
    lengths = np.linalg.norm(np.diff(nodes[:, :DIMENSIONS], axis=0, append=nodes[-1:, :DIMENSIONS]), axis=1)
    lengths[ends - 1] = 0.0  # no chord begins there
    places = places_along(lengths, spacing)
    return places, _points_at(nodes, places), np.append(0, np.searchsorted(places, ends))


def _points_at(nodes: Array, places: Array) -> Array:
    """Points (m, 7) at places (m,) along nodes (n, 14), by the cubics between these."""
    node = places.astype(np.intp)
    a, b, u = nodes[node], nodes[np.minimum(node + 1, len(nodes) - 1)], (places - node)[:, np.newaxis]
    v, length = 1.0 - u, np.linalg.norm(b[:, :DIMENSIONS] - a[:, :DIMENSIONS], axis=1)[:, np.newaxis]
    return np.asarray(
        (1.0 + 2.0 * u) * v * v * a[:, :DIMENSIONS]
        + u * v * v * length * a[:, DIMENSIONS:]
        + u * u * (3.0 - 2.0 * u) * b[:, :DIMENSIONS]
        - u * u * v * length * b[:, DIMENSIONS:]
    )


def _number_at(nodes: Array, place: float, index: int) -> float:
    """One number of `_points_at` at one place, in a tenth of the time."""
    node = int(place)
    a, b, u = nodes[node].tolist(), nodes[min(node + 1, len(nodes) - 1)].tolist(), place - node
    v, length, tangent = 1.0 - u, math.dist(a[:DIMENSIONS], b[:DIMENSIONS]), DIMENSIONS + index
    at_a, at_b = (
        (1.0 + 2.0 * u) * a[index] + u * length * a[tangent],
        (3.0 - 2.0 * u) * b[index] - v * length * b[tangent],
    )
    return float(v * v * at_a + u * u * at_b)


#: [m] and [rad]; the closure of members where curves meet on limits, and `CLOSURE` is not to be had.
LARGEST_MISS = 1e-7
#: Share by which a member beside a seed is farther than the least step to the target where curves are nearly straight.
STRAIGHT = 0.05


class LostMemberError(JacokinError):
    """A point of a curve that does not reach the target within the limits, though both ends of its piece do."""


@dataclass(frozen=True, slots=True, eq=False)
class Members:
    """One target of one arm."""

    verifier: Verifier
    index: int | None
    """Which joint is the parameter; None for a free axis, and at a pose of six joints."""
    target: TargetPose
    seed: Array
    """(dof,) unlimited joints take the 2 pi copy nearest to this [rad]."""

    @property
    def robot(self) -> Robot:
        """The arm."""
        return self.verifier.robot

    def parameter(self, q: Array) -> float:
        """The parameter [rad] of a configuration (dof,)."""
        free = self.target.free_axis
        if free is not None:
            return free.parameter_of(self.verifier.tool_pose(q).rotation)
        return math.nan if self.index is None else float(q[self.index])

    def candidate(self, q: Array, parameter: float) -> Candidate:
        """A member (dof,) in the copies that are wanted, with its parameter [rad] in the range of the target."""
        free = self.target.free_axis
        if free is None:
            p = self.parameter(q)  # the joint itself, in its copy
        else:
            p = float(angles.wrap_to_pi(parameter)) if free.full_turn else self.target.nearest_angle(parameter)
        return Candidate(q, self.target.at(p), f"parameter {p:.6g} rad", p)

    def near(self, seed: ArrayLike | None) -> Array:
        """A seed (dof,) moved inside the limits [rad]; None for the seed of the set.

        Raises:
            InvalidInputError: malformed, or more than 1e6 rad from zero.
        """
        return self.seed if seed is None else seed_within_limits(self.robot, seed)[0]

    def copies(self, q: Array, seed: Array) -> Array:
        """(..., dof) the copies within the limits nearest to a seed (dof,)."""
        return angles.into_limits(angles.nearest_copy(q, seed), self.robot.lower, self.robot.upper)

    def on_limits(self, q: Array, snap: float | None = None) -> Array:
        """Configurations (..., dof) moved onto the limits they are past by rounding, or what they are inexact [rad].

        NaN where a joint that has more than a turn of room is farther outside: others end their interval there.
        """
        inside = np.clip(q, self.robot.lower, self.robot.upper)
        far = np.abs(inside - q) > (self.verifier.options.limit_snap if snap is None else snap)
        inside[(far & self.wide).any(axis=-1)] = np.nan
        return inside

    @property
    def wide(self) -> NDArray[np.bool_]:
        """(dof,) limited joints that have several copies of some angles within their limits."""
        room = self.robot.upper - self.robot.lower
        return np.isfinite(room) & (room >= TURN)

    def verified(self, q: Array, parameter: float) -> Array:
        """A configuration (dof,) that reaches the target and is within the limits, exactly.

        Raises:
            LostMemberError: it does not, which is not known to happen but where curves meet on a limit.
        """
        errors = self.verifier.measure(q, self.target.at(parameter))
        if max(errors) > CLOSURE:  # a joint that is near its limit all along, moved onto it
            q, _ = self._settled(q, parameter, turning=False)
            errors = self.verifier.measure(q, self.target.at(parameter))
        if max(errors) > LARGEST_MISS or not self.robot.within_limits(q):
            raise LostMemberError(
                f"internal error: a member of a curve misses its target by {errors[0]:.3g} m and "
                f"{errors[1]:.3g} rad, please report it"
            )
        return q

    def on_track(self, track: CurveTrack, parameter: float, q: Array, seed: Array) -> Array:
        """A configuration (dof,) of a track, in the copies nearest to a seed (dof,), verified; or the one beside it.

        Raises:
            LostMemberError: there is none anywhere near.
        """
        try:
            return self.verified(self.copies(q, seed), parameter)
        except LostMemberError as error:
            lost = error
        p, rows = track.polyline()
        for index in np.argsort(np.abs(p - parameter), kind="stable").tolist():
            try:
                return self.verified(self.copies(rows[index], seed), float(p[index]))
            except LostMemberError as error:
                lost = error
        raise lost

    def led_to(self, tracks: Sequence[CurveTrack], parameters: Array, guesses: Array) -> tuple[Array, Array]:
        """Values of the parameter (n,) and members (n, dof) near to the seed that guesses (n, dof) on tracks lead to.

        Raises:
            LostMemberError: there is none anywhere near to one of them.
        """
        free, chain, count = self.target.free_axis, self.verifier.chain, len(guesses)
        axis = None if free is None else np.broadcast_to(free.axis, (count, 3))
        goal = TargetRows(np.broadcast_to(self.target.matrix, (count, 4, 4)), axis)
        x, _ = chain.close(guesses if free is None else np.column_stack([guesses, parameters]), goal)
        rows = x[:, : chain.dof] = self.copies(x[:, : chain.dof], self.seed)
        if free is not None:
            low, high = np.array([(track.start, track.stop) for track in tracks]).T
            x[:, chain.dof] = parameters = x[:, chain.dof].clip(low, high)
        elif self.index is not None:
            parameters = rows[:, self.index]
        for row in np.flatnonzero(np.maximum(*chain.errors(x, goal)) > CLOSURE).tolist():  # clipped, or a singular arm
            rows[row] = self.on_track(tracks[row], parameters.item(row), guesses[row], self.seed)
            if free is not None:
                parameters[row] = self.parameter(rows[row])
        return parameters, rows

    def beside(self, q: Array, parameter: float, within: float = math.inf) -> tuple[Array, float] | None:
        """The member (dof,) beside a configuration nearby, and its parameter [rad]: the nearest, or one steps lead to.

        Args:
            q: (dof,) [rad].
            parameter: [rad].
            within: how far a member that is known is [rad].

        Returns:
            None where none is much nearer than within.

        Raises:
            LostMemberError: they lead to none.
        """
        turning = self.target.free_axis is not None
        try:
            nearest = self._weighted(q, parameter, within, turning=turning)
            return None if nearest is None else (self.verified(*nearest), nearest[1])
        except LostMemberError:
            q, parameter = self._settled(q, parameter, turning=turning)
            return self.verified(q, parameter), parameter

    def is_next(self, q: Array, seed: Array, parameter: float) -> bool:
        """Whether a member (dof,) is as near to a seed (dof,), a little beside it, as any can be where none meet."""
        error, moving = self._missing(seed, parameter, turning=self.target.free_axis is not None)
        step = _least_step(moving, error)
        left, way = np.abs(moving @ step - error).max(), np.linalg.norm(step)
        return bool(
            left <= STRAIGHT * np.abs(error).max()
            and np.linalg.norm(q - seed) <= (1.0 + STRAIGHT) * np.linalg.norm(step[: len(q)])
            and np.linalg.eigvalsh(moving @ moving.T)[0] >= ALONE_PIVOT * way * way
        )

    def _settled(self, q: Array, parameter: float, *, turning: bool) -> tuple[Array, float]:
        """A configuration (dof,) brought nearer to the target within the limits; its parameter too, if it is turning.

        By damped steps of the joints that are not on a limit, or move off it (Levenberg and Marquardt).
        """
        dof, lower, upper = len(q), self.robot.lower, self.robot.upper
        for _ in range(STARTING_STEPS):
            error, moving = self._missing(q, parameter, turning=turning)
            if np.abs(error).max() < RESIDUAL:
                break
            step = _least_step(moving, error)
            stuck = ((q <= lower) & (step[:dof] < 0.0)) | ((q >= upper) & (step[:dof] > 0.0))
            if stuck.any():
                moving[:, :dof][:, stuck] = 0.0
                step = _least_step(moving, error)
            q = np.clip(q + step[:dof], lower, upper)
            if turning:
                parameter = self.target.nearest_angle(parameter + float(step[dof]))
        return self.copies(q, q), parameter

    def _weighted(self, seed: Array, parameter: float, within: float, *, turning: bool) -> tuple[Array, float] | None:
        """A configuration (dof,) within the limits no farther from a seed than any member, and nearly at the target.

        What makes the square of what is missing and a weight times that of the way from the seed least: the smaller the
        weight, the nearer it is to the target. Next to where curves meet, least steps to the target go farther.

        For a member the sum is the weight times the square of its way: no member is nearer than what the least sum
        tells, and None is returned where that is not much less than within [rad].
        """
        dof, lower, upper = len(seed), self.robot.lower, self.robot.upper
        q, weight = seed, FIRST_SEED_WEIGHT
        while weight >= LEAST_SEED_WEIGHT:
            held, moved = np.zeros(dof + turning, dtype=np.bool_), math.inf
            for _ in range(SEED_STEPS):
                error, moving = self._missing(q, parameter, turning=turning)
                way = float(np.linalg.norm(q - seed))
                least = math.hypot(way, float(np.linalg.norm(error)) / math.sqrt(weight))
                if moved <= STRAIGHT * way and (1.0 + STRAIGHT) * least >= within:
                    return None
                moving[:, held] = 0.0
                normal, right = moving.T @ moving, moving.T @ error
                normal[np.diag_indices(dof)] += weight
                right[:dof] += weight * (seed - q)
                right[held] = 0.0
                step = np.linalg.solve(normal + SMALLEST_PIVOT * np.eye(len(right)), right)
                inside = np.clip(q + step[:dof], lower, upper)
                held[:dof] |= inside != q + step[:dof]
                q, moved = inside, float(np.linalg.norm(inside - q))
                if turning:
                    parameter = self.target.nearest_angle(parameter + float(step[dof]))
                if moved < SEED_STEP:
                    break
            weight *= SEED_WEIGHT_FACTOR
        return self.copies(q, q), parameter

    def _missing(self, q: Array, parameter: float, *, turning: bool) -> tuple[Array, Array]:
        """The motion (6,) of the tool that is missing, and what each joint adds to it (6, dof), and the free axis."""
        pose, verifier = self.target.at(parameter), self.verifier
        error = pin.log6(verifier.tool_pose(q).actInv(pin.SE3(pose.rotation, pose.position))).vector
        moving = self.robot.jacobian(q, frame=verifier.frame, reference="local")
        if verifier.tool is not None:
            moving = verifier.tool.toActionMatrixInverse() @ moving
        if turning:
            assert self.target.free_axis is not None
            moving = np.column_stack([moving, np.concatenate([np.zeros(3), -self.target.free_axis.axis])])
        return error, moving


def _least_step(moving: Array, error: Array) -> Array:
    """The least step (k,) that takes an error (6,) away, damped; moving (6, k) is what each of its numbers does."""
    damping = max(float(np.abs(error).max()) ** 2, SMALLEST_PIVOT)
    return np.asarray(moving.T @ np.linalg.solve(moving @ moving.T + damping * np.eye(len(error)), error))
