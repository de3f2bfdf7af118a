"""The C files of the library, and the header that tells them about the kernels' work arrays.

``jacokin/include/jacokin_ik.h`` is what C programs see; the files in ``jacokin/kernels/c`` lead from there to the
kernels. They are compiled as they are linked.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from build_kernels.targets import HERE, Target
from jacokin.kernels import branches
from jacokin.kernels.closed_form import arm
from jacokin.kernels.entries import ENTRIES
from jacokin.kernels.solution_set import slices, within

PACKAGE = Path(__file__).parents[1] / "jacokin"
FOLDER, INCLUDE = PACKAGE / "kernels" / "c", PACKAGE / "include"
#: The kernels that the C files call.
KERNELS = ("solve_targets", "solve_set", "find_point", "find_nearest")
#: C99 with what the C library adds to it (POSIX has no say); the roundings of the kernels, which know no fused
#: multiply-add; and no other names than those of the header.
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fvisibility=hidden", "-DJACOKIN_IK_EXPORTS")
#: What C needs to know beside the arrays: columns of the kernels' tables, sizes, tasks.
CONSTANTS = {
    arm: ("ARM_CONSTANTS",),
    branches: ("COLUMNS", "DISTANCE", "WITHIN_LIMITS", "FAMILY"),
    slices: ("AFTER", "BEFORE", "JOINT_3"),
    within: ("ROWS", "PIECES", "FOLD", "CIRCLE", "LOST"),
}
HEADER = "arrays.h"
#: Functions of the C library that are called by their oldest version, on Linux: by `glibc.c`, which others leave out.
WRAPPED = ("hypot", "exp", "log", "pow")


def sources(target: Target = HERE) -> list[Path]:
    """The C files of a target, in order."""
    return sorted(path for path in FOLDER.glob("*.c") if target.system == "linux" or path.name != "glibc.c")


def flags(folder: Path) -> list[str]:
    """What the compiler is told, once `write_header` has filled the folder."""
    return [*FLAGS, f"-I{FOLDER}", f"-I{INCLUDE}", f"-I{folder}"]


def write_header(folder: Path) -> None:
    """Write the header `header` to a folder."""
    (folder / HEADER).write_text(header(), encoding="ascii")


def header() -> str:
    """The work arrays of every kernel as a macro, in the order of its table, and the constants.

    JACOKIN_<KERNEL>(ARRAY, FREE) expands to ARRAY(name, numbers) for an array of so many numbers, and to FREE(name,
    numbers) for one of any length, with so many numbers in each row; in a table its length follows.
    """
    lines = ["/* Written by build_kernels/c_library.py from the Python of the kernels. */"]
    for entry in ENTRIES:
        lines.append(f"#define JACOKIN_{entry.run.__name__.upper()}(ARRAY, FREE) \\")
        arrays = [f"    {kind}({name}, {numbers})" for kind, name, numbers in _arrays(entry.make_work())]
        lines.append(" \\\n".join(arrays))
    for module, names in CONSTANTS.items():
        lines += [f"#define JACOKIN_{name} {getattr(module, name)!r}" for name in names]
    return "\n".join(lines) + "\n"


def _arrays(work: tuple[object, ...], prefix: str = "") -> Iterator[tuple[str, str, int]]:
    """Kind, name and numbers of each array in nested named tuples."""
    for name, value in zip(work._fields, work, strict=True):  # type: ignore[attr-defined]  # works are named tuples
        if isinstance(value, tuple):
            yield from _arrays(value, f"{prefix}{name}_")
        else:
            assert isinstance(value, np.ndarray)  # what works consist of
            is_free = value.shape[0] == 0
            yield "FREE" if is_free else "ARRAY", f"{prefix}{name}", math.prod(value.shape[is_free:])
