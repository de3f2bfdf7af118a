"""The formats of files of targets and of answers, told by the ending of the name."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Protocol

from jacokin import files
from jacokin.errors import InvalidInputError, MissingExtraError
from jacokin.ik.files import csv_files, npz_files, parquet_files
from jacokin.ik.files.targets import FilePart, TargetFile
from jacokin.ik.results import BatchResult

FilePiece = tuple[Path, int]


class Format(Protocol):
    """What the module of each format does."""

    def blocks(self, path: Path, size: int, consecutive: Sequence[FilePart] | None = None) -> Iterator[TargetFile]:
        """The targets of a file, `size` at a time or less; rows that are not finite are problems of their own.

        With some consecutive `parts` that were made with the same size, these only, one block for each; what comes
        before them is not read, or little of it.

        Raises:
            InvalidInputError: the file cannot be read, or lacks columns; of a CSV file also rows that are not numbers.
            MissingExtraError: the format needs a package that is not installed.
        """

    def parts(self, path: Path, size: int) -> list[FilePart]:
        """Where the rows of each of `blocks` are. Errors as there, all of them: a CSV file is read to its end."""

    def read_names(self, path: Path) -> list[str]:
        """The names of a file's columns. Errors as of `blocks`, of a file that cannot be read."""

    def encode(self, targets: TargetFile, batch: BatchResult) -> bytes:
        """The answers to some targets, for `write_joined`."""

    def write_joined(
        self, path: Path, pieces: Iterable[FilePiece], columns: Sequence[str], carried: Sequence[str] = ()
    ) -> None:
        """Write the file of answers: all pieces in their order.

        Args:
            path: the file.
            pieces: files with what `encode` returned, and how many bytes of each come before it; may be a generator
                that waits for them.
            columns: names of the columns of the targets and q1, q2, ...
            carried: names of the columns that are carried through.
        """


FORMATS: dict[str, Format] = {".csv": csv_files, ".npz": npz_files, ".parquet": parquet_files}
#: Of targets alone.
TARGETS: dict[str, Format] = {".npy": npz_files, **FORMATS}


def targets_format(path: Path) -> Format:
    """The format of a file of targets: CSV, unless its ending says otherwise."""
    return TARGETS.get(path.suffix, csv_files)


def answers_format(path: Path, carried: Iterable[str] = ()) -> Format:
    """The format of a file of answers, with the names of the columns that are carried through; CSV to /dev/stdout.

    Raises:
        InvalidInputError: no format has this ending, or this one has columns of its own with these names.
        MissingExtraError: the format needs a package that is not installed.
    """
    suffix = ".csv" if not path.suffix and files.is_device(path) else path.suffix  # a pipe's name says nothing
    if suffix not in FORMATS:
        raise InvalidInputError(f"{path}: answers are written as {', '.join(FORMATS)}, told by the ending of the name")
    if suffix == ".parquet" and importlib.util.find_spec("pyarrow") is None:
        raise MissingExtraError("pyarrow", "parquet")
    taken = [name for name in carried if name in npz_files.RESERVED]
    if suffix == ".npz" and taken:
        raise InvalidInputError(
            f"{path}: an NPZ has arrays of its own with the names {', '.join(npz_files.RESERVED)}: column "
            f"{', '.join(taken)} cannot be carried through; rename it, or write .csv or .parquet"
        )
    return FORMATS[suffix]
