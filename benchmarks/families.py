"""Families of configurations against scans of 20,000 parameters by other code; members, ends, time.

Run ``python -m benchmarks.families [targets]``; 300 of each kind take about six minutes, nearly all of it the scans.
Six joints are scanned by the closed form, pose by pose, seven by `scan_seven`.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import jacokin
from benchmarks import environments, report
from benchmarks.scan_seven import Scan, within_limits
from benchmarks.worker import Worker, WorkerError
from jacokin import FreeAxis, IKSolver, Robot
from jacokin.arrays import Array
from jacokin.ik import SolutionSet
from jacokin.model.angles import TURN, wrap_to_pi

SCANNED = 20_000
LONG = 1e-3  # [rad] of an interval that must be found
STEP, NEWTON_STEPS = 1e-5, 4  # of the search for ends: of differences [rad], and how many
FOLD_SCALE = 30.0  # of determinants, to the size of the other equations
CLOSURE = 1e-9  # [m] and [rad] by which members may be off
OWN = 1e-6  # [rad] a member this near is the generating configuration
MEMBERS = 7  # of each interval that are looked at
PEER = environments.Peer("ssik", "ssik `j2s7s300_ik.solve`", "ssik_solver", ("ssik==8.2.0",), variant="j2s7s300_ik")
PEER_TARGETS = 120

Counter = Callable[[Array], NDArray[np.int64]]


@dataclass
class Tally:
    """What was found wrong on targets of one kind, and times of calls [s]."""

    name: str
    number: int = 0
    intervals: int = 0
    missed: int = 0
    """Targets where the number of members differs from the scan's on more than LONG."""
    ends: float = 0.0
    """Largest distance of an end from where Newton's method puts it [rad]."""
    bad: int = 0
    """Members outside the limits or farther off than CLOSURE."""
    own: int = 0
    """Targets whose generating configuration is a member."""
    incomplete: int = 0
    all_times: list[float] = field(default_factory=list)
    solve_times: list[float] = field(default_factory=list)


def count_members(found: SolutionSet, parameters: Array) -> NDArray[np.int64]:
    """How many intervals hold each parameter."""
    count = np.zeros(len(parameters), dtype=np.int64)
    for interval in found.intervals:
        for turns in (-TURN, 0.0, TURN):
            count += (parameters + turns >= interval.start) & (parameters + turns < interval.stop)
    return count


def longest_difference(found: SolutionSet, scan: Counter) -> float:
    """Longest run [rad] of parameters at which the set has another number of members than a scan."""
    parameters = -np.pi + TURN * (np.arange(SCANNED) + 0.5) / SCANNED
    wrong = count_members(found, parameters) != scan(parameters)
    runs = [len(list(group)) for differs, group in itertools.groupby(wrong) if differs]
    return max(runs, default=0) * TURN / SCANNED


def worst_end(robot: Robot, found: SolutionSet, target: FreeAxis | pin.SE3) -> float:
    """Largest distance [rad] of an end of an interval from where Newton's method, by Pinocchio, puts it."""
    worst = 0.0
    for interval in found.intervals:
        for p, end in zip((interval.start, interval.stop), interval.ends, strict=True):
            if end.kind in ("limit", "fold"):
                worst = max(worst, end_error(robot, target, interval.at(p), p, end.joint))
    return worst


def end_error(robot: Robot, target: FreeAxis | pin.SE3, q: Array, p: float, joint: str | None) -> float:
    """Distance [rad] of the parameter from where a joint is on its limit, or for None from the fold."""
    free = isinstance(target, FreeAxis)
    index = None if joint is None else robot.joint_index(joint)

    def equations(x: Array) -> Array:
        T = target.at(x[-1]) if isinstance(target, FreeAxis) else target
        configuration = x[:-1] if free else x
        closure = pin.log6(T.actInv(robot.forward_kinematics(configuration))).vector
        if index is not None:
            return np.array([*closure, configuration[index] - q[index]])
        jacobian = robot.jacobian(configuration, reference="local")
        return np.array([*closure, FOLD_SCALE * np.linalg.det(jacobian if free else np.delete(jacobian, 2, axis=1))])

    x = np.r_[q, p] if free else q.copy()
    for _ in range(NEWTON_STEPS):
        slopes = [(equations(x + STEP * way) - equations(x - STEP * way)) / (2.0 * STEP) for way in np.eye(len(x))]
        x = x - np.linalg.solve(np.array(slopes).T, equations(x))
    return abs(float(x[-1] - p if free else x[2] - q[2]))


def bad_members(robot: Robot, found: SolutionSet, target: FreeAxis | pin.SE3) -> int:
    """Members all along the intervals that do not reach the target within the limits, by Pinocchio."""
    bad = 0
    for interval in found.intervals:
        for p in np.linspace(interval.start, interval.stop, MEMBERS):
            q = interval.at(p)
            T = target.at(p) if isinstance(target, FreeAxis) else target
            error = np.abs(T.actInv(robot.forward_kinematics(q)).homogeneous - np.eye(4)).max()
            bad += error > CLOSURE or not robot.within_limits(q)
    return bad


def enter(
    tally: Tally, solver: IKSolver, target: FreeAxis | pin.SE3, q: Array, parameter: float, scan: Counter
) -> None:
    """Find the family of one target, and check it."""
    begin = time.perf_counter()
    found = solver.solve_all(target)
    tally.all_times.append(time.perf_counter() - begin)
    begin = time.perf_counter()
    solver.solve(target)
    tally.solve_times.append(time.perf_counter() - begin)
    tally.number += 1
    tally.intervals += len(found)
    tally.incomplete += not found.complete
    tally.missed += longest_difference(found, scan) > LONG
    tally.ends = max(tally.ends, worst_end(solver.robot, found, target))
    tally.bad += bad_members(solver.robot, found, target)
    tally.own += any(
        np.abs(wrap_to_pi(interval.at(parameter) - q)).max() < OWN
        for interval in found.intervals
        if interval.contains(parameter)
    )


def free_axes(size: int) -> list[Tally]:
    """Random free axes on six joints: across the tool, along the last joint, skew."""
    solver, rng = IKSolver(jacokin.load_robot(), collision="ignore"), np.random.default_rng(0)
    tallies = [Tally(f"six joints, axis {name}") for name in ("across the tool", "of joint 6", "skew")]
    form, seed = solver.closed_form(), np.tile(solver.robot.home, (SCANNED, 1))
    for number in range(size):
        q = solver.robot.sample(rng)
        axis = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), rng.normal(size=3))[number % 3]
        target = FreeAxis(solver.robot.forward_kinematics(q), axis=axis)

        def scan(parameters: Array, target: FreeAxis = target) -> NDArray[np.int64]:
            poses = np.array([target.matrix_at(p) for p in parameters])
            return form.solve_batch(poses, seed[: len(poses)]).branches_within_limits

        enter(tallies[number % 3], solver, target, q, 0.0, scan)
    return tallies


def seven_joints(size: int) -> list[Tally]:
    """Random poses of seven joints, and half as many structured ones."""
    solver, rng = IKSolver(jacokin.load_robot("j2s7s300"), collision="ignore"), np.random.default_rng(0)
    robot, scanner = solver.robot, Scan(solver.robot)
    shares = {"random": size, "stretched": size // 6, "on a limit": size // 6, "tool vertical": size // 6}
    tallies = {name: Tally(f"seven joints, {name}") for name in shares}
    down = jacokin.pose((0.0, 0.0, 0.0), down=True).rotation
    for name, share in (
        ("random", size),
        ("stretched", size // 6),
        ("on a limit", size // 6),
        ("tool vertical", size // 6),
    ):
        while tallies[name].number < share:
            q = robot.sample(rng)
            if name == "stretched":
                q[3] = np.pi + rng.uniform(-0.02, 0.02)
            elif name == "on a limit":
                joint = (1, 3, 5)[tallies[name].number % 3]
                q[joint] = (robot.lower, robot.upper)[tallies[name].number // 3 % 2][joint]
            target = robot.forward_kinematics(q)
            if name == "tool vertical":
                result = solver.solve(pin.SE3(down, target.translation), seed=q, closest=False)
                if not result.success:
                    continue
                q, target = result.q, pin.SE3(down, target.translation)

            def scan(parameters: Array, T: Array = target.homogeneous) -> NDArray[np.int64]:
                rows = scanner.configurations(T, parameters)
                return np.asarray((np.isfinite(rows[..., 0]) & within_limits(robot, rows)).sum(axis=1))

            enter(tallies[name], solver, target, q, float(q[2]), scan)
    return list(tallies.values())


def peer_row() -> tuple[str, ...]:
    """Time of ssik's samples for seven joints, and how many there are."""
    robot, rng = jacokin.load_robot("j2s7s300"), np.random.default_rng(1)
    try:
        with Worker(environments.interpreter(PEER), PEER.module) as worker:
            version = worker.start({"variant": PEER.variant})
            answers, times = worker.solve(worker.forward(robot.sample(rng, PEER_TARGETS)))
    except (environments.InstallError, WorkerError) as error:
        return (PEER.title, "-", f"not measured: {error}", "-", "-")
    samples = float(np.mean([len(rows) for rows in answers]))
    seconds = times[:, 0]
    return (
        f"{PEER.title}, {version}",
        f"{PEER_TARGETS}",
        f"{samples:.0f} samples",
        report.seconds(float(np.median(seconds))),
        report.seconds(float(np.percentile(seconds, 99))),
    )


def section(size: int) -> report.Section:
    """The part of the page on families."""
    tallies = [*free_axes(size), *seven_joints(size)]
    found = report.table(FOUND_HEADER, [_found_row(tally) for tally in tallies])
    times = [_time_row(tally, "solve_all") for tally in tallies] + [_time_row(tally, "solve") for tally in tallies]
    return report.Section(
        "Families: one free parameter",
        "\n\n".join([INTRODUCTION, found, report.table(TIME_HEADER, [*times, peer_row()])]),
    )


INTRODUCTION = f"""Each target is scanned at {SCANNED:,} values of its parameter by other code: six joints by the closed
form, pose by pose, seven by textbook subproblems in NumPy. *Missed*: targets whose number of members differs from the
scan's on more than {LONG:g} rad. *Ends*: largest distance of an end of an interval from where Newton's method, by
Pinocchio, puts the fold or the joint on its limit. *Bad members*: of {MEMBERS} on each interval, those outside the
limits, or farther than {CLOSURE:g} m or rad from the target, by Pinocchio. *Own*: the configuration that the target was
made from is a member. All seeds are home."""

FOUND_HEADER = ("targets", "number", "intervals", "missed", "ends", "bad members", "own", "incomplete")
TIME_HEADER = ("call", "targets", "answers", "median", "p99")


def _found_row(tally: Tally) -> tuple[str, ...]:
    first = (f"{count:,}" for count in (tally.number, tally.intervals, tally.missed))
    last = (f"{count:,}" for count in (tally.bad, tally.own, tally.incomplete))
    return (tally.name, *first, report.number(tally.ends, "rad"), *last)


def _time_row(tally: Tally, call: str) -> tuple[str, ...]:
    times = tally.all_times if call == "solve_all" else tally.solve_times
    answers = f"{tally.intervals / max(tally.number, 1):.1f} intervals" if call == "solve_all" else "one"
    spread = (report.seconds(float(np.percentile(times, share))) for share in (50, 99)) if times else ("-", "-")
    return (f"`{call}`, {tally.name}", f"{tally.number}", answers, *spread)


def main(arguments: Sequence[str]) -> None:
    """Print the section."""
    print(section(int(arguments[0]) if arguments else 300).body)


if __name__ == "__main__":
    main(sys.argv[1:])
