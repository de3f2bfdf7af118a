"""Long batches and maps: rates, memory, what the coordinator costs, and what maps agree with.

python -m benchmarks.reachability                all of it, as in docs/performance.md; about two minutes
python -m benchmarks.reachability batch          a Parquet file of poses beside `solve_batch` in memory
python -m benchmarks.reachability coordinator    what handing out and joining chunks costs; how many workers that feeds
python -m benchmarks.reachability map            a fine map: time, size, agreement, sampled forward kinematics
python -m benchmarks.reachability kills          a file of poses, killed at random moments
"""

from __future__ import annotations

import argparse
import filecmp
import importlib.util
import pickle
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import numpy as np

import jacokin
from benchmarks import report
from jacokin import IKSolver
from jacokin.chunks.execution import run_jobs
from jacokin.chunks.folder import Keeper
from jacokin.ik import solve_file
from jacokin.ik.batches import solve_file as files
from jacokin.ik.batches.chunk import ChunkJob, RowsInFile, read_stamp, read_tally
from jacokin.ik.batches.solve_file import ROWS
from jacokin.ik.files.formats import answers_format, targets_format
from jacokin.ik.files.targets import equal_parts
from jacokin.reachability import Grid, ReachabilityMap, build

RUN = (
    "import sys, jacokin, time; from jacokin.ik import solve_file;"
    "solver = jacokin.IKSolver(jacokin.load_robot(), collision='ignore');"
    "print('ready', flush=True); cpu = time.process_time();"
    "done = solve_file(solver, *sys.argv[1:3], workers=2);"
    "status = dict(line.split(':') for line in open('/proc/self/status'));"  # the resource module counts the parent
    "print(done.seconds, time.process_time() - cpu, int(status['VmHWM'].split()[0]) / 1024)"
)
NAMES = ("x", "y", "z", "qw", "qx", "qy", "qz")
DIFFERENT = 100_000  # poses, again and again
ROUNDS = 2
FED = 100  # workers, on paper
MILLI = 1000.0


def write(path: Path, rows: int) -> None:
    """Poses of random configurations."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    robot = jacokin.load_robot()
    samples = robot.sample(np.random.default_rng(3), min(rows, DIFFERENT))
    values = []
    for q in samples:
        pose = robot.forward_kinematics(q)
        values.append([*pose.translation, *jacokin.model.quat_wxyz(pose.rotation)])
    table = np.array(values)
    whole = np.tile(table, (-(-rows // len(table)), 1))[:rows]
    pq.write_table(pa.table(dict(zip(NAMES, whole.T, strict=True))), path)


def in_memory(rows: int) -> tuple[float, float]:
    """Poses a second of `solve_batch` on two threads, by the clock and of both processors' time."""
    robot = jacokin.load_robot()
    samples = robot.sample(np.random.default_rng(3), min(rows, DIFFERENT))
    targets = np.array([robot.forward_kinematics(q).homogeneous for q in samples])
    solver = IKSolver(robot, collision="ignore")
    solver.solve_batch(targets[:5000], workers=2)
    begin, cpu = time.perf_counter(), time.process_time()
    for _ in range(3):
        solver.solve_batch(targets, workers=2)
    count = 3 * len(targets)
    return count / (time.perf_counter() - begin), count / (time.process_time() - cpu)


def batch(rows: int) -> list[str]:
    """Rate and memory of a file beside the rate in memory, the best of some rounds in which they take turns."""
    files: list[tuple[float, float, float]] = []
    memories = [in_memory(rows)]
    with tempfile.TemporaryDirectory() as name:
        source, out = Path(name) / "in.parquet", Path(name) / "out.parquet"
        write(source, rows)
        words = [sys.executable, "-P", "-c", RUN, str(source), str(out)]
        for _ in range(ROUNDS):
            seconds, cpu, memory = map(float, subprocess.check_output(words, text=True).split()[1:])
            files.append((rows / seconds, rows / cpu, memory))
            memories.append(in_memory(rows))
    clock, used, largest = (max(column) for column in zip(*files, strict=True))
    clock_in_memory, used_in_memory = (max(column) for column in zip(*memories, strict=True))
    cells = (
        (f"{rows:,} poses, Parquet to Parquet, two threads", f"{clock:,.0f} a second"),
        ("the same in memory, `solve_batch`", f"{clock_in_memory:,.0f} a second"),
        ("the file's share of that rate", report.percent(clock / clock_in_memory)),
        ("its share in time of the processors", report.percent(used / used_in_memory)),
        ("largest memory of the process", f"{largest:.0f} MB"),
    )
    return [report.table((f"a file of poses, best of {ROUNDS} rounds", ""), cells)]


def nothing(names: list[str], job: ChunkJob) -> list[str]:
    """A worker that finds its work done."""
    assert isinstance(job.rows, RowsInFile)
    return names[: len(job.rows.parts)]


def coordinator(rows: int = 4 * ROWS) -> list[str]:
    """What each chunk costs the process that hands out and joins, and how many workers that keeps busy."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        source, solver = folder / "in.parquet", IKSolver(jacokin.load_robot(), collision="ignore")
        write(source, rows)
        begin = time.process_time()
        solve_file(solver, source, folder / "out.parquet", workers=1)
        worker = (time.process_time() - begin) * ROWS / rows
        pieces = _chunks(folder, solver, source)
        answers, names = answers_format(Path("out.parquet")), [*NAMES, *(f"q{joint}" for joint in range(1, 7))]
        begin = time.process_time()
        many = [pieces[number % len(pieces)] for number in range(20 * len(pieces))]
        answers.write_joined(folder / "joined.parquet", [(path, _offset(path)) for path in many], names)
        join = (time.process_time() - begin) / len(many)
        cells = []
        executors: list[tuple[str, Callable[[], Executor]]] = [
            ("threads", lambda: stack.enter_context(ThreadPoolExecutor(2)))
        ]
        if importlib.util.find_spec("distributed"):
            executors.append(("dask, scheduler in the same process", partial(_dask, stack)))
        for name, start in executors:
            each = _handed_out(folder, solver, source, start())
            chunk = each / files.TOGETHER + join
            cells.append(
                (
                    name,
                    f"{MILLI * each:.2f} ms",
                    f"{MILLI * each / files.TOGETHER:.2f} ms",
                    f"{MILLI * join:.2f} ms",
                    f"{MILLI * worker:.0f} ms",
                    f"{worker / chunk:.0f}",
                    report.percent(min(1.0, worker / chunk / FED)),
                )
            )
    head = ("executor", "a job", "of that a chunk", "joining it", "a worker's time", "workers fed", f"at {FED} workers")
    return [
        f"Processor time of the coordinator for a job of {files.TOGETHER} chunks of {ROWS:,} poses, Parquet to "
        "Parquet, and how many workers that keeps busy:",
        report.table(head, cells),
    ]


def _chunks(folder: Path, solver: IKSolver, source: Path) -> list[Path]:
    """Finished chunks of a file."""
    parts = targets_format(source).parts(source, ROWS)
    paths = []
    with ThreadPoolExecutor(1) as pool:
        job, missing = _jobs(folder, solver), range(len(parts))
        for index, content in files.solve_chunks(job, source, parts, ROWS, missing, pool, several=True):
            assert isinstance(content, bytes)  # no recipe is in the folder
            paths.append(folder / f"{index}.chunk")
            paths[-1].write_bytes(content)
    return sorted(paths)


def _jobs(folder: Path, solver: IKSolver) -> Callable[..., ChunkJob]:
    keeper = Keeper(folder, "", ".chunk")
    return partial(ChunkJob, jacokin.__version__, pickle.dumps(solver), None, True, ".parquet", keeper)


def _offset(path: Path) -> int:
    return read_tally(path)[1]


def _handed_out(folder: Path, solver: IKSolver, source: Path, executor: Executor) -> float:
    """Processor seconds of this process for a job whose work takes no time."""
    parts = equal_parts(1000 * files.TOGETHER * ROWS, ROWS)  # jobs whose work is left out
    stamp = read_stamp(source)
    assert stamp is not None
    runs = [list(range(first, first + files.TOGETHER)) for first in range(0, len(parts), files.TOGETHER)]
    work = partial(nothing, [f"{index:06d}-{'0' * 16}.chunk" for index in range(files.TOGETHER)])
    job = _jobs(folder, solver)
    jobs = [
        (number, job(run[0], RowsInFile(stamp, ROWS, tuple(parts[index] for index in run))))
        for number, run in enumerate(runs)
    ]
    begin = time.process_time()
    for _ in run_jobs(work, jobs, executor):
        pass
    return (time.process_time() - begin) / len(runs)


def _dask(stack: ExitStack) -> Executor:
    from distributed import Client, LocalCluster

    cluster = stack.enter_context(LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None))
    executor: Executor = stack.enter_context(Client(cluster)).get_executor()
    return executor


def kills(rows: int) -> list[str]:
    """Ten kills, and whether the output is what an undisturbed run writes."""
    with tempfile.TemporaryDirectory() as name:
        source, out, whole = (Path(name) / f"{each}.parquet" for each in ("in", "out", "whole"))
        write(source, rows)
        rng = np.random.default_rng(11)
        words = [sys.executable, "-P", "-c", RUN, str(source)]
        begin = time.perf_counter()
        subprocess.run([*words, str(whole)], check=True, capture_output=True)
        alone = time.perf_counter() - begin
        count = 0
        for _ in range(10):
            with subprocess.Popen([*words, str(out)], stdout=subprocess.PIPE) as run:
                assert run.stdout is not None
                run.stdout.readline()
                time.sleep(rng.uniform(0.1, 0.1 + alone / 10.0))
                count += run.poll() is None
                run.send_signal(signal.SIGKILL)
        subprocess.run([*words, str(out)], check=True, capture_output=True)
        return [f"{rows:,} poses, {count} kills; the same bytes: {filecmp.cmp(out, whole, shallow=False)}"]


def fine_map(samples: int) -> list[str]:
    """A map at 2 cm with 200 directions."""
    robot = jacokin.load_robot()
    with tempfile.TemporaryDirectory() as name:
        begin, cpu = time.perf_counter(), time.process_time()
        grid = Grid.around(robot, 0.02)
        reach = build(IKSolver(robot, collision="ignore"), folder=Path(name) / "map", grid=grid, orientations=200)
        assert reach is not None
        seconds, cpu = time.perf_counter() - begin, time.process_time() - cpu
        size = sum(path.stat().st_size for path in (Path(name) / "map").iterdir())
    empty, farthest = monte_carlo(reach, samples)
    assert reach.bound is not None
    cells = (
        (
            "poses that stand for the full grid",
            f"{reach.counts.size:,} for {' x '.join(map(str, reach.grid.shape))} cells",
        ),
        ("time, two threads", f"{seconds:.1f} s, {cpu:.1f} s of the processors"),
        ("size of the folder", f"{size / 1e6:.2f} MB"),
        ("2,000 random poses of it that `solve_batch` answers alike", report.percent(agreement(reach, 2000))),
        ("its bound: farthest that the tool may be from a reached centre", f"{MILLI * reach.bound:.1f} mm"),
        (f"farthest of {samples:,} random configurations", f"{MILLI * farthest:.1f} mm"),
        ("of them in cells that no orientation reaches", report.percent(empty / samples)),
    )
    return [report.table(("map of the j2n6s300, 2 cm, 200 directions", ""), cells)]


def agreement(reach: ReachabilityMap, count: int) -> float:
    """Share of random poses of a map, turned and rolled to anywhere, whose answer is that of `solve_batch`."""
    import pinocchio as pin

    rng, samples = np.random.default_rng(17), reach.samples
    cells, chosen = rng.integers(samples.positions, size=count), rng.integers(len(samples.orientations), size=count)
    targets = np.tile(np.eye(4), (count, 1, 1))
    axis = samples.symmetries.tool_axis
    for row, position in enumerate(samples.position(cells)):
        turn = pin.exp3(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
        roll = np.eye(3) if axis is None else pin.exp3(rng.uniform(-np.pi, np.pi) * axis)
        targets[row, :3, 3] = turn @ position
        targets[row, :3, :3] = turn @ samples.orientations.rotations[chosen[row]] @ roll
    solved = IKSolver(reach.robot, collision="ignore").solve_batch(targets, closest=False).success
    return float((solved == (reach.counts[cells, chosen] > 0)).mean())


def monte_carlo(reach: ReachabilityMap, samples: int) -> tuple[int, float]:
    """Samples whose tool lies in a cell that the map calls unreachable, and the farthest from a reached centre [m]."""
    from scipy.spatial import cKDTree

    robot, inside = reach.robot, reach.samples
    rows = robot.sample(np.random.default_rng(7), samples)
    positions = np.array([robot.forward_kinematics(q).translation for q in rows])
    cells = inside.cell_of(positions)
    any_orientation = np.asarray((reach.counts > 0).any(axis=1))
    empty = (cells < 0) | ~any_orientation[np.maximum(cells, 0)]
    tree = cKDTree(inside.position(np.flatnonzero(any_orientation))[:, [0, 2]])
    away, _ = tree.query(np.column_stack([np.hypot(positions[:, 0], positions[:, 1]), positions[:, 2]]))
    return int(empty.sum()), float(np.max(away))


def section(share: int) -> report.Section:
    """The part of the page on batches and maps; of the usual numbers of poses one `share`-th."""
    parts = [*batch(2_000_000 // share), *coordinator(), *fine_map(1_000_000 // share)]
    return report.Section("Batches without end, and maps", "\n\n".join(parts))


def main() -> None:
    """Print what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="?", choices=("batch", "coordinator", "map", "kills"))
    parser.add_argument("--rows", type=int, default=2_000_000)
    parser.add_argument("--samples", type=int, default=1_000_000)
    given = parser.parse_args()
    if given.what is None:
        print(section(1).body)
        return
    parts: dict[str, Callable[[], list[str]]] = {
        "batch": partial(batch, given.rows),
        "coordinator": coordinator,
        "map": partial(fine_map, given.samples),
        "kills": partial(kills, given.rows),
    }
    print("\n\n".join(parts[given.what]()))


if __name__ == "__main__":
    main()
