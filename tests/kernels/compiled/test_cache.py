"""The cache of compiled kernels: what is used, what is refused, what is left behind."""

from __future__ import annotations

import errno
import os
import shutil
import stat
import tempfile
import threading
import time
from pathlib import Path

import pytest

from jacokin.kernels.compiled import cache, compiler

CODE = b"machine code" * 1000


@pytest.fixture(autouse=True)
def place(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The folder of an empty cache."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "root"))
    folder = cache.folder()
    assert folder is not None
    return folder


def written() -> Path:
    assert cache.write(CODE) == ""
    file = cache.path()
    assert file is not None
    return file


def test_what_was_written_is_read() -> None:
    assert cache.read() == cache.CachedKernels(None)
    written()
    assert cache.read() == cache.CachedKernels(CODE)


def test_folders_are_private_whatever_the_umask(place: Path) -> None:
    before = os.umask(0)
    try:
        file = written()
    finally:
        os.umask(before)
    for folder in (place, place.parent, place.parent.parent):
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert stat.S_IMODE(file.stat().st_mode) == 0o644  # readable to whom the owner opens the folder


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: b"",
        lambda data: data[:-1],
        lambda data: data[:20],
        lambda data: bytes(len(data)),
        lambda data: data[:-64] + bytes(64),
        lambda data: b"x" + data[1:],
        lambda data: data.replace(cache.key().encode(), b"0" * 16),
        lambda data: data + b"\n",
    ],
    ids=["empty", "truncated", "cut in the head", "zeros", "zeros at the end", "format", "other key", "longer"],
)
def test_a_damaged_file_is_not_used(damage: object) -> None:
    file = written()
    assert callable(damage)
    file.write_bytes(damage(file.read_bytes()))
    found = cache.read()
    assert found.code is None
    assert "damaged or incomplete" in found.problem
    assert str(file) in found.problem
    assert cache.read() == found  # and again
    written()
    assert cache.read() == cache.CachedKernels(CODE)


@pytest.mark.parametrize("mode", [0o775, 0o757, 0o1777])
def test_a_folder_that_others_may_write_to_is_not_used(mode: int) -> None:
    file = written()
    file.parent.chmod(mode)
    found = cache.read()
    assert found.code is None
    assert "group or others may write to it" in found.problem
    assert "NUMBA_CACHE_DIR" in found.problem
    assert "group or others may write to it" in cache.write(b"other code")  # nor written to
    with cache.lock():
        assert [entry.name for entry in file.parent.iterdir()] == [file.name]
    file.parent.chmod(0o700)
    assert cache.read() == cache.CachedKernels(CODE)


@pytest.mark.parametrize("mode", [0o664, 0o646])
def test_a_file_that_others_may_write_to_is_not_used(mode: int) -> None:
    file = written()
    file.chmod(mode)
    assert cache.read().code is None
    assert str(file) in cache.read().problem


def test_the_cache_of_another_user_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    file = written()
    fstat = os.fstat

    def by_another_user(handle: int) -> os.stat_result:
        status = list(fstat(handle))
        status[4] = os.geteuid() + 4321  # whoever runs the tests, root included
        return os.stat_result(status)

    monkeypatch.setattr(os, "fstat", by_another_user)
    found = cache.read()
    assert found.code is None
    assert f"{file} is not used: it belongs to another user" in found.problem


def test_the_cache_of_root_is_used() -> None:
    by_root = os.stat_result((0o100644, 1, 1, 1, 0, 0, 1, 0, 0, 0))
    by_somebody = os.stat_result((0o100644, 1, 1, 1, os.geteuid() + 1, 0, 1, 0, 0, 0))
    assert cache.distrust(by_root, Path("file")) == ""
    assert "another user" in cache.distrust(by_somebody, Path("file"))


def test_a_cache_that_cannot_be_written_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    written()

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    for module, name in ((os, "utime"), (tempfile, "mkstemp"), (Path, "mkdir"), (Path, "touch")):
        monkeypatch.setattr(module, name, refuse)
    file = cache.path()
    assert file is not None
    assert cache.read() == cache.CachedKernels(CODE)
    with cache.lock():
        pass
    assert "cannot be kept" in cache.write(CODE)
    assert cache.read() == cache.CachedKernels(CODE)


def test_a_full_disk_leaves_nothing_behind(monkeypatch: pytest.MonkeyPatch, place: Path) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    problem = cache.write(CODE)
    assert "No space left on device" in problem
    assert str(place) in problem
    assert list(place.iterdir()) == []


def test_without_a_home_folder_the_message_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    assert cache.path() is None
    assert cache.read() == cache.CachedKernels(None)
    problem = cache.write(CODE)
    assert "no home folder" in problem
    assert "None" not in problem
    with cache.lock():
        pass


def test_a_pipe_in_place_of_the_file_is_not_waited_for(place: Path) -> None:
    file = written()
    file.unlink()
    os.mkfifo(file)
    assert "is not a file" in cache.read().problem


def test_the_name_depends_on_contents_only(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    kernels = Path(cache.__file__).parents[1]
    before = cache.key()
    copy = tmp_path / "another environment"
    shutil.copytree(kernels, copy, copy_function=shutil.copyfile)  # times of modification are new
    monkeypatch.setattr(cache, "__file__", str(copy / "compiled" / "cache.py"))
    assert cache.key() == before
    for name in (*compiler.KERNEL_MODULES, "compiled.compiler", "compiled.library"):
        kernel = copy / f"{name.replace('.', '/')}.py"
        text = kernel.read_text()
        kernel.write_text(text + "\n")
        assert cache.key() != before, name
        kernel.write_text(text)


def test_code_of_files_that_changed_while_it_was_compiled_is_not_kept_under_their_new_name() -> None:
    before = cache.pack(b"code of what was imported", "0" * 16)
    with pytest.raises(ValueError, match="damaged or incomplete"):
        cache.unpack(before)
    assert cache.unpack(cache.pack(b"code", cache.key())) == b"code"


def test_the_name_depends_on_the_processor(monkeypatch: pytest.MonkeyPatch) -> None:
    before = cache.key()
    monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    assert cache.key() != before


def test_unused_files_are_removed(place: Path) -> None:
    place.mkdir(parents=True, mode=0o700)
    now = time.time()
    for age in range(1, 12):
        file = place / f"{age:016x}{cache.ENDING}"
        file.touch()
        os.utime(file, (now - 1000 * age, now - 1000 * age))
    left_over, in_use = place / "unfinished-old", place / "unfinished-new"
    left_over.touch()
    in_use.touch()
    os.utime(left_over, (now - 7200, now - 7200))
    old = place.parent / "0123456789abcdef"
    old.mkdir()
    (old / "complete.txt").touch()
    other = place.parent / "somebody-elses"
    other.mkdir()
    file = written()
    assert sorted(place.glob("*" + cache.ENDING)) == sorted(
        [file, *(place / f"{age:016x}{cache.ENDING}" for age in range(1, cache.KEPT_FILES))]
    )
    assert not left_over.exists()
    assert in_use.exists()
    assert not old.exists()
    assert other.exists()


def test_only_one_process_compiles_at_a_time() -> None:
    order: list[str] = []

    def compile_too() -> None:
        with cache.lock():
            order.append("second")

    with cache.lock():
        second = threading.Thread(target=compile_too)
        second.start()
        time.sleep(3 * cache._LOCK_INTERVAL)
        order.append("first")
    second.join()
    assert order == ["first", "second"]


def test_a_filled_cache_ends_the_wait_for_a_lock() -> None:
    entered = threading.Event()

    def wait() -> None:
        with cache.lock():
            entered.set()

    with cache.lock():
        waiting = threading.Thread(target=wait)
        waiting.start()
        assert not entered.is_set()
        written()
        assert entered.wait(timeout=30)
    waiting.join()
