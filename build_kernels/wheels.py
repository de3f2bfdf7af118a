"""`python -m build_kernels.wheels FOLDER`: is there a wheel for each machine, and do only their libraries differ?"""

from __future__ import annotations

import base64
import csv
import hashlib
import re
import struct
import sys
import zipfile
from pathlib import Path

import jacokin
from build_kernels.linking import OLDEST_MACOS, wheel_tag
from build_kernels.targets import TARGETS, WHEELS, Target
from jacokin.kernels import library
from jacokin.kernels.entries import ENTRIES
from jacokin.kernels.library import PREFIX

#: How a library for a processor begins: where, and with what. ELF and Mach-O say it differently.
PROCESSORS = {
    "linux": {"x86_64": (18, b"\x3e\0"), "aarch64": (18, b"\xb7\0")},
    "darwin": {"x86_64": (4, b"\7\0\0\1"), "aarch64": (4, b"\x0c\0\0\1")},
}
#: Functions of the C library, in its header.
C_FUNCTION = re.compile(r"^JACOKIN_IK_API .*?(\w+)\(", re.M)
HEADER = "jacokin/include/jacokin_ik.h"
#: The command of a Mach-O file that says its oldest macOS, <mach-o/loader.h>; commands begin after the header.
LC_BUILD_VERSION, MACH_O_HEADER = 0x32, 32


class WheelError(Exception):
    """A wheel is not what its name says; says what is wrong."""


def check(folder: Path) -> list[Path]:
    """Check the wheels of a folder, one for each machine, and return them.

    Raises:
        WheelError: says what is wrong.
    """
    wheels, others = [], {}
    for name in WHEELS:
        found = sorted(folder.glob(f"jacokin-{jacokin.__version__}-*{_ending(TARGETS[name])}.whl"))
        if len(found) != 1:
            raise WheelError(f"{folder} must hold one wheel for {name}, found {len(found)}")
        wheels += found
        with zipfile.ZipFile(found[0]) as packed:
            contents = {file: packed.read(file) for file in packed.namelist()}
        library_in_it = f"jacokin/kernels/{TARGETS[name].library}"
        if [file for file in contents if "libjacokin." in file] != [library_in_it]:
            raise WheelError(f"{found[0].name} must hold {library_in_it} and no other library")
        _check_metadata(contents, found[0])
        functions = C_FUNCTION.findall(contents[HEADER].decode())
        _check_library(contents.pop(library_in_it), TARGETS[name], found[0].name, functions)
        # The name of the machine, and sums of everything, differ.
        others[name] = {file: text for file, text in contents.items() if not file.endswith(("/WHEEL", "/RECORD"))}
    first, *rest = others.values()
    if any(each != first for each in rest):
        raise WheelError(f"the wheels of {folder} differ in more than the library")
    return wheels


def _ending(target: Target) -> str:
    """How the name of a wheel ends, as a pattern."""
    return f"linux_*{target.name.partition('-')[0]}" if target.system == "linux" else wheel_tag(b"", target)


def _check_metadata(contents: dict[str, bytes], wheel: Path) -> None:
    """The tag inside is that of the name, and sums are those of the files, all of which are listed."""
    (folder,) = {name.partition("/")[0] for name in contents if name.endswith(".dist-info/WHEEL")}
    tags = re.findall(r"^Tag: (\S+)$", contents[f"{folder}/WHEEL"].decode(), re.M)
    if tags != ["-".join(wheel.stem.split("-")[2:])]:
        raise WheelError(f"{wheel.name} says inside that it is for {', '.join(tags) or 'nothing'}")
    listed = {name: digest for name, digest, _ in csv.reader(contents[f"{folder}/RECORD"].decode().splitlines())}
    sums = {name: f"sha256={_sum(content)}" for name, content in contents.items() if not name.endswith("/RECORD")}
    if listed != {**sums, f"{folder}/RECORD": ""}:
        raise WheelError(f"the sums in {wheel.name} are not those of its files")


def _sum(content: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(content).digest()).decode().rstrip("=")


def _oldest_macos(contents: bytes) -> str | None:
    """What a Mach-O file runs on, as "11_0"; None where it does not say."""
    (count,) = struct.unpack_from("<I", contents, 16)
    at = MACH_O_HEADER
    for _ in range(count):
        command, size, _, oldest = struct.unpack_from("<4I", contents, at)
        if command == LC_BUILD_VERSION:
            return f"{oldest >> 16}_{oldest >> 8 & 0xFF}"
        at += size
    return None


def _check_library(contents: bytes, target: Target, wheel: str, functions: list[str]) -> None:
    about = library.about(contents)
    if about is None or about.size != len(contents) or about.version != jacokin.__version__:
        raise WheelError(f"the library in {wheel} is damaged or of another version")
    for entry in ENTRIES:
        name = entry.run.__name__
        if name not in about.layouts or f"{PREFIX}{name}\0".encode() not in contents:
            raise WheelError(f"the library in {wheel} lacks {name}")
    for name in functions:
        if f"{name}\0".encode() not in contents:
            raise WheelError(f"the library in {wheel} lacks {name}, which {HEADER} declares")
    at, begin = PROCESSORS[target.system][target.name.partition("-")[0]]
    if contents[at : at + len(begin)] != begin:
        raise WheelError(f"the library in {wheel} is for another processor")
    if target.system == "darwin" and _oldest_macos(contents) != OLDEST_MACOS:
        raise WheelError(f"the library in {wheel} is for macOS {_oldest_macos(contents)}, not {OLDEST_MACOS}")
    if not wheel.endswith(f"{wheel_tag(contents, target)}.whl"):
        raise WheelError(f"{wheel} should be called {wheel_tag(contents, target)}")


if __name__ == "__main__":
    try:
        print("\n".join(str(wheel) for wheel in check(Path(sys.argv[1]))))
    except WheelError as error:
        sys.exit(f"build_kernels.wheels: {error}")
