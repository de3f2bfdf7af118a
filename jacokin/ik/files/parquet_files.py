"""Parquet files: targets, read batch by batch, and answers with the columns of the CSV file; others keep their type."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jacokin import files
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.files.targets import (
    FilePart,
    TargetColumns,
    TargetFile,
    as_arrow,
    choose_columns,
    equal_parts,
    target_rows,
)
from jacokin.ik.results import BatchResult

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq


TEXTS = ("status", "method", "message")

NOT_PARQUET = "is not a Parquet file that can be read"


def blocks(path: Path, size: int, consecutive: Sequence[FilePart] | None = None) -> Iterator[TargetFile]:
    """The targets, `size` at a time, whatever the row groups of the file are; of some consecutive parts, or all.

    Raises:
        MissingExtraError: pyarrow is not installed.
        InvalidInputError: no such file, not a Parquet file, missing columns (lists those that there are), columns that
            are not numbers, or no rows.
    """
    with _reading(path) as (file, columns):
        import pyarrow as pa  # `_reading` has told if it is missing

        start = consecutive[0].first if consecutive else 0
        left = sum(part.rows for part in consecutive) if consecutive else file.metadata.num_rows
        groups, before = _groups_from(file.metadata, start)
        first, waiting, held = start + 1, list[pa.RecordBatch](), 0
        names = [file.schema_arrow.names[at] for at in (*columns.places, *columns.carried.values())]
        at_once = max(size, 1 << 14)  # rows: small batches cost more than what they hold
        for batch in file.iter_batches(batch_size=at_once, row_groups=groups, columns=names, use_threads=False):
            if before >= len(batch):
                before -= len(batch)
                continue
            rows = batch.slice(before, left)
            before, left = 0, left - len(rows)
            waiting.append(rows)
            held += len(rows)
            while held >= size:
                table = pa.Table.from_batches(waiting)
                waiting, held = table.slice(size).to_batches(), held - size
                yield _rows(path, columns, table.slice(0, size), first, file.schema_arrow.names)
                first += size
            if not left:
                break
        if held:
            yield _rows(path, columns, pa.Table.from_batches(waiting), first, file.schema_arrow.names)


def _rows(path: Path, columns: TargetColumns, table: pa.Table, first: int, names: Sequence[str]) -> TargetFile:
    """The rows of a table, the first of which has this number; `names` are those of all columns of the file."""
    places = zip(columns.names, columns.places, strict=True)
    values = np.column_stack([_numbers(path, name, table.column(names[at])) for name, at in places])
    carried = {name: _whole(table.column(names[at])) for name, at in columns.carried.items()}
    return target_rows(columns.names, values, np.arange(first, first + len(values)), carried)


def _whole(column: pa.ChunkedArray) -> pa.Array:
    """A column in one piece; without a dictionary, which could be another in each chunk."""
    import pyarrow as pa

    if pa.types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    whole = column.combine_chunks()
    return pa.concat_arrays(whole.chunks) if isinstance(whole, pa.ChunkedArray) else whole


def parts(path: Path, size: int) -> list[FilePart]:
    """Where the rows of each of `blocks` are. Errors as there."""
    with _reading(path) as (file, _):
        return equal_parts(int(file.metadata.num_rows), size)


def _groups_from(metadata: pq.FileMetaData, start: int) -> tuple[list[int], int]:
    """The row groups from the one that holds row `start`, and how many rows of it come before."""
    for group in range(metadata.num_row_groups):
        if start < metadata.row_group(group).num_rows:
            return list(range(group, metadata.num_row_groups)), start
        start -= metadata.row_group(group).num_rows
    return [], 0


def read_names(path: Path) -> list[str]:
    """The names of a file's columns. Errors as of `blocks`, of a file that cannot be read."""
    with files.open_parquet(path, NOT_PARQUET) as file:
        return list(file.schema_arrow.names)


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[tuple[pq.ParquetFile, TargetColumns]]:
    with files.open_parquet(path, NOT_PARQUET) as file:
        columns = choose_columns(path, file.schema_arrow.names, "")
        if not file.metadata.num_rows:
            raise InvalidInputError(f"{path}: has no rows of targets")
        yield file, columns


def _numbers(path: Path, name: str, column: pa.ChunkedArray) -> Array:
    """A column as float64, missing values as NaN."""
    import pyarrow as pa

    if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
        raise InvalidInputError(f"{path}, column {name}: must hold numbers, got {column.type}")
    return np.asarray(column.cast(pa.float64()).to_numpy(), dtype=np.float64)


def encode(targets: TargetFile, batch: BatchResult) -> bytes:
    """The columns of these rows, as an Arrow stream."""
    import pyarrow as pa

    columns = dict(zip(targets.columns, targets.values.T, strict=True))
    columns |= {f"q{joint + 1}": angles for joint, angles in enumerate(batch.q.T)}
    table = pa.table(
        {
            **columns,
            "status": pa.array([status.name for status in batch.status], pa.string()),
            "position_error": batch.position_error,
            "orientation_error": batch.orientation_error,
            "method": pa.array(batch.method, pa.string()),
            "message": pa.array(batch.message, pa.string()),
            **{name: as_arrow(column) for name, column in targets.carried.items()},
        }
    )
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema) as writer:
        writer.write_table(table)
    return bytes(sink.getvalue())


def write_joined(
    path: Path, pieces: Iterable[tuple[Path, int]], columns: Sequence[str], carried: Sequence[str] = ()
) -> None:
    """One row group for each piece."""
    import pyarrow.parquet as pq

    writer = None
    try:
        for piece, offset in pieces:
            table = _table(piece, offset)
            if writer is None:
                # Joint angles do not get smaller, and writing is all that a batch on many machines waits for.
                texts = [*TEXTS, *carried]
                writer = pq.ParquetWriter(
                    path,
                    table.schema,
                    use_dictionary=texts,
                    compression=dict.fromkeys(texts, "snappy"),
                    write_statistics=texts,
                    write_batch_size=1 << 14,  # rows
                )
            writer.write_table(table, row_group_size=max(1, table.num_rows))
    finally:
        if writer is not None:
            writer.close()


def _table(piece: Path, offset: int) -> pa.Table:
    import pyarrow as pa

    with piece.open("rb") as file:
        file.seek(offset)
        return pa.ipc.open_stream(file.read()).read_all()
