"""Solve the poses of examples/targets.csv, say how well it went, and draw the arm at one of the answers.

python examples/demo.py            # `make demo`
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import jacokin
from jacokin.ik import BatchResult, read_targets

HERE = Path(__file__).resolve().parent
TARGETS = HERE / "targets.csv"
PICTURE = Path("out/jaco.png")
DEBIAN_PACKAGES = {"egl": "libegl1 libgl1-mesa-dri", "osmesa": "libosmesa6"}  # back ends of MuJoCo that need no display


def main() -> None:
    file = read_targets(TARGETS)
    solver = jacokin.IKSolver(jacokin.load_robot())
    started = time.perf_counter()
    batch = solver.solve_batch(file.targets)
    seconds = time.perf_counter() - started
    report(batch, file.lines, seconds)
    distance = np.linalg.norm(batch.q - solver.robot.home, axis=1)
    draw(batch.q[np.argmin(np.where(batch.success, distance, np.inf))])  # the answer nearest to home


def report(batch: BatchResult, lines: NDArray[np.int_], seconds: float) -> None:
    solved = int(batch.success.sum())
    print(f"{solved} of {len(batch)} targets solved ({100 * solved / len(batch):.1f} %) in {seconds:.2f} s")
    print(f"worst position error     {batch.position_error[batch.success].max():.1e} m")
    print(f"worst orientation error  {batch.orientation_error[batch.success].max():.1e} rad")
    for row in np.flatnonzero(~batch.success):
        print(f"line {lines[row]} is not solved: {batch.status[row].name}: {batch.message[row]}")
        away = f"{batch.position_error[row]:.4f} m and {np.degrees(batch.orientation_error[row]):.2f} deg"
        print(f"    the closest legal configuration is {away} away")


def draw(q: NDArray[np.float64]) -> None:
    """Draw in a process of its own: MuJoCo chooses its back end when it is imported."""
    words = [sys.executable, str(HERE / "render_arm.py"), str(PICTURE), *(repr(float(angle)) for angle in q)]
    for backend in DEBIAN_PACKAGES:
        done = subprocess.run(words, env={**os.environ, "MUJOCO_GL": backend}, capture_output=True, check=False)
        if done.returncode == 0:
            print(f"picture of the arm at an answer: {PICTURE} (drawn with {backend})")
            return
    packages = ", or: ".join(DEBIAN_PACKAGES.values())
    print(f"no picture: MuJoCo found neither EGL nor OSMesa. On Debian and Ubuntu: apt install {packages}")


if __name__ == "__main__":
    main()
