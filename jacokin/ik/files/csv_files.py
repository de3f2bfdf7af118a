"""CSV files: `read_targets`, with errors that name file, line and column, and answers."""

from __future__ import annotations

import io
import itertools
import math
import re
import shutil
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import orjson
from numpy.typing import NDArray

from jacokin import files
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.files.targets import ANSWERS, FilePart, TargetColumns, TargetFile, as_texts, choose_columns, target_rows
from jacokin.ik.results import BatchResult
from jacokin.model import checks

FIRST_LINE = 2  # after the header
# What lines of numbers are made of, and where JSON would lose the sign of a zero.
_IN_NUMBERS, _MINUS_ZEROS = b"0123456789+-.eE,\r\n", (b"-0,", b"-0\r", b"-0\n")
_ENDING = re.compile(r'[,"\r\n]')

CsvRows = tuple[Array, NDArray[np.int_], dict[str, list[str]]]


def read_targets(path: str | Path) -> TargetFile:
    """Read a CSV file of targets.

    Args:
        path: a file with the columns x, y, z [m] and, unless the orientation is free, qw, qx, qy, qz, or roll, pitch,
            yaw [rad], or a rotation matrix r11, r12, ..., r33. Columns with other names are `carried`; those that
            `jacokin ik --output` adds are ignored.

    Raises:
        InvalidInputError: no such file, a missing or repeated column, orientations under other names, a row that is
            longer than the header, a bad number, a quaternion whose norm is not 1, or no rows; names line and column.
    """
    blocks = list(read_blocks(checks.path("path", path), 8192, strict=True))  # lines read at a time
    return TargetFile(
        blocks[0].columns,
        np.concatenate([block.values for block in blocks]),
        np.concatenate([block.targets for block in blocks]),
        np.concatenate([block.lines for block in blocks]),
        carried={
            name: [text for block in blocks for text in as_texts(block.carried[name])] for name in blocks[0].carried
        },
    )


def read_blocks(path: Path, size: int, *, strict: bool) -> Iterator[TargetFile]:
    """The targets of a CSV file in blocks of at most `size` rows: a file of any length fits into memory.

    Unless `strict`, numbers that are not finite and wrong norms are problems of their rows, and not errors; all others
    are those of `read_targets`.
    """
    empty = True
    with files.open_table(path, largest=None) as file:
        text = files.table_lines(path, file)
        columns = choose_columns(path, _names(path, text))
        for values, lines, texts in _rows(path, text, columns, size, finite=strict):
            if len(values):
                empty = False
                block = target_rows(columns.names, values, lines, texts)
                if strict and block.problems:
                    row = min(block.problems)
                    place = f"{path}, line {lines[row]}, columns {', '.join(block.columns[3:])}"
                    raise InvalidInputError(f"{place}: {block.problems[row]}")
                yield block
    if empty:
        raise InvalidInputError(f"{path}: has no rows of targets")


def blocks(path: Path, size: int, consecutive: Sequence[FilePart] | None = None) -> Iterator[TargetFile]:
    """The targets, `size` lines at a time; of some consecutive `parts` that can be read alone, or all.

    Rows that are not finite are problems of their own. Errors as `read_targets`.
    """
    if consecutive is None:
        yield from read_blocks(path, size, strict=False)
        return
    columns = choose_columns(path, read_names(path))
    with files.open_bytes(path) as binary:
        for part in consecutive:
            binary.seek(part.offset or 0)
            text = iter(io.StringIO(b"".join(itertools.islice(binary, size)).decode("utf-8"), newline=""))
            for values, lines, texts in _rows(path, text, columns, size, finite=False, first=part.first):
                yield target_rows(columns.names, values, lines, texts)


def parts(path: Path, size: int) -> list[FilePart]:
    """Where the rows of each block of `size` lines are; rows may be not finite. Errors as `read_targets`."""
    read = [(int(block.lines[0]), len(block)) for block in blocks(path, size)]  # which also bounds the lines
    offsets = _offsets(path, size)
    found = []
    for number, (line, rows) in enumerate(read):
        index = number if offsets is None else (line - FIRST_LINE) // size  # blank blocks are left out
        found.append(FilePart(FIRST_LINE + index * size, rows, None if offsets is None else offsets[index]))
    return found


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
        return None  # `read_blocks` says what is wrong
    return offsets


def read_names(path: Path) -> list[str]:
    """The names of a file's columns. Errors as `read_targets`, of the first line."""
    with files.open_table(path, largest=None) as file:
        return _names(path, files.table_lines(path, file))


def _names(path: Path, lines: Iterator[str]) -> list[str]:
    return next((names for _, names in files.table_rows(path, [next(lines, "")])), [])


def _rows(
    path: Path, text: Iterator[str], columns: TargetColumns, size: int, *, finite: bool, first: int = FIRST_LINE
) -> Iterator[CsvRows]:
    """Values (n, columns), line numbers (n,) and texts of the rows from line `first` on, at most `size` lines at once.

    NaN and infinities are refused if `finite` is wanted.

    Raises:
        InvalidInputError: a number or a row is malformed; names line and column.
    """
    while lines := list(itertools.islice(text, size)):
        together = "".join(lines)
        if '"' in together:  # a quoted cell may hold commas and line ends
            rest = _filled(path, itertools.chain(lines, text), first)
            while rows := list(itertools.islice(rest, size)):
                yield _checked(path, rows, columns, finite)
            return
        values = _only_numbers(together, len(lines), columns)
        if values is None:
            values = _plain(lines, columns, finite)
        if values is None:
            yield _checked(path, list(_filled(path, lines, first)), columns, finite)
        else:
            cells = [line.rstrip("\r\n").split(",") for line in lines] if columns.carried else []
            yield values, np.arange(first, first + len(lines)), _texts(cells, columns)
        first += len(lines)


def _filled(path: Path, lines: Iterable[str], first: int) -> Iterator[tuple[int, list[str]]]:
    """Rows with the number of the line each ends on, blank ones left out."""
    return ((line, row) for line, row in files.table_rows(path, lines, first) if any(cell.strip() for cell in row))


def _only_numbers(text: str, rows: int, columns: TargetColumns) -> Array | None:
    """The values of lines that hold finite numbers and nothing else; None where a closer look is needed.

    Such lines become JSON, which is read in a third of the time, to the same bits.
    """
    content = text.encode()
    if content.translate(None, _IN_NUMBERS):
        return None
    try:
        table = orjson.loads(b"[[" + content.removesuffix(b"\n").replace(b"\n", b"],[") + b"]]")
        values = np.array(table, dtype=np.float64)
    except ValueError:  # written otherwise than JSON has it; rows of different lengths
        return None
    if values.shape != (rows, columns.count):
        return None
    if not values.all() and any(zero in content + b"\n" for zero in _MINUS_ZEROS):
        return None
    return values[:, columns.places]


def _plain(lines: Sequence[str], columns: TargetColumns, finite: bool) -> Array | None:
    """The values if every row has a number wherever one is needed; None where a closer look is needed."""
    commas = columns.count - 1
    if any(line.count(",") != commas for line in lines):
        return None
    try:
        values = np.loadtxt(lines, delimiter=",", usecols=columns.places, comments=None, ndmin=2)
    except ValueError:
        return None
    # Blank lines are skipped there.
    return values if len(values) == len(lines) and (not finite or np.isfinite(values).all()) else None


def _checked(path: Path, rows: Sequence[tuple[int, list[str]]], columns: TargetColumns, finite: bool) -> CsvRows:
    """The values and texts of rows, one by one.

    Raises:
        InvalidInputError: a number or a row is malformed.
    """
    values = np.empty((len(rows), len(columns.places)))
    for index, (line, row) in enumerate(rows):
        if len(row) > columns.count:
            raise InvalidInputError(
                f"{path}, line {line}: has {len(row)} cells, the header has {columns.count} "
                f"(decimals need a point, texts with commas quotation marks)"
            )
        for place, name, at in zip(range(values.shape[1]), columns.names, columns.places, strict=True):
            values[index, place] = _number(path, line, name, row[at].strip() if at < len(row) else "", finite)
    return values, np.array([line for line, _ in rows], dtype=np.int_), _texts([row for _, row in rows], columns)


def _texts(rows: Sequence[Sequence[str]], columns: TargetColumns) -> dict[str, list[str]]:
    """The texts of the columns that are carried through; a row may be shorter than the header."""
    return {name: [row[at] if at < len(row) else "" for row in rows] for name, at in columns.carried.items()}


def _number(path: Path, line: int, column: str, text: str, finite: bool) -> float:
    if not finite and files.NOT_FINITE_TEXT.fullmatch(text):
        return float(text)
    value = float(text) if files.NUMBER_TEXT.fullmatch(text) else math.nan
    if not math.isfinite(value):
        problem = f"{text!r} is not a finite number" if text else "is empty"
        raise InvalidInputError(f"{path}, line {line}, column {column}: {problem}")
    return value


def encode(targets: TargetFile, batch: BatchResult) -> bytes:
    """One row for each target, numbers with the digits that read back to the same bits (17 at most)."""
    configurations = _lines(np.hstack([targets.values, batch.q]))
    errors = _lines(np.stack([batch.position_error, batch.orientation_error], axis=1))
    cells = {text: _cell(text) for text in {*batch.method, *batch.message}}
    others = [list(map(_cell, as_texts(column))) for column in targets.carried.values()]
    ends = ["," + ",".join(row) for row in zip(*others, strict=True)] if others else [""] * len(targets)
    rows = zip(configurations, batch.status, errors, batch.method, batch.message, ends, strict=True)
    return "".join(
        f"{numbers},{status.name},{measured},{cells[method]},{cells[message]}{end}\n"
        for numbers, status, measured, method, message, end in rows
    ).encode()


def write_joined(
    path: Path, pieces: Iterable[tuple[Path, int]], columns: Sequence[str], carried: Sequence[str] = ()
) -> None:
    """The header, and all rows."""
    with path.open("wb") as out:
        out.write((",".join([*columns, *ANSWERS, *map(_cell, carried)]) + "\n").encode())
        for piece, offset in pieces:
            with piece.open("rb") as file:
                file.seek(offset)
                shutil.copyfileobj(file, out)


def _lines(values: Array) -> list[str]:
    """Each row of (n, k) numbers as text, with commas between them."""
    if not np.isfinite(values).all():  # JSON has no infinity
        return [",".join(map(repr, row)) for row in values.tolist()]
    text = orjson.dumps(np.ascontiguousarray(values), option=orjson.OPT_SERIALIZE_NUMPY)
    return text[2:-2].decode("ascii").split("],[")


def _cell(text: str) -> str:
    """A text as a cell, quoted where it would end one."""
    return '"' + text.replace('"', '""') + '"' if _ENDING.search(text) else text
