"""`plan_path`: a path planned over all branches, before anything moves. Read this file first.

`track_path` follows the path from one start after another, tick by tick, and never changes its mind. `plan_path` first
computes all solutions at steps along the path and links those that follow each other, and takes the cheapest way
from the first to the last (`search`); then it computes every tick exactly on the path (`manifold`) and measures it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, StructureError
from jacokin.ik import diagnosis, seeds
from jacokin.ik.solver import IKSolver
from jacokin.ik.targets import Target, TargetPose
from jacokin.ik.verification import Verifier
from jacokin.model import checks
from jacokin.model.many_configurations import Chain
from jacokin.model.poses import FreeAxis, rotation_angle
from jacokin.model.robot import velocity_limits
from jacokin.motion.free_motion.plan_motion import plan_motion
from jacokin.motion.joint_motion import ACCELERATION
from jacokin.motion.path import MOST_FAMILIES, MOST_PLACES, CartesianPath
from jacokin.motion.planning.manifold import Curve, Manifold, Pace
from jacokin.motion.planning.search import Climb, Ladder, PathSearch, Rung
from jacokin.motion.timing import check_ticks, fit_ticks, sample_lines
from jacokin.motion.track import ANGULAR_SPEED, SPEED
from jacokin.motion.trajectory import LEAD_IN, Trajectory, changes

TIMINGS = ("keep", "slow")
FINEST = 0.01  # [rad] between members of a family: more of them take minutes
SLOWEST = 1e-6  # [rad/s] of a velocity limit: a turn takes 70 days
FREE_STEP = float(np.radians(10.0))  # [rad] between members of a family that are tried
SPACING = 0.01  # [m] of the tool between two steps of the path
TURNING = 0.05  # [rad] the same of its orientation
TIGHT = 0.05  # [rad] a joint this near to its limit is why a way ends
SPEED_ROUNDING = 1e-9  # [rad/s] of positions subtracted and divided by a step
ACCELERATION_ROUNDING = 1e-6  # relative


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
) -> Trajectory:
    """Joint trajectory of least cost along straight lines through poses, over all branches.

    Every tick is on the path: positions move on straight lines, orientations turn about one axis by the short way.
    Contact is looked for as the solver does, between ticks too: nothing is stepped over.

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
        start: (dof,) configuration [rad] that the arm is in, instead of `seed`. Where the tool is elsewhere than at the
            first target, the arm first moves there without contact, as `plan_motion` does.
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
    checks.instance("solver", solver, IKSolver, "an IKSolver")
    robot, verifier = solver.robot, solver.verifier
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
        acceleration = checks.positive_vector("acceleration_limit", acceleration_limit, robot.dof, "rad/s^2")
    velocity = velocity_limits(robot, velocity_limit)
    if velocity.min() < SLOWEST:
        raise InvalidInputError(f"velocity_limit must be at least {SLOWEST:g} rad/s, got {velocity.min():g}")
    dt = checks.positive("dt", dt, "s")
    path = CartesianPath(targets, solver.frame)
    if path.free and solver.has_families:
        raise InvalidInputError(
            "a FreeAxis on seven joints leaves two free parameters: give the poses at one angle about it"
        )
    free_step = checks.positive("free_step", free_step, "rad")
    if free_step < FINEST:
        raise InvalidInputError(f"free_step must be at least {FINEST:g} rad, got {free_step!r}")
    times = path.durations(speed, angular_speed)
    check_ticks(times, dt)
    near, note = seeds.choose_start(robot, seed, start)
    if start is not None and is_away(verifier, near, path.target(0.0)):
        line = plan_path(
            solver,
            targets,
            dt,
            speed=speed,
            angular_speed=angular_speed,
            timing=timing,
            seed=near,
            velocity_limit=velocity_limit,
            acceleration_limit=acceleration_limit,
            free_step=free_step,
        )
        return lead_in(solver, near, line, dt, acceleration) if line.success else line

    chain = Chain(robot, verifier.frame_id, verifier.tool)
    manifold = Manifold(robot, chain, path, verifier.options.limit_snap)
    pace = Pace(times, velocity)
    ladder = Ladder(solver, manifold, pace, free_step, keep=timing == "keep")
    places = path.places(SPACING, TURNING, MOST_FAMILIES if manifold.has_families else MOST_PLACES)
    search = PathSearch(ladder, places, near, exactly=start is not None)
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
        stay = near if start is not None else solver.solve(path.target(0.0), seed=near).q
        if verifier.avoids_contact and verifier.touching(stay):
            stay = near
        return writer.stay(stay, _explain_no_start(search.rungs[0], solver, manifold, start is not None))
    reason = ""
    if found.reached < path.lines:
        reason = _explain_end(search, found.reached, found.curve.q[-1], found.blocked, solver)
    return writer.follow(found.curve, found.reached, reason)


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
        x = self.manifold.points(q[None], path.target(0.0))
        return self._measure(u, np.tile(x, (len(u), 1)), parameter, -1.0, reason)

    def follow(self, curve: Curve, reached: float, reason: str) -> Trajectory:
        """The ticks along a joint path; beyond its end the arm stays there."""
        ticks = kept = sample_lines(self.pace.times, self.dt)
        if self.slow and len(curve.u) > 1:
            dof = self.manifold.dof
            ticks = fit_ticks(
                curve.u,
                curve.q,
                lambda u: curve.at(u)[0][:, :dof],
                self.pace.times,
                self.dt,
                self.pace.velocity,
                self.acceleration,
            )
        parameter = self._at_waypoints(curve, reached)
        if reached == self.manifold.path.lines:
            return self._measure(ticks, curve.at(ticks)[0], parameter, reached, reason)
        if self.slow:
            ticks = np.concatenate([ticks, kept[kept > reached]])
        inside = ticks <= reached
        x = np.tile(curve.x[-1], (len(ticks), 1))
        x[inside] = curve.at(ticks[inside])[0] if len(curve.u) > 1 else curve.x[0]
        return self._measure(ticks, x, parameter, reached, reason)

    def _at_waypoints(self, curve: Curve, reached: float) -> Array:
        """The parameter (lines + 1,) at the waypoints that are reached; nan at others, and where there is none."""
        path = self.manifold.path
        parameter = np.full(path.lines + 1, np.nan)
        if self.manifold.column is None:
            return parameter
        passed = np.arange(int(reached) + 1, dtype=np.float64)
        found = (curve.at(passed)[0] if len(curve.u) > 1 else curve.x)[:, self.manifold.column]
        parameter[: len(passed)] = path.free_angle(found) if path.free else found
        return parameter

    def _measure(self, u: Array, x: Array, parameter: Array, reached: float, reason: str) -> Trajectory:
        """Every row measured by Pinocchio, against limits, and for contact."""
        robot, verifier = self.solver.robot, self.solver.verifier
        path, dof = self.manifold.path, self.manifold.dof
        wanted, q = path.at(u, x[:, dof] if path.free else None), x[:, :dof]
        errors = np.array(
            [verifier.measure(row, TargetPose(T, position_only=False)) for row, T in zip(q, wanted, strict=True)]
        )
        v = np.zeros_like(q)
        v[1:] = np.diff(q, axis=0) / self.dt
        off = (errors[:, 0] > verifier.options.position_tolerance) | (
            errors[:, 1] > verifier.options.orientation_tolerance
        )
        fast = np.abs(v) > self.pace.velocity + SPEED_ROUNDING
        hard = np.zeros_like(fast)
        if self.acceleration is not None:
            hard[1:] = np.abs(np.diff(v, axis=0)) > self.acceleration * self.dt * (1.0 + ACCELERATION_ROUNDING)
        status, limiting = [], []
        for row in range(len(q)):
            names = [f"{robot.joint_names[j]} velocity" for j in np.flatnonzero(fast[row])]
            names += [f"{robot.joint_names[j]} acceleration" for j in np.flatnonzero(hard[row])]
            held = off[row] or u[row] > reached
            status.append("HELD" if held else "LIMITED" if names else "OK")
            limiting.append("; ".join(names) if names else reason if held else "")
        clearance = verifier.distances(q) if verifier.looks_for_contact else np.full(len(q), np.nan)
        away = np.abs(q[0] - self.near)
        jump = seeds.describe_jump(robot.joint_names, away, self.origin)
        words = [reason or self._sentence(v, fast, status), jump, self.note]
        return Trajectory(
            joint_names=robot.joint_names,
            t=checks.read_only(np.arange(len(q)) * self.dt),
            q=checks.read_only(q),
            v=checks.read_only(v),
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
            message="; ".join(word for word in words if word),
            start_distance=float(away.max()),
        )

    def _sentence(self, v: Array, fast: NDArray[np.bool_], status: list[str]) -> str:
        if all(word == "OK" for word in status):
            return "on the path throughout"
        ticks = np.flatnonzero(fast.any(axis=1))
        if ticks.size:
            names = ", ".join(self.solver.robot.joint_names[j] for j in np.flatnonzero(fast.any(axis=0)))
            excess = float((np.abs(v) / self.pace.velocity).max()) - 1.0
            return (
                f"{names} cannot follow at this speed on {ticks.size} of {len(fast)} ticks, first at "
                f"{ticks[0] * self.dt:.6g} s, too fast by up to {100.0 * excess:.3g} %; timing='slow' slows "
                "down there"
            )
        if "LIMITED" in status:
            return f"joints would accelerate too much at {status.index('LIMITED') * self.dt:.6g} s"
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
    if manifold.has_families:
        return solver.solve(manifold.path.target(rung.u), closest=False).message
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
    margin = np.minimum(q - robot.lower, robot.upper - q)
    tight = int(np.argmin(margin))
    if margin[tight] < TIGHT:
        return f"{where}: {robot.joint_names[tight]} runs into its limit, and no branch within the limits follows"
    return f"{where}: a gap between branches, {abs(float(nearest[joint])):.3g} rad in {robot.joint_names[joint]}"


THERE = 1e-3  # [m] and [rad] an arm this near to the first pose is at it


def is_away(verifier: Verifier, q: Array, target: pin.SE3 | FreeAxis) -> bool:
    """Whether the tool at `q` (dof,) is elsewhere than at a target, whatever the angle about its free axis."""
    tool = verifier.tool_pose(q)
    pose = target.at(0.0) if isinstance(target, FreeAxis) else target
    if np.linalg.norm(tool.translation - pose.translation) > THERE:
        return True
    if not isinstance(target, FreeAxis):
        return rotation_angle(tool.rotation.T @ pose.rotation) > THERE
    return float(np.linalg.norm(tool.rotation @ target.axis - pose.rotation @ target.axis)) > THERE


def lead_in(solver: IKSolver, start: Array, path: Trajectory, dt: float, acceleration: Array | None) -> Trajectory:
    """A path with the motion to its first row before it, in rows of `dt` [s] whose status is "LEAD_IN".

    Args:
        solver: knows the arm and its scene.
        start: (dof,) where the arm is [rad].
        path: a path that begins elsewhere.
        dt: control step [s].
        acceleration: (dof,) limits [rad/s^2]; None for those of `plan_motion`.
    """
    motion = plan_motion(
        solver,
        start,
        path.q[0],
        dt=dt,
        velocity_limit=path.velocity_limit,
        acceleration_limit=ACCELERATION if acceleration is None else acceleration,
    )
    if not motion.success:
        status = ("HELD",) * len(path)
        q = checks.read_only(np.tile(start, (len(path), 1)))
        away = checks.read_only(np.full(len(path), np.nan))
        message = f"there is no way from the start to where the path would begin: {motion.message}"
        still = checks.read_only(np.zeros_like(q))
        return replace(
            path,
            q=q,
            v=still,
            a=still,
            status=status,
            limiting=(message,) * len(path),
            position_error=away,
            orientation_error=away,
            clearance=away,
            message=message,
        )
    # All but its last row are whole steps; the last one is reached within the step after them.
    count = len(motion) - 1
    q = np.vstack([motion.q[:-1], path.q])
    v = np.zeros_like(q)
    v[1:] = np.diff(q, axis=0) / dt
    unknown = np.full(count, np.nan)
    clear = motion.clearance[:-1] if not np.isnan(path.clearance).all() else unknown
    t = checks.read_only(np.arange(len(q)) * dt)
    return replace(
        path,
        t=t,
        q=checks.read_only(q),
        v=checks.read_only(v),
        a=changes(t, v),
        status=(LEAD_IN,) * count + path.status,
        limiting=("",) * count + path.limiting,
        segment=checks.sealed(np.concatenate([np.full(count, -1, dtype=np.intp), path.segment])),
        position_error=checks.read_only(np.concatenate([unknown, path.position_error])),
        orientation_error=checks.read_only(np.concatenate([unknown, path.orientation_error])),
        clearance=checks.read_only(np.concatenate([clear, path.clearance])),
        start_distance=0.0,
        message=f"{path.message.partition(';')[0]}, after a motion of {motion.duration:.4g} s to where it begins",
    )
