"""Targets from a CSV file, with errors that name file, line and column."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import numpy as np
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    import pinocchio as pin

POSITION = ("x", "y", "z")
QUATERNION = ("qw", "qx", "qy", "qz")


@dataclass(frozen=True, slots=True, eq=False)
class TargetFile:
    """The rows of a CSV file of targets; other columns are ignored."""

    columns: tuple[str, ...]
    """Columns used: x, y, z [m] and, unless the orientation is free, qw, qx, qy, qz."""
    values: NDArray[np.float64]
    """(n, len(columns)) as written."""
    targets: list[pin.SE3] | NDArray[np.float64]
    """n poses, or (n, 3) positions when there are no quaternion columns."""
    lines: tuple[int, ...]
    """(n,) line of each row in the file, the first line is 1."""

    def __len__(self) -> int:
        """Number of targets."""
        return len(self.values)


def read_targets(path: Path) -> TargetFile:
    """Read targets: columns x, y, z [m], and qw, qx, qy, qz or none of them for free orientation.

    Raises:
        InvalidInputError: no such file, a missing column, a bad number, a quaternion that is not one, or no rows.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            return _parse(path, file)
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InvalidInputError(f"{path}: is not a text file in UTF-8") from error
    except csv.Error as error:
        raise InvalidInputError(f"{path}: is not a CSV file: {error}") from error


def _parse(path: Path, file: TextIO) -> TargetFile:
    reader = csv.reader(file)
    header = [name.strip() for name in next(reader, [])]
    columns = _columns(path, header)
    places = [header.index(name) for name in columns]
    values: list[list[float]] = []
    targets: list[pin.SE3] = []
    lines: list[int] = []
    for row in reader:
        if not any(cell.strip() for cell in row):
            continue
        numbers = [_number(path, reader.line_num, header[place], row, place) for place in places]
        if len(columns) > len(POSITION):
            targets.append(_pose(path, reader.line_num, numbers))
        values.append(numbers)
        lines.append(reader.line_num)
    if not values:
        raise InvalidInputError(f"{path}: has no rows of targets")
    array = np.array(values)
    return TargetFile(columns, array, targets or array, tuple(lines))


def _columns(path: Path, header: list[str]) -> tuple[str, ...]:
    """The columns to read."""
    with_orientation = any(name in header for name in QUATERNION)
    columns = POSITION + QUATERNION if with_orientation else POSITION
    missing = [name for name in columns if name not in header]
    if missing:
        found = ", ".join(header) or "nothing"
        raise InvalidInputError(
            f"{path}, line 1: column {', '.join(missing)} is missing; needed: {', '.join(columns)}; found: {found}"
        )
    return columns


def _number(path: Path, line: int, column: str, row: list[str], place: int) -> float:
    text = row[place].strip() if place < len(row) else ""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        problem = f"{text!r} is not a finite number" if text else "is empty"
        raise InvalidInputError(f"{path}, line {line}, column {column}: {problem}")
    return value


def _pose(path: Path, line: int, numbers: list[float]) -> pin.SE3:
    from jacokin.model.poses import pose

    try:
        return pose(numbers[:3], numbers[3:])
    except InvalidInputError as error:
        raise InvalidInputError(f"{path}, line {line}, columns {', '.join(QUATERNION)}: {error}") from error
