"""The rows of a CSV file as numbers, block by block: fast where they are plain, exact about what is wrong."""

from __future__ import annotations

import csv
import itertools
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.files.columns import Columns

# Python's float also takes 1_0 and digits of other scripts, which in a file are mistakes.
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?(nan|inf|infinity)", re.IGNORECASE)

Block = tuple[Array, NDArray[np.int_]]


def blocks(path: Path, file: TextIO, columns: Columns, size: int, *, finite: bool, first: int = 2) -> Iterator[Block]:
    """Values (n, columns) and line numbers (n,) of the rows from line `first` on, at most `size` lines at a time.

    NaN and infinities are refused if `finite` is wanted.

    Raises:
        InvalidInputError: a number or a row is malformed; names line and column.
    """
    while lines := list(itertools.islice(file, size)):
        if any('"' in line for line in lines):  # a quoted cell may hold commas and line ends
            rest = _numbered(itertools.chain(lines, file), first)
            while rows := list(itertools.islice(rest, size)):
                yield _checked(path, rows, columns, finite)
            return
        values = _plain(lines, columns, finite)
        if values is None:
            yield _checked(path, list(_numbered(lines, first)), columns, finite)
        else:
            yield values, np.arange(first, first + len(lines))
        first += len(lines)


def _numbered(lines: Iterable[str], first: int) -> Iterator[tuple[int, list[str]]]:
    """Rows with the number of the line each ends on, blank ones left out."""
    reader = csv.reader(lines, strict=True)
    for row in reader:
        if any(cell.strip() for cell in row):
            yield first + reader.line_num - 1, row


def _plain(lines: Sequence[str], columns: Columns, finite: bool) -> Array | None:
    """The values if every row has a number wherever one is needed; None where a closer look is needed."""
    commas = len(columns.header) - 1
    if any(line.count(",") != commas for line in lines):
        return None
    try:
        values = np.loadtxt(lines, delimiter=",", usecols=columns.places, comments=None, ndmin=2)
    except ValueError:
        return None
    # Blank lines are skipped there.
    return values if len(values) == len(lines) and (not finite or np.isfinite(values).all()) else None


def _checked(path: Path, rows: Sequence[tuple[int, list[str]]], columns: Columns, finite: bool) -> Block:
    """The values of rows, one by one.

    Raises:
        InvalidInputError: a number or a row is malformed.
    """
    values = np.empty((len(rows), len(columns.places)))
    for index, (line, row) in enumerate(rows):
        if len(row) > len(columns.header):
            raise InvalidInputError(
                f"{path}, line {line}: has {len(row)} cells, the header has {len(columns.header)} "
                f"(decimals need a point, texts with commas quotation marks)"
            )
        for place, name, at in zip(range(values.shape[1]), columns.names, columns.places, strict=True):
            values[index, place] = _number(path, line, name, row[at].strip() if at < len(row) else "", finite)
    return values, np.array([line for line, _ in rows], dtype=np.int_)


def _number(path: Path, line: int, column: str, text: str, finite: bool) -> float:
    if not finite and _NOT_FINITE.fullmatch(text):
        return float(text)
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(value):
        problem = f"{text!r} is not a finite number" if text else "is empty"
        raise InvalidInputError(f"{path}, line {line}, column {column}: {problem}")
    return value
