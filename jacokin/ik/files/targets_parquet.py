"""Targets from a Parquet file, read batch by batch."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, MissingExtraError
from jacokin.ik.files.columns import chosen
from jacokin.ik.files.target_rows import TargetFile, target_rows

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq


def count_rows(path: Path) -> int:
    """How many targets there are. Errors as `blocks`."""
    with _reading(path) as (file, _):
        return int(file.metadata.num_rows)


def blocks(path: Path, size: int) -> Iterator[TargetFile]:
    """The targets, `size` at a time, whatever the row groups of the file are.

    Raises:
        MissingExtraError: pyarrow is not installed.
        InvalidInputError: no such file, not a Parquet file, missing columns (lists those that there are), columns that
            are not numbers, or no rows.
    """
    with _reading(path) as (file, columns):
        first, waiting, held = 1, list[Array](), 0
        for batch in file.iter_batches(batch_size=size, columns=list(columns)):
            waiting.append(np.column_stack([_numbers(path, name, batch.column(name)) for name in columns]))
            held += len(waiting[-1])
            while held >= size:
                values = np.concatenate(waiting)
                waiting, held = [values[size:]], held - size
                yield target_rows(columns, values[:size], np.arange(first, first + size))
                first += size
        if held:
            yield target_rows(columns, np.concatenate(waiting), np.arange(first, first + held))


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[tuple[pq.ParquetFile, tuple[str, ...]]]:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise MissingExtraError("pyarrow", "parquet") from error
    try:
        # Without buffering ahead: that would hold a row group, which may be the whole file.
        with pq.ParquetFile(path, pre_buffer=False, buffer_size=1 << 20) as file:
            columns = chosen(path, file.schema_arrow.names, "").names
            if not file.metadata.num_rows:
                raise InvalidInputError(f"{path}: has no rows of targets")
            yield file, columns
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except pa.ArrowException as error:
        raise InvalidInputError(f"{path}: is not a Parquet file that can be read: {error}") from error


def _numbers(path: Path, name: str, column: pa.Array) -> Array:
    """A column as float64, missing values as NaN."""
    import pyarrow as pa

    if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
        raise InvalidInputError(f"{path}, column {name}: must hold numbers, got {column.type}")
    return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)
