"""The compiled kernels on disk: one file, named after everything that its machine code depends on.

A file holds a line of format, its name, the SHA-256 of the machine code, and the machine code; nothing of it is used
before the hash is checked. It is used wherever it can be read, also where it could not be written, on one condition:
only its owner may write to it and to its folder, and the owner is the user or root. A new file takes its name when it
is complete.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import importlib.metadata
import os
import platform
import re
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from jacokin.kernels.compiled.library import cpu

FORMAT = b"jacokin kernels 1\n"
ENDING = ".kernels"
#: Files of other versions and CPUs that are kept, those last used longest.
KEPT_FILES = 8
_TEMPORARY = "unfinished-"
_LEFT_OVER = 3600.0  # [s] a temporary file that is older belongs to nobody
_TOUCH_AFTER = 86400.0  # [s] the time of the last use is written down once a day
_LOCK_TIMEOUT = 120.0  # [s] to wait for another process that compiles
_LOCK_INTERVAL = 0.2  # [s]
_OLD_FOLDER = re.compile("[0-9a-f]{16}")  # version 0.1.0 kept numba's own cache files in such folders


class CachedKernels(NamedTuple):
    """What the cache holds.

    Attributes:
        code: the machine code; None when there is none to use.
        problem: why a file that is there is not used.
    """

    code: bytes | None
    problem: str = ""


def folder() -> Path | None:
    """Where compiled kernels belong; None without a home folder.

    ``NUMBA_CACHE_DIR`` and ``XDG_CACHE_HOME`` are respected.
    """
    base = os.environ.get("NUMBA_CACHE_DIR")
    try:
        root = Path(base) if base else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:
        return None
    return root.absolute() / "jacokin" / "kernels"


def path() -> Path | None:
    """The file for this version, machine and Python; None without a home folder."""
    place = folder()
    return None if place is None else place / (key() + ENDING)


def key() -> str:
    """A name that changes with everything the machine code depends on, and with nothing else."""
    digest = hashlib.sha256(FORMAT)
    here = Path(__file__).parent
    kernels = [path for path in sorted(here.parent.rglob("*.py")) if path.parent != here]
    for source in (*kernels, here / "compiler.py", here / "library.py"):
        digest.update(source.read_bytes())
    packages = [_version(name) for name in ("numba", "llvmlite", "numpy")]
    digest.update(repr((packages, platform.python_version(), platform.system(), platform.machine(), *cpu())).encode())
    return digest.hexdigest()[:16]


def pack(code: bytes, name: str) -> bytes:
    """The contents of a file: machine code under the name that `key` gave before it was compiled."""
    return FORMAT + f"{name}\n{hashlib.sha256(code).hexdigest()}\n".encode() + code


def unpack(contents: bytes) -> bytes:
    """The machine code in the contents of a file, its hash checked.

    Raises:
        ValueError: the contents are incomplete, damaged, or made for something else.
    """
    start, *head, code = (contents[: len(FORMAT)], *contents[len(FORMAT) :].split(b"\n", 2), b"", b"")[:4]
    if start != FORMAT or head != [key().encode(), hashlib.sha256(code).hexdigest().encode()]:
        raise ValueError("it is damaged or incomplete")
    return code


def read() -> CachedKernels:
    """The machine code for this machine, if it is there and can be trusted."""
    file = path()
    if file is None:
        return CachedKernels(None)
    try:
        problem = distrust(file.parent.stat(), file.parent)
        if problem:
            return CachedKernels(None, problem)
        with open(os.open(file, os.O_RDONLY | os.O_NONBLOCK), "rb") as stream:  # noqa: PTH123  # never waits for a FIFO
            status = os.fstat(stream.fileno())
            if not stat.S_ISREG(status.st_mode):
                return CachedKernels(None, f"{file} is not a file")
            problem = distrust(status, file)
            if problem:
                return CachedKernels(None, problem)
            code = unpack(stream.read())
    except (FileNotFoundError, NotADirectoryError):
        return CachedKernels(None)
    except OSError as error:
        return CachedKernels(None, f"{file} cannot be read: {error.strerror}")
    except ValueError as error:
        return CachedKernels(None, f"{file} is not used: {error}")
    if time.time() - status.st_mtime > _TOUCH_AFTER:
        with contextlib.suppress(OSError):
            os.utime(file)
    return CachedKernels(code)


def distrust(status: os.stat_result, place: Path) -> str:
    """Why machine code from there is not run; empty when only the user or root could have put it there."""
    if status.st_uid not in (os.geteuid(), 0):
        reason = f"it belongs to another user (uid {status.st_uid})"
    elif status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        reason = "group or others may write to it"
    else:
        return ""
    return f"{place} is not used: {reason}; set NUMBA_CACHE_DIR to a folder of your own"


def write(code: bytes) -> str:
    """Keep machine code for later processes; returns why it could not be kept, or nothing."""
    file = path()
    if file is None:
        return "there is no home folder to keep the compiled closed form in; set NUMBA_CACHE_DIR to a folder"
    temporary = None
    try:
        _make_private(file.parent)
        problem = distrust(file.parent.stat(), file.parent)
        if problem:
            return problem
        handle, temporary = tempfile.mkstemp(prefix=_TEMPORARY, dir=file.parent)
        with open(handle, "wb") as stream:  # noqa: PTH123  # the handle is open already
            stream.write(pack(code, file.stem))
        os.chmod(temporary, 0o644)  # noqa: PTH101  # who may enter the folder may read
        os.replace(temporary, file)  # noqa: PTH105
    except OSError as error:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        return f"the compiled closed form cannot be kept in {file.parent}: {error.strerror}"
    _prune(file)
    return ""


@contextlib.contextmanager
def lock() -> Iterator[None]:
    """Wait while another process compiles, unless the cache is filled meanwhile; without a folder do not wait."""
    place = folder()
    handle = None
    if place is not None:
        with contextlib.suppress(OSError):
            _make_private(place)
            if not distrust(place.stat(), place):
                handle = os.open(place / "lock", os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
    try:
        deadline = time.monotonic() + _LOCK_TIMEOUT
        while handle is not None and time.monotonic() < deadline and read().code is None:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                time.sleep(_LOCK_INTERVAL)
            except OSError:  # a file system without locks
                break
        yield
    finally:
        if handle is not None:
            os.close(handle)


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:  # in an application that was packed without it
        return "unknown"


def _make_private(place: Path) -> None:
    """Make a folder, and those above it, that only the user may enter."""
    for parent in (*reversed(place.parents), place):
        with contextlib.suppress(FileExistsError):
            if not parent.is_dir():
                parent.mkdir(mode=0o700)


def _prune(newest: Path) -> None:
    """Remove what nobody uses any more: old files, unfinished ones, and the folders of an earlier layout."""
    with contextlib.suppress(OSError):
        by_age = sorted(newest.parent.glob("*" + ENDING), key=lambda file: file.stat().st_mtime, reverse=True)
        left_over = [
            file for file in newest.parent.glob(_TEMPORARY + "*") if time.time() - file.stat().st_mtime > _LEFT_OVER
        ]
        for file in (*by_age[KEPT_FILES:], *left_over):
            file.unlink(missing_ok=True)
        for old in newest.parent.parent.iterdir():
            if _OLD_FOLDER.fullmatch(old.name) and not old.is_symlink() and (old / "complete.txt").is_file():
                shutil.rmtree(old, ignore_errors=True)
