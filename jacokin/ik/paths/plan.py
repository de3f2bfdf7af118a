"""Plan a path over all branches, before anything moves. Read this file first, then `jacokin.ik.planning`.

`track_path` follows the path from one start after another, tick by tick, and never changes its mind. `plan_path` first
computes all solutions at steps along the path, links those that follow each other, and takes the cheapest way from the
first to the last; then it computes every tick exactly on the path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, StructureError, shown
from jacokin.ik import seeds
from jacokin.ik.paths import lines
from jacokin.ik.paths.planned import Planned, Settings
from jacokin.ik.paths.result import PathResult
from jacokin.ik.paths.track import ANGULAR_SPEED, SPEED
from jacokin.ik.planning import reasons
from jacokin.ik.planning.cartesian import CartesianPath
from jacokin.ik.planning.chain import Chain
from jacokin.ik.planning.curve import Curve
from jacokin.ik.planning.ladder import Ladder, Pace
from jacokin.ik.planning.manifold import Manifold
from jacokin.ik.planning.rungs import Rung, Rungs
from jacokin.ik.planning.search import Search
from jacokin.ik.planning.smoothing import Smoothing
from jacokin.ik.solver import IKSolver
from jacokin.ik.tracking.joint_limits import velocity_limits
from jacokin.ik.tracking.setup import checked_start
from jacokin.model import angles, checks
from jacokin.model.pose_targets import FreeAxis

TIMINGS = ("keep", "slow")
FREE_STEP = float(np.radians(10.0))  # [rad] between members of a family that are tried
SPACING = 0.01  # [m] of the tool between two steps of the path
TURNING = 0.05  # [rad] the same of its orientation
RESOLUTION = 0.02  # [rad] no joint moves farther between two places at which contact is looked for
AT_START = 1e-3  # [rad] a solution this near to `start` is the one the arm is on
FROM_SEED = 0.1  # cost of a first solution's squared distance to the seed, beside that of the motion
SMOOTHINGS = 4  # times a way is smoothed, with what got worse by it left alone
MOST_ROUNDS = 100  # times the way is changed because a closer look found a gap or an obstacle


def plan_path(
    solver: IKSolver,
    targets: Sequence[pin.SE3 | FreeAxis] | ArrayLike,
    dt: float = 0.01,
    *,
    speed: ArrayLike = SPEED,
    angular_speed: ArrayLike = ANGULAR_SPEED,
    timing: str = "keep",
    seed: ArrayLike | None = None,
    start: ArrayLike | None = None,
    velocity_limit: ArrayLike | None = None,
    acceleration_limit: ArrayLike | None = None,
    free_step: float = FREE_STEP,
) -> PathResult:
    """Joint trajectory of least cost along straight lines through poses, over all branches.

    Every tick is on the path: positions move on straight lines, orientations turn about one axis by the short way.
    Contact is looked for as the solver does, at every tick and wherever a joint has moved 0.02 rad.

    Args:
        solver: a solver whose robot has a closed form, of six or seven joints; its scene, clearance and limits hold
            along the path.
        targets: two or more poses T_base_tool (`pin.SE3` or (4, 4)), or `FreeAxis` targets on six joints, each with an
            axis and a range of its own. On seven joints a pose leaves the elbow free, which is chosen here.
        dt: control step [s].
        speed: along the lines [m/s], one for all or (n - 1,).
        angular_speed: of turning [rad/s], as `speed`; a line takes the longer of the two times. Turning about a free
            axis does not count.
        timing: "keep" holds these speeds and says where joints cannot follow; "slow" slows down there.
        seed: (dof,) configuration [rad] to start near; None for home.
        start: (dof,) configuration [rad] that the arm is in, instead of `seed`.
        velocity_limit: (dof,) or one for all [rad/s]; None for the robot's own.
        acceleration_limit: (dof,) or one for all [rad/s^2], with timing="slow"; None for none. With one, the path is
            run through from rest to rest, and the arm stands still at corners.
        free_step: between values of the free angle, or of joint 3 on seven joints, that are tried [rad]; the ends of
            their intervals are tried too, and the best way is then smoothed.

    Returns:
        The trajectory, with the free angle or joint 3 at every waypoint as `parameter`. When there is no way to the
        end, the best one as far as it leads, where the arm then stays, and the reason in `message`.

    Raises:
        InvalidInputError: malformed targets, speeds or limits; `start` outside the limits or beside `seed`;
            acceleration limits with timing="keep"; a `FreeAxis` on seven joints.
        UnknownNameError: unknown timing.
        StructureError: the robot has no closed form.
    """
    settings = _settings(solver, dt, timing, velocity_limit, acceleration_limit)
    path = CartesianPath(targets)
    free_step = checks.positive("free_step", free_step, "rad")
    times = lines.durations_of(path.lengths, speed, angular_speed)
    lines.check_ticks(times, settings.dt)
    if start is not None and seed is not None:
        raise InvalidInputError("give at most one of seed and start")
    robot = solver.robot
    near, note = seeds.seed_within_limits(robot, seed) if start is None else (checked_start(robot, start, "start"), "")
    manifold = Manifold(robot, _chain(solver), path, solver.verifier.options.limit_snap)
    pace = Pace(times, settings.velocity)
    ladder = Ladder(Rungs(solver, manifold, free_step), manifold, pace, free_step, keep=timing == "keep")
    begin = _Begin(manifold, near, pace, exactly=start is not None)
    search = Search(ladder, path.places(SPACING, TURNING), near, begin)
    found = _climb(search, solver, begin, settings)
    planned = Planned(solver, manifold, times, settings, "home" if seed is None and start is None else "the seed")
    if found is None:
        failed = reasons.of_first(search.rungs[0], solver, manifold, start is not None)
        stay = solver.solve(path.target(0.0), seed=near).q if start is None else near
        return planned.nowhere(stay, near, failed, note)
    reached = search.rungs[found.way_length - 1].u
    reason = "" if reached == path.lines else reasons.of_end(search, found.way_length - 1, found.blocked, solver)
    return planned.result(found.curve, reached, near, reason, note)


@dataclass(frozen=True, slots=True)
class _Found:
    """The way that passed every closer look, and its knots."""

    curve: Curve
    way_length: int
    blocked: str


class _Begin:
    """Cost of beginning at a solution.

    Attributes:
        near: (dof,) where the path should begin [rad].
        exactly: whether it must begin there.
    """

    def __init__(self, manifold: Manifold, near: Array, pace: Pace, *, exactly: bool) -> None:
        """Take where the path should begin."""
        self.near, self.exactly = near, exactly
        self._manifold, self._scale = manifold, pace.scale

    def __call__(self, rung: Rung) -> Array:
        """(k,) for the solutions of the first rung; infinite where the arm cannot be."""
        q = rung.x[:, : self._manifold.dof]
        away = q - angles.nearest_copy(self.near, q, self._manifold.circular[: self._manifold.dof])
        if self.exactly:  # the nearest one of those that are near enough
            farthest = np.abs(away).max(axis=1, initial=0.0)
            return np.where(farthest <= min(AT_START, farthest.min(initial=np.inf)), 0.0, np.inf)
        return np.asarray(FROM_SEED * ((away / self._scale) ** 2).sum(axis=1))


def _chain(solver: IKSolver) -> Chain:
    """The kinematics up to the tool."""
    if not solver.has_families:
        return Chain(solver.closed_form().chain)
    from jacokin.ik.closed_form.geometry_seven import measure_seven

    verifier = solver.verifier
    return Chain(measure_seven(solver.robot.pin_model, verifier.frame_id, verifier.tool).chain)


def _settings(
    solver: IKSolver,
    dt: float,
    timing: str,
    velocity_limit: ArrayLike | None,
    acceleration_limit: ArrayLike | None,
) -> Settings:
    if not isinstance(solver, IKSolver):
        raise InvalidInputError(f"solver must be an IKSolver, got {shown(solver)}")
    try:
        _chain(solver)
    except StructureError as error:
        raise StructureError(f"plan_path needs a closed form: {error}") from error
    checks.choice("timing", timing, TIMINGS)
    acceleration = None
    if acceleration_limit is not None:
        if timing == "keep":
            raise InvalidInputError("acceleration_limit needs timing='slow': the speed that is kept has corners")
        acceleration = checks.positive_vector("acceleration_limit", acceleration_limit, solver.robot.dof, "rad/s^2")
    return Settings(
        checks.positive("dt", dt, "s"), timing == "slow", velocity_limits(solver.robot, velocity_limit), acceleration
    )


def _climb(search: Search, solver: IKSolver, begin: _Begin, settings: Settings) -> _Found | None:
    """The best way without gaps and contact between its steps; None when it does not even begin."""
    blocked = ""
    for rounds in range(MOST_ROUNDS):
        way = search.best()
        if not way.chosen:
            return None
        curve = _curve(search, way.chosen, begin)
        if len(way.chosen) == 1:
            return _Found(curve, 1, blocked)
        wrong, touched, knots = _looked_at(curve, search, solver, settings)
        blocked = next(iter(touched.values()), blocked)
        if not wrong:
            return _Found(_smoothed(curve, search, solver, begin, settings) or knots, len(way.chosen), blocked)
        if rounds == MOST_ROUNDS - 1:
            return _Found(_curve(search, way.chosen[: wrong[-1] + 1], begin), wrong[-1] + 1, blocked)
        for interval in wrong:  # from the end: numbers of the others stay as they are
            if interval not in touched and search.can_halve(interval + 1):
                search.halve(interval + 1)
            else:
                search.cut(interval + 1, way.chosen[interval], way.chosen[interval + 1])
    raise AssertionError("unreachable")


def _looked_at(
    curve: Curve, search: Search, solver: IKSolver, settings: Settings
) -> tuple[list[int], dict[int, str], Curve]:
    """Numbers of the intervals with gaps or contact, the last first; names of what touches; the curve, finely."""
    u, x, bad = curve.refined(
        _with_ticks(curve.u, search.ladder, settings), np.minimum(settings.velocity * settings.dt, RESOLUTION)
    )
    touched = _touched(solver, curve, u, x[:, : search.ladder.manifold.dof], bad)
    return sorted({*bad.tolist(), *touched}, reverse=True), touched, Curve(curve.manifold, u, x)


def _smoothed(curve: Curve, search: Search, solver: IKSolver, begin: _Begin, settings: Settings) -> Curve | None:
    """The curve, finely, after its knots were moved to where joints move less; None when nothing better is free."""
    manifold = curve.manifold
    if not manifold.has_families:
        return None
    smoothing = Smoothing(manifold, search.ladder.pace, curve.u, None if begin.exactly else (begin.near, FROM_SEED))
    pinned = np.zeros(len(curve.u), dtype=np.bool_)
    for _ in range(SMOOTHINGS):
        smooth = Curve(manifold, curve.u, smoothing.smooth(curve.x, pinned))
        wrong, _, knots = _looked_at(smooth, search, solver, settings)
        if not wrong:
            return knots
        for interval in wrong:
            pinned[max(interval - 2, 0) : interval + 4] = True
    return None


def _with_ticks(u: Array, ladder: Ladder, settings: Settings) -> Array:
    """The knots, and the places of the ticks between the first and the last of them."""
    ticks = ladder.manifold.path.ticks(ladder.pace.times, settings.dt)
    return np.unique(np.concatenate([u, ticks[(ticks > u[0]) & (ticks < u[-1])]]))


def _curve(search: Search, chosen: list[int], begin: _Begin) -> Curve:
    """The knots of a way, turns of circular coordinates counted from where the path should begin."""
    rungs, manifold = search.rungs[: len(chosen)], search.ladder.manifold
    x = np.array([rung.x[node] for rung, node in zip(rungs, chosen, strict=True)])
    first = x[0].copy()
    first[: manifold.dof] = angles.nearest_copy(first[: manifold.dof], begin.near, manifold.circular[: manifold.dof])
    unrolled = np.vstack([first, first + np.cumsum(manifold.difference(x[:-1], x[1:]), axis=0)])
    x = np.where(manifold.circular, unrolled, x)
    return Curve(manifold, np.array([rung.u for rung in rungs]), x)


def _touched(solver: IKSolver, curve: Curve, u: Array, q: Array, bad: NDArray[np.intp]) -> dict[int, str]:
    """Numbers of intervals of the curve in which shapes touch, with their names; none unless contact is rejected."""
    verifier = solver.verifier
    if not verifier.rejects_contact:
        return {}
    found: dict[int, str] = {}
    interval = np.clip(np.searchsorted(curve.u, u, side="left") - 1, 0, len(curve.u) - 2)
    for row, index in enumerate(interval.tolist()):
        if index in found or index in bad:
            continue
        pairs = verifier.touching(q[row])
        if pairs:
            found[index] = ", ".join(f"{a} and {b}" for a, b in pairs[:2])
    return found
