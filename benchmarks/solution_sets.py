"""Sets of solutions with a free parameter against scans of its values by other code; members, ends, time.

Run ``python -m benchmarks.solution_sets [targets]``; 300 of each kind take about eight minutes, nearly all of it the
scans. Six joints are scanned by the closed form, pose by pose, seven of a Jaco by `scan_seven`, others by the closed
form of six joints with the parameter held.
"""

from __future__ import annotations

import itertools
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

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
from tests.seven_joint_arms import ARMS, load_arm

SCANNED, SCANNED_HELD = 20_000, 2_000  # values of the parameter; where a joint is held at each
LONG = 1e-3  # [rad] of an interval that must be found
STEP, NEWTON_STEPS = 1e-5, 4  # of the search for ends: of differences [rad], and how many
FOLD_SCALE = 30.0  # of determinants, to the size of the other equations
CLOSURE = 1e-9  # [m] and [rad] by which members may be off
OWN = 1e-6  # [rad] a member this near is the generating configuration
MEMBERS = 7  # of each interval that are looked at
PEER = environments.Peer("ssik", "ssik `j2s7s300_ik.solve`", "ssik_solver", ("ssik==8.2.0",), variant="j2s7s300_ik")
PEER_TARGETS = 120
HELD = (
    ("j2s7s300", "joint_1"),
    ("j2s7s300", "joint_3"),
    ("gen3", "joint_3"),
    ("gen3", "joint_7"),
    ("panda", "joint_4"),
)
HELD_VALUES = 200  # of each of those

Counter = Callable[[Array], NDArray[np.int64]]


@dataclass
class Tally:
    """What was found wrong on targets of one kind, and times of calls [s]."""

    name: str
    number: int = 0
    intervals: int = 0
    missed: int = 0
    """Targets where the number of members differs from the scan's on more than LONG,"""
    wrongly_complete: int = 0
    """and of those, where the set says that it is complete."""
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


def longest_difference(found: SolutionSet, scan: Counter, scanned: int = SCANNED) -> float:
    """Longest run [rad] of so many parameters at which the set has another number of members than a scan."""
    parameters = -np.pi + TURN * (np.arange(scanned) + 0.5) / scanned
    wrong = count_members(found, parameters) != scan(parameters)
    runs = [len(list(group)) for differs, group in itertools.groupby(wrong) if differs]
    return max(runs, default=0) * TURN / scanned


def worst_end(robot: Robot, found: SolutionSet, target: FreeAxis | pin.SE3) -> float:
    """Largest distance [rad] of an end of an interval from where Newton's method, by Pinocchio, puts it."""
    worst = 0.0
    for interval in found.intervals:
        for p, end in zip((interval.start, interval.stop), interval.ends, strict=True):
            if end.kind in ("limit", "fold"):
                worst = max(worst, end_error(robot, target, interval.at(p), found.parameter, p, end.joint))
    return worst


def end_error(
    robot: Robot, target: FreeAxis | pin.SE3, q: Array, parameter: str | None, p: float, joint: str | None
) -> float:
    """Distance [rad] of the parameter from where a joint is on its limit, or for None from the fold."""
    free = isinstance(target, FreeAxis)
    held = None if free or parameter is None else robot.joint_index(parameter)
    index = None if joint is None else robot.joint_index(joint)

    def equations(x: Array) -> Array:
        T = target.at(x[-1]) if isinstance(target, FreeAxis) else target
        configuration = x[:-1] if free else x
        closure = pin.log6(T.actInv(robot.forward_kinematics(configuration))).vector
        if index is not None:
            return np.array([*closure, configuration[index] - q[index]])
        jacobian = robot.jacobian(configuration, reference="local")
        return np.array(
            [*closure, FOLD_SCALE * np.linalg.det(jacobian if held is None else np.delete(jacobian, held, axis=1))]
        )

    x = np.r_[q, p] if free else q.copy()
    for _ in range(NEWTON_STEPS):
        slopes = [(equations(x + STEP * way) - equations(x - STEP * way)) / (2.0 * STEP) for way in np.eye(len(x))]
        x = x - np.linalg.solve(np.array(slopes).T, equations(x))
    return abs(float(x[-1] - p if held is None else x[held] - q[held]))


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
    tally: Tally,
    solver: IKSolver,
    target: FreeAxis | pin.SE3,
    q: Array,
    parameter: float,
    scan: Counter,
    scanned: int = SCANNED,
) -> None:
    """Find the set of one target, and check it."""
    begin = time.perf_counter()
    found = solver.solve_all(target)
    tally.all_times.append(time.perf_counter() - begin)
    begin = time.perf_counter()
    solver.solve(target)
    tally.solve_times.append(time.perf_counter() - begin)
    tally.number += 1
    tally.intervals += len(found)
    tally.incomplete += not found.complete
    missed = longest_difference(found, scan, scanned) > LONG
    tally.missed += missed
    tally.wrongly_complete += missed and found.complete
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


def any_structure(size: int) -> list[Tally]:
    """Random poses of seven joints by other makers, the parameter held at every value that is scanned."""
    tallies = []
    for name in ARMS:
        robot, rng = other_arm(name), np.random.default_rng(0)
        solver = IKSolver(robot, collision="ignore")
        joint = str(solver.parameter)
        tally, index = Tally(f"{name}, {joint}"), robot.joint_index(joint)
        for q in robot.sample(rng, size):
            target = robot.forward_kinematics(q)
            enter(tally, solver, target, q, float(q[index]), held_scan(solver, target, joint), SCANNED_HELD)
        tallies.append(tally)
    return tallies


def held_scan(solver: IKSolver, target: pin.SE3, joint: str) -> Counter:
    """Counts the configurations of a pose within the limits at values of a joint."""
    index = solver.robot.joint_index(joint)
    lower, upper = solver.robot.lower[index], solver.robot.upper[index]

    def scan(parameters: Array) -> NDArray[np.int64]:
        count = np.zeros(len(parameters), dtype=np.int64)
        for each in np.flatnonzero((parameters >= lower) & (parameters <= upper)):
            found = solver.solve_all(target, fixed={joint: float(parameters[each])})
            count[each] = found.within_limits.sum()
        return count

    return scan


def other_arm(name: str) -> Robot:
    """An arm by its name: a bundled one, or one by another maker."""
    if name not in ARMS:
        return jacokin.load_robot(name)
    with tempfile.TemporaryDirectory() as folder:
        return load_arm(name, Path(folder))


def held_row(name: str, joint: str) -> tuple[str, ...]:
    """Times of points with a joint held: the first call, with other values, and with the same value again."""
    robot, rng = other_arm(name), np.random.default_rng(2)
    solver, index = IKSolver(robot, collision="ignore"), robot.joint_index(joint)
    rows = robot.sample(rng, HELD_VALUES)

    def times(values: Array) -> Array:
        spent = np.empty(len(rows))
        for k, (q, value) in enumerate(zip(rows, values, strict=True)):
            held = q.copy()
            held[index] = value
            target, fixed = robot.forward_kinematics(held), {joint: float(value)}
            begin = time.perf_counter()
            solver.solve_all(target, fixed=fixed)
            spent[k] = time.perf_counter() - begin
        return spent

    other = times(rows[:, index])
    same = times(np.full(len(rows), rows[-1, index]))
    figures = (other[0], np.median(other[1:]), np.percentile(other[1:], 99), np.median(same))
    return (f"{name}, {joint}", *(report.seconds(float(figure)) for figure in figures))


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
    """The part of the page on sets with a free parameter."""
    tallies = [*free_axes(size), *seven_joints(size), *any_structure(max(size // 10, 3))]
    found = report.condensed(FOUND_HEADER, [_found_row(tally) for tally in tallies], PROMISED)
    times = [_time_row(tally, "solve_all") for tally in tallies] + [_time_row(tally, "solve") for tally in tallies]
    return report.Section(
        "Sets of solutions: one free parameter",
        "\n\n".join(
            [
                INTRODUCTION,
                found,
                report.table(TIME_HEADER, [*times, peer_row()]),
                HELD_INTRODUCTION,
                report.table(HELD_HEADER, [held_row(*each) for each in HELD]),
            ]
        ),
    )


INTRODUCTION = f"""Each target is scanned at {SCANNED:,} values of its parameter by other code: six joints by the closed
form, pose by pose, seven of a Jaco by textbook subproblems in NumPy; arms by other makers at {SCANNED_HELD:,} values,
by the closed form of six joints. *Missed*: targets whose number of solutions differs from the scan's on more than
{LONG:g} rad; *wrongly complete*: of those, the ones that say they are complete. *Ends*: largest distance of an end of
an interval from where Newton's method, by Pinocchio, puts the fold or the joint on its limit. *Bad solutions*: of
{MEMBERS} on each interval, those outside the limits, or farther than {CLOSURE:g} m or rad from the target, by
Pinocchio. *Own*: the configuration that the target was made from is a solution. All seeds are home."""

HELD_INTRODUCTION = f"""Seven joints, one of them held by `solve_all(fixed=...)`: the first call, calls with
{HELD_VALUES} other values, and with one value again and again."""

FOUND_HEADER = (
    "targets",
    "number",
    "intervals",
    "missed",
    "wrongly complete",
    "ends",
    "bad solutions",
    "own",
    "incomplete",
)
PROMISED = ("missed", "wrongly complete", "bad solutions")
HELD_HEADER = ("held", "first", "other values", "p99", "same value")
TIME_HEADER = ("call", "targets", "answers", "median", "p99")


def _found_row(tally: Tally) -> tuple[str, ...]:
    first = (f"{count:,}" for count in (tally.number, tally.intervals, tally.missed, tally.wrongly_complete))
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
