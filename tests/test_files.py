"""Files that are replaced in one step."""

from __future__ import annotations

import errno
import io
import os
import resource
import shutil
import stat
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin import Robot, files
from jacokin.errors import InvalidInputError
from jacokin.ik import export_c, solve_file
from jacokin.model import PointCloud, Scene, write_urdf
from jacokin.tasks import TaskEnv, record


@pytest.fixture(params=[0o022, 0o077], ids=oct)
def umask(request: pytest.FixtureRequest) -> Iterator[int]:
    value: int = request.param
    before = os.umask(value)
    yield value
    os.umask(before)


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_a_new_file_gets_the_permissions_of_the_umask(tmp_path: Path, umask: int) -> None:
    file = tmp_path / "a.csv"
    with files.replacing(file) as temporary:
        temporary.write_text("new")
    assert mode(file) == 0o666 & ~umask
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


def test_a_replaced_file_keeps_its_permissions_and_links_are_followed(tmp_path: Path) -> None:
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    file, link = folder / "a.csv", tmp_path / "link.csv"
    file.write_text("old")
    file.chmod(0o640)
    link.symlink_to(file)
    with files.replacing(link) as temporary:
        temporary.write_text("new")
        assert temporary.suffix == ".csv"
        assert file.read_text() == "old"
    assert link.is_symlink()
    assert (file.read_text(), mode(file)) == ("new", 0o640)


@pytest.mark.parametrize(
    ("error", "raised"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), InvalidInputError),
        (OSError(errno.ECONNRESET, "Connection reset by peer"), OSError),
        (KeyboardInterrupt(), KeyboardInterrupt),
        (SystemExit(1), SystemExit),
    ],
)
def test_a_block_that_raises_leaves_the_old_file_alone(
    tmp_path: Path, error: BaseException, raised: type[BaseException]
) -> None:
    file = tmp_path / "a.csv"
    file.write_text("old")

    def write() -> None:
        with files.replacing(file) as temporary:
            temporary.write_text("half")
            raise error

    with pytest.raises(raised):
        write()
    assert file.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


def test_a_file_that_finds_no_room_is_named_as_it_was_given(tmp_path: Path) -> None:
    """A write says nothing of its file, a copy names its source, too, and others the temporary file."""
    file, source, (_, most) = tmp_path / "a.npy", tmp_path / "source", resource.getrlimit(resource.RLIMIT_FSIZE)
    source.write_bytes(bytes(100_000))
    writers: list[tuple[Callable[[Path], object], str]] = [
        (lambda path: path.write_bytes(bytes(100_000)), "File too large"),
        (lambda path: shutil.copyfile(source, path), "File too large"),
        (lambda path: (path / "none").replace(path), "Not a directory"),
    ]
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, most))
    try:
        for write, why in writers:
            with pytest.raises(InvalidInputError) as caught, files.replacing(file) as temporary:
                write(temporary)
            assert str(caught.value) == f"{file}: cannot be written: {why}"
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
    assert [path.name for path in tmp_path.iterdir()] == ["source"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_device_that_is_full_is_named() -> None:
    with pytest.raises(InvalidInputError, match="^/dev/full: cannot be written: No space left on device$"):
        write_urdf(jacokin.load_robot(), "/dev/full")


def test_writers_at_the_same_time_and_leftovers_do_not_meet(tmp_path: Path) -> None:
    file = tmp_path / ("long" * 60 + ".csv")  # 244 bytes: the temporary name must not be longer than 255
    with files.replacing(file) as first, files.replacing(file) as second:
        assert first != second
        first.write_text("first")
        second.write_text("second")
    assert file.read_text() == "first"


def test_what_cannot_be_written_is_refused_before_the_work(tmp_path: Path) -> None:
    loop = tmp_path / "loop.csv"
    loop.symlink_to(loop)
    for path, words in (
        (tmp_path, "it is a folder"),
        (tmp_path / "missing" / "a.csv", "No such file"),
        (loop, "cannot be written"),
        (Path("a\0b.csv"), "cannot be written"),
    ):
        with pytest.raises(InvalidInputError, match=words), files.replacing(path):
            pytest.fail("the block ran")


@pytest.mark.parametrize("name", ["long" * 100, "y/" * 3000 + "z", "a\0b"], ids=["name", "path", "null byte"])
def test_what_no_file_can_be_called_is_refused_by_all_that_write(robot: Robot, name: str, tmp_path: Path) -> None:
    solver, targets = jacokin.IKSolver(robot), tmp_path / "targets.csv"
    targets.write_text("x,y,z\n0.3,-0.3,0.4\n", encoding="utf-8")
    writers: list[Callable[[Path], object]] = [
        lambda path: write_urdf(robot, path.with_suffix(".urdf")),
        lambda path: PointCloud("seen", np.zeros((1, 3))).save(path.with_suffix(".ply")),
        lambda path: Scene().save(path.with_suffix(".json")),
        lambda path: solve_file(solver, targets, path.with_suffix(".csv")),
        lambda path: export_c(solver, path),
        lambda path: record(TaskEnv("reach_site"), lambda observation: np.zeros(9), path.with_suffix(".hdf5")),
    ]
    for write in writers:
        with pytest.raises(InvalidInputError, match="cannot be written: (File name too long|embedded null byte)"):
            write(tmp_path / name)
    assert list(tmp_path.iterdir()) == [targets]


def test_a_file_where_a_folder_should_be_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match="cannot be written: Not a directory$"):
        write_urdf(jacokin.load_robot(), tmp_path / "file" / "arm.urdf")


def test_a_pipe_is_written_to_as_it_is(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with files.replacing(pipe) as path:
        assert path == pipe
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_archives_of_arrays_are_read_or_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    np.savez(file, first=np.arange(1000.0), second=np.array(["one", "two"]))
    read = files.read_arrays(file, "is not ours")
    assert list(read) == ["first", "second"]
    assert np.array_equal(read["first"], np.arange(1000.0))
    whole = file.read_bytes()
    for content in (b"", b"PK\x03\x04 nothing", whole[: len(whole) // 2], whole[:4000] + b"x" + whole[4001:]):
        file.write_bytes(content)
        with pytest.raises(InvalidInputError, match="is not ours"):
            files.read_arrays(file, "is not ours")
    np.savez(file, objects=np.array([{}], dtype=object))
    with pytest.raises(InvalidInputError, match="is not ours"):
        files.read_arrays(file, "is not ours")
    with pytest.raises(InvalidInputError, match="cannot be read: No such file"):
        files.read_arrays(tmp_path / "missing.npz", "is not ours")


def test_headers_of_arrays_are_read_one_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """The parser of literals and the filter of warnings are of the whole process."""
    stream, reading, together = io.BytesIO(), list[int](), list[int]()
    np.lib.format.write_array(stream, np.zeros(3))
    whole, read = stream.getvalue(), np.lib.format.read_array_header_1_0

    def slowly(header: io.BytesIO) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
        reading.append(1)
        together.append(len(reading))
        time.sleep(0.01)
        reading.pop()
        return read(header)

    monkeypatch.setattr(np.lib.format, "read_array_header_1_0", slowly)
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(lambda _: files.array_header(io.BytesIO(whole), len(whole)), range(8)))
    assert {shape for shape, *_ in found} == {(3,)}
    assert max(together) == 1
