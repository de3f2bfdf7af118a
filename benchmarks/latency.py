"""How long single solves take, the slowest included.

python -m benchmarks.latency [--picture docs/images/latency.png]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import jacokin
from benchmarks import bridge, report
from jacokin.arrays import Array

CALLS = 20_000
POSES = 2_000
LONG = 0.05  # [s] no call after warming up should take so long
QUANTILES = (0.5, 0.99, 0.999)


def durations(call: Callable[[int], object], more: Callable[[int], bool]) -> Array:
    """(n, 2) wall time and processor time of each call [s]; the second leaves out other work on the machine."""
    times: list[tuple[float, float]] = []
    while more(len(times)):
        start, start_cpu = time.perf_counter(), time.thread_time()
        call(len(times))
        times.append((time.perf_counter() - start, time.thread_time() - start_cpu))
    return np.array(times)


def solves() -> Array:
    """`IKSolver.solve` on poses of random configurations, from the first call after building on."""
    robot = jacokin.load_robot()
    poses = [robot.forward_kinematics(q) for q in robot.sample(np.random.default_rng(1), POSES)]
    solver = jacokin.IKSolver(robot)
    return durations(lambda i: solver.solve(poses[i % POSES]), lambda done: done < CALLS)


def site_solves() -> Array:
    """`set_site_to_xpos` on positions in the workspace of the tasks, tool down, in a prepared scene."""
    physics, arm, hand = bridge.scene()
    arm.prepare(physics, hand.pinch_site)
    positions = np.random.default_rng(2).uniform((-0.25, -0.25, 0.05), (0.25, 0.25, 0.4), (POSES, 3))
    random_state = np.random.RandomState(0)
    return durations(
        lambda i: arm.set_site_to_xpos(physics, random_state, hand.pinch_site, positions[i % POSES]),
        lambda done: done < CALLS,
    )


def in_a_new_process(name: str) -> Array:
    """The same in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder, f"{name}.npy")
        program = f"import sys, numpy as np; from benchmarks import latency; np.save(sys.argv[1], latency.{name}())"
        subprocess.run([sys.executable, "-c", program, output], stderr=subprocess.DEVNULL, check=True)
        times: Array = np.load(output)
    return times


def draw(measured: dict[str, Array], path: Path) -> None:
    """Histograms of the durations, on logarithmic axes."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(len(measured), 1, sharex=True, figsize=(8.0, 2.2 * len(measured)), layout="constrained")
    edges = np.geomspace(1e-5, 1.0, 120)
    for axis, (name, both) in zip(axes, measured.items(), strict=True):
        times = both[:, 0]
        axis.hist(times, edges)
        axis.axvline(times.max(), color="tab:red", linewidth=1.0)
        axis.set(xscale="log", yscale="log", title=f"{name}: slowest {report.seconds(times.max())}", ylabel="calls")
    axes[-1].set_xlabel("duration of a call [s]")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    """Measure, print, and draw if asked to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--picture", type=Path, help="PNG of the histograms")
    options = parser.parse_args()
    measured = {
        "a warm solver: solve": in_a_new_process("solves"),
        "a prepared arm: set_site_to_xpos": in_a_new_process("site_solves"),
    }
    rows = [
        (
            name,
            f"{len(times):,}",
            *(report.seconds(float(value)) for value in np.quantile(times[:, 0], QUANTILES)),
            report.seconds(float(np.quantile(times[:, 1], QUANTILES[-1]))),
            report.seconds(times[:, 0].max()),
            str(int((times[:, 0] > LONG).sum())),
        )
        for name, times in measured.items()
    ]
    header = ("calls one by one", "calls", "median", "99 %", "99.9 %", "99.9 % CPU", "slowest", "over 50 ms")
    print(report.table(header, rows))
    if options.picture is not None:
        draw(measured, options.picture)


if __name__ == "__main__":
    main()
