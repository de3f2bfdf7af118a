"""Targets on the edge of reach, where the curves of a family have shrunk to points: the arm stretched out, say.

No value of the parameter that is solved at meets such a point but by chance. Where nothing was found, the target is
moved a little to and fro: on one side of the edge there are curves. As the target moves on they shrink, and the point
they shrink to is found by Newton's method: with errors e(x) of the configuration x from the target, Jacobian J(x) and
the direction d of the move,

    e(x) + s d = 0,    J(x)^T u = 0,    d.u = 1.

It reaches the target itself where s = 0; u is the normal of the edge.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.closest import ReachBound
from jacokin.ik.diagnosis import LimitExcess
from jacokin.ik.families.curves import CurveProblem
from jacokin.ik.families.members import MEMBER_CLOSURE
from jacokin.ik.options import ORIENTATION_TOLERANCE, POSITION_TOLERANCE
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Verifier
from jacokin.model import angles
from jacokin.model.many_configurations import Chain, Placements, angle_and_axis, cross

#: [m] and [rad] by which a target is moved: the curves of seven joints shrink slowly along joint 3 and lead to the
#: edge from near it only; those about a free axis must be long enough to be found between two slices.
MOVE_SEVEN, MOVE_FREE_AXIS = 1e-4, 1e-3
#: Directions that no structured target has, so that each crosses the edge, besides the way from the shoulder; and how
#: many nodes of each curve to start from. The second one is for where the first one leads to no point, or runs along
#: the edge.
MOVES = (((0.42, -0.28, 0.52, 0.35, 0.54, -0.25), 5), ((-0.17, 0.62, 0.23, 0.49, -0.33, 0.43), 8))
TINY_MOVE = 1e-9  # [m] and [rad]: for points on curves of the target itself
#: [m] and [rad]: curves that pass each other at a distance d nearly meet with an error of its square.
MEETING_CLOSURE = 1e-14
SHORTEST = 1e-9  # [m] away from the shoulder, to have a direction
#: [m] and [rad]; a target that is missed by no more is on the edge.
ON_EDGE = min(POSITION_TOLERANCE, ORIENTATION_TOLERANCE)
#: Starts of Newton's method at most, and its steps.
STARTS, STEPS = 160, 16
#: [rad] the longest step, and a step after which nothing changes any more.
LONGEST_STEP, SETTLED = 0.5, 1e-7
#: Least cosine between the move and the normal to start with.
ALONG_EDGE = 1e-4
#: Relative size of singular values that are zero: on some edges there are curves, which the equations leave free.
NO_CHANGE = 1e-8
#: The same of directions in which the tool is taken not to move, and Gauss-Newton steps in the others.
NO_MOTION, LAST_STEPS = 1e-4, 10
#: Smallest singular value along curves that reach targets no farther from the edge than ON_EDGE, and where it is taken.
STUCK, ALONG_ARC = 1e-3, 5
#: The second smallest one, where the tool nearly cannot move in two directions: members are nearly a surface there, and
#: small curves may be missed. Smaller ones are rounding.
STUCK_TWICE = 1e-8, 1e-3
#: The same of a singular member, as a share of that along the curves.
SINGULAR = 0.1
#: [rad] a joint past its limit by no more may be on it.
NEAR_LIMIT = 1e-3
#: [rad] a joint of a member this near to a limit is on it: about the square root of rounding.
ON_LIMIT = 1e-7
#: [rad] points nearer to each other are one.
SAME_POINT = 1e-2
#: [m] and [rad] by which single points miss the target by rounding alone.
EXACT_POINT = 2e-14
#: [rad] how far from a nearly singular configuration others are looked for: this times how far the tool moves there,
#: which is about half the size of a small curve; but no less than the second one. They close so well [m] and [rad].
AROUND, SHORTEST_WAY, BESIDE_CLOSURE = 10.0, 1e-3, 1e-12


class Sight(NamedTuple):
    """What was found beside the curves."""

    points: list[LimitExcess]
    """Configurations that reach the target all alone, those that exceed limits least first."""
    parameters: list[float]
    """Where there are curves that were missed: to be solved at too [rad]."""


class Edge:
    """What looks for such points, for one arm; immutable, and may be shared between threads.

    Attributes:
        chain: of the arm, for many configurations at once.
    """

    __slots__ = ("_lower", "_reach", "_shoulder", "_snap", "_upper", "chain")

    def __init__(self, verifier: Verifier) -> None:
        """Take the arm."""
        self.chain = Chain(verifier.robot, verifier.frame_id, verifier.tool)
        self._reach, self._snap = ReachBound(verifier), verifier.options.limit_snap
        robot = verifier.robot
        self._lower, self._upper = robot.lower, robot.upper
        data = robot.pin_model.createData()
        pin.forwardKinematics(robot.pin_model, data, np.zeros(robot.dof))
        self._shoulder = data.oMi[2].translation.copy()  # joint 2 stays where it is, on axis 1

    def look(self, problem: CurveProblem) -> Sight:
        """What reaches a target for which no curves were found."""
        if self._reach.exceeded(TargetPose(problem.T)) is not None:
            return Sight([], [])
        axis = axis_in_base(problem)
        away = problem.T[:3, 3] - self._shoulder
        outward = np.append(away / max(float(np.linalg.norm(away)), SHORTEST), np.zeros(3))
        size = MOVE_SEVEN if axis is None else MOVE_FREE_AXIS
        for direction, number in MOVES:
            found: list[Array] = []
            for move in (size * (outward + direction), -size * (outward + direction)):
                T = problem.T.copy()
                T[:3, :3], T[:3, 3] = pin.exp3(move[3:]) @ T[:3, :3], T[:3, 3] + move[:3]
                nodes = [_spread(arc, number) for arc in problem._replace(T=T).find().arcs]
                if nodes:
                    found.append(np.vstack(nodes)[:STARTS])
                    missed = self._missed(found[-1], problem.T, axis)
                    if missed:
                        return Sight([], missed)
                    found[-1] = self._shrunk(found[-1], move, problem.T, axis)
            points = self.fitted(np.vstack(found), problem) if found else []
            if points:
                break
        return Sight(points, [])

    def beside(self, x: Array, problem: CurveProblem, way: float | None = None) -> Array:
        """Rows (m, 7) that reach the target some way from singular or nearly singular ones (k, 7) [rad].

        Curves through these lead there; by default so far as leads from one side of a small curve to another.
        """
        if not len(x):
            return x
        axis = axis_in_base(problem)
        _, jacobian = self.linearised(x, problem.T, axis)
        _, sizes, motions = np.linalg.svd(jacobian)
        ways = np.maximum(AROUND * sizes[:, 5], SHORTEST_WAY) if way is None else np.full(len(x), way)
        stuck = np.hstack([sizes, np.zeros((len(x), 1))]) < NO_MOTION
        rows, motion = np.nonzero(stuck)
        step = ways[rows, np.newaxis] * motions[rows, motion]
        start, length = np.vstack([x[rows], x[rows]]), np.concatenate([ways[rows], ways[rows]])
        ahead = start + np.vstack([step, -step])
        ahead, closure = self._settled(ahead, np.zeros(ahead.shape, dtype=np.bool_), problem.T, axis)
        moved = np.linalg.norm(ahead - start, axis=1)
        return np.asarray(ahead[(closure < BESIDE_CLOSURE) & (moved > 0.5 * length) & (moved < 2.0 * length)])

    def holds(self, arcs: list[Array], problem: CurveProblem) -> bool:
        """Whether curves (m, 14) are as good as points: the tool can hardly move in some direction all along."""
        rows = [_spread(arc, ALONG_ARC) for arc in arcs]
        return not rows or bool((self.mobility(np.vstack(rows), problem) < STUCK).all())

    def nearly_stuck_twice(self, x: Array, problem: CurveProblem) -> bool:
        """Whether the tool nearly cannot move in two directions at any of the rows (k, 7), though not exactly there."""
        if not len(x):
            return False
        second = self._freedoms(x, axis_in_base(problem))[:, 4]
        exact = x[second <= STUCK_TWICE[0]]  # others may be the same, known to the root of rounding
        return any(
            not (np.abs(angles.wrap_to_pi(exact - row)).max(axis=1) <= SAME_POINT).any()
            for row in x[(second > STUCK_TWICE[0]) & (second < STUCK_TWICE[1])]
        )

    def meeting_points(self, x: Array, problem: CurveProblem) -> Array:
        """Points near rows (k, 7) of curves in which two curves of a target meet."""
        points, axis = x[:0], axis_in_base(problem)
        for direction, _ in MOVES if len(x) else ():
            points = self._shrunk(x, TINY_MOVE * np.array(direction), problem.T, axis)
            points = points[np.abs(self.linearised(points, problem.T, axis)[0]).max(axis=1) < MEETING_CLOSURE]
            if len(points):
                break
        return points

    def doubtful(self, x: Array, least_motion: Array, arcs: list[Array], problem: CurveProblem) -> Array:
        """Those of the rows (k, 7), members, which a curve may end at, cross another at, or touch a limit at.

        Singular ones, where the tool can hardly move in some direction, unless it can no better all along the curves
        (m, 14); and those with a joint on a limit. A lower bound of how far it moves (k,) spares most of them the look.
        """
        stuck: NDArray[np.bool_] = least_motion < STUCK
        limited = np.isfinite(problem.arm.limits[0])
        away = angles.wrap_to_pi(x[:, limited] - problem.arm.limits[:, np.newaxis, limited])
        on_limit: NDArray[np.bool_] = np.asarray((np.abs(away) < ON_LIMIT).any(axis=(0, 2)))
        if stuck.any():
            mobility = self.mobility(x[stuck], problem)
            usual = SINGULAR * self._median_mobility(arcs, problem) if arcs and (mobility < STUCK).any() else np.inf
            stuck[stuck] = mobility < min(STUCK, usual)
        if on_limit.any():
            q = self.inside(x)[:, : self.chain.dof]
            margin = np.minimum(q - self._lower, self._upper - q).min(axis=1)
            within = np.abs(angles.wrap_to_pi(q - x[:, : self.chain.dof])).max(axis=1) < ON_LIMIT
            on_limit = within & (margin < ON_LIMIT)
        doubtful: Array = x[stuck | on_limit]
        return doubtful

    def _median_mobility(self, arcs: list[Array], problem: CurveProblem) -> float:
        """That of points along curves (m, 14)."""
        return float(np.median(self.mobility(np.vstack([_spread(arc, ALONG_ARC) for arc in arcs]), problem)))

    def inside(self, x: Array) -> Array:
        """Rows (k, 7) with the joints moved within their limits."""
        dof = self.chain.dof
        return np.hstack([angles.into_limits(x[:, :dof], self._lower, self._upper), x[:, dof:]])

    def mobility(self, x: Array, problem: CurveProblem) -> Array:
        """How far the tool moves where it can least, at rows (k, 7): smallest singular values (k,)."""
        return self._mobility(x, axis_in_base(problem))

    def _mobility(self, x: Array, axis: Array | None) -> Array:
        """See `mobility`."""
        return self._freedoms(x, axis)[:, 5]

    def _freedoms(self, x: Array, axis: Array | None) -> Array:
        """Singular values (k, 6), largest first."""
        placed = self.chain.placements(x[:, : self.chain.dof])
        return np.asarray(np.linalg.svd(_jacobian(placed, axis), compute_uv=False))

    def _missed(self, x: Array, T: Array, axis: Array | None) -> list[float]:
        """Parameters on curves about a free axis that were missed between two slices; from rows (k, 7) near by."""
        if axis is None:
            return []
        x, closure = self._settled(x, np.zeros(x.shape, dtype=np.bool_), T, axis)
        regular = self._mobility(x, axis) > NO_MOTION
        missed: list[float] = x[(closure < MEMBER_CLOSURE) & regular, 6].tolist()
        return missed

    def fitted(self, x: Array, problem: CurveProblem, near: float = SAME_POINT) -> list[LimitExcess]:
        """Those of the rows (k, 7) that reach the target, joints near to their limits moved onto them.

        Those that miss the target by rounding alone are one where they are this near to each other [rad]; others, known
        to the root of rounding, where they are SAME_POINT near.
        """
        dof, lower, upper, free, T = self.chain.dof, self._lower, self._upper, problem.free_axis, problem.T
        axis = axis_in_base(problem)
        if free is not None:
            low, high = (-np.inf, np.inf) if free.full_turn else free.range
            lower, upper = np.append(lower, low), np.append(upper, high)
        inside = angles.into_limits(x, lower, upper)
        over = np.abs(angles.wrap_to_pi(x - inside))
        held = (over <= NEAR_LIMIT) & ((inside == lower) | (inside == upper))
        rows = np.vstack([x, np.where(held, inside, x)])
        rows, closure = self._settled(rows, np.vstack([np.zeros_like(held), held]), T, axis)
        inside = angles.into_limits(rows, lower, upper)
        over = np.abs(angles.wrap_to_pi(rows - inside))
        over[over <= self._snap] = 0.0
        points: list[LimitExcess] = []
        same: list[float] = []  # how far from each of them others are the same
        for i in np.lexsort([closure, over.max(axis=1)]).tolist():
            q, own = inside[i, :dof], near if closure[i] <= EXACT_POINT else SAME_POINT
            known = any(
                np.abs(angles.wrap_to_pi(point.q - q)).max() <= max(own, other)
                for point, other in zip(points, same, strict=True)
            )
            if closure[i] <= ON_EDGE and not over[i, dof:].any() and not known:
                p = float(inside[i, problem.arm.parameter])
                p = float(angles.wrap_to_pi(p)) if problem.closed else p
                points.append(LimitExcess(q, over[i, :dof], p))
                same.append(own)
        return points

    def _settled(self, x: Array, held: NDArray[np.bool_], T: Array, axis: Array | None) -> tuple[Array, Array]:
        """Rows (k, 7) brought to the target as far as the tool moves, but for what is held; and their closures (k,)."""
        for _ in range(LAST_STEPS):
            error, jacobian = self.linearised(x, T, axis)
            inverse = np.linalg.pinv(np.where(held[:, None], 0.0, jacobian), rcond=NO_MOTION)
            x = x + (inverse @ error[:, :, None])[:, :, 0]
        error, _ = self.linearised(x, T, axis)
        return x, np.maximum(np.linalg.norm(error[:, :3], axis=1), np.linalg.norm(error[:, 3:], axis=1))

    def _shrunk(self, x: Array, move: Array, T: Array, axis: Array | None) -> Array:
        """Where curves shrink to points as the target moves on, by Newton's method from rows (k, 7).

        Args:
            x: configurations that reach the moved target; the parameter last where there is a free axis.
            move: (6,) by how much it was moved, in the base [m and rad].
            T: (4, 4) target.
            axis: (3,) the free axis in the base.
        """
        error, jacobian = self.linearised(x, T, axis)
        size = float(np.linalg.norm(move))
        d = move / size
        u = np.linalg.svd(jacobian)[0][:, :, 5]
        along = u @ d
        along = np.where(np.abs(along) < ALONG_EDGE, ALONG_EDGE, along)
        z = np.hstack([x, np.full((len(x), 1), size), u / along[:, None]])
        moving = np.arange(len(z))
        for _ in range(STEPS):
            s, u = z[moving, 7:8], z[moving, 8:]
            system = np.zeros((len(moving), 14, 14))
            system[:, :6, :7], system[:, :6, 7], system[:, 13, 8:] = jacobian, -d, d
            system[:, 6:13, :7], system[:, 6:13, 8:] = self._slopes_of(jacobian, u), jacobian.transpose(0, 2, 1)
            rest = np.hstack([error + s * d, -np.einsum("ki,kij->kj", u, jacobian), 1.0 - (u @ d)[:, None]])
            step = (np.linalg.pinv(system, rcond=NO_CHANGE) @ rest[:, :, None])[:, :, 0]
            longest = np.abs(step[:, :7]).max(axis=1)
            z[moving] += step / np.maximum(1.0, longest / LONGEST_STEP)[:, None]
            moving = moving[longest > SETTLED]
            if len(moving) == 0:
                break
            error, jacobian = self.linearised(z[moving, :7], T, axis)
        return z[:, :7]

    def linearised(self, x: Array, T: Array, axis: Array | None) -> tuple[Array, Array]:
        """Errors (k, 6) of rows (k, 7), position and orientation, and how they shrink with each angle (k, 6, 7)."""
        placed, goal = self.chain.placements(x[:, : self.chain.dof]), T[:3, :3]
        if axis is not None:
            goal = np.array([pin.exp3(p * axis) for p in x[:, 6].tolist()]) @ goal
        angle, about = angle_and_axis(goal @ placed.rotation.transpose(0, 2, 1))
        error = np.hstack([T[:3, 3] - placed.position, angle[:, None] * about])
        return error, _jacobian(placed, axis)

    def _slopes_of(self, jacobian: Array, normal: Array) -> Array:
        """Derivatives (k, 7, 7) of J^T u by the angles: column j for angle j.

        For joints i <= j the linear velocities l and axes z change as dl_i/dq_j = dl_j/dq_i = z_i x l_j, dz_j/dq_i =
        z_i x z_j; a free axis changes nothing and stays.
        """
        linear, angular = jacobian[:, :3].transpose(0, 2, 1), jacobian[:, 3:].transpose(0, 2, 1)
        joints = np.arange(7)
        first, last = np.minimum.outer(joints, joints), np.maximum.outer(joints, joints)
        slopes = (cross(normal[:, None, :3], angular) @ linear.transpose(0, 2, 1))[:, first, last]
        turned = (cross(normal[:, None, 3:], angular) @ angular.transpose(0, 2, 1)).transpose(0, 2, 1)
        slopes += np.where(joints[:, None] > joints, turned, 0.0)
        slopes[:, self.chain.dof :, :] = slopes[:, :, self.chain.dof :] = 0.0
        return np.asarray(slopes)


def _jacobian(placed: Placements, axis: Array | None) -> Array:
    """How the tool moves (k, 6, 7) with each angle; the free axis turns it back."""
    linear, angular = placed.linear, placed.angular
    if axis is not None:
        linear = np.concatenate([linear, np.zeros((len(linear), 1, 3))], axis=1)
        angular = np.concatenate([angular, np.broadcast_to(-axis, (len(angular), 1, 3))], axis=1)
    return np.concatenate([linear, angular], axis=2).transpose(0, 2, 1)


def axis_in_base(problem: CurveProblem) -> Array | None:
    """The free axis (3,) in the base; None without one."""
    return None if problem.free_axis is None else problem.T[:3, :3] @ problem.free_axis.axis


def _spread(nodes: Array, number: int) -> Array:
    """Some of the points (m, 7) of an arc, evenly apart, without its ends if there are more."""
    chosen = np.linspace(0, len(nodes) - 1, number + 2)[1:-1]
    return np.asarray(nodes[chosen.astype(np.intp), :7])
