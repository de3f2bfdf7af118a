"""Calls of the C library beside the same calls from Python.

python -m benchmarks.c_calls [--quick] [--ikfast generated.cpp]
"""

from __future__ import annotations

import argparse
import shlex
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import jacokin
from benchmarks import report
from jacokin.arrays import Array
from jacokin.ik import IKSolver
from jacokin.ik.c_library import compiler_flags, solver_file

ROBOTS = ("j2n6s300", "j2s6s300", "j2s7s300")
ROUNDS = 10
SOURCE = Path(__file__).with_suffix(".c")
IKFAST_SOURCE = Path(__file__).with_name("ikfast_calls.cpp")


def time_python(call: Callable[[Array], object], targets: Array) -> float:
    """Seconds a pose, once through all of them."""
    start = time.perf_counter()
    for target in targets:
        call(target)
    return (time.perf_counter() - start) / len(targets)


def compare(name: str, program: Path, folder: Path, rounds: int, count: int) -> list[tuple[str, str, str, str]]:
    """Rows of the table for one robot: languages take turns, the best round of each counts."""
    robot = jacokin.load_robot(name)
    solver = IKSolver(robot, collision="ignore")
    rng = np.random.default_rng(0)
    targets = np.array([robot.forward_kinematics(q).homogeneous for q in robot.sample(rng, count)])
    file, poses = folder / f"{name}.jacokin", folder / "targets.bin"
    file.write_bytes(solver_file(solver))
    poses.write_bytes(targets.tobytes())
    calls: list[tuple[str, Callable[[Array], object]]] = [
        ("nearest", lambda target: solver.solve(target, closest=False))
    ]
    if robot.dof == 6:
        calls.append(("all", solver.solve_all))
    best_c, best_python = np.full(len(calls), np.inf), np.full(len(calls), np.inf)
    for _ in range(rounds):
        done = subprocess.run([program, file, poses, "2"], capture_output=True, text=True, check=True)
        best_c = np.minimum(best_c, [float(word) for word in done.stdout.split()])
        best_python = np.minimum(best_python, [time_python(call, targets) for _, call in calls])
    return [
        (name, what, report.seconds(float(c)), report.seconds(float(python)))
        for (what, _), c, python in zip(calls, best_c, best_python, strict=True)
    ]


def time_ikfast(generated: Path, folder: Path) -> tuple[str, str, str, str]:
    """A row of the table for code that IKFast generated; ikfast.h is beside it. All branches, within limits or not."""
    program = folder / "ikfast_calls"
    words = ["-O2", "-w", f'-DIKFAST_FILE="{generated.resolve()}"', f"-I{generated.resolve().parent}"]
    subprocess.run(["c++", *words, IKFAST_SOURCE, "-o", program, "-llapack"], check=True)
    done = subprocess.run([program], capture_output=True, text=True, check=True)
    seconds, branches = map(float, done.stdout.split())
    return generated.name, f"all by IKFast, {branches:.2f} a pose", report.seconds(seconds), "-"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few poses, one round")
    parser.add_argument(
        "--ikfast", type=Path, help="C++ file that OpenRAVE's IKFast generated for the arm; needs LAPACK"
    )
    options = parser.parse_args()
    quick = options.quick
    rounds, count = (1, 20) if quick else (ROUNDS, 1000)
    rows = []
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        program = folder / "c_calls"
        subprocess.run(["cc", "-std=c99", "-O2", SOURCE, *shlex.split(compiler_flags()), "-o", program], check=True)
        for name in ROBOTS:
            rows += compare(name, program, folder, rounds, count if name != "j2s7s300" else max(20, count // 5))
        if options.ikfast is not None:
            rows.append(time_ikfast(options.ikfast, folder))
    print(report.table(("arm", "configurations", "from C", "from Python"), rows))


if __name__ == "__main__":
    main()
