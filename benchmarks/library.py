"""The first answer of a process, what an installation weighs, and how long the kernels take to compile.

python -m benchmarks.library [--quick]
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.metadata
import re
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import build_kernels.library as building
from benchmarks import report
from jacokin.kernels import library

#: What a first answer needs; the other requirements, in this order, each with what it adds.
NEEDED_FIRST, ADDED = ("numpy", "pin", "daqp"), ("scipy", "mujoco", "yourdfpy", "osqp", "mink")
_EXTRA = re.compile(r"""extra\s*==\s*["']([^"']+)""")
#: Prints seconds of the first and second solve; what it takes before is in the time of the process.
FIRST_ANSWER = """
import time, jacokin
robot = jacokin.load_robot()
solver = jacokin.IKSolver(robot)
target = robot.forward_kinematics(robot.home)
for _ in range(2):
    start = time.perf_counter()
    assert solver.solve(target).success
    print(time.perf_counter() - start)
"""


def first_answers(repetitions: int) -> tuple[float, float]:
    """Wall seconds of a new process up to its first answer, and of the first solve in it; medians."""
    whole, first = [], []
    for _ in range(repetitions):
        start = time.perf_counter()
        done = subprocess.run([sys.executable, "-P", "-c", FIRST_ANSWER], capture_output=True, text=True, check=True)
        whole.append(time.perf_counter() - start)
        first.append(float(done.stdout.split()[0]))
    return float(np.median(whole)), float(np.median(first))


def all_at_once(processes: int) -> float:
    """Seconds until each of many processes, started together, has its first answer."""
    start = time.perf_counter()
    command = [sys.executable, "-P", "-c", FIRST_ANSWER]
    started = [subprocess.Popen(command, stdout=subprocess.DEVNULL) for _ in range(processes)]
    codes = [process.wait() for process in started]
    if any(codes):
        raise RuntimeError("a process found no answer")
    return time.perf_counter() - start


def installed_size(*packages: str) -> dict[str, float]:
    """Sizes of packages and of all that they require, by name, with the extras that they ask for [MB]."""
    sizes: dict[str, float] = {}
    seen: set[tuple[str, str]] = set()
    ahead = [(name, "") for name in packages]
    while ahead:
        name, extra = ahead.pop()
        try:
            distribution = importlib.metadata.distribution(name)
        except importlib.metadata.PackageNotFoundError:  # of another platform or Python
            continue
        if (name, extra) in seen:
            continue
        seen.add((name, extra))
        if name not in sizes:
            paths = (Path(str(file.locate())) for file in distribution.files or ())
            sizes[name] = sum(path.stat().st_size for path in paths if path.is_file()) / 1e6
        for text in distribution.requires or ():
            found = _EXTRA.search(text)
            if (found[1] if found else "") == extra:
                needed, extras = re.split(r"[\s<>=!~;(]", text)[0].rstrip("]").partition("[")[::2]
                needed = re.sub(r"[-_.]+", "-", needed).lower()
                ahead += [(needed, ""), *((needed, each) for each in extras.split(",") if each)]
    return sizes


def sizes() -> list[tuple[str, str]]:
    """Rows on what an installation weighs without extras: altogether, and what the largest requirements add."""
    everything = sum(installed_size("jacokin").values())
    rows = [("jacokin and all it requires, installed", f"{everything:,.0f} MB")]
    known = list(NEEDED_FIRST)
    before = sum(installed_size(*known).values())
    rows.append((f"of that {', '.join(known)}, for the first answer", f"{before:,.0f} MB"))
    for package in ADDED:
        known.append(package)
        after = sum(installed_size(*known).values())
        rows.append((f"added by {package}", f"{after - before:,.0f} MB"))
        before = after
    return rows


def compile_anew() -> tuple[float, float]:
    """Wall seconds of a build that finds no object file, and the largest memory of one of its processes [MB]."""
    # What a build says is no figure of the page.
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(sys.stderr):
        start = time.perf_counter()
        building.build(Path(folder, library.PATH.name), Path(folder, "kept"))
        seconds = time.perf_counter() - start
    return seconds, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e3


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few repetitions, and nothing is compiled")
    quick = parser.parse_args().quick
    whole, first = first_answers(2 if quick else 20)
    processes = 4 if quick else 64
    rows = [
        ("a new process up to its first answer", report.seconds(whole)),
        ("the first solve in it", report.seconds(first)),
        (f"{processes} such processes at once, until the last", report.seconds(all_at_once(processes))),
        ("the library", f"{library.PATH.stat().st_size / 1e6:.2f} MB"),
        *sizes(),
    ]
    if not quick:
        seconds, memory = compile_anew()
        rows += [
            (f"compiling the kernels, {building.JOBS} at a time", report.seconds(seconds)),
            ("the largest memory of one compiler", f"{memory:,.0f} MB"),
        ]
    print(report.table(("what", "measured"), rows))


if __name__ == "__main__":
    main()
