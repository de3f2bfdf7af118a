"""Wheels for several machines are refused where they are not what their names say."""

from __future__ import annotations

import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import jacokin
from build_kernels import wheels
from build_kernels.linking import wheel_tag
from build_kernels.targets import TARGETS, WHEELS
from build_kernels.wheels import WheelError
from jacokin.kernels.entries import ENTRIES
from jacokin.kernels.library import PREFIX, About, ArrayLayout

Change = Callable[[str, dict[str, bytes]], None]
LIBRARY = "jacokin/kernels/libjacokin.so"
DYLIB = "jacokin/kernels/libjacokin.dylib"
INFO = f"jacokin-{jacokin.__version__}.dist-info"
#: One command: for macOS 11.0.
BUILD_VERSION = struct.pack("<6I", wheels.LC_BUILD_VERSION, 24, 1, 11 << 16, 0, 0)


def head_of(name: str) -> bytes:
    """How a library for a machine begins."""
    system, processor = TARGETS[name].system, name.partition("-")[0]
    at, begin = wheels.PROCESSORS[system][processor]
    head = (b"\0" * at + begin).ljust(16, b"\0")
    return (head + struct.pack("<4I", 1, len(BUILD_VERSION), 0, 0) + BUILD_VERSION) if system == "darwin" else head


def recorded(files: dict[str, bytes]) -> bytes:
    sums = "".join(f"{name},sha256={wheels._sum(content)},{len(content)}\n" for name, content in files.items())
    return f"{sums}{INFO}/RECORD,,\n".encode()


def made(folder: Path, change: Change = lambda name, files: None, later: Change = lambda name, files: None) -> Path:
    """A wheel for each machine, with libraries that have no code; `later` changes what was recorded."""
    for name in WHEELS:
        target = TARGETS[name]
        names = [entry.run.__name__ for entry in ENTRIES]
        symbols = b"".join(f"{PREFIX}{each}\0".encode() for each in names) + b"GLIBC_2.17\0" * (
            target.system == "linux"
        )
        about = About(jacokin.__version__, "0", 0, {each: (ArrayLayout(np.dtype(np.float64), (3,)),) for each in names})
        symbols += b"jacokin_fk\0"
        head = head_of(name) + symbols
        text = about._replace(size=len(head) + len(about.text()) + 1).text().encode()
        files = {
            f"jacokin/kernels/{target.library}": head + text + b"\0",
            "jacokin/a.py": b"a",
            wheels.HEADER: b"JACOKIN_IK_API int jacokin_fk(const double *q);",
            f"{INFO}/WHEEL": f"Tag: {wheel_tag(head, target)}\n".encode(),
        }
        change(name, files)
        files[f"{INFO}/RECORD"] = recorded(files)
        later(name, files)
        with zipfile.ZipFile(folder / f"jacokin-{jacokin.__version__}-{wheel_tag(head, target)}.whl", "w") as packed:
            for file, contents in files.items():
                packed.writestr(file, contents)
    return folder


def test_wheels_that_differ_in_their_library_pass(tmp_path: Path) -> None:
    assert len(wheels.check(made(tmp_path))) == len(WHEELS) == 4


def test_a_missing_wheel_is_named(tmp_path: Path) -> None:
    (wheel,) = made(tmp_path).glob("*macosx_11_0_arm64.whl")
    wheel.unlink()
    with pytest.raises(WheelError, match="one wheel for aarch64-macos, found 0"):
        wheels.check(tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda files: files.pop(LIBRARY), f"must hold {LIBRARY}"),
        (lambda files: files.update({"jacokin/kernels/libjacokin.dylib": b""}), "and no other library"),
        (lambda files: files.update({LIBRARY: files[LIBRARY][:-2]}), "damaged or of another version"),
        (
            lambda files: files.update({LIBRARY: files[LIBRARY].replace(b"_solve_set\0", b"_solve_sed\0")}),
            "lacks solve_set",
        ),
        (lambda files: files.update({LIBRARY: files[LIBRARY].replace(b"\xb7\0", b"\x3e\0")}), "another processor"),
        (
            lambda files: files.update({LIBRARY: files[LIBRARY].replace(b"GLIBC_2.17", b"GLIBC_2.35")}),
            "should be called",
        ),
        (
            lambda files: files.update({LIBRARY: files[LIBRARY].replace(b"jacokin_fk\0", b"jacokin_fj\0")}),
            "lacks jacokin_fk, which",
        ),
        (
            lambda files: files.update({f"{INFO}/WHEEL": b"Tag: py3-none-any\n"}),
            "says inside that it is for py3-none-any",
        ),
        (lambda files: files.update({"jacokin/a.py": b"b"}), "differ in more than the library"),
    ],
)
def test_what_is_wrong_is_said(change: Callable[[dict[str, bytes]], object], message: str, tmp_path: Path) -> None:
    def in_one(name: str, files: dict[str, bytes]) -> None:
        if name == "aarch64-linux":
            change(files)

    with pytest.raises(WheelError, match=message):
        wheels.check(made(tmp_path, in_one))


def test_a_library_for_a_newer_macos_is_refused(tmp_path: Path) -> None:
    def newer(name: str, files: dict[str, bytes]) -> None:
        if name == "aarch64-macos":
            files[DYLIB] = files[DYLIB].replace(BUILD_VERSION, BUILD_VERSION.replace(b"\x0b\0", b"\x0e\0"))

    with pytest.raises(WheelError, match="is for macOS 14_0, not 11_0"):
        wheels.check(made(tmp_path, newer))


@pytest.mark.parametrize("file", ["jacokin/a.py", "jacokin/unlisted.py"])
def test_a_file_that_is_not_as_recorded_is_refused(file: str, tmp_path: Path) -> None:
    def spoiled(name: str, files: dict[str, bytes]) -> None:
        files[file] = b"c"

    with pytest.raises(WheelError, match="sums in .* are not those of its files"):
        wheels.check(made(tmp_path, later=spoiled))
