"""`plan_path`: a path planned over all branches, before anything moves. Read this file first.

`track_path` follows the path from one start after another, tick by tick, and never changes its mind. `plan_path` first
computes all solutions at steps along the path and links those that follow each other, and takes the cheapest way
from the first to the last (`search`); then it computes every tick exactly on the path (`manifold`) and measures it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, StructureError
from jacokin.ik import diagnosis, seeds
from jacokin.ik.solutions.points import Points
from jacokin.ik.solver import IKSolver
from jacokin.ik.targets import Target, TargetPose
from jacokin.ik.verification import Verifier
from jacokin.model import checks
from jacokin.model.angles import wrap_to_pi
from jacokin.model.contact import contact_of_nothing
from jacokin.model.poses import FreeAxis, rotation_angle
from jacokin.model.robot import acceleration_limits, limit_margins, unit_of, velocity_limits
from jacokin.motion.free_motion.plan_motion import plan_motion
from jacokin.motion.joint_motion import ACCELERATION
from jacokin.motion.path import MOST_CURVES, MOST_PLACES, MOST_SURFACES, CartesianPath
from jacokin.motion.planning.manifold import Curve, Manifold, Pace
from jacokin.motion.planning.passing import keep_speed, pass_slowly
from jacokin.motion.planning.search import Climb, Ladder, PathSearch, Rung
from jacokin.motion.rows import HELD, OnTheWay, Rows, coarse, halved, joined, most_between, spline_rows, standing
from jacokin.motion.timing import check_ticks, sample_lines
from jacokin.motion.track import ANGULAR_SPEED, SPEED
from jacokin.motion.trajectory import LEAD_IN, SPEED_ROUNDING, Trajectory

FINEST = 0.01  # [rad] between members of a curve: more of them take minutes
SLOWEST = 1e-6  # [rad/s] of a velocity limit: a turn takes 70 days


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
    free_step: float = float(np.radians(10.0)),
    time_limit: float | None = None,
) -> Trajectory:
    """Joint trajectory of least cost along straight lines through poses, over all branches.

    Every tick is on the path: positions move on straight lines, orientations turn about one axis by the short way.
    It begins and ends at rest, and limits hold as controllers go from row to row, by straight lines, cubics or
    quintics. Contact is looked for as the solver does, between ticks too: nothing is stepped over. Where controllers
    could touch something on their way between two rows, all rows are nearer to each other than `dt`, and `message`
    says so.

    Args:
        solver: a solver whose robot has a closed form, of five to seven joints; its scene, clearance and limits hold
            along the path.
        targets: two or more poses T_base_tool (`pin.SE3` or (4, 4)), or `FreeAxis` targets, each with an axis and a
            range of its own; targets of the tracker that make either will do too. On seven joints a pose leaves the
            elbow free, which is chosen here, with the angle about a free axis.
        dt: control step [s].
        speed: along the lines [m/s], one for all or (n - 1,).
        angular_speed: of turning [rad/s], as `speed`; a line takes the longer of the two times. Turning about a free
            axis does not count.
        timing: "keep" holds these speeds, corners included, between ramps of 1 rad/s^2 at both ends, and says where
            joints cannot follow; "slow" slows down there.
        seed: (dof,) configuration [rad] to start near; None for home.
        start: (dof,) configuration [rad] that the arm is in, instead of `seed`. Where the tool is elsewhere than at the
            first target, or a joint is outside its limits, the arm first moves there without contact, as `plan_motion`
            does.
        velocity_limit: (dof,) or one for all [rad/s]; None for the robot's own.
        acceleration_limit: (dof,) or one for all [rad/s^2], with timing="slow"; None for 1 rad/s^2 of speeding up and
            slowing down along the path, and none at corners, which are passed in a tick. With one, the arm slows down
            or stands still at corners.
        free_step: between values of the free angle, or of joint 3 on seven joints, that are tried [rad]; the ends of
            their intervals are tried too, and the best way is then smoothed. Where both are free, twice as far apart.
        time_limit: after which gaps in the path are not looked at more closely, but end it [s]; None for no limit. What
            leads to the path, and writing its rows, is not counted.

    Returns:
        The trajectory, with the free angle or joint 3 at every waypoint as `parameter`. When there is no way to the
        end, the best one as far as it leads, where the arm then stays, and the reason in `message`.

    Raises:
        InvalidInputError: malformed targets, speeds or limits; `start` beside `seed`;
            acceleration limits with timing="keep".
        UnknownNameError: unknown timing.
        StructureError: the robot has no closed form.
        ShapeError: the robot's shapes cannot be loaded, and contact is to be avoided.
    """
    checks.instance("solver", solver, IKSolver, "an IKSolver")
    robot, verifier = solver.robot, solver.verifier
    verifier.require_contact()
    _require_closed_form(solver)
    checks.choice("timing", timing, ("keep", "slow"))
    if acceleration_limit is not None and timing == "keep":
        raise InvalidInputError("acceleration_limit needs timing='slow': the speed that is kept has corners")
    acceleration = None if acceleration_limit is None else acceleration_limits(robot, acceleration_limit)
    velocity = velocity_limits(robot, velocity_limit)
    if velocity.min() < SLOWEST:
        raise InvalidInputError(f"velocity_limit must be at least {SLOWEST:g} rad/s, got {velocity.min():g}")
    dt = checks.positive("dt", dt, "s")
    path = CartesianPath(targets, solver.frame)
    options = verifier.options
    manifold = Manifold(
        robot,
        verifier.chain,
        path,
        options.limit_snap,
        solver.parameter,
        tolerances=(options.position_tolerance, options.orientation_tolerance),
    )
    free_step = checks.positive("free_step", free_step, "rad")
    finest = 0.1 if manifold.has_surfaces else FINEST  # [rad]
    if free_step < finest:
        raise InvalidInputError(f"free_step must be at least {finest:g} rad, got {free_step!r}")
    limit = np.inf if time_limit is None else checks.positive("time_limit", time_limit, "s")
    times = path.durations(speed, angular_speed)
    check_ticks(times, dt)
    times = np.where(times < 1e-3 * dt, 0.0, times)  # lines that take hardly any take none
    near, note = seeds.choose_start(robot, seed, start)
    inside = seeds.inside_exactly(robot.lower.tolist(), near.tolist(), robot.upper.tolist())
    if start is not None and (not inside or is_away(verifier, near, path.target(0.0))):
        plan = partial(
            plan_path,
            solver,
            targets,
            speed=speed,
            angular_speed=angular_speed,
            timing=timing,
            velocity_limit=velocity_limit,
            acceleration_limit=acceleration_limit,
            free_step=free_step,
            time_limit=time_limit,
        )
        return _led_in(solver, near, plan, dt, ACCELERATION if acceleration is None else acceleration)

    pace = Pace(times, velocity)
    ladder = Ladder(solver, manifold, pace, free_step, near, keep=timing == "keep")
    # Every centimetre of the tool, turning counted in.
    most = MOST_SURFACES if manifold.has_surfaces else MOST_CURVES if manifold.has_curves else MOST_PLACES
    places = path.places(0.01, most)
    search = PathSearch(ladder, places, near, exactly=start is not None, deadline=time.monotonic() + limit)
    found = Climb(search, dt).find()
    writer = _Writer(
        solver=solver,
        manifold=manifold,
        pace=pace,
        dt=dt,
        slow=timing == "slow",
        acceleration=acceleration,
        near=near,
        origin="home" if seed is None and start is None else "the seed",
        note=note,
    )
    if found is None:
        stay = near if start is not None else _clear_or(near, solver, path)
        return writer.stay(stay, _explain_no_start(search.rungs[0], solver, manifold, start is not None))
    reason = ""
    if found.reached < path.lines:
        reason = _explain_end(search, found.reached, found.curve.q[-1], found.blocked, solver)
        reason += ", as far as there was time to look" if search.is_late else ""
    return writer.follow(found.curve, found.reached, reason)


def _require_closed_form(solver: IKSolver) -> None:
    """Refuse a solver that cannot list all solutions.

    Raises:
        StructureError: its robot has no closed form.
    """
    try:
        if solver.dimension() is None:
            solver.closed_form()
    except StructureError as error:
        raise StructureError(f"plan_path needs a closed form: {error}") from error


def _clear_or(near: Array, solver: IKSolver, path: CartesianPath) -> Array:
    """The configuration (dof,) nearest to the first pose; where that is in contact, the one given."""
    stay = solver.solve(path.target(0.0), seed=near).q
    return near if solver.verifier.avoids_contact and solver.verifier.touching(stay) else stay


@dataclass(frozen=True, slots=True, kw_only=True)
class _Writer:
    """From a planned joint path to ticks, measured.

    Attributes:
        solver: what measures.
        manifold: the configurations on the path.
        pace: times of the lines at the speed asked for, and velocity limits.
        dt: control step [s].
        slow: True to slow down where joints cannot follow.
        acceleration: (dof,) limits [rad/s^2], or None.
        near: (dof,) where the path should begin [rad].
        origin: what messages call that place.
        note: a sentence about it.
    """

    solver: IKSolver
    manifold: Manifold
    pace: Pace
    dt: float
    slow: bool
    acceleration: Array | None
    near: Array
    origin: str
    note: str

    def stay(self, q: Array, reason: str) -> Trajectory:
        """A path that does not begin: the arm stays at the configuration (dof,) nearest to the first pose."""
        path = self.manifold.path
        u = sample_lines(self.pace.times, self.dt)
        parameter = np.full(path.lines + 1, np.nan)
        x = np.tile(self.manifold.points(q[None], path.target(0.0)), (len(u), 1))
        return self._measure(
            u, x, standing(spline_rows(q[None], self.dt), len(u) - 1, self.dt), parameter, -1.0, reason
        )

    def follow(self, curve: Curve, reached: float, reason: str) -> Trajectory:
        """The ticks along a joint path; beyond its end the arm stays there."""
        parameter, fault, verifier = self._at_waypoints(curve, reached), "", self.solver.verifier
        robot, contact = self.solver.robot, verifier.contact if verifier.avoids_contact else None
        between = OnTheWay(robot, contact or robot.once(contact_of_nothing))
        for dt in halved(self.dt):
            if len(curve.u) < 2 or np.abs(np.diff(curve.q, axis=0)).max() < 1e-12:  # [rad] it stays
                u, x, rows = curve.u[-1:], curve.x[-1:], spline_rows(curve.q[-1:], dt)
            elif self.slow:
                u, x, rows = pass_slowly(curve, self.pace, dt, self.acceleration)
            else:
                u, x, rows = keep_speed(curve, self.pace, dt)
            found = between.fault(rows)
            if not found:
                break
            fault = found
        if reached < self.manifold.path.lines:  # the time that the rest would have taken
            beyond = sample_lines(self.pace.times, dt)
            beyond = beyond[beyond > reached]
            u, x = np.append(u, beyond), np.vstack([x, np.tile(x[-1], (len(beyond), 1))])
            rows = standing(rows, len(beyond), dt)
        return self._measure(u, x, rows, parameter, reached, reason, coarse(self.dt, dt, fault))

    def _at_waypoints(self, curve: Curve, reached: float) -> Array:
        """The parameter (lines + 1,) at the waypoints that are reached; nan at others, and where there is none."""
        path = self.manifold.path
        parameter = np.full(path.lines + 1, np.nan)
        if not path.free and not self.manifold.has_curves:
            return parameter
        column = self.manifold.dof if path.free else self.manifold.parameters[0]
        passed = np.arange(int(reached) + 1, dtype=np.float64)
        found = (curve.at(passed)[0] if len(curve.u) > 1 else curve.x)[:, column]
        parameter[: len(passed)] = path.free_angle(found) if path.free else found
        return parameter

    def _measure(
        self, u: Array, x: Array, rows: Rows, parameter: Array, reached: float, reason: str, note: str = ""
    ) -> Trajectory:
        """Every row measured by Pinocchio, against limits, and for contact; a note is added to what happened."""
        robot, verifier = self.solver.robot, self.solver.verifier
        path, dof = self.manifold.path, self.manifold.dof
        wanted, q = path.at(u, x[:, dof] if path.free else None), rows.q
        errors = np.array(
            [verifier.measure(row, TargetPose(T, position_only=False)) for row, T in zip(q, wanted, strict=True)]
        )
        off = (errors[:, 0] > verifier.options.position_tolerance) | (
            errors[:, 1] > verifier.options.orientation_tolerance
        )
        speed, hard = self._needed(u, rows)
        fast = speed > self.pace.velocity * HELD + SPEED_ROUNDING
        status, limiting = [], []
        for row in range(len(q)):
            names = [f"{robot.joint_names[j]} velocity" for j in np.flatnonzero(fast[row])]
            names += [f"{robot.joint_names[j]} acceleration" for j in np.flatnonzero(hard[row])]
            held = off[row] or u[row] > reached
            status.append("HELD" if held else "LIMITED" if names else "OK")
            limiting.append("; ".join(names) if names else reason if held else "")
        clearance = verifier.distances(q) if verifier.looks_for_contact else np.full(len(q), np.nan)
        away = np.abs(q[0] - self.near)
        jump = seeds.describe_jump(robot, away, self.origin)
        words = [(reason or self._sentence(speed, fast, status, rows)) + note, jump, self.note]
        return Trajectory(
            joint_names=robot.joint_names,
            t=checks.read_only(rows.t),
            q=checks.read_only(q),
            v=checks.read_only(rows.v),
            a=checks.read_only(rows.a),
            position_error=checks.read_only(errors[:, 0]),
            orientation_error=checks.read_only(errors[:, 1]),
            status=tuple(status),
            limiting=tuple(limiting),
            segment=path.segments(u),
            clearance=checks.read_only(clearance),
            lower=robot.lower,
            upper=robot.upper,
            velocity_limit=checks.read_only(self.pace.velocity),
            parameter=checks.read_only(parameter),
            message="; ".join(word for word in (*words, verifier.note) if word),
            start_distance=float(away.max()),
            sliding=robot.sliding,
        )

    def _needed(self, u: Array, rows: Rows) -> tuple[Array, NDArray[np.bool_]]:
        """Velocities (n, dof) [rad/s] that rows need, and where (n, dof) they accelerate too much.

        Where the speed is kept, those that it asks for count, also on the ramps.
        """
        none = np.zeros((1, rows.q.shape[1]))
        fast, hard = (np.vstack([none, each]) for each in most_between(rows))
        if not self.slow:
            ends = np.append(0.0, np.cumsum(self.pace.times))
            asked = np.diff(np.interp(u, np.arange(len(ends)), ends))[:, None]
            moved = np.abs(np.diff(rows.q, axis=0))
            fast[1:] = np.maximum(fast[1:], np.where(moved > 0.0, moved / np.maximum(asked, 1e-9), 0.0))
        limit = np.inf if self.acceleration is None else self.acceleration * (1.0 + 1e-6)  # rounding
        return fast, hard > limit

    def _sentence(self, speed: Array, fast: NDArray[np.bool_], status: list[str], rows: Rows) -> str:
        if all(word == "OK" for word in status):
            return "on the path throughout"
        ticks = np.flatnonzero(fast.any(axis=1))
        if ticks.size:
            names = ", ".join(self.solver.robot.joint_names[j] for j in np.flatnonzero(fast.any(axis=0)))
            excess = float((speed / self.pace.velocity).max()) - 1.0
            return (
                f"{names} cannot follow at this speed on {ticks.size} of {len(fast)} ticks, first at "
                f"{rows.t[ticks[0]]:.6g} s, too fast by up to {100.0 * excess:.3g} %; timing='slow' slows "
                "down there"
            )
        if "LIMITED" in status:
            return f"joints would accelerate too much at {rows.t[status.index('LIMITED')]:.6g} s"
        return "a tick misses the path"


def _explain_no_start(rung: Rung, solver: IKSolver, manifold: Manifold, from_start: bool) -> str:
    """Why the path does not begin."""
    if from_start and len(rung.x):
        return "the given start is not at the first pose"
    return f"no configuration at the first pose: {_explain_rung(rung, solver, manifold)}"


def _explain_rung(rung: Rung, solver: IKSolver, manifold: Manifold) -> str:
    """Why a place has no configuration."""
    if not rung.solutions:
        return "out of reach"
    if rung.touching:
        return "contact of " + ", ".join(f"{a} and {b}" for a, b in rung.touching[:2])
    if manifold.has_curves:
        return solver.solve(manifold.path.target(rung.u), closest=False).message
    if manifold.dof < 6:
        rows = solver.solve_all(manifold.path.target(rung.u), solver.robot.home)
        assert isinstance(rows, Points)
    else:
        rows = solver.closed_form().solve_all(manifold.path.at(np.array([rung.u]))[0], solver.robot.home)
    return diagnosis.explain_branches(rows, solver.robot.joint_names).message


def _explain_end(search: PathSearch, reached: float, q: Array, blocked: str, solver: IKSolver) -> str:
    """Why the best way ends at a place, which is that of a rung, in a configuration (dof,)."""
    manifold, robot = search.ladder.manifold, solver.robot
    index = [rung.u for rung in search.rungs].index(reached)
    here, ahead = search.rungs[index], search.rungs[index + 1]
    line = min(int(here.u), manifold.path.lines - 1)
    where = f"the best way ends at {100.0 * (here.u - line):.4g} % of line {line}"
    if not len(ahead.x):
        return f"{where}: {_explain_rung(ahead, solver, manifold)}"
    if blocked:
        return f"{where}: contact of {blocked}"
    away = manifold.difference(np.repeat(here.x, len(ahead.x), axis=0), np.tile(ahead.x, (len(here.x), 1)))
    away = away[:, : manifold.dof]
    nearest = away[np.argmin(np.abs(away).max(axis=1))]
    joint = int(np.argmax(np.abs(nearest)))
    margin = limit_margins(robot, q)
    tight = int(np.argmin(margin))
    if margin[tight] < 0.05:  # [rad] then that is why
        return f"{where}: {robot.joint_names[tight]} runs into its limit, and no branch within the limits follows"
    gap = f"{abs(float(nearest[joint])):.3g} {unit_of(robot, joint)} in {robot.joint_names[joint]}"
    return f"{where}: a gap between branches, {gap}"


THERE = 1e-3  # [m] and [rad] an arm this near to the first pose is at it
JOINED = 1e-6  # [rad] a motion that ends this near to the first row leads to it; the same part of a step


def is_away(verifier: Verifier, q: Array, target: pin.SE3 | FreeAxis) -> bool:
    """Whether the tool at `q` (dof,) is elsewhere than at a target, which is any angle in a range of its axis."""
    tool = verifier.tool_pose(q)
    pose = target.at(0.0) if isinstance(target, FreeAxis) else target
    if np.linalg.norm(tool.translation - pose.translation) > THERE:
        return True
    if not isinstance(target, FreeAxis):
        return rotation_angle(tool.rotation.T @ pose.rotation) > THERE
    if float(np.linalg.norm(tool.rotation @ target.axis - pose.rotation @ target.axis)) > THERE:
        return True
    middle = 0.5 * sum(target.range)
    beyond = abs(float(wrap_to_pi(target.parameter_of(tool.rotation) - middle))) - (target.range[1] - middle)
    return beyond > THERE


def _led_in(
    solver: IKSolver, start: Array, plan: Callable[..., Trajectory], dt: float, acceleration: ArrayLike
) -> Trajectory:
    """A path with the motion to its first row before it, in rows whose status is "LEAD_IN".

    Args:
        solver: knows the arm and its scene.
        start: (dof,) where the arm is [rad].
        plan: plans the path, with its step `dt` [s], and a `seed` or `start` of its own.
        dt: control step [s].
        acceleration: limits of the motion [rad/s^2].
    """
    path = plan(dt=dt, seed=start)
    if not path.success:
        return path
    motion = plan_motion(
        solver, start, path.q[0], dt=dt, velocity_limit=path.velocity_limit, acceleration_limit=acceleration
    )
    if not motion.success:
        return _without_way(path, start, motion)
    if np.abs(motion.q[-1] - path.q[0]).max() > JOINED:  # whole turns away: the path begins where the motion ends
        path = plan(dt=dt, start=motion.q[-1])
        if not path.success:
            return path
    steps = float(motion.t[min(1, len(motion) - 1)]) or float(path.t[1]), float(path.t[1])
    if abs(steps[0] - steps[1]) > JOINED * dt:  # one of them needs smaller ones
        return _led_in(solver, start, plan, min(steps), acceleration)
    count = len(motion) - 1
    rows = joined(motion.rows, path.rows)
    unknown = np.full(count, np.nan)
    clear = motion.clearance[:-1] if not np.isnan(path.clearance).all() else unknown
    return replace(
        path,
        t=checks.sealed(steps[0] * np.arange(len(rows.q), dtype=np.float64)),
        q=checks.sealed(rows.q),
        v=checks.sealed(rows.v),
        a=checks.sealed(rows.a),
        status=(LEAD_IN,) * count + path.status,
        limiting=("",) * count + path.limiting,
        segment=checks.sealed(np.concatenate([np.full(count, -1, dtype=np.intp), path.segment])),
        position_error=checks.read_only(np.concatenate([unknown, path.position_error])),
        orientation_error=checks.read_only(np.concatenate([unknown, path.orientation_error])),
        clearance=checks.read_only(np.concatenate([clear, path.clearance])),
        start_distance=0.0,
        message=f"{path.message.partition(';')[0]}, after a motion of {motion.duration:.4g} s to where it begins",
    )


def _without_way(path: Trajectory, start: Array, motion: Trajectory) -> Trajectory:
    """A path that is not reached from the start (dof,) [rad], where the arm stays."""
    q, away = np.tile(start, (len(path), 1)), checks.read_only(np.full(len(path), np.nan))
    message = f"there is no way from the start to where the path would begin: {motion.message}"
    return replace(
        path,
        q=q,
        v=np.zeros_like(q),
        a=np.zeros_like(q),
        status=("HELD",) * len(path),
        limiting=(message,) * len(path),
        position_error=away,
        orientation_error=away,
        clearance=away,
        message=message,
    )
