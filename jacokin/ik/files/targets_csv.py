"""Targets from a CSV file, with errors that name file, line and column."""

from __future__ import annotations

import csv
import io
import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

from jacokin.errors import InvalidInputError
from jacokin.ik.files import rows
from jacokin.ik.files.columns import chosen
from jacokin.ik.files.parts import Part
from jacokin.ik.files.target_rows import TargetFile, target_rows

BLOCK = 8192  # lines read at a time
HEADED = 2  # the first line after the header


def read_targets(path: str | Path) -> TargetFile:
    """Read a CSV file of targets.

    Args:
        path: a file with the columns x, y, z [m] and, unless the orientation is free, qw, qx, qy, qz, or roll, pitch,
            yaw [rad], or a rotation matrix r11, r12, ..., r33. Columns named note, comment, name, label, id, index, t
            or time are ignored, as are those that `jacokin ik --output` adds.

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


def target_blocks(path: str | Path, size: int = BLOCK, *, strict: bool = True) -> Iterator[TargetFile]:
    """As `read_targets`, in blocks of at most `size` rows, so that a file of any length fits into memory.

    Unless `strict`, numbers that are not finite and wrong norms are problems of their rows, and not errors.
    """
    if not isinstance(path, str | Path):
        raise InvalidInputError(f"path must be a str or a Path, got {type(path).__name__}")
    path = Path(path)
    empty = True
    try:
        with _opened(path) as file:
            columns = chosen(path, next(csv.reader([file.readline()], strict=True), []))
            for values, lines in rows.blocks(path, file, columns, size, finite=strict):
                if len(values):
                    empty = False
                    block = target_rows(columns.names, values, lines)
                    if strict and block.problems:
                        _refuse(path, block)
                    yield block
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InvalidInputError(f"{path}: is not a text file in UTF-8") from error
    except csv.Error as error:
        raise InvalidInputError(f"{path}: is not a CSV file: {error}") from error
    if empty:
        raise InvalidInputError(f"{path}: has no rows of targets")


def parts(path: Path, size: int) -> list[Part]:
    """Where the rows of each block of `size` lines are; rows may be not finite. Errors as `read_targets`."""
    offsets = _offsets(path, size)
    found = []
    for number, block in enumerate(target_blocks(path, size, strict=False)):
        index = number if offsets is None else (int(block.lines[0]) - HEADED) // size  # blank blocks are left out
        found.append(Part(HEADED + index * size, len(block), None if offsets is None else offsets[index]))
    return found


def blocks_of(path: Path, size: int, consecutive: Sequence[Part]) -> Iterator[TargetFile]:
    """The rows of some consecutive `parts` that can be read alone."""
    with _opened(path) as file:
        columns = chosen(path, next(csv.reader([file.readline()], strict=True), []))
    with path.open("rb") as binary:
        for part in consecutive:
            binary.seek(part.offset or 0)
            text = io.StringIO(b"".join(itertools.islice(binary, size)).decode("utf-8"), newline=None)
            for values, lines in rows.blocks(path, text, columns, size, finite=False, first=part.first):
                yield target_rows(columns.names, values, lines)


def _offsets(path: Path, size: int) -> list[int] | None:
    """Byte offset of every `size`-th line after the header; None where lines cannot be told from bytes."""
    try:
        with path.open("rb") as file:
            header = file.readline()
            at, offsets = len(header), []
            if header.count(b"\r") != header.count(b"\r\n"):
                return None
            while lines := list(itertools.islice(file, size)):
                content = b"".join(lines)
                if b'"' in content or content.count(b"\r") != content.count(b"\r\n"):
                    return None
                offsets.append(at)
                at += len(content)
    except (OSError, ValueError):
        return None  # `target_blocks` says what is wrong
    return offsets


def _opened(path: Path) -> TextIO:
    try:
        return path.open(encoding="utf-8-sig")
    except ValueError as error:  # a null byte
        raise InvalidInputError(f"{str(path)!r}: cannot be read: {error}") from error


def _refuse(path: Path, block: TargetFile) -> None:
    """Refuse the first row that is not a target.

    Raises:
        InvalidInputError: names the line and the columns.
    """
    row = min(block.problems)
    raise InvalidInputError(
        f"{path}, line {block.lines[row]}, columns {', '.join(block.columns[3:])}: {block.problems[row]}"
    )
