"""Which columns of a file of targets are read, and which headers are refused."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from jacokin.errors import InvalidInputError

POSITION = ("x", "y", "z")
QUATERNION = ("qw", "qx", "qy", "qz")
RPY = ("roll", "pitch", "yaw")
MATRIX = ("r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33")

# Columns that hold no target: remarks, times, what `jacokin ik --output` adds. A column without a name, such as the
# index that pandas writes, is ignored too.
REMARKS = ("note", "comment", "name", "label", "id", "index", "t", "time")
ANSWERS = ("status", "position_error", "orientation_error", "method", "message")
_JOINT = re.compile(r"q[1-9][0-9]*", re.ASCII)


@dataclass(frozen=True, slots=True)
class Columns:
    """The columns of a file that make a target.

    Attributes:
        names: x, y, z, followed by qw, qx, qy, qz, by roll, pitch, yaw, by r11, r12, ..., r33, or by nothing where
            orientations are free.
        places: index of each of them in a row of the file.
        header: every column of the file, as written.
    """

    names: tuple[str, ...]
    places: tuple[int, ...]
    header: tuple[str, ...]


def chosen(path: Path, header: Sequence[str], place: str = ", line 1") -> Columns:
    """The columns to read; `place` is where in the file they are named.

    Raises:
        InvalidInputError: a column is missing, unknown or repeated, or orientations are given twice.
    """
    names = tuple(name.strip() for name in header)
    place = f"{path}{place}"
    repeated = [name for name, count in Counter(names).items() if name and count > 1]
    if repeated:
        raise InvalidInputError(f"{place}: column {', '.join(repeated)} is repeated")
    oriented = [group for group in (QUATERNION, RPY, MATRIX) if any(name in names for name in group)]
    if len(oriented) > 1:
        raise InvalidInputError(
            f"{place}: orientations are given twice, as {' and as '.join(_words(group) for group in oriented)}"
        )
    wanted = POSITION + (oriented[0] if oriented else ())
    missing = [name for name in wanted if name not in names]
    if missing:
        found = ", ".join(names) or "nothing"
        raise InvalidInputError(
            f"{place}: column {', '.join(missing)} is missing; needed: {', '.join(wanted)}; found: {found}"
        )
    unknown = [name for name in names if not (name in wanted or _ignored(name))]
    if unknown:
        raise InvalidInputError(
            f"{place}: unknown column {', '.join(unknown)}; orientations are {', '.join(QUATERNION)}, or "
            f"{', '.join(RPY)}, or {', '.join(MATRIX)}, remarks {', '.join(REMARKS)}"
        )
    return Columns(wanted, tuple(names.index(name) for name in wanted), names)


def _words(group: tuple[str, ...]) -> str:
    return {QUATERNION: "quaternions", RPY: "roll, pitch, yaw", MATRIX: "matrices"}[group]


def _ignored(name: str) -> bool:
    return not name or name in REMARKS or name in ANSWERS or _JOINT.fullmatch(name) is not None
