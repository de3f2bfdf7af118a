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
from jacokin.ik import Family
from jacokin.model.angles import TURN, wrap_to_pi

SCANNED = 20_000
LONG = 1e-3  # [rad] of an interval that must be found
END = 1e-8  # [rad] by which ends may be off
CLOSURE = 1e-9  # [m] and [rad] by which members may be off
OWN = 1e-6  # [rad] a member this near is the generating configuration
MEMBERS = 7  # of each interval that are looked at
PEER = environments.Peer("ssik", "ssik `j2s7s300_ik.solve`", "ssik_seven", ("ssik==8.2.0",))
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
    ends: int = 0
    """Ends of intervals where the scan's number of members changes more than END away."""
    bad: int = 0
    """Members outside the limits or farther off than CLOSURE."""
    own: int = 0
    """Targets whose generating configuration is a member."""
    incomplete: int = 0
    all_times: list[float] = field(default_factory=list)
    solve_times: list[float] = field(default_factory=list)


def count_members(family: Family, parameters: Array) -> NDArray[np.int64]:
    """How many intervals hold each parameter."""
    count = np.zeros(len(parameters), dtype=np.int64)
    for interval in family:
        for turns in (-TURN, 0.0, TURN):
            count += (parameters + turns >= interval.start) & (parameters + turns < interval.stop)
    return count


def longest_difference(family: Family, scan: Counter) -> float:
    """Longest run [rad] of parameters at which the family has another number of members than a scan."""
    parameters = -np.pi + TURN * (np.arange(SCANNED) + 0.5) / SCANNED
    wrong = count_members(family, parameters) != scan(parameters)
    runs = [len(list(group)) for differs, group in itertools.groupby(wrong) if differs]
    return max(runs, default=0) * TURN / SCANNED


def wrong_ends(family: Family, scan: Counter) -> int:
    """Ends at which the family's number of members differs from the scan's a little before or after."""
    ends = [
        p
        for interval in family
        for p, end in zip((interval.start, interval.stop), interval.ends, strict=True)
        if end.kind in ("limit", "fold")
    ]
    parameters = np.array([p + side * END for p in ends for side in (-1.0, 1.0)])
    if len(parameters) == 0:
        return 0
    differs = count_members(family, wrap_to_pi(parameters)) != scan(wrap_to_pi(parameters))
    return int(differs.reshape(-1, 2).any(axis=1).sum())


def bad_members(robot: Robot, family: Family, target: FreeAxis | pin.SE3) -> int:
    """Members all along the intervals that do not reach the target within the limits, by Pinocchio."""
    bad = 0
    for interval in family:
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
    family = solver.family(target)
    tally.all_times.append(time.perf_counter() - begin)
    begin = time.perf_counter()
    solver.solve(target)
    tally.solve_times.append(time.perf_counter() - begin)
    tally.number += 1
    tally.intervals += len(family)
    tally.incomplete += not family.complete
    tally.missed += longest_difference(family, scan) > LONG
    tally.ends += wrong_ends(family, scan)
    tally.bad += bad_members(solver.robot, family, target)
    tally.own += any(
        np.abs(wrap_to_pi(interval.at(parameter) - q)).max() < OWN
        for interval in family
        if interval.contains(parameter)
    )


def free_axes(size: int) -> list[Tally]:
    """Random free axes on six joints: across the tool, along the last joint, skew."""
    solver, rng = IKSolver(jacokin.load_robot()), np.random.default_rng(0)
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
    solver, rng = IKSolver(jacokin.load_robot("j2s7s300")), np.random.default_rng(0)
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
            version = worker.start({})
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
    jacokin.warmup()
    tallies = [*free_axes(size), *seven_joints(size)]
    found = report.table(FOUND_HEADER, [_found_row(tally) for tally in tallies])
    times = [_time_row(tally, "solve_all") for tally in tallies] + [_time_row(tally, "solve") for tally in tallies]
    return report.Section(
        "Families: one free parameter",
        "\n\n".join([INTRODUCTION, found, report.table(TIME_HEADER, [*times, peer_row()])]),
    )


INTRODUCTION = f"""Each target is scanned at {SCANNED:,} values of its parameter by other code: six joints by the closed
form, pose by pose, seven by textbook subproblems in NumPy. *Missed*: targets whose number of members differs from the
scan's on more than {LONG:g} rad. *Ends off*: ends of intervals that the scan does not confirm to {END:g} rad. *Bad
members*: of {MEMBERS} on each interval, those outside the limits, or farther than {CLOSURE:g} m or rad from the target,
by Pinocchio. *Own*: the configuration that the target was made from is a member. All seeds are home."""

FOUND_HEADER = ("targets", "number", "intervals", "missed", "ends off", "bad members", "own", "incomplete")
TIME_HEADER = ("call", "targets", "answers", "median", "p99")


def _found_row(tally: Tally) -> tuple[str, ...]:
    counts = (tally.number, tally.intervals, tally.missed, tally.ends, tally.bad, tally.own, tally.incomplete)
    return (tally.name, *(f"{count:,}" for count in counts))


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
