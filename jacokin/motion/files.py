"""CSV tables and NPZ archives whose numbers come back to the same bits."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jacokin import files
from jacokin.errors import InvalidInputError
from jacokin.model import checks

NOT_OURS = "not a trajectory written by jacokin"


@dataclass(frozen=True, slots=True)
class Table:
    """A CSV file: lines "# name,value,..." before a head line and rows.

    Attributes:
        notes: values by name.
        head: names of the columns.
        rows: cells; a table that was read has rows as long as its head.
        lines: the line of the file in which each row stands; empty in tables to be written.
    """

    notes: Mapping[str, Sequence[str]]
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    lines: Sequence[int] = ()

    def note_numbers(self, file: Path, name: str) -> NDArray[np.float64]:
        """The numbers of a note.

        Raises:
            InvalidInputError: missing or malformed.
        """
        try:
            return np.array(files.plain_numbers(self.notes[name]))
        except (KeyError, ValueError) as error:
            raise InvalidInputError(f"{file}: the line '# {name}' is missing or malformed") from error


def save(path: str | Path, writers: Mapping[str, Callable[[Path], None]]) -> None:
    """Write a file by the ending of its name; what is there is replaced only by a complete file.

    Raises:
        InvalidInputError: another ending, or the file cannot be written.
    """
    file, ending = by_ending(path, writers)
    try:
        with files.replacing(file) as temporary:
            writers[ending](temporary)
    except OSError as error:
        raise InvalidInputError(f"cannot write {file}: {error.strerror or error}") from error


def by_ending(path: str | Path, endings: Iterable[str]) -> tuple[Path, str]:
    """The file and its ending, the longest one that fits.

    Raises:
        InvalidInputError: not a file name, or another ending.
    """
    file = checks.path("path", path, "a file name")
    for ending in sorted(endings, key=len, reverse=True):
        if str(path).endswith(ending):
            return file, ending
    raise InvalidInputError(f"the file name must end in {' or '.join(endings)}, got {str(path)!r}")


def format_exactly(values: NDArray[np.float64]) -> list[str]:
    """Numbers as text that reads back to the same bits."""
    return [repr(value) for value in values.tolist()]


def write_table(file: Path, table: Table) -> None:
    """Write a CSV file."""
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        for name, values in table.notes.items():
            writer.writerow([f"# {name}", *values])
        writer.writerow(table.head)
        writer.writerows(table.rows)


def read_table(file: Path) -> Table:
    """Read a CSV file.

    Raises:
        InvalidInputError: unreadable, without rows, or a row that is longer or shorter than the head.
    """
    rows = files.read_rows(file)
    notes = {row[0][2:]: row[1:] for _, row in rows if row[0].startswith("# ")}
    numbered = [(line, row) for line, row in rows if not row[0].startswith("# ")]
    if len(numbered) < 2:
        raise InvalidInputError(f"{file}: {NOT_OURS} (no rows)")
    head = numbered[0][1]
    for line, row in numbered[1:]:
        if len(row) != len(head):
            raise InvalidInputError(f"{file}, line {line}: {len(row)} columns, the head line has {len(head)}")
    return Table(notes, head, [row for _, row in numbered[1:]], [line for line, _ in numbered[1:]])


def write_arrays(file: Path, arrays: Mapping[str, NDArray[np.generic]]) -> None:
    """Write an NPZ file."""
    with file.open("wb") as stream:
        np.savez_compressed(stream, **dict(arrays))  # type: ignore[arg-type]  # its stub takes allow_pickle for an array
