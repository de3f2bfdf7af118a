"""`python -m build_kernels.wheels FOLDER`: is there a wheel for each machine, and do only their libraries differ?"""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path

import jacokin
from build_kernels.linking import wheel_tag
from build_kernels.targets import TARGETS, WHEELS, Target
from jacokin.kernels import library
from jacokin.kernels.entries import ENTRIES
from jacokin.kernels.library import PREFIX

#: How a library for a processor begins: where, and with what. ELF and Mach-O say it differently.
PROCESSORS = {
    "linux": {"x86_64": (18, b"\x3e\0"), "aarch64": (18, b"\xb7\0")},
    "darwin": {"x86_64": (4, b"\7\0\0\1"), "aarch64": (4, b"\x0c\0\0\1")},
}


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
        _check_library(contents.pop(library_in_it), TARGETS[name], found[0].name)
        # The name of the machine, and sums of everything, differ.
        others[name] = {file: text for file, text in contents.items() if not file.endswith(("/WHEEL", "/RECORD"))}
    first, *rest = others.values()
    if any(each != first for each in rest):
        raise WheelError(f"the wheels of {folder} differ in more than the library")
    return wheels


def _ending(target: Target) -> str:
    """How the name of a wheel ends, as a pattern."""
    return f"linux_*{target.name.partition('-')[0]}" if target.system == "linux" else wheel_tag(b"", target)


def _check_library(contents: bytes, target: Target, wheel: str) -> None:
    about = library.about(contents)
    if about is None or about.size != len(contents) or about.version != jacokin.__version__:
        raise WheelError(f"the library in {wheel} is damaged or of another version")
    for entry in ENTRIES:
        name = entry.run.__name__
        if name not in about.layouts or f"{PREFIX}{name}\0".encode() not in contents:
            raise WheelError(f"the library in {wheel} lacks {name}")
    at, begin = PROCESSORS[target.system][target.name.partition("-")[0]]
    if contents[at : at + len(begin)] != begin:
        raise WheelError(f"the library in {wheel} is for another processor")
    if not wheel.endswith(f"{wheel_tag(contents, target)}.whl"):
        raise WheelError(f"{wheel} should be called {wheel_tag(contents, target)}")


if __name__ == "__main__":
    try:
        print("\n".join(str(wheel) for wheel in check(Path(sys.argv[1]))))
    except WheelError as error:
        sys.exit(f"build_kernels.wheels: {error}")
