"""Parquet files: targets, read batch by batch, and answers with the columns of the CSV file."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, needed
from jacokin.ik.files.targets import FilePart, TargetFile, choose_columns, equal_parts, target_rows
from jacokin.ik.results import STATUS_NAMES, BatchResult

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq


TEXTS = ("status", "method", "message")
WRITTEN_AT_ONCE = 1 << 14  # rows


def blocks(path: Path, size: int, consecutive: Sequence[FilePart] | None = None) -> Iterator[TargetFile]:
    """The targets, `size` at a time, whatever the row groups of the file are; of some consecutive parts, or all.

    Raises:
        MissingExtraError: pyarrow is not installed.
        InvalidInputError: no such file, not a Parquet file, missing columns (lists those that there are), columns that
            are not numbers, or no rows.
    """
    with _reading(path) as (file, columns):
        start = consecutive[0].first if consecutive else 0
        left = sum(part.rows for part in consecutive) if consecutive else file.metadata.num_rows
        groups, before = _groups_from(file.metadata, start)
        first, waiting, held = start + 1, list[Array](), 0
        for batch in file.iter_batches(batch_size=size, row_groups=groups, columns=list(columns)):
            if before >= len(batch):
                before -= len(batch)
                continue
            rows = batch.slice(before, left)
            before, left = 0, left - len(rows)
            waiting.append(np.column_stack([_numbers(path, name, rows.column(name)) for name in columns]))
            held += len(waiting[-1])
            while held >= size:
                values = np.concatenate(waiting)
                waiting, held = [values[size:]], held - size
                yield target_rows(columns, values[:size], np.arange(first, first + size))
                first += size
            if not left:
                break
        if held:
            yield target_rows(columns, np.concatenate(waiting), np.arange(first, first + held))


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


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[tuple[pq.ParquetFile, tuple[str, ...]]]:
    with needed("pyarrow", "parquet"):
        import pyarrow as pa
        import pyarrow.parquet as pq
    try:
        # Without buffering ahead: that would hold a row group, which may be the whole file.
        with pq.ParquetFile(path, pre_buffer=False, buffer_size=1 << 20) as file:
            columns = choose_columns(path, file.schema_arrow.names, "").names
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


def encode(targets: TargetFile, batch: BatchResult) -> bytes:
    """The columns of these rows, as an Arrow stream."""
    import pyarrow as pa

    columns = dict(zip(targets.columns, targets.values.T, strict=True))
    columns |= {f"q{joint + 1}": angles for joint, angles in enumerate(batch.q.T)}
    table = pa.table(
        {
            **columns,
            "status": pa.array([STATUS_NAMES[status] for status in batch.status], pa.string()),
            "position_error": batch.position_error,
            "orientation_error": batch.orientation_error,
            "method": pa.array(batch.method, pa.string()),
            "message": pa.array(batch.message, pa.string()),
        }
    )
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema) as writer:
        writer.write_table(table)
    return bytes(sink.getvalue())


def write_joined(path: Path, pieces: Iterable[tuple[Path, int]], columns: Sequence[str]) -> None:
    """One row group for each piece."""
    import pyarrow.parquet as pq

    writer = None
    try:
        for piece, offset in pieces:
            table = _table(piece, offset)
            if writer is None:
                # Joint angles do not get smaller, and writing is all that a batch on many machines waits for.
                texts = list(TEXTS)
                writer = pq.ParquetWriter(
                    path,
                    table.schema,
                    use_dictionary=texts,
                    compression=dict.fromkeys(texts, "snappy"),
                    write_statistics=texts,
                    write_batch_size=WRITTEN_AT_ONCE,
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
