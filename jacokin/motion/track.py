"""Follow a Cartesian path, from the start configuration that makes it possible. Read this file first.

A pose is reached in up to a dozen ways, and a path that is easy from one of them runs into a joint limit from another.
`track_path` starts the tracker on every branch of the first pose within the limits (on seven joints: on members of its
curves), nearest to the seed first, until one of them stays on the path throughout; or on the one that the arm is on.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, StructureError
from jacokin.ik import seeds
from jacokin.ik.options import TRACKING_ORIENTATION_TOLERANCE, TRACKING_POSITION_TOLERANCE
from jacokin.ik.solver import IKSolver
from jacokin.ik.targets import matrix_errors
from jacokin.model import angles, checks
from jacokin.model.robot import Robot, checked_robot
from jacokin.model.scene import Scene
from jacokin.motion.path import CartesianPath
from jacokin.motion.rows import HELD, Limits, averaged_rows, spline_rows
from jacokin.motion.timing import Schedule, check_ticks, fit_line, sample_lines
from jacokin.motion.tracking.steps import TrackerStatus, TrackerStep
from jacokin.motion.tracking.tracker import Tracker
from jacokin.motion.trajectory import BranchReport, Trajectory, list_segments

SPEED = 0.05  # [m/s]
ANGULAR_SPEED = 0.5  # [rad/s]

Progress = Callable[[int, int], None]


def track_path(
    robot: Robot,
    waypoints: Sequence[pin.SE3] | ArrayLike,
    dt: float = 0.01,
    *,
    speed: ArrayLike = SPEED,
    angular_speed: ArrayLike = ANGULAR_SPEED,
    frame: str | None = None,
    tool: pin.SE3 | ArrayLike | None = None,
    seed: ArrayLike | None = None,
    start: ArrayLike | None = None,
    velocity_limit: ArrayLike | None = None,
    acceleration_limit: ArrayLike | None = None,
    scene: Scene | None = None,
    clearance: float | None = None,
    collision: str | None = None,
    self_collision: bool = True,
    pairs: Sequence[tuple[str, str]] | None = None,
    qp_solver: str = "daqp",
    progress: Callable[[int, int], None] | None = None,
) -> Trajectory:
    """Joint trajectory that moves the tool on straight lines through poses.

    Args:
        robot: the arm.
        waypoints: two or more poses T_base_tool, `pin.SE3` or (n, 4, 4).
        dt: control step [s].
        speed: along the lines [m/s], one for all segments or (n - 1,).
        angular_speed: of turning [rad/s], as `speed`; a segment takes the longer of the two times.
        frame: frame to move; None for the robot's default frame.
        tool: T_frame_tool, a constant pose after the frame.
        seed: (dof,) configuration [rad] to start near; None for home. The path may begin on another branch if that is
            the one that allows it: `Trajectory.start_distance` says how far from the seed.
        start: (dof,) configuration [rad] that the arm is in, instead of `seed`; the path begins there, and no other
            branch is tried.
        velocity_limit: (dof,) or one for all [rad/s]; None for the robot's own.
        acceleration_limit: (dof,) or one for all [rad/s^2]; None for the robot's own, `numpy.inf` for none. With one,
            each line is run through from rest to rest, and more slowly than asked for where the joints need it;
            without, at the speed asked for, and velocities jump at corners and at both ends.
        scene: obstacles around the arm, in the base frame.
        clearance: shapes are kept this far apart [m]; None for 0.01.
        collision: "reject" or "ignore"; None for "reject" where a scene, a clearance or pairs are given.
        self_collision: False to keep the arm clear of obstacles only.
        pairs: exactly these pairs of shapes, by name, instead of all.
        qp_solver: a QP solver installed for qpsolvers.
        progress: called with ticks done and ticks in all, for the branch being tried.

    Returns:
        The first branch that stays on the path, or the one that stays on it longest; `branches` reports on each. When
        no configuration within the limits reaches the first pose, the arm starts at the closest one and the result
        says so.

    Raises:
        InvalidInputError: malformed path, speeds or limits, see `Tracker`; `start` beside `seed`.
        UnknownNameError: unknown frame, QP solver, collision mode or shape.
    """
    checked_robot("robot", robot)
    checks.optional(checks.function, "progress", progress, "callable with two counts, or None")
    path = CartesianPath(waypoints, "", "waypoints")
    if path.free:
        raise InvalidInputError("track_path follows full poses; plan_path takes waypoints with a free axis")
    times = path.durations(speed, angular_speed)
    near, note = seeds.choose_start(robot, seed, start)

    tracker = Tracker(
        robot,
        frame,
        dt=dt,
        tool=tool,
        q=near,
        velocity_limit=velocity_limit,
        acceleration_limit=acceleration_limit,
        scene=scene,
        clearance=clearance,
        collision=collision,
        self_collision=self_collision,
        pairs=pairs,
        qp_solver=qp_solver,
    )
    rehearsal = None
    if np.isfinite(tracker.acceleration_limit).any():
        # 1000 rad/s are no limit in effect.
        rehearsal = Tracker(robot, frame, dt=dt, tool=tool, velocity_limit=1e3, acceleration_limit=np.inf)
    follower = _Follower(tracker, path, times, progress, rehearsal)
    if start is not None:
        starts, reaching = [near], 1
    else:
        solver = IKSolver(robot, tracker.frame, tool=tool, qp_solver=qp_solver, collision="ignore")
        starts = start_branches(solver, path.poses[0], near)
        reaching = len(starts)
        starts = starts or [solver.solve(path.poses[0], seed=near).q]
    best: Trajectory | None = None
    reports: list[BranchReport] = []
    for q in starts:
        result = follower.follow(q)
        report = BranchReport(
            q_start=checks.read_only(q),
            failed_segments=result.failed_segments,
            position_error=float(result.position_error.max()),
            orientation_error=float(result.orientation_error.max()),
        )
        reports.append(report)
        if best is None or _rank(result) < _rank(best):
            best = result
        if result.success:
            break
    assert best is not None  # there is at least one start
    away = np.abs(best.q[0] - near)
    if start is not None:
        words = [_sentence_from_start(best), note]
    else:
        words = [
            _sentence(best, len(reports), reaching, "start" if solver.dimension() == 1 else "branch"),
            seeds.describe_jump(robot, away, "home" if seed is None else "the seed"),
            note,
        ]
    return replace(
        best,
        branches=tuple(reports),
        message="; ".join(word for word in words if word),
        start_distance=float(away.max()),
    )


def start_branches(solver: IKSolver, pose: pin.SE3, seed: Array) -> list[Array]:
    """Configurations within the limits that reach a pose, nearest to the seed first: all of them by the closed form.

    On seven joints the nearest one and others spread over all intervals. Where the closed form does not apply, those
    that the QP finds from the seed and random configurations.
    """
    try:
        reaching = solver.solve_all(pose, seed=seed)
    except StructureError:
        pass
    else:
        if reaching.dimension == 0:
            return [np.array(q) for q in reaching.q_within_limits]
        nearest = reaching.nearest(seed)
        if nearest is None:
            return []
        others = reaching.sample(24)
        order = np.argsort(angles.circular_distance(others, seed, solver.robot.unlimited), kind="stable")
        return [nearest, *(np.array(q) for q in others[order])]
    robot, found = solver.robot, list[Array]()
    rng = np.random.default_rng(seeds.DEFAULT_RANDOM_SEED)
    for first in (seed, *robot.sample(rng, 24)):
        result = solver.solve(pose, seed=first, max_restarts=0, closest=False)
        q = angles.nearest_copy(result.q, seed, robot.unlimited)
        if result.success and all(np.abs(q - other).max() > 1e-3 for other in found):  # [rad] else the same one
            found.append(q)
    return sorted(found, key=lambda q: float(angles.circular_distance(q, seed, robot.unlimited)))


class _Follower:
    """Follows the lines from one start after another.

    Under acceleration limits each start is rehearsed without limits on velocity and acceleration: how the joints move
    along the lines decides how fast the lines can be run through. Limits hold between rows, too.
    """

    def __init__(
        self,
        tracker: Tracker,
        path: CartesianPath,
        times: Array,
        progress: Progress | None,
        rehearsal: Tracker | None,
    ) -> None:
        """Take the path and how long its lines take at the speed asked for (lines,) [s].

        With acceleration limits also a tracker without limits, to rehearse with.
        """
        check_ticks(times, tracker.dt)
        self._tracker, self._path, self._times, self._progress = tracker, path, times, progress
        self._rehearsal = rehearsal
        self._frame = tracker.robot.frame_id(tracker.frame)

    def follow(self, q: Array) -> Trajectory:
        """The whole path from a configuration (dof,) [rad]."""
        times, dt = self._times, self._tracker.dt
        u = sample_lines(times, dt)
        if self._rehearsal is not None:
            # Lines have 200 ticks at least, which show how joints speed up and slow down.
            u = sample_lines(np.where(times > 0.0, np.maximum(times, 200 * dt), 0.0), dt)
            u = self._accelerated(u, self._steps(self._rehearsal, u, q, None))
        return self._result(u, self._steps(self._tracker, u, q, self._progress))

    def _accelerated(self, u: Array, rehearsed: list[TrackerStep]) -> Array:
        """Places of the ticks with each line run through from rest to rest, for rehearsed ticks at places (n,)."""
        q, dt = np.array([step.q for step in rehearsed]), self._tracker.dt
        times, schedules = self._times.copy(), dict[int, Schedule]()
        for line, end in enumerate(np.searchsorted(u, np.arange(1.0, len(times) + 1.0)).tolist()):
            start = int(np.searchsorted(u, line, side="right")) - 1
            on_path = all(step.status is TrackerStatus.OK for step in rehearsed[start : end + 1])
            if times[line] > 0.0 and on_path:  # what the rehearsal leaves fails at any speed
                knots = np.append(float(line), u[start + 1 : end + 1])
                limits = self._tracker.velocity_limit, self._tracker.acceleration_limit
                schedules[line] = fit_line(knots, q[start : end + 1], float(times[line]), *limits)
                times[line] = schedules[line].t[-1]
        check_ticks(times, dt)
        ticks = sample_lines(times, dt)
        places = [np.zeros(1)]
        for line in range(len(times)):
            between = (ticks > line) & (ticks <= line + 1)
            places.append(schedules[line].ticks(dt)[1:] if line in schedules else ticks[between])
        return np.concatenate(places)

    def _steps(self, tracker: Tracker, u: Array, q: Array, progress: Progress | None) -> list[TrackerStep]:
        """A tick for every place of the path, and those until the arm stands; the first one only measures the start."""
        poses = [pin.SE3(T[:3, :3], T[:3, 3]) for T in self._path.at(u)]
        tracker.reset(q)
        steps = [tracker.measure(poses[0])]
        every = 1 + len(u) // 200  # at most so many calls
        for index, pose in enumerate(poses[1:], start=1):
            steps.append(tracker.step(pose))
            if progress is not None and (index % every == 0 or index + 1 == len(u)):
                progress(index + 1, len(u))
        settling = int(1.0 / tracker.dt)  # [s] in which the arm may still come nearer to the end
        while self._rehearsal is not None and np.abs(tracker.v).max() > 1e-6:  # [rad/s]
            if settling:
                settling -= 1
                steps.append(tracker.step(poses[-1]))
            else:
                tracker.brake()
                steps.append(tracker.measure(poses[-1]))
        if progress is not None and len(steps) > len(u):
            progress(len(steps), len(steps))
        return steps

    def _result(self, u: Array, steps: list[TrackerStep]) -> Trajectory:
        tracker, q = self._tracker, np.array([step.q for step in steps])
        u = np.append(u, np.full(len(steps) - len(u), u[-1]))
        rows = spline_rows(q, tracker.dt)
        limits = Limits(tracker.velocity_limit, tracker.acceleration_limit)
        if self._rehearsal is not None and float(limits.strain(rows).max()) > HELD:
            # Ticks that brake as hard as they may: a spline through them swings.
            rows = averaged_rows(q, tracker.dt)
            steps, u = [steps[0], *steps, steps[-1]], np.concatenate([u[:1], u, u[-1:]])
            steps = [self._at_row(*row) for row in zip(steps, rows.q, self._path.at(u), strict=True)]
        return Trajectory(
            joint_names=tracker.robot.joint_names,
            t=checks.read_only(rows.t),
            q=checks.read_only(rows.q),
            v=checks.read_only(rows.v),
            a=checks.read_only(rows.a),
            lower=tracker.robot.lower,
            upper=tracker.robot.upper,
            velocity_limit=tracker.velocity_limit,
            sliding=tracker.robot.sliding,
            position_error=checks.read_only([step.position_error for step in steps]),
            orientation_error=checks.read_only([step.orientation_error for step in steps]),
            status=tuple(step.status.name for step in steps),
            limiting=tuple("; ".join(step.limiting) for step in steps),
            segment=self._path.segments(u),
            clearance=checks.read_only([np.nan if step.clearance is None else step.clearance for step in steps]),
            qp_solver=next((step.qp_solver for step in steps if "then" in step.qp_solver), steps[-1].qp_solver),
        )

    def _at_row(self, step: TrackerStep, q: Array, pose: Array) -> TrackerStep:
        """A tick towards a pose (4, 4) as it is for a row beside it, (dof,) [rad]."""
        tracker = self._tracker
        position, turn = matrix_errors(tracker.robot.placement(q, self._frame) * tracker.tool, pose)
        is_off = position > TRACKING_POSITION_TOLERANCE or turn > TRACKING_ORIENTATION_TOLERANCE
        status = TrackerStatus.LIMITED if is_off and step.status is TrackerStatus.OK else step.status
        return replace(step, position_error=position, orientation_error=turn, status=status)


def _rank(result: Trajectory) -> tuple[float, float]:
    """Least part of the ticks off the path first, then the smaller error."""
    return sum(status != "OK" for status in result.status) / len(result), float(result.position_error.max())


def _sentence(result: Trajectory, tried: int, reaching: int, word: str) -> str:
    if not reaching:
        return "no configuration within the limits reaches the first pose; started at the closest one found"
    if result.success:
        return f"{word} {tried} of {reaching} stays on the path"
    words = "branches" if word == "branch" else f"{word}s"
    where = list_segments(result.failed_segments)
    return f"none of the {reaching} {words} stays on the path; the best one leaves it on segment {where}{_why(result)}"


def _sentence_from_start(result: Trajectory) -> str:
    if result.success:
        return "the given start stays on the path"
    if result.status[0] != "OK":
        return (
            f"the given start is not at the first pose: {result.position_error[0]:.3g} m and "
            f"{result.orientation_error[0]:.3g} rad away"
        )
    return f"the given start leaves the path on segment {list_segments(result.failed_segments)}{_why(result)}"


def _why(result: Trajectory) -> str:
    """What holds the arm back in most ticks that are off the path, for the end of a sentence."""
    off = [words for words, status in zip(result.limiting, result.status, strict=True) if status != "OK"]
    often = Counter(word for words in off for word in words.split("; ") if word).most_common(2)
    return f", held back by {' and '.join(word for word, _ in often)}" if often else ""
