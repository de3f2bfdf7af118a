"""Long batches and maps: rates, memory, and what they agree with.

python -m benchmarks.reachability batch        a Parquet file of poses beside `solve_batch` in memory
python -m benchmarks.reachability kills        the same file, killed at random moments
python -m benchmarks.reachability map          a fine map: time, size, agreement, sampled forward kinematics
"""

from __future__ import annotations

import argparse
import filecmp
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import jacokin
from jacokin import IKSolver
from jacokin.reachability import Grid, ReachabilityMap, build
from jacokin.reachability.sampling.samples import NOWHERE

RUN = (
    "import sys, jacokin, resource; from jacokin.ik import solve_file;"
    "print('ready', flush=True);"
    "done = solve_file(jacokin.IKSolver(jacokin.load_robot(), warm=None), *sys.argv[1:3], workers=2);"
    "print(done.seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)"
)
NAMES = ("x", "y", "z", "qw", "qx", "qy", "qz")


def write(path: Path, rows: int) -> None:
    """Poses of random configurations; a hundred thousand different ones, again and again."""
    robot = jacokin.load_robot()
    samples = robot.sample(np.random.default_rng(3), min(rows, 100_000))
    values = []
    for q in samples:
        pose = robot.forward_kinematics(q)
        values.append([*pose.translation, *jacokin.model.quat_wxyz(pose.rotation)])
    table = np.array(values)
    whole = np.tile(table, (-(-rows // len(table)), 1))[:rows]
    pq.write_table(pa.table(dict(zip(NAMES, whole.T, strict=True))), path)


def in_memory(rows: int) -> float:
    """Poses a second of `solve_batch` on two threads."""
    robot = jacokin.load_robot()
    samples = robot.sample(np.random.default_rng(3), min(rows, 100_000))
    targets = np.array([robot.forward_kinematics(q).homogeneous for q in samples])
    solver = IKSolver(robot)
    solver.solve_batch(targets[:5000], workers=2)
    begin = time.perf_counter()
    for _ in range(3):
        solver.solve_batch(targets, workers=2)
    return 3 * len(targets) / (time.perf_counter() - begin)


def batch(folder: Path, rows: int) -> None:
    """Rate and memory of a file beside the rate in memory, before and after."""
    source, out = folder / "in.parquet", folder / "out.parquet"
    write(source, rows)
    before = in_memory(rows)
    words = [sys.executable, "-P", "-c", RUN, str(source), str(out)]
    seconds, memory = map(float, subprocess.check_output(words, text=True).split()[1:])
    after = in_memory(rows)
    print(f"{rows} rows: {rows / seconds:.0f} poses/s, {memory:.0f} MB; in memory {before:.0f} and {after:.0f} poses/s")


def kills(folder: Path, rows: int) -> None:
    """Ten kills, and whether the output is what an undisturbed run writes."""
    source, out, whole = folder / "in.parquet", folder / "out.parquet", folder / "whole.parquet"
    if not source.exists():
        write(source, rows)
    rng = np.random.default_rng(11)
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-P", "-c", RUN, str(source), str(whole)], check=True, capture_output=True)
    alone = time.perf_counter() - begin
    count = 0
    for _ in range(10):
        with subprocess.Popen([sys.executable, "-P", "-c", RUN, str(source), str(out)], stdout=subprocess.PIPE) as run:
            assert run.stdout is not None
            run.stdout.readline()
            time.sleep(rng.uniform(0.5, 0.5 + alone / 10.0))
            count += run.poll() is None
            run.send_signal(signal.SIGKILL)
    subprocess.run([sys.executable, "-P", "-c", RUN, str(source), str(out)], check=True, capture_output=True)
    print(f"{count} kills; the same bytes: {filecmp.cmp(out, whole, shallow=False)}")


def fine_map(folder: Path, samples: int) -> None:
    """A map at 2 cm with 200 directions."""
    robot = jacokin.load_robot()
    begin, cpu = time.perf_counter(), time.process_time()
    reach = build(robot, folder=folder / "map", grid=Grid.around(robot, 0.02), orientations=200)
    assert reach is not None
    seconds, cpu = time.perf_counter() - begin, time.process_time() - cpu
    size = sum(path.stat().st_size for path in (folder / "map").iterdir())
    print(f"{reach}: {reach.counts.size} poses, {seconds:.1f} s ({cpu:.1f} s of processor), {size / 1e6:.2f} MB")
    print(f"Monte Carlo, {samples} samples: {monte_carlo(reach, samples)}")


def monte_carlo(reach: ReachabilityMap, samples: int) -> str:
    """Samples whose tool lies in a cell that the map calls unreachable, and how far from a reached one at most."""
    robot, inside = reach.robot, reach.samples
    q = robot.sample(np.random.default_rng(7), samples)
    positions = np.array([robot.forward_kinematics(each).translation for each in q])
    cells = inside.cell_of(positions)
    empty = (cells == NOWHERE) | ~(reach.counts[np.maximum(cells, 0)] > 0).any(axis=1)
    if not empty.any():
        return "all in cells that are reached"
    reached = np.flatnonzero((reach.counts > 0).any(axis=1))
    from scipy.spatial import cKDTree

    tree = cKDTree(inside.position(reached)[:, [0, 2]])
    outside = positions[empty]
    away, _ = tree.query(np.column_stack([np.hypot(outside[:, 0], outside[:, 1]), outside[:, 2]]))
    farthest = 1000.0 * float(np.max(away))
    return f"{empty.sum()} in cells without a reached orientation, at most {farthest:.1f} mm from a reached sample"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("batch", "kills", "map"))
    parser.add_argument("--rows", type=int, default=2_000_000)
    parser.add_argument("--samples", type=int, default=1_000_000)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if given.what == "map":
            fine_map(folder, given.samples)
        else:
            (batch if given.what == "batch" else kills)(folder, given.rows)


if __name__ == "__main__":
    main()
