"""How often and how exactly the QP alone reaches poses, with each QP solver.

python -m benchmarks.qp_success [--targets FILE.csv ...] [--qp-solver daqp ...] [--count 500]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import jacokin
from benchmarks import report, targets
from benchmarks.comparison import make_referee
from jacokin import Robot

QP_SOLVERS = ("daqp", "quadprog", "osqp", "proxqp")


@dataclass(frozen=True, slots=True)
class QPSuccess:
    """Figures of one QP solver on one set of targets; errors over the successes, by the referee."""

    targets: str
    qp_solver: str
    count: int
    solved: int
    outside: int
    """Answers outside a limit at tolerance 0, successes or not."""
    position: float
    orientation: float
    fallbacks: int
    """Targets where another QP solver had to step in."""
    median: float
    p99: float


def measure(robot: Robot, wanted: targets.Targets, qp_solver: str) -> QPSuccess:
    """Solve every target by the QP, from home."""
    solver = jacokin.IKSolver(robot, method="qp", qp_solver=qp_solver, collision="ignore")
    referee = make_referee(robot)
    solver.solve(wanted.poses[0])
    solved = outside = fallbacks = 0
    position, orientation, seconds = [0.0], [0.0], []
    for pose in wanted.poses:
        begin = time.perf_counter()
        result = solver.solve(pose, closest=False)
        seconds.append(time.perf_counter() - begin)
        outside += not referee.within_limits(result.q[None])[0]
        fallbacks += result.qp_solver not in (qp_solver, None)
        if result.success:
            solved += 1
            errors = referee.errors(result.q[None], pose)
            position.append(float(errors[0][0]))
            orientation.append(float(errors[1][0]))
    return QPSuccess(
        targets=wanted.name,
        qp_solver=qp_solver,
        count=len(wanted.poses),
        solved=solved,
        outside=outside,
        position=max(position),
        orientation=max(orientation),
        fallbacks=fallbacks,
        median=float(np.median(seconds)),
        p99=float(np.percentile(seconds, 99)),
    )


def section(robot: Robot, sets: Sequence[targets.Targets], qp_solvers: Sequence[str]) -> report.Section:
    """The part of the page on the QP."""
    rows, notes = [], []
    for wanted in sets:
        for qp_solver in qp_solvers:
            try:
                rows.append(_row(measure(robot, wanted, qp_solver)))
            except jacokin.JacokinError as error:  # a solver that is not installed
                notes.append(f"{qp_solver} was not measured: {error}")
                continue
            print(" ".join(rows[-1]), flush=True)
    body = "\n\n".join([INTRODUCTION, report.table(HEADER, rows), *dict.fromkeys(notes)])
    return report.Section('The QP alone (`method="qp"`)', body)


INTRODUCTION = """Each target from home, then from random starts, as `solve` does. *Outside limits* counts every answer,
at tolerance 0. Errors are of the successes, by the referee."""

HEADER = (
    "targets",
    "QP solver",
    "number",
    "solved",
    "outside limits",
    "position",
    "orientation",
    "fallbacks",
    "median",
    "p99",
)


def _row(measured: QPSuccess) -> tuple[str, ...]:
    return (
        measured.targets,
        measured.qp_solver,
        f"{measured.count:,}",
        report.percent(measured.solved / measured.count),
        str(measured.outside),
        report.number(measured.position, "m"),
        report.number(measured.orientation, "rad"),
        str(measured.fallbacks),
        report.seconds(measured.median),
        report.seconds(measured.p99),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--targets", type=Path, nargs="+", help="CSV files: x, y, z, qw, qx, qy, qz")
    parser.add_argument("--qp-solver", nargs="+", default=QP_SOLVERS)
    parser.add_argument("--count", type=int, default=500, help="random targets, when no file is given")
    options = parser.parse_args()
    robot = jacokin.load_robot()
    if options.targets:
        sets = [targets.from_csv(path) for path in options.targets]
    else:
        sets = [targets.random_configurations(robot, np.random.default_rng(2), options.count)]
    print(section(robot, sets, options.qp_solver).body)


if __name__ == "__main__":
    main()
