"""What `jacokin ik --targets` costs from end to end: reading, solving and writing a file of poses.

python -m benchmarks.pose_files
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import jacokin
from benchmarks import report, targets
from jacokin import Robot
from jacokin.model import quat_wxyz

ROWS = (20_000, 100_000)
COMMAND = "from jacokin.cli.main import main; main()"


def write(robot: Robot, path: Path, rows: int) -> None:
    """Write poses of random configurations, numbers with 17 digits."""
    poses = targets.random_configurations(robot, np.random.default_rng(5), rows).poses
    with path.open("w", encoding="utf-8") as file:
        file.write("x,y,z,qw,qx,qy,qz\n")
        for pose in poses:
            numbers = [*pose[:3, 3], *quat_wxyz(pose[:3, :3])]
            file.write(",".join(f"{value:.17g}" for value in numbers) + "\n")


def run(path: Path, workers: int) -> tuple[float, float]:
    """Wall seconds of the command in a new process, and its largest memory [MB]."""
    out = path.with_name("answers.csv")
    words = ["ik", "--targets", str(path), "--output", str(out), "--workers", str(workers)]
    begin = time.perf_counter()
    process = subprocess.Popen([sys.executable, "-P", "-c", COMMAND, *words], stdout=subprocess.DEVNULL)
    _, code, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - begin
    process.returncode = os.waitstatus_to_exitcode(code)
    if process.returncode:
        raise RuntimeError(f"the command ended with code {process.returncode}")
    return seconds, usage.ru_maxrss / 1024.0  # Linux counts in kB


def section(robot: Robot) -> report.Section:
    """The part of the page on files."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "poses.csv"
        for count in ROWS:
            write(robot, path, count)
            for workers in (1, 2):
                seconds, memory = min(run(path, workers) for _ in range(3))
                cells = (
                    f"{count:,}",
                    f"{workers}",
                    report.seconds(seconds),
                    f"{count / seconds:,.0f}",
                    f"{memory:.0f}",
                )
                rows.append(cells)
    head = ("rows", "workers", "time", "poses a second", "memory [MB]")
    text = "`jacokin ik --targets poses.csv --output answers.csv`, a new process from end to end:"
    return report.Section("Files of poses", "\n\n".join([text, report.table(head, rows)]))


if __name__ == "__main__":
    print(section(jacokin.load_robot()).body)
