"""Wheels for several machines are refused where they are not what their names say."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

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


def made(folder: Path, change: Change = lambda name, files: None) -> Path:
    """A wheel for each machine, with libraries that have no code."""
    for name in WHEELS:
        target = TARGETS[name]
        at, begin = wheels.PROCESSORS[target.system][name.partition("-")[0]]
        names = [entry.run.__name__ for entry in ENTRIES]
        symbols = b"".join(f"{PREFIX}{each}\0".encode() for each in names) + b"GLIBC_2.17\0" * (
            target.system == "linux"
        )
        about = About(jacokin.__version__, "0", 0, {each: (ArrayLayout("float64", (3,)),) for each in names})
        head = b"\0" * at + begin + symbols
        text = about._replace(size=len(head) + len(about.text()) + 1).text().encode()
        files = {
            f"jacokin/kernels/{target.library}": head + text + b"\0",
            "jacokin/a.py": b"a",
            "x/WHEEL": name.encode(),
        }
        change(name, files)
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
        (lambda files: files.update({"jacokin/a.py": b"b"}), "differ in more than the library"),
    ],
)
def test_what_is_wrong_is_said(change: Callable[[dict[str, bytes]], object], message: str, tmp_path: Path) -> None:
    def in_one(name: str, files: dict[str, bytes]) -> None:
        if name == "aarch64-linux":
            change(files)

    with pytest.raises(WheelError, match=message):
        wheels.check(made(tmp_path, in_one))
