"""Plan a path over all branches, before anything moves. Read this file first, then `jacokin.ik.planning`.

`track_path` follows the path from one start after another, tick by tick, and never changes its mind. `plan_path` first
computes all solutions at steps along the path, links those that follow each other, and takes the cheapest way from the
first to the last; then it computes every tick exactly on the path.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, StructureError, shown
from jacokin.ik import diagnosis, seeds
from jacokin.ik.solver import IKSolver
from jacokin.ik.targets import Target
from jacokin.model import checks
from jacokin.model.many_configurations import Chain
from jacokin.motion import lines
from jacokin.motion.path_result import PathResult
from jacokin.motion.planning.cartesian import MOST_FAMILIES, MOST_PLACES, CartesianPath
from jacokin.motion.planning.climbing import Begin, Climb
from jacokin.motion.planning.ladder import Ladder, Pace, Rung, Rungs
from jacokin.motion.planning.manifold import Manifold
from jacokin.motion.planning.planned import Planned, Settings
from jacokin.motion.planning.search import Search
from jacokin.motion.track import ANGULAR_SPEED, SPEED
from jacokin.motion.tracking.joint_limits import velocity_limits
from jacokin.motion.tracking.setup import checked_start

TIGHT = 0.05  # [rad] a joint this near to its limit is why a way ends


def of_first(rung: Rung, solver: IKSolver, manifold: Manifold, from_start: bool) -> str:
    """When the path does not begin."""
    if from_start and len(rung.x):
        return "the given start is not at the first pose"
    return f"no configuration at the first pose: {of_rung(rung, solver, manifold)}"


def of_rung(rung: Rung, solver: IKSolver, manifold: Manifold) -> str:
    """When a place has no configuration."""
    if not rung.solutions:
        return "out of reach"
    if rung.touching:
        return "contact of " + ", ".join(f"{a} and {b}" for a, b in rung.touching[:2])
    if manifold.has_families:
        return solver.solve(manifold.path.target(rung.u), closest=False).message
    rows = solver.closed_form().solve_all(manifold.path.at(np.array([rung.u]))[0], solver.robot.home)
    return diagnosis.of_branches(rows, solver.robot.joint_names).message


def of_end(search: Search, reached: float, q: Array, blocked: str, solver: IKSolver) -> str:
    """When the best way ends at a place, which is that of a rung, in a configuration (dof,)."""
    manifold, robot = search.ladder.manifold, solver.robot
    index = [rung.u for rung in search.rungs].index(reached)
    here, ahead = search.rungs[index], search.rungs[index + 1]
    line = min(int(here.u), manifold.path.lines - 1)
    where = f"the best way ends at {100.0 * (here.u - line):.4g} % of line {line}"
    if not len(ahead.x):
        return f"{where}: {of_rung(ahead, solver, manifold)}"
    if blocked:
        return f"{where}: contact of {blocked}"
    away = manifold.difference(np.repeat(here.x, len(ahead.x), axis=0), np.tile(ahead.x, (len(here.x), 1)))
    away = away[:, : manifold.dof]
    nearest = away[np.argmin(np.abs(away).max(axis=1))]
    joint = int(np.argmax(np.abs(nearest)))
    margin = np.minimum(q - robot.lower, robot.upper - q)
    tight = int(np.argmin(margin))
    if margin[tight] < TIGHT:
        return f"{where}: {robot.joint_names[tight]} runs into its limit, and no branch within the limits follows"
    return f"{where}: a gap between branches, {abs(float(nearest[joint])):.3g} rad in {robot.joint_names[joint]}"


TIMINGS = ("keep", "slow")
FINEST = 0.01  # [rad] between members of a family: more of them take minutes
SLOWEST = 1e-6  # [rad/s] of a velocity limit: a turn takes 70 days
FREE_STEP = float(np.radians(10.0))  # [rad] between members of a family that are tried
SPACING = 0.01  # [m] of the tool between two steps of the path
TURNING = 0.05  # [rad] the same of its orientation


def plan_path(
    solver: IKSolver,
    targets: Sequence[Target] | ArrayLike,
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
            axis and a range of its own; targets of the tracker that make either will do too. On seven joints a pose
            leaves the elbow free, which is chosen here.
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
    path = CartesianPath(targets, solver.frame)
    if path.free and solver.has_families:
        raise InvalidInputError(
            "a FreeAxis on seven joints leaves two free parameters: give the poses at one angle, target.at(angle)"
        )
    free_step = checks.positive("free_step", free_step, "rad")
    if free_step < FINEST:
        raise InvalidInputError(f"free_step must be at least {FINEST:g} rad, got {free_step!r}")
    times = lines.durations_of(path.lengths, speed, angular_speed)
    lines.check_ticks(times, settings.dt)
    if start is not None and seed is not None:
        raise InvalidInputError("give at most one of seed and start")
    robot = solver.robot
    near, note = seeds.seed_within_limits(robot, seed) if start is None else (checked_start(robot, start, "start"), "")
    chain = Chain(robot, solver.verifier.frame_id, solver.verifier.tool)
    manifold = Manifold(robot, chain, path, solver.verifier.options.limit_snap)
    pace = Pace(times, settings.velocity)
    ladder = Ladder(Rungs(solver, manifold, free_step), manifold, pace, free_step, keep=timing == "keep")
    begin = Begin(manifold, near, pace, exactly=start is not None)
    places = path.places(SPACING, TURNING, MOST_FAMILIES if manifold.has_families else MOST_PLACES)
    search = Search(ladder, places, near, begin)
    found = Climb(search, solver, begin, settings.dt, keep=timing == "keep").found()
    planned = Planned(solver, manifold, times, settings, "home" if seed is None and start is None else "the seed")
    if found is None:
        failed = of_first(search.rungs[0], solver, manifold, start is not None)
        stay = near if start is not None else solver.solve(path.target(0.0), seed=near).q
        if solver.verifier.rejects_contact and solver.verifier.touching(stay):
            stay = near
        return planned.nowhere(stay, near, failed, note)
    reason = ""
    if found.reached < path.lines:
        reason = of_end(search, found.reached, found.curve.q[-1], found.blocked, solver)
    return planned.result(found.curve, found.reached, near, reason, note)


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
        if not solver.has_families:
            solver.closed_form()
    except StructureError as error:
        raise StructureError(f"plan_path needs a closed form: {error}") from error
    checks.choice("timing", timing, TIMINGS)
    acceleration = None
    if acceleration_limit is not None:
        if timing == "keep":
            raise InvalidInputError("acceleration_limit needs timing='slow': the speed that is kept has corners")
        acceleration = checks.positive_vector("acceleration_limit", acceleration_limit, solver.robot.dof, "rad/s^2")
    velocity = velocity_limits(solver.robot, velocity_limit)
    if velocity.min() < SLOWEST:
        raise InvalidInputError(f"velocity_limit must be at least {SLOWEST:g} rad/s, got {velocity.min():g}")
    return Settings(checks.positive("dt", dt, "s"), timing == "slow", velocity, acceleration)
