"""Files of targets: every format, any executor, runs that are killed, and what is refused."""

from __future__ import annotations

import csv
import dataclasses
import errno
import importlib
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jacokin import IKSolver, Robot, Status
from jacokin.arrays import Array
from jacokin.chunks import folder
from jacokin.errors import InvalidInputError, JacokinError
from jacokin.ik import Progress, solve_file
from jacokin.ik.batches import batch, chunk
from jacokin.ik.batches import solve_file as module
from jacokin.model import quat_wxyz

N = 230
ROWS = 32  # of a chunk in these tests, so that there are several


@pytest.fixture
def solver(robot: Robot) -> IKSolver:
    return IKSolver(robot)


@pytest.fixture(autouse=True)
def _small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "ROWS", ROWS)
    monkeypatch.setattr(module, "CLOSEST_ROWS", ROWS)


@pytest.fixture
def targets(robot: Robot, rng: np.random.Generator) -> Array:
    poses = np.array([robot.forward_kinematics(q).homogeneous for q in robot.sample(rng, N)])
    poses[5, :3, 3] += 3.0  # [m], out of reach
    return poses


def quaternions(targets: Array) -> Array:
    return np.array([[*pose[:3, 3], *quat_wxyz(pose[:3, :3])] for pose in targets])


def write(path: Path, targets: Array) -> Path:
    rows = quaternions(targets)
    names = ("x", "y", "z", "qw", "qx", "qy", "qz")
    if path.suffix == ".csv":
        lines = [",".join(map(repr, row)) for row in rows.tolist()]
        path.write_text("\n".join([",".join(names), *lines]) + "\n", encoding="utf-8")
    elif path.suffix == ".npz":
        np.savez_compressed(path, position=rows[:, :3], quat_wxyz=rows[:, 3:])
    else:
        pa = importlib.import_module("pyarrow")
        table = pa.table(dict(zip(names, rows.T, strict=True)))
        importlib.import_module("pyarrow.parquet").write_table(table, path, row_group_size=50)
    return path


def joints(path: Path) -> Array:
    """The joint angles in a file of answers."""
    if path.suffix == ".npz":
        with np.load(path) as file:
            return np.asarray(file["q"])
    if path.suffix == ".parquet":
        table = importlib.import_module("pyarrow.parquet").read_table(path)
        return np.column_stack([table.column(f"q{joint}").to_numpy() for joint in range(1, 7)])
    with path.open(newline="", encoding="utf-8") as file:
        return np.array([[float(row[f"q{joint}"]) for joint in range(1, 7)] for row in csv.DictReader(file)])


@pytest.mark.one_quick("after")
@pytest.mark.parametrize("before", [".csv", ".npz", ".parquet"])
@pytest.mark.parametrize("after", [".csv", ".npz", ".parquet"])
def test_every_format_holds_the_answers_of_a_batch(
    solver: IKSolver, targets: Array, tmp_path: Path, before: str, after: str
) -> None:
    source, out = write(tmp_path / f"in{before}", targets), tmp_path / f"out{after}"
    summary = solve_file(solver, source, out)
    assert (summary.targets, summary.solved) == (N, N - 1)
    assert summary.statuses == {Status.OK: N - 1, Status.UNREACHABLE: 1}
    assert repr(summary).startswith(f"FileSummary({N} targets: {N - 1} OK, 1 UNREACHABLE; ")
    assert len(repr(summary)) < 300
    again = pickle.loads(pickle.dumps(summary))
    assert again == summary
    assert hash(again) == hash(summary)
    assert summary.failures[0][0] == (7 if before == ".csv" else 6)  # the line, after a header, or the row
    from jacokin.ik.files.targets import target_rows

    rows = target_rows(("x", "y", "z", "qw", "qx", "qy", "qz"), quaternions(targets), np.arange(N))
    np.testing.assert_array_equal(joints(out), solver.solve_batch(rows.targets).q)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([source.name, out.name])


def test_matrices_in_an_npz_are_the_targets_of_a_batch(solver: IKSolver, targets: Array, tmp_path: Path) -> None:
    np.savez(tmp_path / "in.npz", targets=targets)
    solve_file(solver, tmp_path / "in.npz", tmp_path / "out.npz")
    with np.load(tmp_path / "out.npz") as found:
        np.testing.assert_array_equal(found["q"], solver.solve_batch(targets).q)
        names = found["status_names"][found["status"]]
        assert (names[5], names[6]) == ("UNREACHABLE", "OK")
        np.testing.assert_array_equal(found["r12"], targets[:, 0, 1])


NOTES = [f"part {row}, 'Ä' \"{'#' * (row % 40)}\"\n" if row % 7 else "" for row in range(N)]
FORCES = np.random.default_rng(3).normal(size=N)
COUNTS = np.arange(N) * 10**15  # of more digits than a float has


def write_with_remarks(path: Path, targets: Array) -> Path:
    """A file of targets with columns of remarks, before and behind; text, floats and whole numbers."""
    numbers = dict(zip(("x", "y", "z", "qw", "qx", "qy", "qz"), quaternions(targets).T, strict=True))
    columns: dict[str, Any] = {"remark, long": NOTES, **numbers, "t": FORCES, "count": COUNTS}
    if path.suffix == ".csv":
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows(zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True))
    elif path.suffix == ".npz":
        np.savez(path, allow_pickle=False, **columns)
    else:
        table = importlib.import_module("pyarrow").table(columns)
        importlib.import_module("pyarrow.parquet").write_table(table, path, row_group_size=50)
    return path


def remarks(path: Path) -> dict[str, list[Any]]:
    """What a file of answers carries, as its format reads it."""
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            return {name: arrays[name].tolist() for name in ("remark, long", "t", "count")}
    if path.suffix == ".parquet":
        table = importlib.import_module("pyarrow.parquet").read_table(path)
        assert table.column_names[-4:] == ["message", "remark, long", "t", "count"]
        return {name: table.column(name).to_pylist() for name in table.column_names[-3:]}
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0])[-4:] == ["message", "remark, long", "t", "count"]
    return {name: [row[name] for row in rows] for name in ("remark, long", "t", "count")}


@pytest.mark.one_quick("after")
@pytest.mark.parametrize("before", [".csv", ".npz", ".parquet"])
@pytest.mark.parametrize("after", [".csv", ".npz", ".parquet"])
def test_remarks_travel_from_every_format_to_every_other(
    solver: IKSolver, targets: Array, tmp_path: Path, before: str, after: str
) -> None:
    source, out = write_with_remarks(tmp_path / f"in{before}", targets), tmp_path / f"out{after}"
    assert solve_file(solver, source, out).carried == ("remark, long", "t", "count")
    if ".csv" in (before, after):  # which has texts
        expected: dict[str, list[Any]] = {
            "remark, long": NOTES,
            "t": [*map(repr, FORCES.tolist())],
            "count": [*map(str, COUNTS.tolist())],
        }
    else:
        expected = {"remark, long": NOTES, "t": FORCES.tolist(), "count": COUNTS.tolist()}
    assert remarks(out) == expected
    again = tmp_path / f"again{after}"
    solve_file(solver, out, again)  # answers are targets
    assert again.read_bytes() == out.read_bytes()


@pytest.mark.one_quick
@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_remarks_come_with_the_rows_to_workers_without_the_file(
    solver: IKSolver, targets: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    source = write_with_remarks(tmp_path / f"in{suffix}", targets)
    solve_file(solver, source, tmp_path / f"a{suffix}", workers=1)

    def elsewhere(job: chunk.ChunkJob) -> object:
        if isinstance(rows := job.rows, chunk.RowsInFile):
            job = dataclasses.replace(job, rows=rows._replace(stamp=rows.stamp._replace(path=tmp_path / "elsewhere")))
        return chunk.make(pickle.loads(pickle.dumps(job)))

    monkeypatch.setattr(module, "make", elsewhere)
    solve_file(solver, source, tmp_path / f"b{suffix}", workers=2)
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_remarks_of_a_run_that_is_continued(solver: IKSolver, targets: Array, tmp_path: Path) -> None:
    source, out = write_with_remarks(tmp_path / "in.csv", targets), tmp_path / "out.npz"
    solve_file(solver, source, tmp_path / "whole.npz")

    def stop(_: Progress) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solve_file(solver, source, out, workers=1, progress=stop)
    assert solve_file(solver, source, out).resumed >= ROWS
    assert out.read_bytes() == (tmp_path / "whole.npz").read_bytes()


def test_columns_of_unusual_types_and_missing_values_travel(solver: IKSolver, targets: Array, tmp_path: Path) -> None:
    pa, parquet = importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    days = np.arange("2026-01-01", "2026-01-04", dtype="datetime64[D]")
    columns = {
        **dict(zip("xyz", targets[:3, :3, 3].T, strict=True)),
        "day": days,
        "kind": pa.array(["a", "b", "a"]).dictionary_encode(),
        "missing": pa.array([1, None, 3]),
        "seen": pa.array([True, None, False]),
        "rows": pa.array([[1], [2, 3], []]),
    }
    parquet.write_table(pa.table(columns), tmp_path / "in.parquet")
    solve_file(solver, tmp_path / "in.parquet", tmp_path / "same.parquet")
    table = parquet.read_table(tmp_path / "same.parquet").select(list(columns))
    assert table.to_pydict() == pa.table(columns).to_pydict()
    solve_file(solver, tmp_path / "in.parquet", tmp_path / "out.npz")
    with np.load(tmp_path / "out.npz") as arrays:
        assert arrays["day"].tolist() == days.tolist()
        assert arrays["kind"].tolist() == ["a", "b", "a"]
        np.testing.assert_array_equal(arrays["missing"], [1.0, np.nan, 3.0])
        assert arrays["seen"].tolist() == ["True", "", "False"]
        assert arrays["rows"].tolist() == ["[1]", "[2, 3]", "[]"]
    solve_file(solver, tmp_path / "in.parquet", tmp_path / "out.csv")
    with (tmp_path / "out.csv").open(newline="", encoding="utf-8") as file:
        first, second, _ = csv.DictReader(file)
    assert [first[name] for name in ("day", "kind", "missing", "seen", "rows")] == [
        "2026-01-01",
        "a",
        "1",
        "True",
        "[1]",
    ]
    assert [second[name] for name in ("missing", "seen")] == ["", ""]
    unusual = {"big": np.arange(3, dtype=">f8"), "hour": days.astype("M8[h]"), "raw": np.array([b"a", b"", b"c"])}
    np.savez(tmp_path / "in.npz", allow_pickle=False, targets=targets[:3], **unusual, table=np.eye(2), x=np.zeros(3))
    for suffix in (".npz", ".parquet", ".csv"):
        summary = solve_file(solver, tmp_path / "in.npz", tmp_path / f"out{suffix}")
        assert summary.carried == ("big", "hour", "raw")
    with np.load(tmp_path / "out.npz") as arrays:
        for name, values in unusual.items():
            np.testing.assert_array_equal(arrays[name], values)
    assert parquet.read_table(tmp_path / "out.parquet").column("raw").to_pylist() == ["a", "", "c"]


@pytest.mark.parametrize(
    ("kind", "whole", "text"),
    [
        ("timestamp", 1_700_000_000_000_000_000, "2023-11-14T22:13:20"),
        ("berlin", 1_700_000_000_000_000_000, "2023-11-14T23:13:20"),
        ("time64", 3_600_000_000_000, "01:00:00"),
        ("duration", 90_000_000_000, "0:01:30"),
    ],
)
def test_times_in_nanoseconds_travel_to_every_format(  # as pandas writes them, which Python's times do not hold
    kind: str, whole: int, text: str, solver: IKSolver, targets: Array, tmp_path: Path
) -> None:
    pa, parquet = importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    zone = "+01:00" if kind == "berlin" else ""
    type_ = pa.timestamp("ns", "Europe/Berlin") if kind == "berlin" else getattr(pa, kind)("ns")
    times = pa.array([whole, whole + 120_000, whole + 1, whole + 123_456_789, None], type_)
    table = pa.table({**dict(zip("xyz", targets[:5, :3, 3].T, strict=True)), "when": times})
    parquet.write_table(table, tmp_path / "in.parquet")
    for suffix in (".csv", ".npz", ".parquet"):
        assert solve_file(solver, tmp_path / "in.parquet", tmp_path / f"out{suffix}").carried == ("when",)
    with (tmp_path / "out.csv").open(newline="", encoding="utf-8") as file:
        written = [row["when"] for row in csv.DictReader(file)]
    decimals = ["", ".000120", ".000000001", ".123456789"]
    assert written == [*(f"{text}{each}{zone}" for each in decimals), ""]
    assert parquet.read_table(tmp_path / "out.parquet").column("when").combine_chunks().equals(times)


def test_what_cannot_be_carried_is_refused_before_anything_is_solved(
    solver: IKSolver, targets: Array, tmp_path: Path
) -> None:
    np.savez(tmp_path / "in.npz", allow_pickle=True, targets=targets, who=np.array([None] * N))
    with pytest.raises(InvalidInputError, match=r"array 'who': cannot be carried through, since it holds object"):
        solve_file(solver, tmp_path / "in.npz", tmp_path / "out.npz")
    (tmp_path / "in.csv").write_text("x,y,z,q\n0.3,0.2,0.4,1\n")
    with pytest.raises(InvalidInputError, match=r"column q cannot be carried through; rename it, or write \.csv"):
        solve_file(solver, tmp_path / "in.csv", tmp_path / "out.npz")
    assert not list(tmp_path.glob("out*"))
    assert solve_file(solver, tmp_path / "in.csv", tmp_path / "out.csv").carried == ("q",)


def test_rows_that_are_not_finite_have_a_status(solver: IKSolver, targets: Array, tmp_path: Path) -> None:
    targets[3, 0, 3] = np.nan
    targets[40] *= 2.0
    np.savez(tmp_path / "in.npz", targets=targets)
    summary = solve_file(solver, tmp_path / "in.npz", tmp_path / "out.csv")
    assert summary.statuses[Status.INVALID_TARGET] == 2
    assert summary.solved == N - 3
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(joints(tmp_path / "out.csv")).any(axis=1)), [3, 40])


def test_answers_do_not_depend_on_executors_or_chunks(
    solver: IKSolver, targets: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = write(tmp_path / "in.csv", targets)
    solve_file(solver, source, tmp_path / "a.csv", workers=1)
    with ThreadPoolExecutor(3) as executor:
        solve_file(solver, source, tmp_path / "b.csv", executor)
    monkeypatch.setattr(module, "ROWS", 7)
    monkeypatch.setattr(module, "CLOSEST_ROWS", 7)
    solve_file(solver, source, tmp_path / "c.csv", workers=2)
    first = (tmp_path / "a.csv").read_bytes()
    assert first == (tmp_path / "b.csv").read_bytes() == (tmp_path / "c.csv").read_bytes()


@pytest.mark.one_quick("unseen")
@pytest.mark.parametrize("unseen", ["nothing", "the file", "the folder", "either"])
@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_answers_do_not_depend_on_what_workers_see(
    solver: IKSolver, targets: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, unseen: str, suffix: str
) -> None:
    """On machines without the file the rows come with the job; without the folder, answers go back with it."""
    source = write(tmp_path / f"in{suffix}", targets)
    solve_file(solver, source, tmp_path / "a.parquet", workers=1)
    monkeypatch.setattr(module, "SHARE", 1)  # several chunks in a job
    numbers = iter(range(1000))

    def elsewhere(job: chunk.ChunkJob) -> object:
        if next(numbers) % 2 or unseen == "nothing":
            return chunk.make(job)
        keeper, rows = job.keeper, job.rows
        if unseen in ("the folder", "either"):
            keeper = dataclasses.replace(keeper, folder=tmp_path / "elsewhere")
        if unseen in ("the file", "either") and isinstance(rows, chunk.RowsInFile):
            rows = rows._replace(stamp=rows.stamp._replace(path=tmp_path / "elsewhere"))
        return chunk.make(dataclasses.replace(job, keeper=keeper, rows=rows))

    monkeypatch.setattr(module, "make", elsewhere)
    solve_file(solver, source, tmp_path / "b.parquet", workers=2)
    assert next(numbers) > 1
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


def test_jobs_get_smaller_towards_the_end() -> None:
    missing = [*range(40), *range(41, 300)]
    runs = list(module._runs(missing, shares=8))
    assert [index for run in runs for index in run] == missing
    assert [len(run) for run in runs[:4]] == [16, 16, 8, 16]  # one chunk in the middle is finished
    assert all(run == list(range(run[0], run[-1] + 1)) for run in runs)
    assert [len(run) for run in runs[-8:]] == [1] * 8


def test_a_file_that_changes_meanwhile_is_refused(
    solver: IKSolver, targets: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, out = write(tmp_path / "in.csv", targets), tmp_path / "out.csv"

    def change(_: Progress) -> None:
        other = tmp_path / "other.csv"
        other.write_text(source.read_text(encoding="utf-8") + "0.1,0.2,0.3,1,0,0,0\n", encoding="utf-8")
        other.replace(source)

    with pytest.raises(InvalidInputError, match="has changed since the batch began"):
        solve_file(solver, source, out, workers=1, progress=change)
    assert not out.exists()


def test_a_finished_chunk_is_not_solved_again(
    solver: IKSolver, targets: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, out = write(tmp_path / "in.csv", targets), tmp_path / "out.csv"
    solve_file(solver, source, tmp_path / "whole.csv")

    def stop(progress: Progress) -> None:
        if progress.done >= 3 * ROWS:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solve_file(solver, source, out, workers=1, progress=stop)
    chunks = sorted((tmp_path / "out.csv.chunks").glob("*.chunk"))
    assert len(chunks) >= 3
    assert not out.exists()
    chunks[0].write_bytes(chunks[0].read_bytes()[:-10])  # truncated: found by its hash, made again
    seen: list[Progress] = []
    summary = solve_file(solver, source, out, progress=seen.append)
    assert summary.resumed == ROWS * (len(chunks) - 1)
    assert seen[-1].done == seen[-1].total == N
    assert seen[-1].rate > 0.0
    assert out.read_bytes() == (tmp_path / "whole.csv").read_bytes()
    assert not (tmp_path / "out.csv.chunks").exists()


def test_an_interrupted_run_does_not_wait_for_chunks_that_have_begun(
    solver: IKSolver, targets: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    targets[:, :3, 3] += 3.0  # [m], out of reach: each takes a while
    source, solved, single = write(tmp_path / "in.csv", targets[: 4 * ROWS]), list[int](), batch._job

    def counted(*given: Any) -> Any:
        solved.append(1)
        return single(*given)

    def stop(_: Progress) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(batch, "_job", counted)
    with pytest.raises(KeyboardInterrupt):
        solve_file(solver, source, tmp_path / "out.csv", workers=1, progress=stop)
    assert ROWS <= len(solved) < ROWS + ROWS // 2


@pytest.mark.parametrize("what", ["targets", "robot", "options", "version"])
def test_a_run_is_not_continued_with_something_else(
    robot: Robot, targets: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    import jacokin

    source, out = write(tmp_path / "in.csv", targets), tmp_path / "out.csv"

    def stop(_: Progress) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solve_file(IKSolver(robot), source, out, progress=stop)
    solver = IKSolver(robot)
    if what == "targets":
        write(source, targets[::-1])
    elif what == "robot":
        solver = IKSolver(jacokin.load_robot(limits={"joint_2": (1.0, 5.0)}))
    elif what == "options":
        solver = IKSolver(robot, position_tolerance=1e-5)
    else:
        monkeypatch.setattr(jacokin, "__version__", "9.9.9")
    with pytest.raises(InvalidInputError, match=rf"differs in {what}"):
        solve_file(solver, source, out)
    assert not out.exists()
    solve_file(solver, source, out, resume=False)
    assert out.exists()


def test_a_full_disk_keeps_what_is_finished(
    solver: IKSolver, targets: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, out = write(tmp_path / "in.csv", targets), tmp_path / "out.csv"
    out.write_text("old")
    write_chunk = folder.write

    def full(path: Path, content: bytes) -> None:
        if path.name.startswith("000002"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write_chunk(path, content)

    monkeypatch.setattr(folder, "write", full)
    with pytest.raises(JacokinError, match="No space left on device; finished chunks are kept"):
        solve_file(solver, source, out, workers=1)
    assert out.read_text() == "old"
    monkeypatch.undo()
    monkeypatch.setattr(module, "ROWS", ROWS)
    monkeypatch.setattr(module, "CLOSEST_ROWS", ROWS)
    assert solve_file(solver, source, out).resumed >= 2 * ROWS


def test_a_run_on_threads_of_ones_own_ends_with_ctrl_c(
    robot: Robot, targets: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whose pool waits for chunks under way: these end within a target."""
    monkeypatch.setattr(module, "ROWS", 10_000)
    source, seen = write(tmp_path / "targets.csv", np.tile(targets, (4, 1, 1))), []
    solver = IKSolver(robot, method="qp")

    def slowly(*_: object, **__: object) -> object:
        seen.append(1)
        time.sleep(0.02)  # [s] of 920 in a chunk
        return answer

    answer = solver.solve(targets[0])
    monkeypatch.setattr(IKSolver, "solve", slowly)
    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt), ThreadPoolExecutor(1) as executor:
        solve_file(solver, source, tmp_path / "answers.csv", executor)
    assert time.monotonic() - begun < 5.0
    assert seen


def test_a_signal_while_the_folder_is_made_leaves_nothing(
    solver: IKSolver, targets: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = write(tmp_path / "targets.csv", targets)

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("jacokin.chunks.folder.write", interrupted)  # the recipe, which waits for the disk
    with pytest.raises(KeyboardInterrupt):
        solve_file(solver, source, tmp_path / "answers.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["targets.csv"]


@pytest.mark.parametrize("kind", ["matrices", "quaternions", "positions"])
def test_one_array_is_a_file_of_targets(solver: IKSolver, targets: Array, tmp_path: Path, kind: str) -> None:
    rows = {"matrices": targets, "quaternions": quaternions(targets), "positions": targets[:40, :3, 3]}[kind]
    np.save(tmp_path / "targets.npy", rows)
    solve_file(solver, tmp_path / "targets.npy", tmp_path / "answers.npz")
    seeds = np.tile(solver.robot.home, (len(rows), 1))
    poses = rows if kind == "positions" else targets
    with np.load(tmp_path / "answers.npz") as answers:
        np.testing.assert_allclose(answers["q"], solver.solve_batch(poses, seeds).q, atol=1e-9)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (np.zeros((3, 6)), r"targets must have shape \(n, 4, 4\), \(n, 7\) .*, got \(3, 6\)"),
        (np.zeros((0, 3)), "has no rows of targets"),
        (np.array([["a", "b", "c"]]), "must be rows of real numbers, got <U1 of shape"),
        (np.float64(1.0), r"targets must have shape .*, got \(\)"),
    ],
)
def test_arrays_that_are_no_targets_are_refused(solver: IKSolver, tmp_path: Path, rows: Array, words: str) -> None:
    np.save(tmp_path / "targets.npy", rows)
    with pytest.raises(InvalidInputError, match=f"targets.npy: {words}"):
        solve_file(solver, tmp_path / "targets.npy", tmp_path / "answers.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["targets.npy"]


REFUSED_FILES = [
    ("a.parquet", "column y, z is missing; needed: x, y, z; found: x, height"),
    ("b.parquet", "column x: must hold numbers, got string"),
    ("c.parquet", "not a Parquet file"),
    ("d.npz", "not an NPZ file"),
    ("e.npz", r"needed: targets \(n, 4, 4\).*found: q \(3, 6\)"),
    ("f.npz", "different lengths"),
    ("none.npz", "cannot be read"),
    ("none.parquet", "cannot be read"),
]


@pytest.mark.parametrize(("name", "message"), REFUSED_FILES)
def test_wrong_files_are_refused_before_anything_is_solved(
    solver: IKSolver, tmp_path: Path, name: str, message: str
) -> None:
    pa = importlib.import_module("pyarrow")
    parquet = importlib.import_module("pyarrow.parquet")
    parquet.write_table(pa.table({"x": [0.1], "height": [0.2]}), tmp_path / "a.parquet")
    parquet.write_table(pa.table({"x": ["a"], "y": [0.2], "z": [0.3]}), tmp_path / "b.parquet")
    (tmp_path / "c.parquet").write_bytes(b"PAR1 no")
    (tmp_path / "d.npz").write_bytes(b"no")
    np.savez(tmp_path / "e.npz", q=np.zeros((3, 6)))
    np.savez(tmp_path / "f.npz", position=np.zeros((3, 3)), rpy=np.zeros((2, 3)))
    with pytest.raises(InvalidInputError, match=message):
        solve_file(solver, tmp_path / name, tmp_path / "out.csv")
    assert not list(tmp_path.glob("out*"))


REFUSED_ARGUMENTS: list[tuple[dict[str, object], str]] = [
    ({"solver": "j2n6s300"}, "solver must be an IKSolver, got 'j2n6s300'"),
    ({"targets": 3}, "targets must be a str or a Path, got 3"),
    ({"output": ""}, "output must be a str or a Path, got ''"),
    ({"output": "out.xlsx"}, r"\.csv, \.npz, \.parquet"),
    ({"output": "../folder/in.csv"}, "is the file of targets: they would be lost"),
    ({"output": "nowhere/out.csv"}, "there is no folder"),
    ({"executor": type("Client", (), {"get_executor": None})()}, r"client\.get_executor"),
    ({"executor": ThreadPoolExecutor(1), "workers": 2}, "workers does not go with executor"),
    ({"workers": 0}, "workers must be"),
    ({"resume": "no"}, "resume must be True or False"),
    ({"closest": 1}, "closest must be True or False"),
    ({"seed": [0.0] * 5}, "seed"),
    ({"progress": 3}, "progress must be callable, got 3"),
]


@pytest.mark.parametrize(("arguments", "message"), REFUSED_ARGUMENTS)
def test_wrong_arguments_are_refused_before_anything_is_solved(
    solver: IKSolver,
    targets: Array,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: dict[str, object],
    message: str,
) -> None:
    (tmp_path / "folder").mkdir()
    monkeypatch.chdir(tmp_path / "folder")
    before = write(Path("in.csv"), targets[:3]).read_bytes()
    given: dict[str, Any] = {"solver": solver, "targets": "in.csv", "output": "out.csv", **arguments}
    with pytest.raises(InvalidInputError, match=message):
        solve_file(**given)
    assert Path("in.csv").read_bytes() == before
    assert [path.name for path in Path().iterdir()] == ["in.csv"]


@pytest.mark.parametrize("resume", [True, False])
def test_one_process_at_a_time_works_on_a_file(
    solver: IKSolver, targets: Array, tmp_path: Path, *, resume: bool
) -> None:
    source, out = write(tmp_path / "in.csv", targets), tmp_path / "out.csv"
    refusals: list[str] = []

    def again(_: Progress) -> None:
        with pytest.raises(InvalidInputError, match="another process is working on it") as refused:
            solve_file(solver, source, out, resume=resume)
        refusals.append(str(refused.value))

    solve_file(solver, source, out, progress=again)
    assert refusals


RUN = """
import os, signal, sys, jacokin
from jacokin.ik import solve_file
from jacokin.ik.batches import solve_file as module
module.ROWS, module.CLOSEST_ROWS = 64, 64
syncs, fsync = int(sys.argv[3]), os.fsync
def counted(file):
    global syncs
    syncs -= 1
    if syncs == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    fsync(file)
os.fsync = counted
solve_file(jacokin.IKSolver(jacokin.load_robot()), sys.argv[1], sys.argv[2], workers=1)
"""


def run_until(sync: int, source: Path, out: Path) -> int:
    """Solve a file in a process that is killed before this file is on disk, the first is 1; returns how it ended."""
    words = [sys.executable, "-P", "-c", RUN, str(source), str(out), str(sync)]
    return subprocess.run(words, check=False, capture_output=True).returncode


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_killed_runs_end_in_the_same_bytes(robot: Robot, tmp_path: Path, rng: np.random.Generator, suffix: str) -> None:
    poses = np.array([robot.forward_kinematics(q).homogeneous for q in robot.sample(rng, 1_000)])
    source, whole, out = tmp_path / "in.npz", tmp_path / f"whole{suffix}", tmp_path / f"out{suffix}"
    np.savez(source, targets=poses)
    assert run_until(-1, source, whole) == 0
    chunks = -(-len(poses) // 64)
    # At the recipe, at the first chunk, on the way, and when all chunks are there and the whole is written.
    folder = tmp_path / f"{out.name}.chunks"
    for sync, most in ((1, 0), (2, 1), (8, 8), (5, 13), (chunks, chunks)):
        found = len(list(folder.glob("*.chunk")))
        # The file that is joined is brought to disk when it is complete.
        assert run_until(sync if most < chunks else chunks - found + 1, source, out) == -signal.SIGKILL
        assert not out.exists()
        assert found <= len(list(folder.glob("*.chunk"))) <= most
    assert len(list(folder.glob("*.chunk"))) == chunks
    assert run_until(-1, source, out) == 0
    assert out.read_bytes() == whole.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([source.name, whole.name, out.name])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of dask about its own ports and clocks
def test_a_cluster_that_loses_a_worker_gives_the_same_bytes(solver: IKSolver, targets: Array, tmp_path: Path) -> None:
    distributed = importlib.import_module("distributed")
    source = write(tmp_path / "in.csv", np.tile(targets, (10, 1, 1)))
    solve_file(solver, source, tmp_path / "whole.csv")
    with (
        distributed.LocalCluster(n_workers=3, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        killed: list[int] = []

        def kill(_: Progress) -> None:
            if not killed:
                killed.append(next(iter(client.run(os.getpid).values())))
                os.kill(killed[0], signal.SIGKILL)

        solve_file(solver, source, tmp_path / "out.csv", client.get_executor(), progress=kill)
    assert killed
    assert (tmp_path / "out.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()
