"""Follow a Cartesian path, from the start configuration that makes it possible.

A pose is reached in up to a dozen ways, and a path that is easy from one of them runs into a joint limit from another.
`track_path` starts the tracker on every legal branch of the first pose, nearest to the seed first, until one of them
stays on the path throughout.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, StructureError
from jacokin.ik import seeds
from jacokin.ik.paths import lines
from jacokin.ik.paths.lines import SampledPath
from jacokin.ik.paths.result import BranchReport, PathResult
from jacokin.ik.solver import IKSolver
from jacokin.ik.tracking.clearance import Clearance
from jacokin.ik.tracking.result import TrackerStep
from jacokin.ik.tracking.tracker import Tracker
from jacokin.model import angles, checks
from jacokin.model.robot import Robot

SPEED = 0.05  # [m/s]
ANGULAR_SPEED = 0.5  # [rad/s]
QP_STARTS = 24  # random seeds that look for branches where the closed form does not apply
PROGRESS_CALLS = 200  # per branch at most
SAME_BRANCH = 1e-3  # [rad] two starts nearer than this are one branch


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
    velocity_limit: ArrayLike | None = None,
    acceleration_limit: ArrayLike | None = None,
    collision: Clearance | None = None,
    qp_solver: str = "daqp",
    progress: Callable[[int, int], None] | None = None,
) -> PathResult:
    """Joint trajectory that moves the tool on straight lines through poses.

    Args:
        robot: the arm.
        waypoints: two or more poses T_base_tool, `pin.SE3` or (n, 4, 4).
        dt: control step [s].
        speed: along the lines [m/s], one for all segments or (n - 1,).
        angular_speed: of turning [rad/s], as `speed`; a segment takes the longer of the two times.
        frame: frame to move; None for the robot's default frame.
        tool: T_frame_tool, a constant pose after the frame.
        seed: (dof,) configuration [rad] to start near; None for home.
        velocity_limit: (dof,) or one for all [rad/s]; None for the robot's own.
        acceleration_limit: (dof,) or one for all [rad/s^2]; None for none. The arm then lags where the path's speed
            jumps, as it does at its start.
        collision: shapes to keep apart; None for none.
        qp_solver: a QP solver installed for qpsolvers.
        progress: called with ticks done and ticks in all, for the branch being tried.

    Returns:
        The first branch that stays on the path, or the one that stays on it longest; `branches` says what became of
        each. When no legal configuration reaches the first pose, the arm starts at the closest one and the result
        says so.

    Raises:
        InvalidInputError: malformed path, speeds or limits, see `Tracker`.
        UnknownNameError: unknown frame, QP solver or shape.
    """
    if not isinstance(robot, Robot):
        raise InvalidInputError(f"robot must be a jacokin.Robot (see load_robot), got {type(robot).__name__}")
    if progress is not None and not callable(progress):
        raise InvalidInputError(f"progress must be callable with two counts, or None, got {progress!r}")
    points = lines.checked_waypoints(waypoints)
    start, note = seeds.seed_within_limits(robot, seed)
    tracker = Tracker(
        robot,
        frame,
        dt=dt,
        tool=tool,
        q=start,
        velocity_limit=velocity_limit,
        acceleration_limit=acceleration_limit,
        collision=collision,
        qp_solver=qp_solver,
    )
    path = lines.sample(points, speed, angular_speed, tracker.dt)
    solver = IKSolver(robot, tracker.frame, tool=tool)
    legal = start_branches(solver, points[0], start)
    starts = legal or [solver.solve(points[0], seed=start).q]
    best: PathResult | None = None
    reports: list[BranchReport] = []
    for q in starts:
        result = _follow(tracker, path, q, progress)
        reports.append(_report(q, result))
        if best is None or _rank(result) < _rank(best):
            best = result
        if result.success:
            break
    assert best is not None  # there is at least one start
    words = [_sentence(best, len(reports), len(legal)), note]
    return replace(best, branches=tuple(reports), message="; ".join(word for word in words if word))


def start_branches(solver: IKSolver, pose: pin.SE3, seed: Array) -> list[Array]:
    """Legal configurations that reach a pose, nearest to the seed first: all of them by the closed form.

    Where the closed form does not apply, those that the QP finds from the seed and random configurations.
    """
    try:
        return [np.array(q) for q in solver.solve_all(pose, seed=seed).legal]
    except StructureError:
        pass
    robot, found = solver.robot, list[Array]()
    rng = np.random.default_rng(seeds.DEFAULT_RANDOM_SEED)
    for first in (seed, *robot.sample(rng, QP_STARTS)):
        result = solver.solve(pose, seed=first, max_restarts=0, closest=False)
        q = angles.nearest_copy(result.q, seed, robot.unlimited)
        if result.success and all(np.abs(q - other).max() > SAME_BRANCH for other in found):
            found.append(q)
    return sorted(found, key=lambda q: float(angles.circular_distance(q, seed, robot.unlimited)))


def _follow(tracker: Tracker, path: SampledPath, q: Array, progress: Callable[[int, int], None] | None) -> PathResult:
    """The whole path from one start."""
    tracker.reset(q)
    # The start is a tick that goes nowhere when it is on the path.
    steps: list[TrackerStep] = [tracker.measure(path.poses[0])]
    total = len(path.poses)
    every = 1 + total // PROGRESS_CALLS
    for index in range(1, total):
        steps.append(tracker.step(path.poses[index]))
        if progress is not None and (index % every == 0 or index + 1 == total):
            progress(index + 1, total)
    robot = tracker.robot
    return PathResult(
        joint_names=robot.joint_names,
        t=checks.read_only(np.arange(total) * tracker.dt),
        q=checks.read_only([step.q for step in steps]),
        v=checks.read_only([step.v for step in steps]),
        position_error=checks.read_only([step.position_error for step in steps]),
        orientation_error=checks.read_only([step.orientation_error for step in steps]),
        status=tuple(step.status.name for step in steps),
        limiting=tuple("; ".join(step.limiting) for step in steps),
        segment=path.segment,
        clearance=checks.read_only([np.nan if step.clearance is None else step.clearance for step in steps]),
        lower=robot.lower,
        upper=robot.upper,
        velocity_limit=tracker.velocity_limit,
        qp_solver=next((step.qp_solver for step in steps if "then" in step.qp_solver), steps[-1].qp_solver),
    )


def _report(q: Array, result: PathResult) -> BranchReport:
    return BranchReport(
        q_start=checks.read_only(q),
        failed_segments=result.failed_segments,
        position_error=float(result.position_error.max()),
        orientation_error=float(result.orientation_error.max()),
    )


def _rank(result: PathResult) -> tuple[int, float]:
    """Fewest ticks off the path first, then the smaller error."""
    return sum(status != "OK" for status in result.status), float(result.position_error.max())


def _sentence(result: PathResult, tried: int, legal: int) -> str:
    if not legal:
        return "no legal configuration reaches the first pose; started at the closest one found"
    if result.success:
        return f"branch {tried} of {legal} stays on the path"
    failed = ", ".join(str(segment) for segment in result.failed_segments)
    return f"none of the {legal} legal branches stays on the path; the best one leaves it on segment {failed}"
