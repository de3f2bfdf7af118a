"""Targets from a CSV file, with errors that name file, line and column."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.files import rows
from jacokin.ik.files.columns import QUATERNION, RPY, Columns, chosen
from jacokin.ik.files.orientations import rotations_from_quats, rotations_from_rpys

BLOCK = 8192  # lines read at a time


@dataclass(frozen=True, slots=True, eq=False)
class TargetFile:
    """Targets as a CSV file gives them."""

    columns: tuple[str, ...]
    """x, y, z [m], followed by qw, qx, qy, qz, by roll, pitch, yaw [rad], or by nothing where orientations are free."""
    values: Array
    """(n, len(columns)) as written."""
    targets: Array
    """(n, 4, 4) poses, or (n, 3) positions where orientations are free."""
    lines: NDArray[np.int_]
    """(n,) line of each row in the file, the first line is 1."""

    def __len__(self) -> int:
        """Number of targets."""
        return len(self.values)


def read_targets(path: str | Path) -> TargetFile:
    """Read a CSV file of targets.

    Args:
        path: a file with the columns x, y, z [m] and, unless the orientation is free, either qw, qx, qy, qz or
            roll, pitch, yaw [rad]. Columns named note, comment, name, label, id, index, t or time are ignored, as are
            those that `jacokin ik --output` adds.

    Raises:
        InvalidInputError: no such file, an unknown, missing or repeated column, a row that is longer than the header, a
            bad number, a quaternion whose norm is not 1, or no rows; names line and column.
    """
    parts = list(target_blocks(path))
    return TargetFile(
        parts[0].columns,
        np.concatenate([part.values for part in parts]),
        np.concatenate([part.targets for part in parts]),
        np.concatenate([part.lines for part in parts]),
    )


def target_blocks(path: str | Path, size: int = BLOCK) -> Iterator[TargetFile]:
    """As `read_targets`, in blocks of at most `size` rows, so that a file of any length fits into memory."""
    if not isinstance(path, str | Path):
        raise InvalidInputError(f"path must be a str or a Path, got {type(path).__name__}")
    path = Path(path)
    empty = True
    try:
        with _opened(path) as file:
            columns = chosen(path, next(csv.reader([file.readline()], strict=True), []))
            for values, lines in rows.blocks(path, file, columns, size):
                if len(values):
                    empty = False
                    yield TargetFile(columns.names, values, _targets(path, columns, values, lines), lines)
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InvalidInputError(f"{path}: is not a text file in UTF-8") from error
    except csv.Error as error:
        raise InvalidInputError(f"{path}: is not a CSV file: {error}") from error
    if empty:
        raise InvalidInputError(f"{path}: has no rows of targets")


def _opened(path: Path) -> TextIO:
    try:
        return path.open(encoding="utf-8-sig")
    except ValueError as error:  # a null byte
        raise InvalidInputError(f"{str(path)!r}: cannot be read: {error}") from error


def _targets(path: Path, columns: Columns, values: Array, lines: NDArray[np.int_]) -> Array:
    """Poses (n, 4, 4), or positions (n, 3).

    Raises:
        InvalidInputError: a quaternion whose norm is not 1.
    """
    orientation = columns.names[3:]
    if not orientation:
        return values
    matrices = np.zeros((len(values), 4, 4))
    matrices[:, 3, 3] = 1.0
    matrices[:, :3, 3] = values[:, :3]
    if orientation == RPY:
        matrices[:, :3, :3] = rotations_from_rpys(values[:, 3:])
        return matrices
    rotations, wrong = rotations_from_quats(values[:, 3:])
    if len(wrong):
        line = f"{path}, line {lines[wrong[0]]}, columns {', '.join(QUATERNION)}"
        norm = np.linalg.norm(values[wrong[0], 3:])
        raise InvalidInputError(f"{line}: quat_wxyz must have norm 1 (within 1 %), got norm {norm:.6g}")
    matrices[:, :3, :3] = rotations
    return matrices
