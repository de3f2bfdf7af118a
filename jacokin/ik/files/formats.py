"""The formats of files of targets and answers, told by the ending of the name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Protocol

from jacokin.errors import InvalidInputError
from jacokin.ik.files import csv_files, npz_files, parquet_files
from jacokin.ik.files.targets import Part, TargetFile, equal_parts
from jacokin.ik.results import BatchResult

OUTPUTS = (".csv", ".npz", ".parquet")
_AS_CSV = ("", ".csv", ".txt")

Piece = tuple[Path, int]


class AnswerFormat(Protocol):
    """How answers are written: piece by piece, and then together."""

    def encoded(self, targets: TargetFile, batch: BatchResult) -> bytes:
        """The answers to some targets, for `write_joined`."""

    def write_joined(self, path: Path, pieces: Iterable[Piece], columns: Sequence[str]) -> None:
        """Write the file of answers: all pieces in their order.

        Args:
            path: the file.
            pieces: files with what `encoded` returned, and how many bytes of each come before it; may be a generator
                that waits for them.
            columns: names of the columns of the targets and q1, q2, ...
        """


def blocks(path: Path, size: int) -> Iterator[TargetFile]:
    """The targets of a file, `size` at a time or less; rows that are not finite are problems of their own.

    Raises:
        InvalidInputError: the file cannot be read, or lacks columns; of a CSV file also rows that are not numbers.
        MissingExtraError: the format needs a package that is not installed.
    """
    if path.suffix == ".npz":
        return npz_files.blocks(path, size)
    if path.suffix == ".parquet":
        return parquet_files.blocks(path, size)
    return csv_files.target_blocks(path, size, strict=False)


def parts(path: Path, size: int) -> list[Part]:
    """Where the rows of each of `blocks` are. Errors as there, all of them: a CSV file is read to its end."""
    if path.suffix == ".npz":
        total, alone = npz_files.count_rows(path)
        return equal_parts(total, size, alone=alone)
    if path.suffix == ".parquet":
        return equal_parts(parquet_files.count_rows(path), size)
    return csv_files.parts(path, size)


def blocks_of(path: Path, size: int, consecutive: Sequence[Part]) -> Iterator[TargetFile]:
    """The rows of some consecutive `parts` that were made with the same size, one block for each; errors as `blocks`.

    What comes before them is not read, or little of it.
    """
    if path.suffix == ".npz":
        return npz_files.blocks(path, size, consecutive)
    if path.suffix == ".parquet":
        return parquet_files.blocks(path, size, consecutive)
    return csv_files.blocks_of(path, size, consecutive)


def answers(path: Path) -> AnswerFormat:
    """The format of a file of answers.

    Raises:
        InvalidInputError: no format has this ending.
        MissingExtraError: the format needs a package that is not installed.
    """
    if path.suffix in _AS_CSV:
        return csv_files.CSV
    if path.suffix == ".npz":
        return npz_files.NPZ
    if path.suffix == ".parquet":
        return parquet_files.prepared()
    raise InvalidInputError(f"{path}: answers are written as {', '.join(OUTPUTS)}, told by the ending of the name")
